"""The installed services: versions next to each other, a link to the present one, a user, units, and the data.

A version is a virtual environment in `/opt/arcor2-hw/VERSION`. The link `/opt/arcor2-hw/current` selects the one that
runs. The data of the server is in `/var/lib/arcor2-hw`, that of nodes in `/var/lib/arcor2-hw-node` and that of the
page of a fleet in `/var/lib/arcor2-hw-fleet`. All belongs to the user of the services.
"""

import grp
import os
import pwd
import shutil
import subprocess
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Final

import msgspec
from packaging.version import InvalidVersion, Version

from arcor2_hw.exceptions import Arcor2Error, NotFound, StorageError
from arcor2_server.deployment.bundle import REQUIREMENTS, WHEELS

NAME: Final = "arcor2-hw"
"""Name of the user, the group and the service."""
UNIT: Final = f"{NAME}.service"
NODE: Final = f"{NAME}-node"
FLEET: Final = f"{NAME}-fleet"
UNITS: Final = (UNIT, f"{NODE}@.service", f"{FLEET}.service")
"""The units. Only the first one is enabled by the installation."""
COMMAND_TIMEOUT: Final = 60.0
INSTALL_TIMEOUT: Final = 600.0
_GROUPS: Final = "SupplementaryGroups="
_SETTINGS: Final = """\
# Settings of ARCOR2-HW, read by the service. See docs/reference/command-line.md for all variables.
# Other machines can connect only if this is set. The server then requires tokens and uses TLS.
#ARCOR2_HW_HOST=0.0.0.0
"""


class CommandFailed(Arcor2Error):
    """A command of the system failed."""


def run(command: Sequence[str | Path], timeout: float = COMMAND_TIMEOUT, user: str | None = None) -> str:
    """Run a command of the system, and return its output.

    Args:
        command: the program and its arguments.
        timeout: time limit, s.
        user: the user who runs it; None: the present user.

    Raises:
        CommandFailed: the command does not exist, failed or did not end in time.
    """
    name = " ".join(map(str, command[:2]))
    try:
        done = subprocess.run(  # noqa: S603 - the commands are ours
            list(map(str, command)),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=timeout,
            check=False,
            user=user,
            group=user,
            extra_groups=None if user is None else [],
        )
    except (OSError, KeyError) as error:
        raise CommandFailed("{command} cannot be run: {reason}", command=name, reason=error) from error
    except subprocess.TimeoutExpired as error:
        raise CommandFailed("{command} did not end within {timeout} s", command=name, timeout=timeout) from error
    if done.returncode:
        reason = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:] or [f"status {done.returncode}"]
        raise CommandFailed("{command} failed: {reason}", command=name, reason=reason[0])
    return done.stdout


class Installation(msgspec.Struct, frozen=True):
    """The paths of an installation, below `root`."""

    root: Path = Path("/")

    @property
    def programs(self) -> Path:
        """The directory of all versions."""
        return self.root / "opt" / NAME

    @property
    def current(self) -> Path:
        """The link to the version that runs."""
        return self.programs / "current"

    @property
    def data(self) -> Path:
        """The data directory."""
        return self.root / "var/lib" / NAME

    @property
    def settings(self) -> Path:
        """The file of environment variables."""
        return self.root / "etc" / NAME / "environment"

    @property
    def public_key(self) -> Path:
        """The key with which releases are signed."""
        return self.root / "etc" / NAME / "release.pub"

    @property
    def units(self) -> Path:
        """The directory of the units."""
        return self.root / "etc/systemd/system"

    @property
    def command(self) -> Path:
        """The link to the command line."""
        return self.root / "usr/local/bin" / NAME

    def version(self) -> Version | None:
        """Return the version that runs, None if none is installed."""
        try:
            return Version(self.current.readlink().name)
        except (OSError, InvalidVersion):
            return None

    def versions(self) -> list[Version]:
        """Return the installed versions, oldest first."""
        found = []
        for path in self.programs.iterdir():
            if not path.is_symlink():
                try:
                    found.append(Version(path.name))
                except InvalidVersion:
                    continue
        return sorted(found)

    def path_of(self, version: Version) -> Path:
        """Return the directory of a version."""
        return self.programs / str(version)

    # ------------------------------------------------------------------------------------------ changes
    def add_version(self, bundle: Path, version: Version, python: Path) -> None:
        """Install the wheels of a bundle into a directory of its own, without a network.

        Raises:
            CommandFailed: a wheel does not fit this machine, or the disk is full. Nothing is left behind.
            StorageError: the directory cannot be written.
        """
        target = self.path_of(version)
        try:
            shutil.rmtree(target, ignore_errors=True)
            self.programs.mkdir(mode=0o755, parents=True, exist_ok=True)
            run([python, "-m", "venv", target])
            pip = (target / "bin/python", "-m", "pip", "--isolated", "--disable-pip-version-check", "--no-input")
            wheels = ("--no-index", "--find-links", bundle / WHEELS)
            install = ("install", "--require-hashes", *wheels, "--requirement", bundle / REQUIREMENTS)
            run([*pip, *install], INSTALL_TIMEOUT)
        except OSError as error:
            shutil.rmtree(target, ignore_errors=True)
            raise StorageError("{path} cannot be written: {reason}.", path=target, reason=error) from error
        except CommandFailed:
            shutil.rmtree(target, ignore_errors=True)
            raise

    def select(self, version: Version) -> None:
        """Select the version that the services run from their next start on: write the units, and set the links.

        Raises:
            NotFound: the version is not installed.
            StorageError: a file cannot be written.
        """
        target = self.path_of(version)
        if not (target / "bin" / NAME).exists():
            raise NotFound("Version {version} is not installed in {path}.", version=version, path=self.programs)
        try:
            for unit in UNITS:
                _write(self.units / unit, _unit_text(unit))
            if not self.settings.exists():
                _write(self.settings, _SETTINGS)
            _link(self.current, Path(str(version)))
            _link(self.command, Path("/opt", NAME, "current/bin", NAME))
        except OSError as error:
            raise StorageError("{path} cannot be written: {reason}.", path=error.filename, reason=error) from error

    def add_user(self) -> None:
        """Create the user of the services and the data directories. Raises CommandFailed and StorageError."""
        try:
            owner = pwd.getpwnam(NAME)
        except KeyError:
            run(["useradd", "--system", "--user-group", "--home-dir", self.data, "--shell", "/usr/sbin/nologin", NAME])
            owner = pwd.getpwnam(NAME)
        for path in (self.data, self.data.with_name(NODE), self.data.with_name(FLEET)):
            try:
                path.mkdir(mode=0o700, parents=True, exist_ok=True)
                os.chown(path, owner.pw_uid, owner.pw_gid)
            except OSError as error:
                raise StorageError("{path} cannot be used: {reason}.", path=path, reason=error) from error

    def remove(self, version: Version) -> None:
        """Remove a version that does not run."""
        shutil.rmtree(self.path_of(version), ignore_errors=True)


def _unit_text(unit: str) -> str:
    """Return a unit of this version, with those groups for devices that exist on this machine."""
    existing = {group.gr_name for group in grp.getgrall()}
    lines = resources.files("arcor2_server.deployment").joinpath(unit).read_text().splitlines(keepends=True)
    for number, line in enumerate(lines):
        if line.startswith(_GROUPS):
            groups = [name for name in line.removeprefix(_GROUPS).split() if name in existing]
            lines[number] = f"{_GROUPS}{' '.join(groups)}\n"
    return "".join(lines)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.new")
    temporary.write_text(text)
    temporary.chmod(0o644)
    temporary.replace(path)


def _link(path: Path, target: Path) -> None:
    """Set a link atomically."""
    path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.new")
    temporary.unlink(missing_ok=True)
    temporary.symlink_to(target)
    temporary.replace(path)

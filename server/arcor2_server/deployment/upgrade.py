"""Upgrades of the installed services. If the new version does not start, the old one runs again with the old data."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final, Protocol

import structlog
from packaging.version import Version

from arcor2_hw.exceptions import Arcor2Error, Conflict, NotFound
from arcor2_server.deployment import bundle as bundles
from arcor2_server.deployment.backup import BACKUPS
from arcor2_server.deployment.installation import NAME, UNIT, CommandFailed, Installation, run

log = structlog.get_logger(__name__)

READY_TIMEOUT: Final = 60.0
"""Time limit for the start of the new version, s. It is half of the 2 min within which a failed upgrade is reverted."""
STOPPED_TIMEOUT: Final = 30.0
BACKUP_TIMEOUT: Final = 600.0


class Services(Protocol):
    """The services of this machine as the service manager sees them."""

    def start(self, within: float) -> None:
        """Start the services, and wait until they are ready. Raises CommandFailed."""

    def stop(self, within: float) -> None:
        """Stop the services. Raises CommandFailed."""


class Systemd:
    """The services of systemd: the server unless it is disabled, and the nodes and fleet pages that were running."""

    def __init__(self) -> None:
        self._others: set[str] = set()

    def start(self, within: float) -> None:
        """Start the services, and wait until they are ready. Raises CommandFailed."""
        run(["systemctl", "daemon-reload"])
        units = sorted(self._others)
        if "disabled" not in run(["systemctl", "show", "--property", "UnitFileState", UNIT]):
            units.insert(0, UNIT)
        if units:
            # An earlier start that failed several times must not prevent this one.
            run(["systemctl", "reset-failed", *units])
            run(["systemctl", "start", *units], within)

    def stop(self, within: float) -> None:
        """Stop the services. Raises CommandFailed."""
        listed = run(["systemctl", "list-units", "--plain", "--no-legend", "--state=active,activating", f"{NAME}-*"])
        self._others |= {line.split()[0] for line in listed.splitlines() if line.strip()}
        run(["systemctl", "stop", UNIT, *sorted(self._others)], within)


class UpgradeFailed(Arcor2Error):
    """The new version does not work on this machine. The old one runs again."""


def upgrade(
    installation: Installation,
    bundle: Path,
    version: Version,
    services: Services,
    report: Callable[[str], None] = lambda _: None,
    user: str | None = NAME,
) -> None:
    """Replace the running version by that of a checked bundle.

    Args:
        installation: the present installation.
        bundle: the checked bundle.
        version: its version.
        services: the services.
        report: called with a description of each step.
        user: the owner of the data; None: the present user.

    Raises:
        NotFound: nothing is installed.
        Conflict: the bundle is not newer than the installed version.
        CommandFailed: the new version cannot be installed. The old one was not stopped.
        UpgradeFailed: the new version does not start. The old one runs again with its data.
    """
    old = installation.version()
    if old is None:
        raise NotFound("No version is installed in {path}.", path=installation.programs)
    if version <= old:
        raise Conflict("Version {old} is installed; {new} is not newer.", old=old, new=version)
    report(f"installing version {version}")
    installation.add_version(bundle, version, Path(sys.base_prefix, "bin", "python3"))
    commands = {each: installation.path_of(each) / "bin" / NAME for each in (old, version)}
    run([commands[version], "--version"])
    report("stopping the service")
    backup = installation.data / BACKUPS / f"before-{version}.zip"
    stored = False
    try:
        services.stop(STOPPED_TIMEOUT)
        report(f"copying the data to {backup}")
        run(["install", "-d", "-m", "700", backup.parent], user=user)
        data = ("--data-dir", installation.data)
        run([commands[old], "backup", backup, "--force", *data], BACKUP_TIMEOUT, user)
        stored = True
        report(f"starting version {version}")
        run([commands[version], "install", "--select-only", "--root", installation.root])
        services.start(READY_TIMEOUT)
    except CommandFailed as error:
        report(f"{error}; going back to version {old}")
        log.error("upgrade failed", version=str(version), reason=str(error))
        _go_back(installation, services, old, backup if stored else None, user)
        installation.remove(version)
        raise UpgradeFailed(
            "Version {new} did not start ({reason}). Version {old} runs again with its data.",
            new=version,
            reason=error,
            old=old,
        ) from error
    for other in installation.versions():
        if other not in (old, version):
            installation.remove(other)


def _go_back(
    installation: Installation, services: Services, old: Version, backup: Path | None, user: str | None
) -> None:
    try:
        services.stop(STOPPED_TIMEOUT)
    except CommandFailed as error:
        log.warning("the service cannot be stopped", reason=str(error))
    installation.select(old)
    if backup is not None:
        command = installation.path_of(old) / "bin" / NAME
        run([command, "restore", backup, "--data-dir", installation.data], BACKUP_TIMEOUT, user)
    services.start(READY_TIMEOUT)


def check_bundle(bundle: Path, key: Path, unsigned: bool) -> Version:
    """Check a bundle with the stored key, and return its version.

    Args:
        bundle: the bundle.
        key: the file of the public key.
        unsigned: accept a bundle without checking its signature.

    Raises:
        InvalidData: the bundle was changed, or there is no key.
        StorageError: a file cannot be read.
    """
    from arcor2_server.deployment import minisign

    if unsigned:
        return bundles.check(bundle, None)
    return bundles.check(bundle, minisign.read_public_key(key.read_text()))

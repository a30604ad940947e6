"""`arcor2-hw install` and `arcor2-hw upgrade`: set up the service of this machine, and replace its version."""

import os
import sys
import tarfile
import tempfile
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter
from packaging.version import Version

from arcor2_hw.exceptions import Arcor2Error, Conflict, InvalidData, NotFound
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.deployment import minisign
from arcor2_server.deployment.installation import NAME, UNIT, CommandFailed, Installation, run
from arcor2_server.deployment.upgrade import READY_TIMEOUT, Systemd, UpgradeFailed, check_bundle, upgrade as upgrade_to

PUBLIC: Final = 0o022
"""Mask of the permissions of programs, which all users may read."""

Root = Annotated[Path, Parameter(help="Directory below which everything is installed.", show=False)]


def install(
    *,
    public_key: str | None = None,
    start: bool = True,
    server: bool = True,
    select_only: Annotated[bool, Parameter(negative="", show=False)] = False,
    root: Root = Path("/"),
) -> int:
    """Set up the service with this version, which is installed in /opt/arcor2-hw.

    Parameters
    ----------
    public_key
        The minisign key of the releases (RW...). `upgrade` accepts only bundles that are signed with it.
    start
        With --no-start the service starts with the machine only.
    server
        With --no-server the service of the server is not enabled, on a computer that is only a node or shows a fleet.
    """
    here = Installation(root)
    os.umask(PUBLIC)
    if root == Path("/") and os.geteuid() != 0:
        return fail("install", "only root can install the service", ExitStatus.NOT_PERMITTED)
    try:
        key = None if public_key is None else minisign.read_public_key(public_key)
        here.select(Version(version("arcor2-hw")))
        if key is not None:
            here.public_key.write_text(f"{public_key}\n")
        if not select_only:
            here.add_user()
        if server and not select_only:
            run(["systemctl", "enable", UNIT])
            if start:
                Systemd().start(READY_TIMEOUT)
    except (Arcor2Error, OSError) as error:
        return fail("install", error, _status(error))
    return ExitStatus.OK


def upgrade(
    bundle: Path,
    *,
    unsigned: Annotated[bool, Parameter(negative="")] = False,
    root: Root = Path("/"),
) -> int:
    """Replace the running version by that of a bundle, without a network.

    The data is copied first. If the new version is not ready within a minute, the old version and data are used again.

    Parameters
    ----------
    bundle
        The release: a tar file or its unpacked directory.
    unsigned
        Do not check the signature. Use it only for bundles that you have built.
    """
    here = Installation(root)
    os.umask(PUBLIC)
    if root == Path("/") and os.geteuid() != 0:
        return fail("upgrade", "only root can upgrade the service", ExitStatus.NOT_PERMITTED)
    if not unsigned and not here.public_key.exists():
        reason = f"{here.public_key} is missing; `arcor2-hw install --public-key RW...` stores the key of the releases"
        return fail("upgrade", reason, ExitStatus.NOT_FOUND)
    try:
        with ExitStack() as stack:
            directory = bundle
            if not bundle.is_dir():
                directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix=".bundle-", dir=here.programs)))
                # Only files without compression are accepted, which are not larger when they are unpacked.
                with tarfile.open(bundle, "r:") as archive:
                    archive.extractall(directory, filter="data")
            new = check_bundle(directory, here.public_key, unsigned)
            user = NAME if root == Path("/") else None
            upgrade_to(here, directory, new, Systemd(), _report, user)
    except (Arcor2Error, OSError, tarfile.TarError) as error:
        return fail("upgrade", error, _status(error))
    sys.stdout.write(f"version {new} is running\n")
    return ExitStatus.OK


def _report(step: str) -> None:
    sys.stdout.write(f"{step}\n")
    sys.stdout.flush()


def _status(error: Exception) -> ExitStatus:
    match error:
        case InvalidData() | tarfile.TarError():
            return ExitStatus.DOCUMENT_PROBLEMS
        case NotFound() | FileNotFoundError():
            return ExitStatus.NOT_FOUND
        case Conflict():
            return ExitStatus.CONFLICT
        case UpgradeFailed() | CommandFailed():
            return ExitStatus.FAILED
        case _:
            return ExitStatus.DATA_UNUSABLE

"""`arcor2-hw backup` and `arcor2-hw restore`: copy the data of a server into one file, and back."""

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter

from arcor2_hw.exceptions import InvalidData, StorageError
from arcor2_server.cli.exit_status import CannotServe, ExitStatus, fail
from arcor2_server.cli.serve import data_directory
from arcor2_server.deployment.backup import Manifest, restore_backup, write_backup
from arcor2_server.settings import ServerSettings, default_data_dir

NICENESS: Final = 10

DataDir = Annotated[Path | None, Parameter(help="Data directory of the server ($XDG_DATA_HOME/arcor2-hw).")]


def backup(
    file: Path,
    *,
    data_dir: DataDir = None,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Copy the data of a server, which may be running, into one file.

    Parameters
    ----------
    file
        The new file. Only its owner may read it, since it contains the passwords of devices.
    force
        Replace an existing file.
    """
    directory = data_dir or default_data_dir()
    if file.exists() and not force:
        return fail("backup", f"{file} exists; --force replaces it", ExitStatus.CONFLICT)
    if (problem := _owner_problem(directory)) is not None:
        return fail("backup", problem, ExitStatus.DATA_UNUSABLE)
    try:
        with ThreadPoolExecutor(1, initializer=_lower_priority) as background:
            manifest = background.submit(write_backup, directory, file, version("arcor2-hw")).result()
    except StorageError as error:
        return fail("backup", error, ExitStatus.DATA_UNUSABLE)
    sys.stdout.write(f"{file}: {_summary(manifest)}\n")
    if url := ServerSettings.from_environment(data_dir=directory).database_url:
        kind = url.partition(":")[0].partition("+")[0]
        sys.stderr.write(f"arcor2-hw backup: the documents are in {kind} and not in the backup; back them up there\n")
    return ExitStatus.OK


def restore(file: Path, *, data_dir: DataDir = None) -> int:
    """Replace the data of a server, which must not be running, with a backup.

    The whole file is checked first. The replaced data is kept in a directory `before-restore-...` of the data
    directory; delete it when it is no longer needed.

    Parameters
    ----------
    file
        The backup.
    """
    directory = data_dir or default_data_dir()
    if not file.is_file():
        return fail("restore", f"{file} does not exist", ExitStatus.NOT_FOUND)
    if directory.exists() and (problem := _owner_problem(directory)) is not None:
        return fail("restore", problem, ExitStatus.DATA_UNUSABLE)
    try:
        with data_directory(directory):
            manifest = restore_backup(file, directory)
    except CannotServe as error:
        return fail("restore", error, error.status)
    except InvalidData as error:
        return fail("restore", error, ExitStatus.DOCUMENT_PROBLEMS)
    except StorageError as error:
        return fail("restore", error, ExitStatus.DATA_UNUSABLE)
    sys.stdout.write(f"{directory}: {_summary(manifest)} of {manifest.host}, {manifest.created[:19]} UTC\n")
    return ExitStatus.OK


def _lower_priority() -> None:
    """Lower the priority of this thread, so that it does not delay the server."""
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)


def _owner_problem(directory: Path) -> str | None:
    """Return the reason if this user should not open the data, because the server could not read files of this user."""
    try:
        owner = directory.stat().st_uid
    except OSError as error:
        return f"the data directory {directory} cannot be used: {error.strerror}"
    if owner == os.geteuid():
        return None
    import pwd

    try:
        name = pwd.getpwuid(owner).pw_name
    except KeyError:
        name = str(owner)
    return f"{directory} belongs to the user {name}; run the command as this user (runuser -u {name} -- ...)"


def _summary(manifest: Manifest) -> str:
    return f"{len(manifest.files)} files, {manifest.size / 1e6:.1f} MB, version {manifest.version}"

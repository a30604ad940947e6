"""`arcor2-hw audit`: check and export the audit trail of a server, which may be running."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from arcor2_hw.exceptions import StorageError
from arcor2_server.audit.chain import AuditFile
from arcor2_server.audit.export import csv_chunks
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.settings import ServerSettings, default_data_dir

app = App(name="audit", help="Check and export the audit trail of changes and commands.")

DataDir = Annotated[Path | None, Parameter(help="Data directory of the server ($XDG_DATA_HOME/arcor2-hw).")]


@app.command
def check(*, data_dir: DataDir = None) -> int:
    """Check whether entries were edited or removed.

    Prints the numbers of the oldest and newest entry and the digest of the newest. Store the digest elsewhere: a later
    export that contains the same entry with another digest was replaced as a whole. The exit status is 15 if
    entries were edited or removed.
    """
    try:
        found = _file(data_dir).check()
    except StorageError as error:
        return fail("audit", error, ExitStatus.DATA_UNUSABLE)
    sys.stdout.write(f"entries {found.first} to {found.last}\ndigest  {found.digest}\n")
    return fail("audit", found.problem, ExitStatus.DIFFERENT) if found.problem else ExitStatus.OK


@app.command
def export(*, data_dir: DataDir = None) -> int:
    """Print all entries as CSV, oldest first."""
    try:
        for chunk in csv_chunks(_file(data_dir).all()):
            sys.stdout.buffer.write(chunk)
    except StorageError as error:
        return fail("audit", error, ExitStatus.DATA_UNUSABLE)
    return ExitStatus.OK


def _file(data_dir: Path | None) -> AuditFile:
    return AuditFile(ServerSettings(data_dir=data_dir or default_data_dir()).audit_file)

"""`arcor2-hw database`: move the documents of a data directory to PostgreSQL."""

import asyncio
import os
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from arcor2_hw.exceptions import Arcor2Error, Conflict, DatabaseInUse, InvalidData, NotFound
from arcor2_server.cli.exit_status import CannotServe, ExitStatus, fail
from arcor2_server.cli.serve import data_directory
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.copying import copy_to_postgresql

app = App(name="database", help="Move the documents of a data directory to PostgreSQL.")

_STATUSES = (
    (NotFound, ExitStatus.NOT_FOUND),
    (Conflict, ExitStatus.CONFLICT),
    (InvalidData, ExitStatus.DATABASE_UNUSABLE),
    (DatabaseInUse, ExitStatus.DATA_IN_USE),
)


@app.command
def copy(
    *, data_dir: Annotated[Path | None, Parameter(help="Data directory ($XDG_DATA_HOME/arcor2-hw).")] = None
) -> int:
    """Copy the documents from SQLite in the data directory to the empty database at ARCOR2_HW_DATABASE_URL.

    Stop the server first. The SQLite file is left unchanged. Assets, packages, the journal, alarms, the audit trail and
    secrets stay in the data directory. Either everything is copied or nothing.
    """
    os.umask(0o077)
    try:
        settings = ServerSettings.from_environment(data_dir=data_dir)
        if not settings.database_url:
            return fail("database", "ARCOR2_HW_DATABASE_URL is not set. It is the destination.", ExitStatus.USAGE)
        if not settings.data_dir.is_dir():
            return fail("database", f"the directory {settings.data_dir} does not exist", ExitStatus.NOT_FOUND)
        with data_directory(settings.data_dir):
            counts = asyncio.run(copy_to_postgresql(settings))
    except CannotServe as error:
        return fail("database", error, error.status)
    except Arcor2Error as error:
        status = next((status for kind, status in _STATUSES if isinstance(error, kind)), ExitStatus.DATABASE_UNUSABLE)
        return fail("database", error, status)
    for table, count in counts.items():
        if count:
            sys.stdout.write(f"{table}: {count}\n")
    sys.stdout.write(f"{sum(counts.values())} rows copied\n")
    return ExitStatus.OK

"""`arcor2-hw metrics`: the token with which Prometheus reads the metrics of a server."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from arcor2_hw.exceptions import StorageError
from arcor2_server.access.metrics_token import MetricsToken
from arcor2_server.audit.command_line import note_command
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.settings import ServerSettings, default_data_dir

app = App(name="metrics", help="Manage the token for the metrics of a server. Changes take effect immediately.")

DataDir = Annotated[Path | None, Parameter(help="Data directory of the server ($XDG_DATA_HOME/arcor2-hw).")]


@app.command
def token(*, data_dir: DataDir = None) -> int:
    """Create the token for `/metrics` and print it. A previous token becomes invalid.

    It cannot be shown again, since only its hash is stored. It permits only reading metrics.
    """
    settings = ServerSettings(data_dir=data_dir or default_data_dir())
    try:
        sys.stdout.write(f"{MetricsToken(settings.data_dir).create()}\n")
        note_command(settings.audit_file, "metrics token", "")
    except StorageError as error:
        return fail("metrics", error, ExitStatus.DATA_UNUSABLE)
    return ExitStatus.OK


@app.command
def off(*, data_dir: DataDir = None) -> int:
    """Remove the token. Without a token, the server has no metrics."""
    settings = ServerSettings(data_dir=data_dir or default_data_dir())
    try:
        if not MetricsToken(settings.data_dir).remove():
            return fail("metrics", "There is no metrics token.", ExitStatus.NOT_FOUND)
        note_command(settings.audit_file, "metrics off", "")
    except StorageError as error:
        return fail("metrics", error, ExitStatus.DATA_UNUSABLE)
    return ExitStatus.OK

"""`arcor2-hw token`: manage the access tokens of a server."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter, validators
from rich.table import Table

from arcor2_hw.data.role import Role, RoleName
from arcor2_hw.exceptions import Arcor2Error, NotFound, StorageError
from arcor2_server.access.tokens import TokenFile
from arcor2_server.audit.command_line import note_command
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.tables import console
from arcor2_server.settings import ServerSettings, default_data_dir

app = App(name="token", help="Manage the access tokens of a server. Changes take effect immediately.")

DataDir = Annotated[Path | None, Parameter(help="Data directory of the server ($XDG_DATA_HOME/arcor2-hw).")]


def _file(data_dir: Path | None) -> TokenFile:
    return TokenFile(data_dir or default_data_dir())


def _failed(error: Arcor2Error) -> int:
    if isinstance(error, StorageError):
        return fail("token", error, ExitStatus.DATA_UNUSABLE)
    return fail("token", error, ExitStatus.NOT_FOUND if isinstance(error, NotFound) else ExitStatus.USAGE)


def _note(data_dir: Path | None, command: str, name: str) -> None:
    """Add an entry to the audit trail. The token has been changed, so a failure is only reported."""
    try:
        note_command(ServerSettings(data_dir=data_dir or default_data_dir()).audit_file, f"token {command}", name)
    except StorageError as error:
        fail("token", error, ExitStatus.OK)


@app.command
def add(
    name: str,
    *,
    role: RoleName,
    days: Annotated[int | None, Parameter(validator=validators.Number(gte=1, lte=3650))] = None,
    shared: Annotated[bool, Parameter(negative="")] = False,
    data_dir: DataDir = None,
) -> int:
    """Create a token and print it. It cannot be shown again, since only its hash is stored.

    Parameters
    ----------
    name
        The user or device of the token.
    role
        The role of its owner.
    days
        Number of days for which it is valid. The default is until it is revoked.
    shared
        The token belongs to a device at which persons log on, see `arcor2-hw person`. This role is the maximum for all
        persons on the device.
    """
    try:
        _, secret = _file(data_dir).add(name, Role[role.upper()], days, shared=shared)
    except Arcor2Error as error:
        return _failed(error)
    sys.stdout.write(f"{secret}\n")
    _note(data_dir, "add", name)
    return ExitStatus.OK


@app.command(name="list")
def list_tokens(*, data_dir: DataDir = None) -> int:
    """List the tokens without their secrets."""
    try:
        file = _file(data_dir)
        tokens = file.all()
    except Arcor2Error as error:
        return _failed(error)
    if file.damage:
        fail("token", str(file.damage), ExitStatus.DATA_UNUSABLE)
        if file.unusable:
            return ExitStatus.DATA_UNUSABLE
    if not tokens:
        sys.stdout.write("There are no tokens. The server accepts clients of this machine only, without a token.\n")
        return ExitStatus.OK
    table = Table("id", "name", "role", "shared", "created", "valid until", box=None, pad_edge=False)
    for token in tokens:
        until = "revoked" if token.expires is None else token.expires[:16]
        table.add_row(
            token.id,
            token.name,
            token.role.identifier,
            "yes" if token.shared else "",
            token.created[:16],
            f"[red]{until}, expired" if token.expired else until,
        )
    console().print(table)
    return ExitStatus.OK


@app.command
def revoke(which: str, *, data_dir: DataDir = None) -> int:
    """Revoke tokens by id or name, and disconnect their clients.

    Parameters
    ----------
    which
        The id or name that `arcor2-hw token list` shows.
    """
    try:
        revoked = _file(data_dir).revoke(which)
    except Arcor2Error as error:
        return _failed(error)
    for token in revoked:
        sys.stdout.write(f"revoked: {token.id} of {token.name}\n")
        _note(data_dir, "revoke", token.name)
    return ExitStatus.OK

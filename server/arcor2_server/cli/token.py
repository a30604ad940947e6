"""`arcor2-hw token`: manage the tokens for a server and their roles."""

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter, validators
from rich.console import Console
from rich.table import Table

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Arcor2Error, NotFound, StorageError
from arcor2_server.access.tokens import TokenFile
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.settings import default_data_dir

app = App(name="token", help="Say who may connect to a server, and in which role. A running server follows at once.")

RoleName = Literal["operator", "standard_user", "advanced_user", "technician", "programmer"]
DataDir = Annotated[Path | None, Parameter(help="Data directory of the server ($XDG_DATA_HOME/arcor2-hw).")]


def _file(data_dir: Path | None) -> TokenFile:
    return TokenFile(data_dir or default_data_dir())


def _failed(error: Arcor2Error) -> int:
    sys.stderr.write(f"arcor2-hw token: {error}\n")
    if isinstance(error, StorageError):
        return ExitStatus.DATA_UNUSABLE
    return ExitStatus.NOT_FOUND if isinstance(error, NotFound) else ExitStatus.USAGE


@app.command
def add(
    name: str,
    *,
    role: RoleName,
    days: Annotated[int | None, Parameter(validator=validators.Number(gte=1, lte=3650))] = None,
    data_dir: DataDir = None,
) -> int:
    """Create a token and print it, once: it is nowhere kept in clear.

    Parameters
    ----------
    name
        The person or device that it is for.
    role
        What its owner may do.
    days
        After so many days it is not valid any more; without it, it stays valid until it is revoked.
    """
    try:
        _, secret = _file(data_dir).add(name, Role[role.upper()], days)
    except Arcor2Error as error:
        return _failed(error)
    sys.stdout.write(f"{secret}\n")
    return ExitStatus.OK


@app.command(name="list")
def list_tokens(*, data_dir: DataDir = None) -> int:
    """List the tokens; what they are cannot be shown again."""
    try:
        file = _file(data_dir)
        tokens = file.all()
    except Arcor2Error as error:
        return _failed(error)
    if file.damage:
        sys.stderr.write(f"arcor2-hw token: {file.damage}\n")
        if file.unusable:
            return ExitStatus.DATA_UNUSABLE
    if not tokens:
        sys.stdout.write("There is no token: the server serves this machine alone, and asks nobody.\n")
        return ExitStatus.OK
    table = Table("id", "name", "role", "made", "valid until", box=None, pad_edge=False)
    for token in tokens:
        until = "it is revoked" if token.expires is None else token.expires[:16]
        table.add_row(
            token.id,
            token.name,
            token.role.name.lower(),
            token.created[:16],
            f"[red]{until}, over" if token.expired else until,
        )
    Console(highlight=False).print(table)
    return ExitStatus.OK


@app.command
def revoke(which: str, *, data_dir: DataDir = None) -> int:
    """Create a token, named by its id or its owner, worth nothing; who is connected by it is disconnected.

    Parameters
    ----------
    which
        The id or the name that `arcor2-hw token list` shows.
    """
    try:
        gone = _file(data_dir).revoke(which)
    except Arcor2Error as error:
        return _failed(error)
    for token in gone:
        sys.stdout.write(f"revoked: {token.id} of {token.name}\n")
    return ExitStatus.OK

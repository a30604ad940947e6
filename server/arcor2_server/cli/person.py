"""`arcor2-hw person`: manage the persons who log on at shared devices. The server may be running."""

import asyncio
import getpass
import os
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.markup import escape
from rich.table import Table

from arcor2_hw.data.role import Role, RoleName
from arcor2_hw.data.rpc import ChangePersonArgs
from arcor2_hw.exceptions import Arcor2Error, Conflict, NotFound, StorageError
from arcor2_server.access.tokens import TokenFile
from arcor2_server.audit.command_line import note_command
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.tables import console
from arcor2_server.collaboration.persons import Persons
from arcor2_server.collaboration.pins import CardHashes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.persons import PersonStore, StoredPerson

app = App(name="person", help="Manage the persons who log on at shared devices. Changes take effect within seconds.")

DataDir = Annotated[Path | None, Parameter(help="Data directory of the server ($XDG_DATA_HOME/arcor2-hw).")]
Name = Annotated[str, Parameter(help="The name of the person.")]


@app.command
def add(
    name: str,
    *,
    role: RoleName,
    card: Annotated[bool, Parameter(negative="")] = False,
    pin: bool = True,
    data_dir: DataDir = None,
) -> int:
    """Add a person. The PIN is asked for twice, or read from standard input if that is not a terminal.

    Parameters
    ----------
    name
        The name of the person, as it is shown at the devices and in the audit trail.
    role
        The role of the person. Persons with the role programmer are administrators.
    card
        Also read a card: hold it to a reader that types its number, or type it.
    pin
        With --no-pin, the person logs on with the card only.
    """
    try:
        chosen = _secret(f"PIN of {name}: ", twice=True) if pin else ""
        number = _secret(f"Card of {name}: ") if card else ""
    except EOFError:
        return fail("person", "standard input has no PIN or card", ExitStatus.USAGE)
    except ValueError as error:
        return fail("person", error, ExitStatus.USAGE)

    async def work(persons: Persons) -> str:
        return (await persons.add(name, Role[role.upper()], chosen, number)).name

    return _run(data_dir, work, "add")


@app.command(name="list")
def list_persons(*, data_dir: DataDir = None) -> int:
    """List the persons, their means to log on, and the devices where they are locked out."""
    table = Table("name", "role", "logs on with", "locked out", box=None, pad_edge=False)

    async def work(persons: Persons) -> str:
        names = {token.id: token.name for token in TokenFile(_settings(data_dir).data_dir).all()}
        for person in await persons.all():
            means = [word for word, stored in (("PIN", person.pin), ("card", person.card)) if stored is not None]
            locked = [each for each in await persons.lock_outs(person, names) if each.until]
            where = ", ".join(f"{each.device} until {each.until}" for each in locked)
            table.add_row(escape(person.name), person.role.identifier, ", ".join(means), escape(where))
        return ""

    status = _run(data_dir, work, "")
    if status == ExitStatus.OK and not table.row_count:
        sys.stdout.write("There are no persons. Add one with `arcor2-hw person add`.\n")
    elif status == ExitStatus.OK:
        console().print(table)
    return status


@app.command
def remove(name: Name, /, *, data_dir: DataDir = None) -> int:
    """Remove a person, and log them off."""

    async def work(persons: Persons) -> str:
        return (await persons.remove((await _named(persons, name)).id)).name

    return _run(data_dir, work, "remove")


@app.command
def unlock(name: Name, /, *, data_dir: DataDir = None) -> int:
    """Unlock a person who entered too many wrong PINs."""

    async def work(persons: Persons) -> str:
        person = await _named(persons, name)
        return (await persons.change(ChangePersonArgs(person.id, unlock=True))).name

    return _run(data_dir, work, "unlock")


async def _named(persons: Persons, name: str) -> StoredPerson:
    for person in await persons.all():
        if person.name.casefold() == name.casefold():
            return person
    raise NotFound("The person {name!r} does not exist.", name=name)


def _secret(prompt: str, *, twice: bool = False) -> str:
    """Return a PIN or the number of a card, from the terminal without echo, or from a line of standard input.

    Raises:
        EOFError: standard input has ended.
        ValueError: the two inputs differ.
    """
    if not sys.stdin.isatty():
        if not (line := sys.stdin.readline()):
            raise EOFError
        return line.strip()
    entered = getpass.getpass(prompt).strip()
    if twice and getpass.getpass(f"{prompt.removesuffix(': ')}, again: ").strip() != entered:
        raise ValueError("the two PINs differ")
    return entered


def _settings(data_dir: Path | None) -> ServerSettings:
    return ServerSettings.from_environment(data_dir=data_dir)


def _run(data_dir: Path | None, work: Callable[[Persons], Awaitable[str]], command: str) -> int:
    """Call a function with the persons of a data directory.

    Add its change to the audit trail if `command` is not empty.
    """

    async def opened(settings: ServerSettings) -> str:
        storage = await Storage.open(settings, exclusive=False)  # the server may be running
        try:
            return await work(Persons(PersonStore(storage), CardHashes(settings.data_dir)))
        finally:
            await storage.close()

    os.umask(0o077)
    try:
        settings = _settings(data_dir)
        settings.data_dir.mkdir(parents=True, exist_ok=True)
        changed = asyncio.run(opened(settings))
        if command:
            note_command(settings.audit_file, f"person {command}", changed)
    except StorageError as error:
        return fail("person", error, ExitStatus.DATABASE_UNUSABLE)
    except OSError as error:
        return fail("person", error, ExitStatus.DATA_UNUSABLE)
    except Arcor2Error as error:
        statuses = {NotFound: ExitStatus.NOT_FOUND, Conflict: ExitStatus.CONFLICT}
        return fail("person", error, statuses.get(type(error), ExitStatus.USAGE))
    return ExitStatus.OK

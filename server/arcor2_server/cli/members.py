"""Commands for the members of a broker: nodes of a server, and cells, sites and the page of the fleet."""

import asyncio
import logging
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from rich.table import Table

from arcor2_hw.data.cell import LOCAL_BROKER
from arcor2_hw.exceptions import Arcor2Error, InvalidData, StorageError
from arcor2_server.access.authority import AUTHORITY
from arcor2_server.audit.command_line import note_command
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.server_connection import printable, status_of
from arcor2_server.cli.tables import console
from arcor2_server.settings import ServerSettings

if TYPE_CHECKING:
    from arcor2_server.nodes.accounts import Accounts
    from arcor2_server.nodes.credentials import Credentials, MemberKind


def run(group: str, work: Callable[[], Any]) -> int:
    """Run the function of a command, print errors, and return the exit status."""
    if find_spec("nats") is None:
        return fail(group, "install the extra `nodes` of arcor2-hw", ExitStatus.FAILED)
    logging.getLogger("asyncio").setLevel(logging.ERROR)  # asyncio warns of each end of a TLS connection
    try:
        work()
    except StorageError as error:
        return fail(group, printable(str(error)), ExitStatus.DATA_UNUSABLE)
    except InvalidData as error:
        return fail(group, printable(str(error)), ExitStatus.USAGE)
    except Arcor2Error as error:
        return fail(group, printable(str(error)), status_of(error))
    except OSError as error:
        return fail(group, error, ExitStatus.PORT_TAKEN)
    return ExitStatus.OK


def credentials_for(file: Path, broker: str | None, ca: Path | None) -> "Credentials":
    """Return the credentials for a broker. The file is used if it exists and no address is given.

    Raises:
        Arcor2Error: they are invalid.
    """
    from arcor2_server.nodes.credentials import load, of_address

    found = load(file) if broker is None and file.exists() else of_address(broker or LOCAL_BROKER, str(ca or ""))
    found.options()  # report errors before the start
    return found


def trusted_authority(settings: ServerSettings, ca: Path | None) -> str:
    """Return the certificates to trust: those in a file, otherwise those of the server's authority, if it has one.

    Raises:
        InvalidData: the file cannot be read.
    """
    trusted = ca or settings.data_dir / AUTHORITY
    try:
        return trusted.read_text() if ca or trusted.exists() else ""
    except (OSError, ValueError) as error:
        raise InvalidData("{file} cannot be used: {reason}", file=trusted, reason=error) from error


def check_certificate(address: str, certificate: str, key: str) -> None:
    """Raise InvalidData if an address with TLS has no certificate."""
    if address.startswith("tls://") and not (certificate and key):
        raise InvalidData("The broker needs a certificate: --certificate FILE --key FILE.")


def accept(
    settings: ServerSettings,
    accounts: "Accounts",
    group: str,
    place: str,
    name: str,
    host: str | None,
    port: int | None,
    kind: "MemberKind",
    *,
    same_version: bool = True,
) -> None:
    """Show a code, wait for a member that knows it, and accept it.

    Args:
        settings: settings with the path of the audit trail.
        accounts: the accounts to which the member is added.
        group: group of the commands.
        place: where to run the other command, for the message.
        name: name of the member.
        host: address to listen on; None for all.
        port: port to listen on; None for the default one.
        kind: kind of the member.
        same_version: whether its version must be that of this computer.

    Raises:
        Arcor2Error: it cannot be accepted.
        OSError: the address cannot be used.
    """
    from arcor2_server.nodes import pairing

    accounts.check_new(name, kind)
    where = urlsplit(accounts.url()).hostname

    def accepted(key: str, address: str) -> "Credentials":
        return accounts.accept(name, key, address, kind)

    async def waiting() -> str:
        invitation = pairing.Invitation(name, accepted, same_version=same_version)
        async with invitation.listening(host, pairing.PORT if port is None else port) as used:
            server = where if used == pairing.PORT else f"{where}:{used}"
            sys.stdout.write(f"Run {place}: arcor2-hw {group} pair {name} --server {server}\nCode: {invitation.code}\n")
            sys.stdout.flush()
            return await invitation.wait_accepted()

    key = pairing.short_key(asyncio.run(waiting()))
    sys.stdout.write(f"accepted {name}, key {key}\n")
    note(settings, f"{group} accept", f"{name}, key {key}")


def pair(group: str, name: str, server: str, *, same_version: bool = True) -> tuple["Credentials", str]:
    """Ask for the code and get credentials from the server; return them and the end of the key.

    Raises:
        Arcor2Error: the server cannot be reached or refuses, or an argument is invalid.
    """
    from arcor2_server.nodes import pairing
    from arcor2_server.nodes.credentials import check_name
    from arcor2_server.nodes.nkeys import SigningKey

    check_name(name)
    host, port = _address(server, pairing.PORT)
    if sys.stdin.isatty():
        sys.stderr.write("Code that the server shows: ")
        sys.stderr.flush()
    code = sys.stdin.readline()
    found = asyncio.run(pairing.pair(name, host, port, code, command=group, same_version=same_version))
    return found, pairing.short_key(SigningKey.from_seed(found.seed).public)


def show(accounts: "Accounts", empty: str, *, kinds: bool = False) -> None:
    """Print the members.

    Args:
        accounts: the accounts of the members.
        empty: text to print without members.
        kinds: whether to show the kind of each member.

    Raises:
        StorageError: the file cannot be used.
    """
    from arcor2_server.nodes.credentials import MemberKind
    from arcor2_server.nodes.pairing import short_key

    members = accounts.members()
    if not members:
        sys.stdout.write(f"{empty}\n")
        return
    kind = ("kind",) if kinds else ()
    table = Table("name", *kind, "key", "accepted", "from", box=None, pad_edge=False)
    for name, member in sorted(members.items()):
        shown = ("cell" if member.kind is MemberKind.MEMBER else member.kind,) if kinds else ()
        table.add_row(name, *shown, short_key(member.key), member.accepted[:16], member.address)
    console().print(table)


def revoke(settings: ServerSettings, accounts: "Accounts", group: str, name: str) -> None:
    """Revoke a member. Raise Arcor2Error if that fails."""
    asyncio.run(accounts.revoke(name))
    sys.stdout.write(f"revoked {name}\n")
    note(settings, f"{group} revoke", name)


def note(settings: ServerSettings, command: str, target: str) -> None:
    """Add an entry to the audit trail. The change has been made, so a failure is only reported."""
    try:
        note_command(settings.audit_file, command, target)
    except StorageError as error:
        fail(command.split()[0], error, ExitStatus.OK)


def _address(text: str, port: int) -> tuple[str, int]:
    """Return host and port. Raise InvalidData if the text is not an address."""
    try:
        parts = urlsplit(f"//{text}")
        if parts.hostname:
            return parts.hostname, parts.port or port
    except ValueError:
        pass
    raise InvalidData("{address!r} is not an address HOST:PORT.", address=text)

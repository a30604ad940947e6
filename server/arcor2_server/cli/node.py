"""`arcor2-hw node`: devices on other computers, and the credentials of these computers (nodes)."""

import asyncio
import contextlib
import logging
import os
import signal
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final
from urllib.parse import urlsplit

import uvloop
from cyclopts import App, Parameter
from rich.table import Table

from arcor2_hw.data.cell import BROKER_AUTHORITY, BROKER_URL, LOCAL_BROKER
from arcor2_hw.exceptions import Arcor2Error, InvalidData, StorageError
from arcor2_server.access.authority import AUTHORITY
from arcor2_server.audit.command_line import note_command
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.server_connection import printable, status_of
from arcor2_server.cli.tables import console
from arcor2_server.deployment.service_manager import ServiceManager
from arcor2_server.log import setup as server_logging
from arcor2_server.settings import ServerSettings, default_data_dir

if TYPE_CHECKING:
    from arcor2_server.nodes.accounts import Accounts
    from arcor2_server.nodes.credentials import Credentials

NICENESS: Final = -5
"""Niceness of the service: stops and beats pass through it."""

app = App(name="node", help="Run devices on another computer (node), and manage the nodes of a server.")

DataDir = Annotated[Path | None, Parameter(help="Data directory ($XDG_DATA_HOME/arcor2-hw).")]
Broker = Annotated[str | None, Parameter(env_var=BROKER_URL)]
Authority = Annotated[Path | None, Parameter(env_var=BROKER_AUTHORITY)]


# -------------------------------------------------------------------------------------------------------- node
@app.command
def run(
    name: str,
    *,
    broker: Broker = None,
    ca: Authority = None,
    log_level: str = "info",
    data_dir: DataDir = None,
) -> int:
    """On the node: run devices for the server until Ctrl-C or SIGTERM.

    Prints `ready NAME` on standard output each time when the server can use the node. Uses the credentials from `node
    pair`; they are read again before each connection.

    Parameters
    ----------
    name
        Name of this node.
    broker
        Address of a broker (nats-server) without `node broker`, for trials: nats://127.0.0.1:4222, or tls:// with user
        and password. Set the variable instead of the option to hide them from other users.
    ca
        Certificate to trust for such a broker.
    log_level
        Level of the log on standard error: debug, info, warning or error.
    """

    def work() -> None:
        from arcor2_server.nodes.credentials import check_name, load, node_file, of_address

        check_name(name)
        file = node_file(_data_dir(data_dir), name)

        def credentials() -> "Credentials":
            if broker is None and file.exists():
                return load(file)
            return of_address(broker or LOCAL_BROKER, str(ca or ""))

        credentials().options()  # report errors before the start
        try:
            server_logging.set_up(log_level)
        except (KeyError, ValueError) as error:
            raise InvalidData("{level!r} is not a level of the log.", level=log_level) from error
        with contextlib.suppress(OSError):  # not permitted without LimitNICE in the service file
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
        os.umask(0o077)  # only the user may read the files of the node and its hosts
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(_serve(name, credentials))

    return _run(work)


@app.command
def pair(name: str, *, server: str, data_dir: DataDir = None) -> int:
    """On the node: get credentials from the server.

    First run `arcor2-hw node accept NAME` on the server. It shows a code, for which this command asks (or reads it from
    standard input).

    Parameters
    ----------
    name
        Name of this node: lower-case letters, digits, - and _.
    server
        Address of the server as HOST or HOST:PORT.
    """

    def work() -> None:
        from arcor2_server.nodes import pairing
        from arcor2_server.nodes.credentials import check_name, node_file
        from arcor2_server.nodes.nkeys import SigningKey

        check_name(name)
        host, port = _address(server, pairing.PORT)
        if sys.stdin.isatty():
            sys.stderr.write("Code that the server shows: ")
            sys.stderr.flush()
        code = sys.stdin.readline()
        found = asyncio.run(pairing.pair(name, host, port, code))
        file = node_file(_data_dir(data_dir), name)
        found.save(file)
        key = pairing.short_key(SigningKey.from_seed(found.seed).public)
        sys.stdout.write(f"paired {name}, key {key}\nStart it: arcor2-hw node run {name}\n")

    return _run(work)


async def _serve(name: str, credentials: "Callable[[], Credentials]") -> None:
    from arcor2_server.nodes.service import NodeService

    def ready() -> None:
        sys.stdout.write(f"ready {name}\n")
        sys.stdout.flush()

    manager = ServiceManager.from_environment()  # first: hosts must not report to it
    serving = asyncio.create_task(NodeService(name, credentials, ready=ready).run())
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, serving.cancel)
    manager.ready()  # also without a broker, to which the service connects again and again
    try:
        with contextlib.suppress(asyncio.CancelledError):
            await serving
    finally:
        manager.stopping()


# -------------------------------------------------------------------------------------------------------- server
@app.command
def broker(
    address: str,
    *,
    certificate: str = "",
    key: str = "",
    ca: Path | None = None,
    folder: str = "/var/lib/nats/arcor2-hw",
    data_dir: DataDir = None,
) -> int:
    """On the server: create its credentials, and print the configuration file for the broker (nats-server).

    Repeat it to change the address or certificate; accepted nodes stay accepted, but must be paired again to learn
    another address.

    Parameters
    ----------
    address
        Address of the broker for the server and the nodes: tls://HOST:PORT, or nats://127.0.0.1:PORT for trials on one
        computer.
    certificate
        File of the certificate of the broker. The user of the broker must be able to read it.
    key
        File of its key.
    ca
        Certificate that the server and the nodes trust. The default is the authority of the server, if it has one.
    folder
        Folder for the broker's copy of the accounts. The user of the broker must be able to write it.
    """

    def work() -> None:
        settings = _settings(data_dir)
        if address.startswith("tls://") and not (certificate and key):
            raise InvalidData("The broker needs a certificate: --certificate FILE --key FILE.")
        trusted = ca or settings.data_dir / AUTHORITY
        try:
            authority = trusted.read_text() if ca or trusted.exists() else ""
        except (OSError, ValueError) as error:
            raise InvalidData("{file} cannot be used: {reason}", file=trusted, reason=error) from error
        configuration = _accounts(settings).set_up(
            address, authority, certificate=certificate, key_file=key, folder=folder
        )
        sys.stdout.write(configuration)
        _note(settings, "broker", address)

    return _run(work)


@app.command
def accept(
    name: str,
    *,
    host: str | None = None,
    port: int | None = None,
    data_dir: DataDir = None,
) -> int:
    """On the server: show a code with which a node gets its credentials, and wait for the node.

    The code is valid for 10 minutes, for one node, and for three attempts.

    Parameters
    ----------
    name
        Name of the node.
    host
        Address to listen on. The default is all addresses.
    port
        Port to listen on (4223).
    """

    def work() -> None:
        from arcor2_server.nodes import pairing

        settings = _settings(data_dir)
        accounts = _accounts(settings)
        accounts.check_new(name)
        where = urlsplit(accounts.url()).hostname

        async def waiting() -> str:
            invitation = pairing.Invitation(name, lambda key, address: accounts.accept(name, key, address))
            async with invitation.listening(host, pairing.PORT if port is None else port) as used:
                server = where if used == pairing.PORT else f"{where}:{used}"
                sys.stdout.write(
                    f"Run on the node: arcor2-hw node pair {name} --server {server}\nCode: {invitation.code}\n"
                )
                sys.stdout.flush()
                return await invitation.accepted()

        key = pairing.short_key(asyncio.run(waiting()))
        sys.stdout.write(f"accepted {name}, key {key}\n")
        _note(settings, "accept", f"{name}, key {key}")

    return _run(work)


@app.command(name="list")
def list_nodes(*, data_dir: DataDir = None) -> int:
    """On the server: list the accepted nodes."""

    def work() -> None:
        from arcor2_server.nodes.pairing import short_key

        nodes = _accounts(_settings(data_dir)).nodes()
        if not nodes:
            sys.stdout.write("There are no nodes. Accept one with `arcor2-hw node accept NAME`.\n")
            return
        table = Table("name", "key", "accepted", "from", box=None, pad_edge=False)
        for name, node in sorted(nodes.items()):
            table.add_row(name, short_key(node.key), node.accepted[:16], node.address)
        console().print(table)

    return _run(work)


@app.command
def revoke(name: str, *, data_dir: DataDir = None) -> int:
    """On the server: revoke the credentials of a node.

    The broker disconnects it at once, and its devices stop. Pair it again to use it again.

    Parameters
    ----------
    name
        Name of the node.
    """

    def work() -> None:
        settings = _settings(data_dir)
        asyncio.run(_accounts(settings).revoke(name))
        sys.stdout.write(f"revoked {name}\n")
        _note(settings, "revoke", name)

    return _run(work)


def _run(work: Callable[[], Any]) -> int:
    """Do the work of a command and print errors; return its exit status."""
    if find_spec("nats") is None:
        return fail("node", "install the extra `nodes` of arcor2-hw", ExitStatus.FAILED)
    logging.getLogger("asyncio").setLevel(logging.ERROR)  # it warns of each end of a TLS connection
    try:
        work()
    except StorageError as error:
        return fail("node", printable(str(error)), ExitStatus.DATA_UNUSABLE)
    except InvalidData as error:
        return fail("node", printable(str(error)), ExitStatus.USAGE)
    except Arcor2Error as error:
        return fail("node", printable(str(error)), status_of(error))
    except OSError as error:
        return fail("node", error, ExitStatus.PORT_TAKEN)
    return ExitStatus.OK


def _data_dir(data_dir: Path | None) -> Path:
    return data_dir or default_data_dir()


def _settings(data_dir: Path | None) -> ServerSettings:
    return ServerSettings(data_dir=_data_dir(data_dir))


def _accounts(settings: ServerSettings) -> "Accounts":
    from arcor2_server.nodes.accounts import Accounts

    return Accounts(settings)


def _address(text: str, port: int) -> tuple[str, int]:
    """Return host and port. Raise InvalidData if the text is not an address."""
    try:
        parts = urlsplit(f"//{text}")
        if parts.hostname:
            return parts.hostname, parts.port or port
    except ValueError:
        pass
    raise InvalidData("{address!r} is not an address HOST:PORT.", address=text)


def _note(settings: ServerSettings, command: str, target: str) -> None:
    """Add an entry to the audit trail. The change has been made, so a failure is only reported."""
    try:
        note_command(settings.audit_file, f"node {command}", target)
    except StorageError as error:
        fail("node", error, ExitStatus.OK)

"""`arcor2-hw node`: devices on other computers, and the credentials of these computers (nodes)."""

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import uvloop
from cyclopts import App, Parameter

from arcor2_hw.data.cell import BROKER_AUTHORITY, BROKER_URL
from arcor2_hw.exceptions import InvalidData
from arcor2_server.cli import members
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
        from arcor2_server.nodes.credentials import check_name, node_file

        check_name(name)
        file = node_file(_data_dir(data_dir), name)
        credentials = partial(members.credentials_for, file, broker, ca)
        credentials()  # report errors before the start
        try:
            server_logging.set_up(log_level)
        except (KeyError, ValueError) as error:
            raise InvalidData("{level!r} is not a level of the log.", level=log_level) from error
        with contextlib.suppress(OSError):  # not permitted without LimitNICE in the service file
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
        os.umask(0o077)  # only the user may read the files of the node and its hosts
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(_serve(name, credentials, file.parent / "sessions"))

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
        from arcor2_server.nodes.credentials import node_file

        found, key = members.pair("node", name, server)
        found.save(node_file(_data_dir(data_dir), name))
        sys.stdout.write(f"paired {name}, key {key}\n")
        sys.stdout.write(f"Start it: systemctl enable --now arcor2-hw-node@{name}\n")
        sys.stdout.write(f"Without the service: arcor2-hw node run {name}\n")

    return _run(work)


async def _serve(name: str, credentials: "Callable[[], Credentials]", sessions: Path) -> None:
    from arcor2_server.nodes.service import NodeService

    def ready() -> None:
        sys.stdout.write(f"ready {name}\n")
        sys.stdout.flush()

    manager = ServiceManager.from_environment()  # first, because hosts must not report to the service manager
    serving = asyncio.create_task(NodeService(name, credentials, sessions, ready=ready).run())
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, serving.cancel)
    manager.ready()  # ready even without a broker: the service retries the connection
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
        members.check_certificate(address, certificate, key)
        authority = members.trusted_authority(settings, ca)
        configuration = _accounts(settings).set_up(
            address, authority, certificate=certificate, key_file=key, folder=folder
        )
        sys.stdout.write(configuration)
        members.note(settings, "node broker", address)

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
        from arcor2_server.nodes.credentials import MemberKind

        settings = _settings(data_dir)
        members.accept(settings, _accounts(settings), "node", "on the node", name, host, port, MemberKind.MEMBER)

    return _run(work)


@app.command(name="list")
def list_nodes(*, data_dir: DataDir = None) -> int:
    """On the server: list the accepted nodes."""

    def work() -> None:
        empty = "There are no nodes. Accept one with `arcor2-hw node accept NAME`."
        members.show(_accounts(_settings(data_dir)), empty)

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
        members.revoke(settings, _accounts(settings), "node", name)

    return _run(work)


def _run(work: Callable[[], Any]) -> int:
    """Run the function of a command, print errors, and return the exit status."""
    return members.run("node", work)


def _data_dir(data_dir: Path | None) -> Path:
    return data_dir or default_data_dir()


def _settings(data_dir: Path | None) -> ServerSettings:
    return ServerSettings(data_dir=_data_dir(data_dir))


def _accounts(settings: ServerSettings) -> "Accounts":
    from arcor2_server.nodes.accounts import Accounts

    return Accounts(settings)

"""`arcor2-hw node`: run devices on this computer for a server on another one."""

import asyncio
import contextlib
import os
import re
import signal
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final
from urllib.parse import urlsplit

import uvloop
from cyclopts import App, Parameter

from arcor2_hw.data.cell import BROKER_URL
from arcor2_hw.exceptions import InvalidData
from arcor2_server.access.admission import is_loopback
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.log import setup as server_logging

NAME: Final = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")
"""A name of a node. It is part of subjects, in which dots, spaces and wildcards have a meaning."""

NICENESS: Final = -5
"""Niceness of the service: stops and beats pass through it."""

app = App(name="node")


@app.command
def run(
    name: str,
    *,
    broker: Annotated[str, Parameter(env_var=BROKER_URL)] = "nats://127.0.0.1:4222",
    ca: Annotated[Path | None, Parameter(env_var="ARCOR2_HW_NATS_CA")] = None,
    insecure: bool = False,
    log_level: str = "info",
) -> int:
    """Run devices for a server until Ctrl-C or SIGTERM.

    Prints `ready NAME` on standard output each time when the server can use the node.

    Parameters
    ----------
    name
        Name of this node: lower-case letters, digits, - and _. Each node of a server needs another one.
    broker
        Address of the broker (nats-server), with tls:// if it is on another computer. User and password are part of it;
        set the variable instead of the option to hide them from other users.
    ca
        Certificate to trust for tls://, such as the authority.pem of the server.
    insecure
        Connect to a broker on another computer without TLS. Anybody in this network can then move the devices. Use this
        only in an isolated network.
    log_level
        Level of the log on standard error: debug, info, warning or error.
    """
    if find_spec("nats") is None:
        return fail("node", "install the extra `nodes` of arcor2-hw", ExitStatus.FAILED)
    try:
        if not NAME.fullmatch(name):
            raise InvalidData("{name!r} is not a name of a node: use lower-case letters, digits, - and _.", name=name)
        address = urlsplit(broker)
        if not (insecure or address.scheme == "tls" or is_loopback(address.hostname or "")):
            raise InvalidData(
                "The broker at {host} is on another computer. Use an address with tls://, or --insecure in an "
                "isolated network.",
                host=address.hostname,
            )
        server_logging.set_up(log_level)
    except (InvalidData, KeyError, ValueError) as error:
        return fail("node", error, ExitStatus.USAGE)
    with contextlib.suppress(OSError):  # not permitted without LimitNICE in the service file
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    os.umask(0o077)  # only the user may read the files of the node and its hosts
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(_serve(name, broker, str(ca or "")))
    return ExitStatus.OK


async def _serve(name: str, broker: str, authority: str) -> None:
    from arcor2_server.nodes.service import NodeService  # needs the extra `nodes`

    def ready() -> None:
        sys.stdout.write(f"ready {name}\n")
        sys.stdout.flush()

    serving = asyncio.create_task(NodeService(name, broker, ready=ready, authority=authority).run())
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, serving.cancel)
    try:
        await serving
    except asyncio.CancelledError:
        return

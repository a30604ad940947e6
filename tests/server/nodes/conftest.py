"""A broker and a node, each a process of its own, and hosts on the node."""

import asyncio
import contextlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import nats
import pytest
from nats.aio.client import Client

from arcor2_hw.data.cell import BROKER_CREDENTIALS
from arcor2_hw.data.nodes import NodeState
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.access.authority import Authority
from arcor2_server.hosts.process import CellHost
from arcor2_server.nodes.accounts import Accounts
from arcor2_server.nodes.board import NodeBoard
from arcor2_server.nodes.credentials import Credentials
from arcor2_server.settings import ServerSettings
from tests.waiting import wait_for

NODE = "press"
NATS_SERVER = shutil.which("nats-server") or "/usr/sbin/nats-server"  # where users other than root do not look
PATIENCE = 30.0  # time limit, s; the machine may be busy
CLI = (sys.executable, "-P", "-m", "arcor2_server.cli.main")


class Broker:
    """A nats-server on a port that the operating system has chosen.

    Args:
        folder: for its files.
        address: to listen on.
        options: further options of the command.
    """

    def __init__(self, folder: Path, address: str = "127.0.0.1", options: tuple[str, ...] = ()) -> None:
        for old in folder.glob("*.ports"):
            old.unlink()
        command = (NATS_SERVER, "--addr", address, "--port", "-1", "--ports_file_dir", str(folder), *options)
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        with contextlib.suppress(PermissionError):  # as recommended for the service of a real broker
            os.setpriority(os.PRIO_PROCESS, self.process.pid, -5)

        def read() -> str:
            found = [each.read_text() for each in folder.glob("*.ports")]
            return str(json.loads(found[0])["nats"][0]) if found and found[0].endswith("}") else ""

        self.url = wait_for(read)

    def end(self) -> None:
        self.process.kill()
        self.process.wait()


def paired_by_commands(group: str, name: str, server: Path, member: Path, *options: str) -> tuple[str, str]:
    """Pair a member with the broker of a server as a technician does.

    `server` and `member` are their data directories, `options` those of `accept`. Return the command that `accept`
    prints for the member, and the output of `pair`.
    """
    accept = (*CLI, group, "accept", name, *options, "--host", "127.0.0.1", "--port", "0", "--data-dir", str(server))
    with subprocess.Popen(accept, stdout=subprocess.PIPE, text=True) as accepting:
        assert accepting.stdout is not None
        run, code = accepting.stdout.readline(), accepting.stdout.readline().removeprefix("Code: ")
        words = run.split()
        pairing = [*CLI, *words[words.index("arcor2-hw") + 1 :], "--data-dir", str(member)]
        pair = subprocess.run(pairing, input=code.lower(), capture_output=True, text=True, check=False)
        assert pair.returncode == 0, pair.stderr
        accepted = accepting.stdout.readline()
    assert accepting.returncode == 0
    assert accepted.removeprefix("accepted ") == pair.stdout.splitlines()[0].removeprefix("paired ") + "\n"
    return run, pair.stdout


def tls_configuration(folder: Path, host: str) -> tuple[Path, Path]:
    """Write the configuration of a broker with TLS; return it and the certificate to trust."""
    authority = Authority(folder, lambda: [host])
    authority.renew()
    chain, key = authority.files
    config = folder / "nats.conf"
    config.write_text(f'tls {{ cert_file: "{chain}", key_file: "{key}" }}\n')
    return config, authority.file


class Server:
    """A data directory of a server, and a broker that accepts only the server and its nodes."""

    def __init__(self, folder: Path) -> None:
        self.settings = ServerSettings(data_dir=folder / "data")
        self.accounts = Accounts(self.settings)
        self._folder = folder
        self._config = folder / "nats.conf"
        accounts = str(folder / "accounts")
        self._config.write_text(self.accounts.set_up("nats://127.0.0.1:4222", "", folder=accounts))
        self.broker = Broker(folder, options=("--config", str(self._config)))
        self.accounts.set_up(self.broker.url, "", folder=accounts)

    @property
    def environment(self) -> dict[str, str]:
        """Return the environment of relays."""
        return os.environ | {BROKER_CREDENTIALS: str(self.settings.broker_credentials)}

    def restart_broker(self) -> None:
        """Start the broker again on the same port."""
        port = self.broker.url.rpartition(":")[2]
        self.broker.end()
        self.broker = Broker(self._folder, options=("--config", str(self._config), "--port", port))


class Node:
    """A node service."""

    def __init__(self, url: str, cache: Path, *options: str, name: str = NODE, wrapper: tuple[str, ...] = ()) -> None:
        broker = ("--broker", url) if url else ()
        self.process = subprocess.Popen(
            [*wrapper, *CLI, "node", "run", name, *broker, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | {"XDG_CACHE_HOME": str(cache), "XDG_DATA_HOME": str(cache)},
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == f"ready {name}\n"

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broker]:
    running = Broker(tmp_path_factory.mktemp("broker"))
    yield running
    running.end()


@pytest.fixture(scope="module")
def node(broker: Broker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Node]:
    running = Node(broker.url, tmp_path_factory.mktemp("cache"))
    yield running
    running.end()


@contextlib.asynccontextmanager
async def followed(environment: Mapping[str, str]) -> AsyncIterator[Callable[..., Any]]:
    """Follow the announcements of nodes; yield a function that waits for a state of `NODE` and kinds of sessions."""
    board = NodeBoard(SimpleNamespace(broadcast=lambda _: None), {}, dict, lambda: True, environment)
    board.start()

    async def until(state: NodeState, kinds: list[str]) -> None:
        async with asyncio.timeout(PATIENCE):
            while (state, kinds) not in [
                (each.state, [session.kind for session in each.sessions])
                for each in board.data().nodes
                if each.name == NODE
            ]:
                await asyncio.sleep(0.02)

    try:
        yield until
    finally:
        await board.close()


class Listener:
    """Stores the reports of a host, or of a group of hosts."""

    def __init__(self) -> None:
        self.messages: list[m.ServerBound] = []
        self.reasons: list[str] = []
        self.ended_at = 0.0

    def host_message(self, host: object, message: m.ServerBound) -> None:
        self.messages.append(message)

    def host_silent(self, host: object, silent: bool) -> None:
        """Ignore silence, which a busy machine causes now and then."""

    def host_ended(self, host: object, reason: Message) -> None:
        self.reasons.append(reason.text)
        self.ended_at = asyncio.get_running_loop().time()


@pytest.fixture
async def start_host(broker: Broker) -> AsyncIterator[Callable[..., Any]]:
    """Start a host on a node, with its listener."""
    hosts: list[CellHost] = []

    async def start(
        url: str = broker.url, name: str = NODE, environment: Mapping[str, str] | None = None
    ) -> tuple[CellHost, Listener]:
        host = await CellHost.start(environment or os.environ | {"ARCOR2_HW_NATS_URL": url}, name)
        hosts.append(host)
        listener = Listener()
        host.user = listener
        async with asyncio.timeout(PATIENCE):
            await asyncio.shield(host.ready)
        return host, listener

    yield start
    for host in hosts:
        await host.close()


class Connected:
    """A client of a NATS broker that stores the errors which the broker sends."""

    def __init__(self) -> None:
        self.errors: list[str] = []
        self.closed = asyncio.Event()
        self.client: Client

    async def connect(self, credentials: Credentials, answers: str = "_INBOX") -> "Connected":
        async def failed(error: Exception) -> None:
            self.errors.append(str(error))

        async def ended() -> None:
            self.closed.set()

        self.client = await nats.connect(
            credentials.url, allow_reconnect=False, error_cb=failed, closed_cb=ended, inbox_prefix=answers,
            **credentials.options(),
        )  # fmt: skip
        return self

"""Credentials of cells and sites: pairing by the command line, rights, revocation, and a site, with real brokers."""

import asyncio
import contextlib
import json
import os
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import nats
import pytest
from nats.aio.client import Client
from nats.aio.msg import Msg

from arcor2_hw.exceptions import Conflict
from arcor2_server.cli import fleet_members as cli
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.fleet.accounts import fleet_accounts, save_hub, set_up
from arcor2_server.fleet.records import answer_subject, encode, state_subject, stream_name
from arcor2_server.nodes.credentials import Credentials, load
from arcor2_server.nodes.nkeys import Kind, SigningKey
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from tests.server.fleet.broker import free_port, listens
from tests.server.fleet.cells import state_of, unit
from tests.server.fleet.test_results import CELL, FleetProcess, SmallCell, until
from tests.server.nodes.conftest import CLI, NATS_SERVER
from tests.waiting import WITHIN, wait_for

pytestmark = pytest.mark.xdist_group("fleet")


class Hub:
    """A broker whose configuration `set_up` writes, with its data directory."""

    def __init__(self, folder: Path, domain: str, *, sites: bool = False) -> None:
        folder.mkdir(exist_ok=True)
        self.settings = ServerSettings(data_dir=folder / "data")
        self.accounts = fleet_accounts(self.settings)
        self.port, self.folder, self.domain = free_port(), folder, domain
        self.sites = f"nats://127.0.0.1:{free_port()}" if sites else ""

    def start(self) -> None:
        store = self.folder / "broker"
        store.mkdir(exist_ok=True)
        for name in ("hub.creds", "hub.pem"):
            if (file := self.settings.broker_dir / name).exists():
                (store / name).write_bytes(file.read_bytes())
        config = self.folder / "nats.conf"
        url = f"nats://127.0.0.1:{self.port}"
        config.write_text(
            set_up(
                self.settings, url, "", domain=self.domain, certificate="", key_file="", folder=str(store),
                sites=self.sites,
            )
        )  # fmt: skip
        log = self.folder / "nats.log"
        self.process = subprocess.Popen((NATS_SERVER, "-c", str(config), "-l", str(log)))
        wait_for(lambda: listens(self.port))

    def accept(self, name: str, *, site: bool = False) -> Credentials:
        key = SigningKey.create(Kind.USER)
        found = self.accounts.accept(name, key.public, "127.0.0.1", site=site)
        return Credentials(found.url, found.authority, found.claim, key.seed, leaf=site)

    def end(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[Hub]:
    running = Hub(tmp_path / "hub", "hub", sites=True)
    running.start()
    yield running
    running.end()


class Connected:
    """A user of the broker, with the errors that it gets."""

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


@contextlib.asynccontextmanager
async def connected(credentials: Credentials, cell: str = "") -> AsyncIterator[Connected]:
    found = await Connected().connect(credentials, answer_subject(cell) if cell else "_INBOX")
    try:
        yield found
    finally:
        await found.client.close()


FORBIDDEN = (
    "arcor2hw.fleet.oven.state", "arcor2hw.fleet.oven.unit", "arcor2hw.fleet.oven.answer.1", "arcor2.press-3.open",
    "_INBOX.any.1", "$JS.API.STREAM.CREATE.ARCOR2_HW_FLEET_press-3", "$JS.API.STREAM.CREATE.ARCOR2_HW_FLEET_oven",
    "$JS.API.STREAM.DELETE.ARCOR2_HW_FLEET_oven", "$JS.API.STREAM.MSG.GET.ARCOR2_HW_FLEET_oven",
    "$JS.API.CONSUMER.CREATE.ARCOR2_HW_FLEET_oven", "$JS.hub.API.STREAM.DELETE.ARCOR2_HW_FLEET_oven",
    "$JS.ACK.ARCOR2_HW_FLEET_oven.fleet.1.1.1.1.1", "$SYS.REQ.CLAIMS.UPDATE",
)  # fmt: skip


async def test_a_cell_publishes_only_under_its_own_name(hub: Hub) -> None:
    received: list[str] = []

    async def receive(message: Msg) -> None:
        received.append(message.subject)

    page = load(hub.settings.broker_credentials)
    async with connected(page) as here, connected(hub.accept(CELL), CELL) as press:
        stream = here.client.jetstream(domain="hub")
        for cell in ("oven", CELL):
            await stream.add_stream(name=stream_name(cell), subjects=[f"arcor2hw.fleet.{cell}.unit"])
        await here.client.subscribe("arcor2hw.fleet.*.state", cb=receive)
        await here.client.flush()
        for subject in FORBIDDEN:
            await press.client.publish(subject, b"x")
        for subject in ("arcor2hw.fleet.*.state", "arcor2hw.fleet.oven.>", ">", "_INBOX.>", "arcor2hw.fleet.press-3.>"):
            await press.client.subscribe(subject, cb=receive)
        await press.client.publish(state_subject(CELL), b"x")
        own = press.client.jetstream()
        assert (await own.account_info()).domain == "hub"
        assert (await own.publish("arcor2hw.fleet.press-3.unit", b"x")).stream == stream_name(CELL)
        # A broker answers a cell on any subject, also on one that deletes the stream of another cell.
        deletion = "$JS.API.STREAM.DELETE.ARCOR2_HW_FLEET_oven"
        await press.client.publish("arcor2hw.fleet.press-3.unit", b"", reply=deletion)
        await press.client.publish("$JS.API.INFO", b"", reply=deletion)
        await press.client.flush()
        await here.client.flush()
        await asyncio.sleep(0.3)
        assert (await stream.stream_info(stream_name("oven"))).state.messages == 0
        assert received == [state_subject(CELL)]
        assert len([each for each in press.errors if "permissions violation" in each]) == len(FORBIDDEN) + 5
        # The server of the page commands nothing.
        for subject in ("arcor2hw.fleet.press-3.state", "arcor2.press.open", "$JS.API.STREAM.DELETE.X"):
            await here.client.publish(subject, b"x")
        await here.client.flush()
        assert len(here.errors) == 3

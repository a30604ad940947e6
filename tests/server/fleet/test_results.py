"""Results of a cell at another site: the link is cut, the broker and the server of the fleet are killed."""

import asyncio
import contextlib
import subprocess
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import msgspec
import pytest

from arcor2_hw.data.units import UnitState
from arcor2_server.fleet.broker import keep_connected
from arcor2_server.fleet.columns import columns_of
from arcor2_server.fleet.delivery import Delivery
from arcor2_server.fleet.driver_texts import DriverTexts
from arcor2_server.fleet.file import FILE, FleetFile, ReceivedResult
from arcor2_server.fleet.records import answer_subject, encode, state_subject
from arcor2_server.nodes.credentials import Credentials, of_address
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.outbox import OutboxKind, UnitOutbox
from arcor2_server.storage.units import UnitStore
from tests.ports import free_port
from tests.server.fleet.broker import Link, Server
from tests.server.fleet.cells import ENTERED, state_of, unit
from tests.waiting import WITHIN

pytestmark = pytest.mark.xdist_group("fleet")
CELL, IDENTITY = "press-3", "a" * 32


class FleetProcess:
    """A process that runs `arcor2-hw fleet serve`."""

    def __init__(self, url: str, data_dir: Path, *options: str) -> None:
        self.command = [sys.executable, "-P", "-m", "arcor2_server.cli.main", "fleet", "serve", "--port", "0"]
        self.command += [*(("--broker", url) if url else ()), "--data-dir", str(data_dir), *options]
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().split()[1].replace("ws://", "http://")

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()

    def cells(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = httpx.get(f"{self.url}/api/fleet/cells").json()["cells"]
        return found

    def numbers(self) -> list[int]:
        """Return the numbers of the stored units in order. They may arrive in another one."""
        found = httpx.get(f"{self.url}/api/fleet/results", params={"kind": "unit", "limit": 1000}).json()
        return sorted(each["record"]["number"] for each in found)


class SmallCell:
    """The database of a cell, and the tasks that publish its state and results."""

    def __init__(self, storage: Storage, broker: str | Credentials, domain: str) -> None:
        self.outbox = UnitOutbox(storage)
        self.units = UnitStore(storage, self.outbox)
        self._delivery = Delivery([self.outbox], CELL, IDENTITY, DriverTexts(list))
        self._domain = domain
        credentials = of_address(broker) if isinstance(broker, str) else broker
        answers = answer_subject(CELL) if credentials.claim else ""
        connecting = keep_connected(lambda: credentials, "cell", self._publish, lambda: None, answers)
        self._task = asyncio.create_task(connecting)

    async def _publish(self, client: object) -> None:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._delivery.run(client))  # type: ignore[arg-type]
            tasks.create_task(self._states(client))

    async def _states(self, client: object) -> None:
        for number in range(1, 10**6):
            state = state_of(IDENTITY, number=number, domain=self._domain)
            await client.publish(state_subject(CELL), encode(state))  # type: ignore[attr-defined]
            await asyncio.sleep(0.2)

    async def sent(self, within: float = WITHIN) -> None:
        """Wait until the broker of the site has stored all results."""
        async with asyncio.timeout(within):
            while await self.outbox.count():
                await asyncio.sleep(0.02)

    async def close(self) -> None:
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)


@contextlib.asynccontextmanager
async def two_sites(folder: Path) -> AsyncIterator[tuple[SmallCell, Link, Server, FleetProcess]]:
    """Run a hub with the fleet, a link, and a leaf with a cell."""
    leaf_port = free_port()
    hub = Server(folder / "hub", "hub", leaf_port=leaf_port)
    link = Link(leaf_port)
    await link.heal()
    site = Server(folder / "site", "site", hub_port=link.port)
    fleet = FleetProcess(hub.fleet_url, folder / "fleet")
    storage = await Storage.open(ServerSettings(data_dir=folder))
    cell = SmallCell(storage, site.url, "site")
    try:
        yield cell, link, site, fleet
    finally:
        await cell.close()
        await storage.close()
        fleet.kill()
        site.kill()
        hub.kill()
        with contextlib.suppress(AssertionError):
            await link.cut()


async def until(read: Callable[[], object], expected: object) -> None:
    async with asyncio.timeout(2 * WITHIN):
        while await asyncio.to_thread(read) != expected:
            await asyncio.sleep(0.2)


async def test_results_queued_while_offline_arrive_once_each(tmp_path: Path) -> None:
    async with two_sites(tmp_path) as (cell, link, site, fleet):
        await cell.units.put([unit(1)])
        await until(fleet.numbers, [1])

        # While the link is cut, the broker of the site stores the results. When that broker fails too, the cell does.
        await link.cut()
        await cell.units.put([unit(number) for number in range(2, 151)])
        await cell.sent()
        site.kill()
        await cell.units.put([unit(number) for number in range(151, 301)])
        assert await cell.outbox.count() == 150
        fleet.kill()
        site.start()
        await cell.sent()
        await link.heal()
        fleet.start()
        await until(fleet.numbers, list(range(1, 301)))

        # A unit that changes later replaces its earlier version.
        await cell.units.put([unit(300, state=UnitState.REJECTED)])
        await cell.sent()

        def state_of_300() -> str:
            found = httpx.get(f"{fleet.url}/api/fleet/results", params={"cell": CELL, "limit": 1000}).json()
            return next(str(each["record"]["state"]) for each in found if each["record"]["number"] == 300)

        await until(state_of_300, "rejected")
        assert fleet.numbers() == list(range(1, 301))


@pytest.fixture
def file(tmp_path: Path) -> Iterator[FleetFile]:
    opened = FleetFile(tmp_path / FILE)
    yield opened
    opened.close()


def received(number: int, stamp: int, state: UnitState = UnitState.GOOD, since: str = ENTERED) -> ReceivedResult:
    document = msgspec.json.encode(unit(number, state=state))
    return ReceivedResult(CELL, IDENTITY, "unit", number, since, stamp, document, columns_of("unit", stamp, document))


def test_a_result_that_is_delivered_again_is_stored_once(file: FleetFile) -> None:
    """A kill before the acknowledgement, or a broker that no longer has the message id, causes a second delivery."""
    file.put_results([received(1, 10), received(2, 11)])
    file.put_results([received(1, 10), received(1, 20, UnitState.BAD)])
    file.put_results([received(1, 10)])  # an older version, delivered late
    file.put_results([received(2, 30, since="2026-02-02T03:04:05.000000+00:00")])  # number reused after a restoration
    found = [(each.id, msgspec.json.decode(each.record)["state"]) for each in file.results("", "unit", 0, 10)]
    assert found == [(max(each for each, _ in found), "good"), (2, "good"), (1, "bad")]
    assert file.count() == 3


async def test_a_record_that_changes_while_it_waits_is_sent_once(tmp_path: Path) -> None:
    storage = await Storage.open(ServerSettings(data_dir=tmp_path))
    outbox = UnitOutbox(storage)
    units = UnitStore(storage, outbox)
    try:
        await units.put([unit(1), unit(2), unit(3, state=UnitState.IN_CELL)])
        before = [each.number for each in await outbox.first(10)]
        await units.put([unit(1, state=UnitState.BAD)])
        await outbox.remove(before)  # the broker has stored the versions from before
        (waiting,) = await outbox.first(10)
        assert (waiting.kind, msgspec.json.decode(waiting.document)["state"]) == (OutboxKind.UNIT, "bad")
        await units.put([], {1})
        assert await outbox.first(10) == []
        assert await outbox.count() == 0
    finally:
        await storage.close()

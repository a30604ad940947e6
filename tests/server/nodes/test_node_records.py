"""The server stores runs on a node like runs on its own computer: inventory, checkpoints and recordings."""

import asyncio
import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import msgspec
import pytest
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.held import HeldData, HoldChoice
from arcor2_hw.data.parts import ConfirmedPart, Part, PartInventory, RunCheckpoint
from arcor2_hw.data.recordings import SignalKind
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.checkpoints import CheckpointFile
from arcor2_hw.runtime.ring import Ring, records
from arcor2_hw.runtime.ring_records import ActionEnded, ActionStarted, Names, converted, encode
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.process import CellHost
from arcor2_server.nodes.run_records import RingSender, RunRecords
from arcor2_server.storage.recordings import RecordingFiles
from tests.e2e.harness import until
from tests.runtime.conftest import Package
from tests.runtime.test_host_parts import ONE, STEPS, write_package
from tests.runtime.test_host_recording import check, running
from tests.server.cell.conftest import running_server
from tests.server.cell.test_execution_history import subscribe
from tests.server.cell.test_part_inventories import CONFIRMED, CONTINUE
from tests.server.core.serving import ServerProcess, running as running_process, talking
from tests.server.nodes.conftest import NODE, PATIENCE, Broker, Listener, Node
from tests.server.nodes.test_node_hosts import AN_HOUR_AHEAD
from tests.waiting import wait_for

pytestmark = pytest.mark.xdist_group("nodes")


class Cell:
    """Runs of one scene, whose arm writes notes to a directory."""

    def __init__(self, directory: Path, start_host: Callable[..., Any]) -> None:
        self.directory, self._start_host = directory, start_host
        self.records = directory / "records"
        self.host: CellHost
        self.listener: Listener
        self._runs = 0

    async def start(self, body: str, url: str, **options: Any) -> None:
        self._runs += 1
        self.host, self.listener = await self._start_host(url)
        path = write_package(self.directory / f"pkg_{self._runs}", self.directory, body)
        more = {"records": str(self.records), "run": self._runs, "hold_on_error": True} | options
        self.host.send(m.RunPackage("pkg_1", str(path), streaming_period=0, **more))

    @property
    def inventory(self) -> PartInventory:
        found = CheckpointFile(self.records, "scn_1").read()
        assert found is not None
        return found

    @property
    def run(self) -> RunCheckpoint:
        assert self.inventory.run is not UNSET
        return self.inventory.run  # type: ignore[return-value]

    def notes(self) -> list[str]:
        path = self.directory / "notes"
        return path.read_text().split() if path.exists() else []

    async def until_moving(self) -> None:
        """Wait until the arm moves."""
        await asyncio.to_thread(wait_for, self.notes)

    async def message(self, kind: type[Any]) -> Any:
        async def found() -> Any:
            while not (all_ := [each for each in self.listener.messages if isinstance(each, kind)]):
                await asyncio.sleep(0.01)
            return all_[-1]

        return await asyncio.wait_for(found(), PATIENCE)

    async def until_held(self) -> HeldData:
        held: HeldData = (await self.message(m.ProgramHeld)).held
        return held

    async def until_ended(self) -> None:
        async with asyncio.timeout(PATIENCE):
            await asyncio.shield(self.host.ended)


@pytest.fixture
def cell(tmp_path: Path, start_host: Callable[..., Any]) -> Cell:
    return Cell(tmp_path, start_host)


def cut(broker: Broker, host: CellHost) -> None:
    """A suspended broker delivers everything late, like a cable that is cut and repaired."""
    os.kill(broker.process.pid, signal.SIGSTOP)
    os.waitid(os.P_PID, broker.process.pid, os.WSTOPPED | os.WNOWAIT)  # until all its threads are suspended


def kill_relay(broker: Broker, host: CellHost) -> None:
    host.kill()


@pytest.mark.parametrize("fault", [cut, kill_relay])
async def test_a_run_that_a_fault_interrupts_continues(
    cell: Cell, broker: Broker, node: Node, fault: Callable[[Broker, CellHost], None]
) -> None:
    (cell.directory / "hang").touch()
    await cell.start(STEPS, broker.url)
    await cell.until_moving()
    assert [action.action_name for action in cell.run.actions] == ["pick"]  # stored before it has started
    fault(broker, cell.host)
    (cell.directory / "hang").unlink()  # the action ends, but the next one must not start
    await cell.until_ended()
    os.kill(broker.process.pid, signal.SIGCONT)
    assert (cell.run.ended, cell.run.last, cell.run.results["act_scan"]) == (False, "act_scan", ['"A-1"'])
    assert cell.inventory.parts == [Part(1, "obj_feeder", "A-1", moving_to="obj_arm")]

    await cell.start(STEPS, broker.url, continues=True)
    held = await cell.until_held()
    assert (held.kind, held.action_name) == ("program_interrupted", "pick")
    assert cell.notes() == ["pick"]  # nothing has moved since
    await cell.host.decide(held.number, HoldChoice.RETRY, [], "")
    await cell.until_ended()
    assert cell.notes() == ["pick", "pick", "place", "pick", "place"]
    assert (cell.run.ended, cell.inventory.counts.fed, cell.inventory.counts.good, cell.inventory.parts) == (
        True,
        1,
        1,
        [],
    )


async def test_clients_inspect_and_continue_a_run_of_a_killed_node(
    broker: Broker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ARCOR2_HW_NATS_URL", broker.url)
    (tmp_path / "hang").touch()
    node = Node(broker.url, tmp_path, name="lathe")
    try:
        async with running_server(tmp_path / "data") as server:
            subscribe(server, "PartsChanged")
            package = server.services.settings.packages_dir / "pkg_1"
            write_package(package, tmp_path, ONE)
            on_node(package)
            await server.ask("RunPackage", {"id": "pkg_1", "on_error": "hold"})
            await until((tmp_path / "notes").exists, "the arm picks the part")
            (inventory,) = await server.ask("GetParts")
            assert (inventory.parts[0].serial, inventory.parts[0].moving_to) == ("A-1", "obj_arm")
            with pytest.raises(Arcor2Error, match="while an action runs: pick"):
                await server.ask("ConfirmParts", CONFIRMED)
            node.end()
            await server.client.state("stopped", "PackageState")
            published = await server.client.event("PartsChanged", lambda data: "run" in data)
            assert [action["action_name"] for action in published["run"]["actions"]] == ["pick"]

        async with running_server(tmp_path / "data") as server:  # a restart changes nothing
            subscribe(server, "Held")
            with pytest.raises(RequestRefused, match=r"Confirm where these parts are .*: A-1 \(feeder\)"):
                await server.ask("RunPackage", CONTINUE)
            await server.ask("ConfirmParts", CONFIRMED)
            (tmp_path / "hang").unlink()
            node = Node(broker.url, tmp_path, name="lathe")
            await server.ask("RunPackage", CONTINUE)
            held = await server.client.event("Held")
            assert (held["kind"], held["action_name"]) == ("program_interrupted", "pick")
            await server.ask("DecideHeld", {"number": held["number"], "choice": "skip"})  # the part is in the gripper
            await server.client.state("stopped", "PackageState")
            assert (tmp_path / "notes").read_text().split() == ["pick", "place"]
            (inventory,) = await server.ask("GetParts")
            assert [(part.serial, part.place) for part in inventory.parts] == [("A-1", "obj_nest")]
    finally:
        node.end()


async def test_the_inventory_is_published_and_confirmed_during_a_run(cell: Cell, broker: Broker, node: Node) -> None:
    (cell.directory / "fault").touch()
    await cell.start(ONE, broker.url)
    held = await cell.until_held()
    assert cell.inventory.parts == [Part(1, "obj_feeder", "A-1", moving_to="obj_arm", confirmed=False)]
    assert (await cell.message(m.PartsChanged)).inventory.parts == cell.inventory.parts
    assert (await cell.message(m.PartStep)).part == 1
    await cell.host.confirm_parts([ConfirmedPart(1, "obj_nest")])
    assert cell.inventory.parts == [Part(1, "obj_nest", "A-1")]
    await cell.host.decide(held.number, HoldChoice.END, [], "")
    await cell.until_ended()
    assert cell.run.ended


async def test_an_action_whose_checkpoint_is_not_stored_does_not_start(cell: Cell, broker: Broker, node: Node) -> None:
    cell.records.write_text("no directory")
    await cell.start(ONE, broker.url)
    await cell.until_ended()
    end = [each for each in cell.listener.messages if isinstance(each, m.ProgramChanged)][-1]
    assert end.error is not None
    assert "The state of the run cannot be stored" in str(end.error.message)
    assert cell.notes() == []


async def start_lift(start_host: Callable[..., Any], folder: Path, name: str = NODE) -> CellHost:
    """Run a program until its last action is recorded."""
    host, _ = await start_host(name=name)
    (folder / "package").mkdir()
    sender: Any = SimpleNamespace(send=host.send, expect=lambda *_: None)
    running(sender, Package(folder / "package"), folder / "recordings")
    await asyncio.to_thread(wait_for, lambda: [each.name for each in recorded(host.ring).actions] == ["a", "b", "c"])
    return host  # type: ignore[no-any-return]


def recorded(ring: Ring) -> Any:
    moment = time.monotonic()
    return converted([ring.segments()], moment, moment - 60.0, moment)[0]


async def test_the_server_has_the_recording_of_a_killed_node(
    broker: Broker, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    node = Node(broker.url, tmp_path, name="lathe")
    try:
        host = await start_lift(start_host, tmp_path, "lathe")
        node.process.kill()
        async with asyncio.timeout(PATIENCE):
            await asyncio.shield(host.ended)
        check(recorded(host.ring))
        assert not (tmp_path / "recordings").exists()
    finally:
        node.end()


async def test_a_failed_run_is_recorded_to_its_end_on_the_clock_of_the_server(
    broker: Broker, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    """The recording is made when the end of the program is reported."""
    if subprocess.run([*AN_HOUR_AHEAD, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this user may not create a time namespace (needs root and Linux 5.6)")
    node = Node(broker.url, tmp_path, name="ahead", wrapper=AN_HOUR_AHEAD)
    try:
        host, listener = await start_host(broker.url, "ahead")
        found: list[Any] = []

        def watch(source: CellHost, message: m.ServerBound) -> None:
            if isinstance(message, m.ProgramChanged) and message.state == "stopped":
                found.append(recorded(source.ring))

        listener.host_message = watch  # type: ignore[method-assign]
        (tmp_path / "fault").touch()
        path = write_package(tmp_path / "pkg", tmp_path, ONE)
        host.send(m.RunPackage("pkg_1", str(path), streaming_period=0))
        async with asyncio.timeout(PATIENCE):
            await asyncio.shield(host.ended)
        actions = found[0].actions
        assert [each.name for each in actions] == ["scan", "pick"]
        assert "the part sticks" in actions[1].error
    finally:
        node.end()


async def test_the_relay_stores_the_recording_of_a_run_interrupted_by_the_end_of_the_server(
    broker: Broker, node: Node, start_host: Callable[..., Any], tmp_path: Path
) -> None:
    host = await start_lift(start_host, tmp_path)
    await host.close()
    [saved] = RecordingFiles(tmp_path / "recordings").saved_rings()
    assert saved.run == 3
    check(converted(saved.rings, saved.monotonic, saved.monotonic - 60.0, saved.monotonic)[0])


def on_node(package: Path) -> None:
    """Assign the devices of a package to the node "lathe"."""
    file = package / "data" / "scene.json"
    scene = msgspec.json.decode(file.read_bytes())
    scene["objects"][0]["node"] = "lathe"
    file.write_bytes(msgspec.json.encode(scene))


async def recordings(server: ServerProcess) -> list[dict[str, Any]]:
    """Wait for recordings, and return them with their content."""
    async with httpx.AsyncClient(base_url=server.url.replace("ws", "http", 1)) as http:
        async with asyncio.timeout(PATIENCE):
            while not (listed := (await http.get("/api/recordings")).json()):
                await asyncio.sleep(0.1)
        return [(await http.get(f"/api/recordings/{each['number']}")).json() for each in listed]


@pytest.mark.matrix
async def test_a_run_on_a_node_survives_killed_servers_and_nodes(broker: Broker, tmp_path: Path) -> None:
    """Both are real processes. After each kill there is one more recording, and the program continues."""
    data, hang = tmp_path / "data", tmp_path / "hang"
    hang.touch()
    write_package(data / "packages" / "pkg_1", tmp_path, ONE)
    on_node(data / "packages" / "pkg_1")
    node = Node(broker.url, tmp_path, name="lathe")
    try:
        server = ServerProcess(data, ARCOR2_HW_NATS_URL=broker.url)
        await server.start()
        async with talking(server.url, "ann") as client:
            await client.granted("RunPackage", {"id": "pkg_1", "on_error": "hold"})
            await until((tmp_path / "notes").exists, "the arm picks the part")
            server.process.kill()
        await server.ended()

        async with running_process(data, ARCOR2_HW_NATS_URL=broker.url) as server, talking(server.url, "ann") as client:
            (recording,) = await recordings(server)
            assert [each["name"] for each in recording["actions"]] == ["scan", "pick"]
            assert "Confirm where these parts are" in await client.refused("RunPackage", CONTINUE)
            await client.granted("ConfirmParts", CONFIRMED | {"parts": [{"number": 1, "place": "obj_feeder"}]})
            await client.granted("RunPackage", CONTINUE)
            async with asyncio.timeout(PATIENCE):
                while not (held := (await client.granted("GetHeld")).get("held")):
                    await asyncio.sleep(0.05)
            await client.granted("DecideHeld", {"number": held["number"], "choice": "retry", "confirmed": True})
            await until(lambda: (tmp_path / "notes").read_text().split() == ["pick", "pick"], "it picks again")
            node.process.kill()
            async with asyncio.timeout(PATIENCE):
                while not any(each["run"] == 2 and each.get("run_failed") for each in await recordings(server)):
                    await asyncio.sleep(0.1)
            (inventory,) = await client.granted("GetParts")
            assert [each["action_name"] for each in inventory["run"]["actions"]] == ["pick"]
            assert (inventory["counts"]["fed"], len(inventory["parts"])) == (1, 1)
    finally:
        node.end()


# ------------------------------------------------------------------------------------------------ without a broker
async def test_a_node_cannot_change_the_inventory_of_another_scene(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "project.json").write_text('{"scene_id": "scn_1"}')
    answers: list[m.CheckpointAnswer] = []
    records = RunRecords(None, lambda body: answers.append(m.decode_host_bound(body)), lambda moment: moment)
    records.begin(m.RunPackage("pkg_1", str(tmp_path), records=str(tmp_path / "records")))
    for number, scene in enumerate(("scn_2", "../scn_1", "scn_1")):
        records.handle("StoreCheckpoint", msgspec.msgpack.encode(m.StoreCheckpoint(number, PartInventory(scene))))
    records.handle("ReadCheckpoint", msgspec.msgpack.encode(m.ReadCheckpoint(3)))
    await records.close()
    assert [each.number for each in answers if each.problem is not None] == [0, 1]
    assert [each.inventory for each in answers if each.number == 3] == [PartInventory("scn_1")]
    assert sorted(each.name for each in (tmp_path / "records").iterdir()) == ["scn_1.0", "scn_1.1"]


def test_the_ring_of_the_server_has_the_same_records_on_its_clock() -> None:
    """There are more records than a segment can hold, and the clock offset changes within a segment."""
    server_ring, node_ring, offset = Ring(), Ring(), -100.0
    copy = RunRecords(server_ring, lambda _: None, lambda moment: moment + offset)
    sender = RingSender(node_ring, lambda body: copy.handle("RingRecords", body))
    names = Names(0, SignalKind.POINT, "obj", "obj", ["x"], [""])
    expected: list[list[bytes]] = []
    for number in range(30):
        if number % 10 == 0:
            node_ring.begin_segment()
            offset = -100.0 - number
            expected.append([])
        for record in (names, ActionStarted(200.0 + number, number, "a" * 1000), ActionEnded(200.5 + number, number)):
            assert node_ring.append(encode(record))
            if not isinstance(record, Names):
                record = replace(record, stamp=record.stamp - 100.0 - number // 10 * 10)
            expected[-1].append(encode(record))
        if number % 3 == 0:
            sender.flush()
            offset += 0.001
    sender.flush()
    sender.flush()
    assert [[bytes(each) for each in records(segment)] for segment in server_ring.segments()] == expected

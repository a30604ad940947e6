"""A scene and a program whose objects run on this computer and on two nodes."""

import asyncio
import os
import signal
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.device import Connection
from arcor2_hw.data.interlocks import Interlock, InterlockCondition, InterlockTarget, Need, Unmet
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, SeveralNodes
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.ring import Ring
from arcor2_server.hosts.group import HostGroup
from arcor2_server.hosts.placement import place
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.process import CellError
from tests.runtime.conftest import Package, open_scene, scene_object, type_code
from tests.runtime.test_host_program import ARM
from tests.server.nodes.conftest import NODE, PATIENCE, Broker, Listener, Node
from tests.waiting import wait_for

pytestmark = pytest.mark.xdist_group("nodes")  # its tests share a broker and nodes

OVEN = "oven"
READER = """
from arcor2_hw.data.device import Connection, Quality, Reading

@dataclass
class ReaderSettings(Settings):
    file: str
    broken: bool = False

class Reader(Generic):
    _ABSTRACT = False
    moving = False
    CANCEL_MAPPING = {"wait": "cancel_wait"}
    is_closed = True

    def __init__(self, obj_id, name, settings: ReaderSettings):
        super().__init__(obj_id, name, settings)

    def connect(self, timeout: float = 5.0):
        if self.settings.broken and Path(self.settings.file).with_name("off").exists():
            raise NotConnected(f"{self.name} is switched off")

    def note(self, text):
        with open(self.settings.file, "a") as f:
            f.write(f"{self.name} {text}\\n")

    def disconnect(self): self.note("disconnected")

    owner = None

    def take_control(self):
        self.owner = "us"
        self.note("control")

    def control_owner(self): return self.owner

    @action(again="safe")
    def scan(self, where: Pose, times: int = 1, *, an: str | None = None) -> tuple[str, Position]:
        self.note("scan")
        return f"code {times} of {os.getpid()}", where.position

    @action
    def refuse(self, *, an: str | None = None) -> None:
        raise OutOfRange("too far", "0.3 m")

    @action
    def quick(self, *, an: str | None = None) -> int:
        return 1

    @action(deadline=0.3)
    def hang(self, *, an: str | None = None) -> None:
        time.sleep(2.0)

    @action
    def move(self, *, an: str | None = None) -> None:
        self.moving = True
        self.note("moves")
        while self.moving:
            time.sleep(0.002)
        raise Cancelled("stopped")

    @action
    def untyped(self, *, an: str | None = None):
        return {"a": 1}

    def take(self, what: object) -> None:
        pass

    def cancel_wait(self) -> None:
        pass

    @observation
    def closed(self) -> bool:
        return self.is_closed

    @observation
    def timed(self) -> Reading[bool]:
        return Reading.of(self.is_closed)

    def set_closed(self, value: bool) -> None:
        self.is_closed = value

    def pid(self) -> int:
        return os.getpid()

    def stop(self) -> None:
        if self.moving:
            self.note("stopped")
        self.moving = False
"""
TYPES = {"Arm": ARM, "Reader": READER}
HOME = "Pose(Position(1.0, 2.0, 3.0))"


def derives(name: str, base: str) -> bool:
    return (name, base) in (("Arm", "Robot"), ("Box", "VirtualCollisionObject"))


class GroupListener(Listener):
    """Stores the reports of a group of hosts."""

    async def until(self, kind: type[Any], where: Callable[[Any], bool] = lambda _: True) -> Any:
        def found() -> list[Any]:
            return [each for each in self.messages if isinstance(each, kind) and where(each)]

        return (await asyncio.to_thread(wait_for, found))[-1]


class Cell:
    """A pool of hosts, and the objects of a scene: an arm on this computer, readers on two nodes."""

    def __init__(self, pool: CellHosts, folder: Path) -> None:
        self.pool, self.folder, self.listener = pool, folder, GroupListener()
        self.file = folder / "notes"
        self.file.touch()
        self.objects = [
            scene_object("arm", "Arm", pose=True, file=str(self.file)),
            self.reader("reader", NODE),
            self.reader("belt", OVEN),
        ]

    def reader(self, name: str, node: str, **settings: Any) -> SceneObject:
        return replace(scene_object(name, "Reader", file=str(self.file), **settings), node=node)

    def notes(self) -> list[str]:
        return self.file.read_text().splitlines()

    async def until_noted(self, *lines: str) -> None:
        await asyncio.to_thread(wait_for, lambda: set(lines) <= set(self.notes()))

    async def take(self) -> HostGroup:
        return await self.pool.take_all(self.listener, self.pool.place(self.objects))

    def opening(self, *objects: SceneObject) -> m.OpenScene:
        return open_scene([type_code(*each) for each in TYPES.items()], *objects)

    async def online(self, *interlocks: Interlock, keep_going: bool = False) -> HostGroup:
        group = await self.take()
        opening = replace(self.opening(*self.objects), keep_going=keep_going)
        group.send(replace(opening, scene=replace(opening.scene, interlocks=list(interlocks))))
        opened = await self.listener.until(m.SceneOpened | m.SceneFailed)  # type: ignore[arg-type]
        assert isinstance(opened, m.SceneOpened), opened
        return group

    async def run(self, body: str, *interlocks: Interlock) -> HostGroup:
        names = "\n".join(f'{each.name} = res.objects["{each.id}"]' for each in self.objects)
        head = f"from arcor2_hw.data.geometry import Pose, Position\n{names}\n"
        package = Package(self.folder / "package")
        package.write(TYPES, self.objects, Project("p", "scn_1", id="pro_1"), head + body, interlocks=list(interlocks))
        group = await self.take()
        group.send(m.RunPackage("pkg_1", str(package.directory)))
        return group

    async def end(self) -> m.ProgramChanged:
        found: m.ProgramChanged = await self.listener.until(m.ProgramChanged, lambda each: each.state == "stopped")
        return found


@pytest.fixture(scope="module")
def oven(broker: Broker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Node]:
    running = Node(broker.url, tmp_path_factory.mktemp("oven"), name=OVEN)
    yield running
    running.end()


@pytest.fixture
async def cell(
    broker: Broker, node: Node, oven: Node, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[Cell]:
    monkeypatch.setenv("ARCOR2_HW_NATS_URL", broker.url)
    pool = CellHosts([], derives=derives)
    yield Cell(pool, tmp_path)
    await pool.close()


# ------------------------------------------------------------------------------------------------ placement
def objects_on(**nodes: str) -> list[SceneObject]:
    kinds = {"arm": "Arm", "other": "Arm", "box": "Box"}
    return [SceneObject(name, kinds.get(name, "Reader"), id=name, node=node) for name, node in nodes.items()]


def test_the_main_host_is_on_the_node_of_the_robots() -> None:
    found = place(None, objects_on(arm="press", reader="oven", clock="", box=""), derives)
    assert (found.main, found.all) == ("press", ["press", "oven", ""])
    assert found.nodes == {"arm": "press", "reader": "oven", "clock": "", "box": "press"}
    with pytest.raises(SeveralNodes, match=r"arm \(node press\), other \(the computer of the server\)"):
        place(None, objects_on(arm="press", other="", reader="oven"), derives)


def test_without_robots_the_main_host_is_where_most_objects_are() -> None:
    assert place(None, objects_on(a="press", b="oven", c="press"), derives).main == "press"
    assert place(None, objects_on(a="press", b="", box="oven"), derives).main == ""
    assert place(None, [], derives).all == [""]


# ------------------------------------------------------------------------------------------------ programs
async def test_a_program_uses_objects_of_all_computers(cell: Cell) -> None:
    await cell.run(f"""
(code, where) = reader.scan({HOME}, 2, an="scan")
assert code.startswith("code 2 of ") and int(code.split()[-1]) != os.getpid()
assert where == Position(1.0, 2.0, 3.0), where
assert belt.scan({HOME}, an="scan")[0] != reader.scan({HOME}, an="scan")[0]
assert reader.closed() is True and abs(belt.timed().age) < 5.0
arm.go({HOME}, an="go")
try:
    reader.refuse(an="refuse")
except OutOfRange as error:
    assert "reader" in str(error) and "too far" in str(error) and error.detail == "0.3 m", error
else:
    raise AssertionError
for call in (lambda: reader.untyped(an="untyped"), lambda: reader.take(threading.Lock())):
    try:
        call()
    except InvalidData as error:
        assert "another computer" in str(error), error
    else:
        raise AssertionError
try:
    belt.hang(an="hang")
except DeviceTimeout as error:
    assert "belt" in str(error), error
""")
    end = await cell.end()
    assert (end.finished, end.error) == (True, None)
    notes = cell.notes()
    assert {"belt disconnected", "reader disconnected", "disconnected"} <= set(notes)
    assert sorted(each for each in notes if "control" in each) == ["belt control", "control", "reader control"]
    states = [each for each in cell.listener.messages if isinstance(each, m.DeviceChanged)]
    assert {each.object_id for each in states} == {"obj_arm", "obj_reader", "obj_belt"}
    assert cell.listener.reasons == []


async def test_a_lost_node_stops_the_program_and_all_other_computers(cell: Cell, oven: Node) -> None:
    await cell.run("""
import threading
threading.Thread(target=lambda: arm.slow(60.0, an="slow")).start()
threading.Thread(target=lambda: reader.move(an="move")).start()
belt.move(an="move")
""")
    await cell.until_noted("slow", "reader moves", "belt moves")
    began = time.monotonic()
    os.kill(oven.process.pid, signal.SIGSTOP)
    try:
        await cell.until_noted("stop", "reader stopped")
        assert time.monotonic() - began < PATIENCE
        await asyncio.to_thread(wait_for, lambda: cell.listener.reasons)
        (reason,) = cell.listener.reasons
        assert f"the node {OVEN}" in reason
        assert "It is not known whether belt.move was executed" in reason
        await cell.until_noted("belt stopped")
    finally:
        os.kill(oven.process.pid, signal.SIGCONT)
    moved = [each for each in cell.notes() if each.endswith("moves")]
    assert len(moved) == 2, "nothing moves after the repair"


async def test_stopping_a_program_stops_all_computers(cell: Cell) -> None:
    group = await cell.run("""
import threading
threading.Thread(target=lambda: arm.slow(60.0, an="slow")).start()
belt.move(an="move")
""")
    await cell.until_noted("slow", "belt moves")
    group.send(m.StopProgram())
    end = await cell.end()
    assert (end.finished, end.error) == (False, None)
    assert {"stop", "belt stopped"} <= set(cell.notes())


async def test_an_object_that_cannot_be_connected_ends_the_program_with_its_name(cell: Cell) -> None:
    cell.objects[2] = cell.reader("belt", OVEN, broken=True)
    (cell.folder / "off").touch()
    await cell.run('arm.slow(0.0, an="slow")')
    end = await cell.end()
    assert end.error
    assert "belt" in end.error.message.text
    assert f"switched off (node {OVEN})" in end.error.message.text
    assert "slow" not in cell.notes()


# ------------------------------------------------------------------------------------------------ scenes
async def test_calls_go_to_the_host_of_the_object_and_stops_to_all(cell: Cell) -> None:
    group = await cell.online()
    where = msgspec.json.encode({"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"w": 1, "x": 0, "y": 0, "z": 0}})
    code = await group.call("obj_belt", "scan", {"where": where}, control=True)
    assert code.startswith(b'["code 1 of ')
    moves = [asyncio.create_task(group.call(each, "move", control=True)) for each in ("obj_reader", "obj_belt")]
    await cell.until_noted("reader moves", "belt moves")
    stops = await group.stop_all()
    assert sorted(each.object_id for each in stops) == ["obj_arm", "obj_belt", "obj_reader"]
    for each in moves:
        with pytest.raises(CellError, match="stopped"):
            await each
    group.send(m.CloseScene())
    closed = await cell.listener.until(m.SceneClosed)
    assert closed.error is None
    await group.wait_or_kill()
    assert cell.listener.reasons == []
    assert {"belt disconnected", "reader disconnected", "disconnected"} <= set(cell.notes())


async def test_the_end_of_the_main_host_stops_the_other_computers(cell: Cell) -> None:
    group = await cell.online()
    moving = asyncio.create_task(group.call("obj_belt", "move", control=True))
    await cell.until_noted("belt moves")
    os.kill(group.pid, signal.SIGKILL)
    await cell.until_noted("belt stopped", "reader disconnected")
    with pytest.raises(Arcor2Error):
        await moving
    assert cell.listener.reasons == ["the cell host was killed by SIGKILL"]


async def test_an_object_of_a_node_is_connected_again_or_added_later(cell: Cell) -> None:
    """Because of the interlocks, the calls pass through the main host, which needs stubs of the objects."""
    cell.objects[2] = cell.reader("belt", OVEN, broken=True)
    (cell.folder / "off").touch()
    group = await cell.online(interlock("obj_belt", "quick", "obj_reader"), keep_going=True)
    failed = await cell.listener.until(m.DeviceChanged, lambda each: each.connection is Connection.FAILED)
    assert failed.object_id == "obj_belt"
    with pytest.raises(CellError, match="switched off"):
        await group.call("obj_belt", "quick", control=True)
    with pytest.raises(CellError, match="switched off"):
        await group.retry("obj_belt")
    (cell.folder / "off").unlink()
    await group.retry("obj_belt")
    assert await group.call("obj_belt", "quick", control=True) == b"1"

    await group.add(cell.opening(cell.reader("lamp", NODE)), NODE)
    group.send(m.SetInterlocks([interlock("obj_lamp", "quick", "obj_belt")]))
    assert await group.call("obj_lamp", "quick", control=True) == b"1"
    assert {"belt control", "lamp control"} <= set(cell.notes())


async def test_the_error_names_a_host_that_cannot_be_started_and_its_objects(cell: Cell) -> None:
    cell.objects[2] = cell.reader("belt", "saw")
    with pytest.raises(Arcor2Error, match=r"The node saw is not connected\. These objects run there: belt"):
        await cell.take()


async def test_an_object_that_fails_ends_the_start_and_is_named(cell: Cell) -> None:
    cell.objects[1] = cell.reader("reader", NODE, broken=True)
    (cell.folder / "off").touch()
    group = await cell.take()
    group.send(cell.opening(*cell.objects))
    failed = await cell.listener.until(m.SceneFailed)
    assert failed.error.object_id == "obj_reader"
    assert f"reader is switched off (node {NODE})" in failed.error.message.text
    await group.close()


# ------------------------------------------------------------------------------------------------ interlocks
def interlock(object_id: str, action: str, needed: str, observed: str = "closed", **more: Any) -> Interlock:
    need = Need(needed, observed, value="true")
    more = {"needs": [need], "otherwise": Unmet.HOLD, "id": "ilk_1"} | more
    return Interlock("door", InterlockTarget.ACTION, object_id, [action], **more)


@pytest.mark.parametrize("observed", ["closed", "timed"])
async def test_an_interlock_across_computers_prevents_an_action(cell: Cell, observed: str) -> None:
    """The belt and the reader that it needs are on two nodes. The robot's host checks the interlocks."""
    group = await cell.online(interlock("obj_belt", "move", "obj_reader", observed, during=True))
    await group.call("obj_reader", "set_closed", {"value": b"false"})
    await cell.listener.until(m.InterlocksChanged, lambda each: each.states[0].state is InterlockCondition.NOT_MET)
    with pytest.raises(CellError, match=r"Interlock door: reader: (closed|timed) is not met"):
        await group.call("obj_belt", "move", control=True)
    await group.call("obj_reader", "set_closed", {"value": b"true"})
    await cell.listener.until(m.InterlocksChanged, lambda each: each.states[0].state is InterlockCondition.MET)
    moving = asyncio.create_task(group.call("obj_belt", "move", control=True))
    await cell.until_noted("belt moves")
    await group.call("obj_reader", "set_closed", {"value": b"false"})
    with pytest.raises(CellError, match=r"was stopped\. Interlock door"):
        await moving
    assert "belt stopped" in cell.notes()


async def test_an_interlock_stops_an_action_when_the_other_computer_does_not_answer(cell: Cell) -> None:
    group = await cell.online(interlock("obj_belt", "move", "obj_reader", during=True))
    await cell.listener.until(m.InterlocksChanged, lambda each: each.states[0].state is InterlockCondition.MET)
    host = int(await group.call("obj_reader", "pid"))
    moving = asyncio.create_task(group.call("obj_belt", "move", control=True))
    await cell.until_noted("belt moves")
    os.kill(host, signal.SIGSTOP)
    try:
        with pytest.raises(CellError, match="reader: closed is not confirmed, last known 1 s ago"):
            await moving
        assert "belt stopped" in cell.notes()
        with pytest.raises(CellError, match=r"not started\. Interlock door"):
            await group.call("obj_belt", "move", control=True)
    finally:
        os.kill(host, signal.SIGCONT)


# ------------------------------------------------------------------------------------------------ calls and stops
class HostStub:
    """Stub of a host that stores the sent messages."""

    def __init__(self, node: str) -> None:
        self.node, self.sent, self.reason, self.ring = node, list[Any](), None, Ring()

    def send(self, message: m.ToHost) -> None:
        self.sent.append(message)

    async def stop_motion(self, object_id: str) -> None:
        self.sent.append(m.StopMotion(1, object_id))

    async def ask(self, *call: Any, **_: Any) -> m.CallDone:
        self.sent.append(call)
        return m.CallDone(1, b"7", 0.5)


async def test_a_call_that_crosses_a_stop_is_not_executed() -> None:
    hosts = HostStub(""), HostStub(NODE)
    listener: Any = GroupListener()
    placement = place(None, [SceneObject("arm", "Arm", id="arm"), *objects_on(reader=NODE)], derives)
    group = HostGroup(listener, placement, hosts, lambda _: None)  # type: ignore[arg-type]
    main, other = hosts
    await group.stop_motion("reader")
    assert (main.sent, other.sent) == ([m.StopMotion(0, "reader")], [m.StopMotion(1, "reader")])
    for number, stops in enumerate((0, 1)):
        group.host_message(main, m.RemoteCall(number, "reader", "scan", stops=stops))  # type: ignore[arg-type]
    await asyncio.sleep(0.0)
    await asyncio.sleep(0.0)
    _, refused, done = main.sent
    assert (refused.id, refused.error.code) == (0, "cancelled")
    assert done == m.RemoteDone(1, b"7", 0.5)
    assert [each[:2] for each in other.sent if isinstance(each, tuple)] == [("reader", "scan")]

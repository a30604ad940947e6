"""Starting a scene with unreachable devices, connecting them later; streams at each client's rate."""

import itertools
import json
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.geometry import Position
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.project import Action, ActionPoint, Flow, Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc import (
    general as _general,  # noqa: F401 - for its handlers
    operation as _operation,  # noqa: F401 - for its handlers
)
from tests.runtime.conftest import scene_object
from tests.server.core.serving import until

from .conftest import Recorder, Server, action, robot_meta, serving

BOX = """
from arcor2_hw.data.device import Alarm, Health, Severity

@dataclass
class BoxSettings(Settings):
    file: str

class Box(Generic):
    _ABSTRACT = False
    def __init__(self, obj_id: str, name: str, settings: BoxSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.hot = False
    def connect(self, timeout: float = 2.0) -> None:
        if not os.path.exists(self.settings.file):
            raise NotConnected("nobody at 192.0.2.7:502")
    @property
    def health(self): return Health.OFF_SPEC if self.hot else Health.NORMAL
    def alarms(self):
        stamp = "2026-01-01T00:00:00+00:00"
        return [Alarm("hot", Severity.WARNING, "it is hot", "let it cool", stamp)] if self.hot else []
    @property
    def shown_values(self): return {"lid": float(self.hot)}
    def heat(self) -> None: self.hot = True
    @action
    def open(self, *, an: str | None = None) -> bool: return True
"""


class Boxes:
    """A scene of two boxes, only one of which is connected."""

    def __init__(self, server: Server) -> None:
        self.server = server
        directory = server.services.settings.data_dir
        self.present, self.absent = directory / "present", directory / "absent"

    async def open(self) -> None:
        self.present.touch()
        objects = [scene_object(name, "Box", file=str(file)) for name, file in self._files()]
        actions = [Action(f"open_{name}", f"obj_{name}/open", f"act_{name}", [], [Flow()]) for name, _ in self._files()]
        point = ActionPoint("top", Position(), id="acp_1", actions=actions)
        self.server.types.add("Box", BOX, [action("open", "boolean")])
        await self.server.open(
            Scene("scene", id="scn_1", objects=objects), Project("project", "scn_1", id="pro_1", action_points=[point])
        )

    def _files(self) -> list[tuple[str, Path]]:
        return [("present", self.present), ("absent", self.absent)]


def subscribed(server: Server, *events: str) -> Recorder:
    server.services.hub.subscribe(server.client, set(events), True)  # type: ignore[arg-type]
    return server.client


CLOCK = """
class Clock(Generic):
    _ABSTRACT = False
    @action
    def read(self, *, an: str | None = None) -> bool: return True
"""


def _file(path: Path) -> list[dict[str, str]]:
    return [{"name": "file", "type": "string", "value": json.dumps(str(path))}]


@serving()
async def test_objects_are_added_to_the_online_scene(server: Server) -> None:
    boxes, client = Boxes(server), subscribed(server, "ObjectState")
    server.types.settings["Box"] = [ParameterMeta("file", "string")]
    server.types.add("Clock", CLOCK, [action("read", "boolean")])
    await boxes.open()
    boxes.absent.touch()
    await server.start()

    await server.ask("AddSceneObject", {"name": "clock", "type": "Clock"})
    added = (await client.event("SceneObjectChanged"))["id"]
    states = [await client.event("ObjectState", lambda data: data["object_id"] == added) for _ in range(2)]
    assert [state["state"] for state in states] == ["connecting", "online"]
    assert await server.services.online.call(added, "read", deadline=5.0) == b"true"

    missing = boxes.absent.with_name("missing")
    await server.ask("AddSceneObject", {"name": "late", "type": "Box", "parameters": _file(missing)})
    failed = await client.event("ObjectState", lambda data: data["state"] == "failed")
    assert "192.0.2.7:502" in failed["reason"]
    missing.touch()
    await server.ask("RetryObject", {"object_id": failed["object_id"]})
    assert await server.services.online.call(failed["object_id"], "open", deadline=5.0) == b"true"
    # The types of the devices that were already online can still be loaded.
    assert [state.state for state in server.services.online.board.states()] == ["online"] * 4


@serving()
async def test_a_connection_is_checked_without_a_scene_object(server: Server) -> None:
    boxes = Boxes(server)
    server.types.settings["Box"] = [ParameterMeta("file", "string")]
    await boxes.open()
    check = {"type": "Box", "parameters": _file(boxes.absent)}
    with pytest.raises(Arcor2Error, match=r"192\.0\.2\.7:502"):
        await server.ask("CheckConnection", check)
    boxes.absent.touch()
    answer = await server.ask("CheckConnection", check)
    assert answer.health == "normal"
    assert len(server.services.session.require_scene().objects) == 2
    await server.start()
    with pytest.raises(RequestRefused, match="connected already"):
        await server.ask("CheckConnection", check | {"id": "obj_absent"})
    assert (await server.ask("CheckConnection", check)).alarms == [], "another device can be checked meanwhile"


@serving()
async def test_a_scene_starts_without_a_device_and_a_retry_connects_it(server: Server) -> None:
    boxes, client = Boxes(server), subscribed(server, "ObjectState")
    await boxes.open()
    with pytest.raises(RequestRefused, match="offline"):
        await server.ask("RetryObject", {"object_id": "obj_absent"})
    await server.ask("StartSceneKeepGoing")
    failed = await client.event("ObjectState", lambda data: data["state"] == "failed")
    assert failed["object_id"] == "obj_absent"
    assert "192.0.2.7:502" in failed["reason"]
    assert (await client.state("started"))["message"] == "Not connected: absent."
    with pytest.raises(RequestRefused, match="online"):
        await server.ask("StartSceneKeepGoing")

    with pytest.raises(RequestRefused, match=r"absent is not connected: .*192\.0\.2\.7:502"):
        await server.ask("ExecuteAction", {"action_id": "act_absent"})
    await server.ask("ExecuteAction", {"action_id": "act_present"})
    assert (await client.event("ActionResult"))["results"] == ["true"]
    await until(lambda: [one.state for one in server.services.online.board.states()] == ["online", "failed"])

    with pytest.raises(Arcor2Error, match=r"192\.0\.2\.7:502"):
        await server.ask("RetryObject", {"object_id": "obj_absent"})
    boxes.absent.touch()
    client.got.clear()
    await server.ask("RetryObject", {"object_id": "obj_absent"})
    states = [await client.event("ObjectState") for _ in range(2)]
    assert [state["state"] for state in states] == ["connecting", "online"]
    await server.ask("ExecuteAction", {"action_id": "act_absent"})
    assert (await client.event("ActionResult"))["results"] == ["true"]
    with pytest.raises(Arcor2Error, match="absent has not failed"):
        await server.ask("RetryObject", {"object_id": "obj_absent"})
    with pytest.raises(Arcor2Error, match="obj_nobody"):
        await server.ask("RetryObject", {"object_id": "obj_nobody"})
    await server.ask("StopScene")
    assert "message" not in await client.state("stopped")


@serving()
async def test_other_errors_still_prevent_the_start_of_a_scene(server: Server) -> None:
    boxes = Boxes(server)
    with pytest.raises(RequestRefused, match="No scene is open"):
        await server.ask("StartSceneKeepGoing")
    await boxes.open()
    boxes.absent.touch()
    await server.ask("StartSceneKeepGoing")
    assert "message" not in await server.client.state("started")  # every device is connected
    await server.ask("StopScene")
    await server.client.state("stopped")
    boxes.absent.unlink()
    await server.ask("StartScene")
    assert "192.0.2.7:502" in (await server.client.state("stopping"))["message"]
    await server.client.state("stopped")


@serving()
async def test_health_and_alarms_are_published(server: Server) -> None:
    boxes, client = Boxes(server), subscribed(server, "ObjectHealth")
    await boxes.open()
    boxes.absent.touch()
    await server.start()
    await server.services.online.call("obj_present", "heat")
    hot = await client.event("ObjectHealth", lambda data: data["health"] == "off_spec" and data["alarms"])
    assert hot["object_id"] == "obj_present"
    assert [alarm["remedy"] for alarm in hot["alarms"]] == ["let it cool"]
    assert [one.health for one in server.services.online.board.healths()] == ["off_spec", "normal"]


@serving()
async def test_shown_values_are_published(server: Server) -> None:
    boxes, client = Boxes(server), subscribed(server, "ObjectValues")
    await boxes.open()
    boxes.absent.touch()
    await server.start()
    await server.services.online.call("obj_present", "heat")
    opened = await client.event("ObjectValues", lambda data: data["values"] == {"lid": 1.0})
    assert opened == {"object_id": "obj_present", "values": {"lid": 1.0}, "parts": []}
    assert [one.values for one in server.services.online.board.values()] == [{"lid": 1.0}, {"lid": 0.0}]


ARM = """
class Arm(Robot):
    _ABSTRACT = False
    def get_end_effectors_ids(self): return {"tool"}
    def get_end_effector_pose(self, end_effector): return Pose()
    def robot_joints(self, include_gripper=False): return [Joint("turn", time.monotonic())]
    def grippers(self): return set()
    def suctions(self): return set()
"""


class Slow(Recorder):
    """A client that does not read; only the newest message of each stream is queued for it."""

    def __init__(self, user: str) -> None:
        super().__init__(user)
        self.newest: dict[str, dict[str, Any]] = {}

    def put_newest(self, stream: str, message: bytes) -> None:
        self.newest[stream] = json.loads(message)


async def with_arm(server: Server) -> None:
    server.types.add("Arm", ARM, robot=robot_meta("Arm"))
    await server.open(Scene("scene", id="scn_1", objects=[scene_object("arm", "Arm", pose=True)]))
    await server.start()


def joints(client: Recorder) -> list[dict[str, Any]]:
    return [event["data"] for event in client.got if event["event"] == "RobotJoints"]


@serving(with_arm)
async def test_each_client_chooses_its_streaming_rate(server: Server) -> None:
    quick, other, slow = server.client, Recorder("bob"), Slow("carl")
    for client in (other, slow):
        server.services.hub.add(client)  # type: ignore[arg-type]
    stream = {"robot_id": "obj_arm", "what": "joints"}
    for client in (quick, other, slow):
        await server.ask("RegisterForRobotEvent", stream | {"send": True}, client)
    await server.ask("StreamRobot", stream | {"rate": 30}, quick)
    await server.ask("StreamRobot", stream | {"rate": 30}, slow)
    await until(lambda: any("time_ms" in data for data in joints(quick)))
    quick.got.clear()
    await until(lambda: len(joints(quick)) >= 20 and joints(other) and slow.newest)
    seen = joints(quick)
    assert all("time_ms" in data for data in seen), "the client also gets the ordinary events"
    steps = [after["time_ms"] - before["time_ms"] for before, after in itertools.pairwise(seen)]
    assert all(step > 0.0 for step in steps)
    assert sum(steps) >= (len(steps) - 2) * 33.3, "faster than requested"
    assert min(steps) <= 60.0, "as slow as the ordinary events"
    assert all("time_ms" not in data for data in joints(other))
    (newest,) = slow.newest.values()
    assert newest["data"]["time_ms"] >= seen[-5]["time_ms"], "the client that reads slowly gets an old event"

    await server.ask("StreamRobot", stream | {"send": False}, quick)
    await until(lambda: "time_ms" not in (joints(quick) or [{"time_ms": 0.0}])[-1])
    quick.got.clear()
    await until(lambda: len(joints(quick)) >= 3)
    assert all("time_ms" not in data for data in joints(quick))
    with pytest.raises(RequestRefused, match="not subscribed"):
        await server.ask("StreamRobot", stream | {"send": False}, quick)


@serving(with_arm)
async def test_invalid_streams_are_refused(server: Server) -> None:
    stream = {"robot_id": "obj_arm", "what": "eef_pose"}
    for rate in (0.5, 31.0):
        with pytest.raises(RequestRefused, match="1 to 30 Hz"):
            await server.ask("StreamRobot", stream | {"rate": rate})
    with pytest.raises(Arcor2Error, match="obj_nobody"):
        await server.ask("StreamRobot", stream | {"robot_id": "obj_nobody"})
    await server.ask("StreamRobot", stream)
    await server.client.event("RobotEef", lambda data: "time_ms" in data)
    await server.ask("StopScene")
    await server.client.state("stopped")
    with pytest.raises(RequestRefused, match="offline"):
        await server.ask("StreamRobot", stream)

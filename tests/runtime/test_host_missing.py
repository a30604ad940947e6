"""Scenes that open without failed objects, retries of objects, and streams at different rates."""

import time
from pathlib import Path
from typing import Any

import msgspec

from arcor2_hw.data.device import Connection
from arcor2_hw.runtime import messages as m
from tests.waiting import wait_for

from .conftest import HostProcess, open_scene, scene_object, type_code

BOX = """
@dataclass
class BoxSettings(Settings):
    file: str
    size: int = 1

class Box(Generic):
    _ABSTRACT = False
    def __init__(self, obj_id: str, name: str, settings: BoxSettings) -> None:
        super().__init__(obj_id, name, settings)
        with open(self.settings.file + ".log", "a") as log:
            log.write("made ")
    def connect(self, timeout: float = 2.0) -> None:
        if not os.path.exists(self.settings.file):
            raise NotConnected("nobody at 192.0.2.7:502")
    def disconnect(self) -> None:
        with open(self.settings.file + ".log", "a") as log:
            log.write("closed ")
    def size(self) -> int:
        return self.settings.size
"""
BROKEN = "import no_such_vendor_library\n\nclass Broken(Generic):\n    _ABSTRACT = False\n"
TYPES = [type_code("Box", BOX), type_code("Broken", BROKEN)]


def retry(host: HostProcess, object_id: str, number: int = 500) -> Any:
    host.send(m.RetryObject(number, object_id))
    return host.answer(number)


def changes(host: HostProcess, object_id: str) -> list[tuple[Connection, str]]:
    return [
        (s.connection, str(s.reason or ""))
        for s in host.seen
        if isinstance(s, m.DeviceChanged) and s.object_id == object_id
    ]


def test_a_scene_opens_without_failed_objects(host: HostProcess, tmp_path: Path) -> None:
    here, away = tmp_path / "here", tmp_path / "away"
    here.touch()
    host.send(
        open_scene(
            TYPES,
            scene_object("good", "Box", file=str(here)),
            scene_object("away", "Box", file=str(away)),
            scene_object("wrong", "Box", file=str(here), size="large"),
            scene_object("broken", "Broken"),
            keep_going=True,
        )
    )
    host.expect(m.SceneOpened)
    assert host.call("obj_good", "size") == 1
    for name, reason in (("away", "192.0.2.7:502"), ("wrong", "size"), ("broken", "no_such_vendor_library")):
        error = host.call(f"obj_{name}", "size")
        assert isinstance(error, m.ErrorData)
        assert error.code == "not_connected"
        assert name in error.message.text
        assert reason in error.message.text
        ((connection, text),) = changes(host, f"obj_{name}")
        assert connection is Connection.FAILED
        assert reason in text
    # A failed object is closed in its own thread.
    wait_for(lambda: Path(f"{away}.log").read_text().split(), lambda calls: calls == ["made", "closed"])


def test_a_failed_object_connects_on_retry(host: HostProcess, tmp_path: Path) -> None:
    file = tmp_path / "switch"
    host.send(open_scene(TYPES, scene_object("box", "Box", file=str(file)), keep_going=True))
    host.expect(m.SceneOpened)
    error = retry(host, "obj_box", 501)
    assert isinstance(error, m.ErrorData)
    assert "192.0.2.7:502" in error.message.text
    file.touch()
    assert retry(host, "obj_box", 502) is None
    assert host.call("obj_box", "size") == 1
    assert [connection for connection, _ in changes(host, "obj_box")] == [
        Connection.FAILED,
        Connection.CONNECTING,
        Connection.FAILED,
        Connection.CONNECTING,
        Connection.ONLINE,
    ]
    error = retry(host, "obj_box", 503)
    assert isinstance(error, m.ErrorData)
    assert "has not failed" in error.message.text
    host.send(m.CloseScene())
    assert host.expect(m.SceneClosed).error is None
    assert Path(f"{file}.log").read_text().split() == ["made", "closed"] * 2 + ["made", "closed"]


def test_a_retry_loads_a_type_that_could_not_be_loaded(host: HostProcess, tmp_path: Path) -> None:
    library = tmp_path / "lib"
    library.mkdir()
    source = f"sys.path.insert(0, {str(library)!r})\nimport late_vendor_library\n" + BROKEN.partition("\n\n")[2]
    host.send(open_scene([type_code("Broken", source)], scene_object("broken", "Broken"), keep_going=True))
    host.expect(m.SceneOpened)
    assert "late_vendor_library" in retry(host, "obj_broken", 501).message.text
    (library / "late_vendor_library.py").write_text("")
    assert retry(host, "obj_broken", 502) is None


def test_a_failed_object_fails_the_scene_without_keep_going(host: HostProcess, tmp_path: Path) -> None:
    host.send(open_scene(TYPES, scene_object("box", "Box", file=str(tmp_path / "away"))))
    assert "192.0.2.7:502" in host.expect(m.SceneFailed).error.message.text
    assert host.gone() == 0


ARM = """
class Arm(Robot):
    _ABSTRACT = False
    def get_end_effectors_ids(self): return {"tool"}
    def get_end_effector_pose(self, end_effector): return Pose(Position(time.monotonic()))
    def robot_joints(self, include_gripper=False): return [Joint("turn", time.monotonic())]
    def grippers(self): return set()
    def suctions(self): return set()
"""


def streamed(host: HostProcess, event: str, rate: float) -> list[dict[str, Any]]:
    found = [s for s in host.seen if isinstance(s, m.StreamEvent) and (s.event, s.rate) == (event, rate)]
    return [msgspec.json.decode(one.encoded)["data"] for one in found]


def test_streams_have_the_requested_rates(host: HostProcess) -> None:
    host.send(open_scene([type_code("Arm", ARM)], scene_object("arm", "Arm", pose=True)))
    host.expect(m.SceneOpened)
    host.send(m.Subscribe("obj_arm", True, False))
    start = time.monotonic()
    host.send(m.Stream("obj_arm", [30.0, 5.0], [20.0]))

    def all_streams() -> list[list[dict[str, Any]]]:
        host.call("obj_arm", "grippers")  # processes all earlier messages of the host
        return [
            streamed(host, event, rate)
            for event, rate in (("RobotJoints", 30.0), ("RobotEef", 20.0), ("RobotJoints", 5.0))
        ]

    wait_for(all_streams, lambda streams: len(streams[0]) > len(streams[1]) > len(streams[2]) >= 5)
    host.send(m.Stream("obj_arm", [5.0], []))
    fast, eef, slow = all_streams()
    seconds = time.monotonic() - start
    for events, rate in ((fast, 30.0), (eef, 20.0), (slow, 5.0)):
        assert len(events) <= rate * seconds + 2
    # The time is that of the sample, on the clock of this machine.
    assert all(abs(one["joints"][0]["value"] * 1e3 - one["time_ms"]) < 5000.0 for one in fast)
    assert all("time_ms" not in one for one in streamed(host, "RobotJoints", 0.0))
    host.seen.clear()
    fast, eef, _ = wait_for(all_streams, lambda streams: len(streams[2]) >= 4)
    assert fast[1:] == []  # one value may have been sent before
    assert eef[1:] == []

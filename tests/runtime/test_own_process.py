"""Object types whose instances run in a separate process."""

import contextlib
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from arcor2_hw.data.device import Connection
from arcor2_hw.data.project import Project
from arcor2_hw.runtime import messages as m

from .conftest import HostProcess, Package, open_scene, scene_object, type_code

DEVICE = """
import enum
import numpy as np
from PIL import Image
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.objects.frame import Frame, PictureNote
from arcor2_hw.data.camera import CameraParameters

class Colour(enum.Enum):
    RED = "red"

@dataclass
class Part:
    colour: Colour
    weights: tuple[float, ...]

class Jam(DeviceFault):
    '''An error class of an object type.'''

    code = "jam"

    def __init__(self, place: str, *, depth: float) -> None:
        super().__init__(f"jammed at {place}", f"{depth} mm", 17)
        self.depth = depth

@dataclass
class WorkerSettings(Settings):
    file: str = ""
    fail: str = ""
    other: str = ""

class Plain(GenericWithPose):
    '''Runs in the cell host.'''

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: WorkerSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self.stopped = threading.Event()

    def note(self, text: str) -> None:
        with open(self.settings.file, "a") as f:
            f.write(self.name + " " + text + "\\n")

    def connect(self, timeout: float = 5.0) -> None:
        if self.settings.fail == "refused":
            raise NotConnected("no route to 192.0.2.1:30004")
        if self.settings.fail == "dies":
            os._exit(7)
        self.note("connected")

    def disconnect(self) -> None:
        if self.settings.fail == "hangs":
            time.sleep(600)
        self.note("disconnected")

    def pid(self) -> int:
        return os.getpid()

    def move(self) -> str:
        self.note("moving")
        self.stopped.wait(30)
        return "arrived"

    def stop(self) -> None:
        self.note("stop")
        self.stopped.set()

    @action
    def count(self, until: int, an: str | None = None) -> int:
        self.note(f"count {until}")
        return until

class Worker(Plain):
    '''Runs in a separate process.'''

    own_process = True
    CANCEL_MAPPING = {"spin": "stop"}

    def attach(self, find) -> None:
        self._find = find

    def keep_interpreter(self, fifo: str) -> str:
        '''Keep the interpreter in a C call until something is written to a pipe.'''
        read_end = os.open(fifo, os.O_RDWR)
        self.note("keeping")
        ctypes.PyDLL(None).read(read_end, ctypes.create_string_buffer(1), 1)
        return "released"

    def spin(self, file: str) -> int:
        '''Compute in Python until a file exists.'''
        self.note("spinning")
        turns = 0
        while not os.path.exists(file) and not self.stopped.is_set():
            turns += sum(range(1000))
        return turns

    def values(self, part: str) -> object:
        note = PictureNote(CameraParameters(1, 1, 1, 1, [0.0] * 4), Pose(), "2026-01-01T00:00:00+00:00", "cam")
        frame = Frame(np.full((4, 6, 3), 7, np.uint8), None, note, 1.5)
        return {"part": Part(Colour.RED, (1.0, 2.0)), "frame": frame, "pose": self.pose, "me": self}

    def fail(self, kind: str) -> None:
        if kind == "jam":
            raise Jam("the gate", depth=2.5)
        if kind == "kinematics":
            raise Robot.KinematicsException("no joints for the pose", "q1")
        if kind == "odd":
            raise UnicodeDecodeError("utf-8", b"x", 0, 1, "odd")
        if kind == "value":
            return (number for number in range(3))
        raise Refused("in this state", "S3")

    def other(self) -> tuple[str, int, int, bool]:
        found = self._find(self.settings.other)
        return found.name, found.pid(), os.getpid(), isinstance(found, Plain)

    def let_other_keep(self, fifo: str) -> str:
        return self._find(self.settings.other).keep_interpreter(fifo)

    def crash(self) -> None:
        os._exit(3)

    @property
    def speed(self) -> float:
        return 1.25
"""


@pytest.fixture
def notes(tmp_path: Path) -> Path:
    return tmp_path / "notes"


def _open(host: HostProcess, notes: Path, *names: str, **settings: object) -> None:
    """Open a scene. Objects whose names start with w run in a separate process."""
    objects = [
        scene_object(name, "Worker" if name.startswith("w") else "Plain", pose=True, file=str(notes), **settings)
        for name in names
    ]
    plain = type_code("Plain", DEVICE)
    types = [plain, m.TypeCode("Worker", module=plain.module, source=plain.source)]
    host.send(open_scene(types, *objects))
    host.expect(m.SceneOpened)


def _wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def _ended(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE  # where nobody reaps orphans
    except psutil.NoSuchProcess:
        return True


def _wait_for_note(notes: Path, text: str) -> None:
    _wait(lambda: notes.exists() and text in notes.read_text())


@contextlib.contextmanager
def _kept_interpreter(
    host: HostProcess, notes: Path, directory: Path, caller: str = "obj_w1", method: str = "keep_interpreter"
) -> Iterator[int]:
    """Make w1 block its interpreter in a C call. Return the number of the call."""
    fifo = directory / "fifo"
    os.mkfifo(fifo)
    call = host.begin(caller, method, fifo=str(fifo))
    _wait_for_note(notes, "w1 keeping")
    try:
        yield call
    finally:
        with fifo.open("wb") as pipe:
            pipe.write(b"x")


def test_an_instance_runs_in_its_own_process(host: HostProcess, notes: Path) -> None:
    _open(host, notes, "w1", "w2", "p")
    pids = [host.call(f"obj_{name}", "pid") for name in ("w1", "w2", "p")]
    assert len(set(pids)) == 3
    assert pids[2] == host.process.pid
    assert host.call("obj_w1", "speed") == 1.25
    host.send(m.CloseScene())
    assert host.expect(m.SceneClosed).error is None
    assert host.gone() == 0
    _wait(lambda: all(_ended(pid) for pid in pids if pid != host.process.pid))
    assert sorted(notes.read_text().splitlines()[-3:]) == ["p disconnected", "w1 disconnected", "w2 disconnected"]


def test_a_type_that_blocks_the_interpreter_does_not_delay_other_devices(
    host: HostProcess, notes: Path, tmp_path: Path
) -> None:
    _open(host, notes, "w1", "w2", "p")
    moves = [host.begin(f"obj_{name}", "move") for name in ("w2", "p")]
    _wait_for_note(notes, "w2 moving")
    _wait_for_note(notes, "p moving")
    with _kept_interpreter(host, notes, tmp_path) as kept:
        # Each call is answered although w1 cannot run any code, because its C call ends only after this block.
        host.send(m.StopMotion(98, "obj_w2"))
        host.send(m.StopMotion(99, "obj_p"))
        assert [host.answer(number) for number in (98, 99)] == [None, None]
        assert [host.answer(number).code for number in moves] == ["cancelled", "cancelled"]
        assert host.call("obj_p", "pid") == host.process.pid
        assert not any(isinstance(s, m.CallDone | m.CallFailed) and s.id == kept for s in host.seen)
    assert host.answer(kept) == "released"


def test_a_stop_interrupts_an_action_that_computes(host: HostProcess, notes: Path, tmp_path: Path) -> None:
    _open(host, notes, "w1")
    spin = host.begin("obj_w1", "spin", file=str(tmp_path / "never"))
    queued = host.begin("obj_w1", "pid")
    _wait_for_note(notes, "spinning")
    host.send(m.StopMotion(99, "obj_w1"))
    assert host.answer(queued).code == "cancelled"
    assert host.answer(99) is None
    assert host.answer(spin).code == "cancelled"
    assert isinstance(host.call("obj_w1", "pid"), int)


def test_a_stop_cancels_a_call_that_has_not_started(host: HostProcess, notes: Path, tmp_path: Path) -> None:
    # The call has left the lane of the cell host, but the process cannot start it while its interpreter is blocked.
    _open(host, notes, "w1", "w2", "p", other="w1")
    with _kept_interpreter(host, notes, tmp_path, "obj_w2", "let_other_keep"):
        move = host.begin("obj_w1", "move")
        assert host.call("obj_p", "pid") == host.process.pid
        host.send(m.StopMotion(99, "obj_w1"))
        assert host.call("obj_p", "pid") == host.process.pid
    assert host.answer(99) is None
    assert host.answer(move).code == "cancelled"
    acts = [line for line in notes.read_text().splitlines() if line in ("w1 moving", "w1 stop")]
    assert acts[-1] == "w1 stop"  # the call did not start, or the stop came after it


@pytest.mark.parametrize(
    ("kind", "code", "text", "detail"),
    [
        ("jam", "jam", "jammed at the gate", "2.5 mm"),
        ("kinematics", "kinematics", "no joints for the pose", "q1"),
        ("refused", "refused", "in this state", "S3"),
        ("odd", "device", "UnicodeDecodeError", ""),
        ("value", "invalid_data", "generator", ""),
    ],
)
def test_errors_keep_their_class(host: HostProcess, notes: Path, kind: str, code: str, text: str, detail: str) -> None:
    _open(host, notes, "w1")
    error = host.call("obj_w1", "fail", kind=kind)
    assert (error.code, error.detail, error.object_id) == (code, detail, "obj_w1")
    assert text in error.message.text
    assert "w1" in error.message.text


def test_object_references_work_across_processes(host: HostProcess, notes: Path) -> None:
    _open(host, notes, "w1", "w2", "p", other="p")
    name, other, own, is_plain = host.call("obj_w1", "other")
    assert (name, other, is_plain) == ("p", host.process.pid, True)
    assert own == host.call("obj_w1", "pid")


def test_a_process_that_is_killed_is_reported_and_can_be_retried(host: HostProcess, notes: Path) -> None:
    _open(host, notes, "w1", "w2", "p")
    move = host.begin("obj_w1", "move")
    _wait_for_note(notes, "w1 moving")
    child = next(one for one in psutil.Process(host.process.pid).children() if one.pid != host.call("obj_w2", "pid"))
    child.kill()
    lost = host.answer(move)
    assert lost.code == "connection_lost"
    assert "w1: the process of the device was killed by SIGKILL" in lost.message.text
    known = [s for s in host.seen if isinstance(s, m.DeviceChanged) and s.connection is Connection.FAILED]
    changed = known or [host.expect(m.DeviceChanged, lambda c: c.connection is Connection.FAILED)]
    assert changed[0].object_id == "obj_w1"
    assert changed[0].reason is not None
    assert changed[0].reason.key == "{name}: the process of the device was killed by {signal}"
    refused = host.call("obj_w1", "pid")
    assert refused.code == "not_connected"
    assert host.call("obj_p", "pid") == host.process.pid
    assert isinstance(host.call("obj_w2", "pid"), int)
    host.send(m.RetryObject(70, "obj_w1"))
    assert host.answer(70) is None
    assert isinstance(host.call("obj_w1", "pid"), int)
    psutil.Process(host.call("obj_w1", "pid")).kill()
    host.expect(m.DeviceChanged, lambda c: c.connection is Connection.FAILED)
    host.send(m.CloseScene())
    assert host.expect(m.SceneClosed).error is None
    assert host.gone() == 0


@pytest.mark.parametrize(("fail", "text"), [("refused", "192.0.2.1:30004"), ("dies", "ended with status 7")])
def test_a_device_that_does_not_connect_fails_the_scene(host: HostProcess, notes: Path, fail: str, text: str) -> None:
    objects = [scene_object("w1", "Worker", pose=True, file=str(notes), fail=fail)]
    host.send(open_scene([m.TypeCode("Worker", module="plain", source=type_code("Plain", DEVICE).source)], *objects))
    error = host.expect(m.SceneFailed).error
    assert error.object_id == "obj_w1"
    assert text in error.message.text
    assert host.gone() == 0


@pytest.mark.parametrize("hangs", [False, True])
def test_the_process_ends_with_the_cell_host(host: HostProcess, notes: Path, hangs: bool) -> None:
    _open(host, notes, "w1", fail="hangs" if hangs else "")
    pid = host.call("obj_w1", "pid")
    host.begin("obj_w1", "move")
    _wait_for_note(notes, "w1 moving")
    os.kill(host.process.pid, signal.SIGKILL)
    _wait(lambda: _ended(pid))  # also if disconnecting never returns
    assert "w1 stop" in notes.read_text()
    assert ("w1 disconnected" in notes.read_text()) is not hangs


def test_the_end_of_the_server_stops_and_disconnects_the_device(host: HostProcess, notes: Path) -> None:
    _open(host, notes, "w1")
    pid = host.call("obj_w1", "pid")
    host.begin("obj_w1", "move")
    _wait_for_note(notes, "w1 moving")
    host.socket.close()
    assert host.gone() == 0
    _wait(lambda: _ended(pid))
    assert notes.read_text().splitlines()[-2:] == ["w1 stop", "w1 disconnected"]


def test_a_program_uses_a_device_in_its_own_process(host: HostProcess, package: Package, notes: Path) -> None:
    body = """
    w, p = res.objects["obj_w"], res.objects["obj_p"]
    assert isinstance(w, GenericWithPose) and w.pid() not in (os.getpid(), p.pid())
    assert w.count(3, an="count") == 3
    found = w.values("x")
    assert found["part"].colour.name == "RED" and found["part"].weights == (1.0, 2.0)
    assert found["frame"].color.shape == (4, 6, 3) and found["frame"].color[3, 5, 2] == 7
    assert found["frame"].note.camera == "cam"
    assert found["pose"] == Pose() == w.pose and found["me"].pid() == w.pid()
    moved = Pose(Position(1, 2, 3))
    w.set_pose(moved)
    assert w.pose == moved and w.values("x")["pose"] == moved
    assert w.speed == 1.25
    try:
        w.fail("jam")
    except DeviceFault as error:
        assert type(error).__name__ == "Jam" and error.code == "jam" and error.fault_code == 17 and error.depth == 2.5
        assert "In the process of the device" in error.__notes__[0]
    else:
        raise AssertionError
    assert w.other()[:2] == ("p", p.pid())
    """
    objects = [
        scene_object("w", "Worker", pose=True, file=str(notes), other="p"),
        scene_object("p", "Plain", pose=True, file=str(notes)),
    ]
    types = {"Plain": DEVICE, "Worker": "from object_types.plain import Worker as Worker"}
    directory = package.write(types, objects, Project("p", "scn_1", id="pro_1"), body)
    script = directory / "script.py"
    imports = "from arcor2_hw.data.geometry import *; from arcor2_hw.objects import GenericWithPose\n"
    script.write_text(imports + script.read_text())
    host.send(m.RunPackage("pkg_1", str(directory)))
    ended = host.expect_state("stopped")
    assert ended.error is None, ended
    assert ended.finished
    assert sorted(notes.read_text().splitlines()) == [
        "p connected", "p disconnected", "w connected", "w count 3", "w disconnected",
    ]  # fmt: skip


def test_a_program_ends_when_the_process_of_a_device_ends(host: HostProcess, package: Package, notes: Path) -> None:
    types = {"Plain": DEVICE, "Worker": "from object_types.plain import Worker as Worker"}
    objects = [
        scene_object("w", "Worker", pose=True, file=str(notes)),
        scene_object("p", "Plain", pose=True, file=str(notes)),
    ]
    body = """
    threading.Thread(target=res.objects["obj_p"].move).start()
    os.kill(res.objects["obj_w"].pid(), 9)
    time.sleep(60)
    """
    directory = package.write(types, objects, Project("p", "scn_1", id="pro_1"), body)
    host.send(m.RunPackage("pkg_1", str(directory)))
    ended = host.expect_state("stopped")
    assert not ended.finished
    assert ended.error is not None
    assert ended.error.code == "connection_lost"
    assert "w" in ended.error.message.text
    assert "p stop" in notes.read_text()

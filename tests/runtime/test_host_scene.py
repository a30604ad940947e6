"""The cell host with an online scene: creation, calls, deadlines, stops, and the end of the server."""

import os
import signal
import time
from pathlib import Path

import msgspec
import pytest

from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import SceneObjectOverride
from arcor2_hw.data.secret import ObjectSecrets, new_reference
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from tests.waiting import wait_for

from .conftest import HostProcess, open_scene, scene_object, type_code

DEVICE = """
@dataclass
class DeviceSettings(Settings):
    file: str = ""
    connect_takes: float = 0.0
    fail: str = ""

class Device(Generic):
    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: DeviceSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.stopped = threading.Event()

    def note(self, text):
        if self.settings.file:
            with open(self.settings.file, "a") as f:
                f.write(self.name + " " + text + "\\n")

    def connect(self, timeout: float = 5.0) -> None:
        if self.settings.fail == "refused":
            raise NotConnected("no route to 192.0.2.1:30004")
        if self.settings.fail == "odd":
            raise ZeroDivisionError("odd")
        time.sleep(self.settings.connect_takes)
        self.note("connected")

    def disconnect(self) -> None:
        self.note("disconnected")

    def echo(self, value: float, pose: Pose, joints: list[Joint], an: str | None = None) -> tuple[float, Pose]:
        assert isinstance(pose, Pose) and all(isinstance(j, Joint) for j in joints)
        return value, pose

    def hang(self, seconds: float) -> str:
        time.sleep(seconds)
        return "late"

    def hang_while(self, file: str) -> str:
        while os.path.exists(file):
            time.sleep(0.01)
        return "late"

    def quick(self) -> str:
        return "quick"

    def move(self) -> str:
        self.note("move")
        self.stopped.wait(60)
        return "arrived"

    def stop(self) -> None:
        self.note("stop")
        self.stopped.set()

    def crash(self) -> None:
        os._exit(7)

    def shout(self, size: int) -> int:
        print("x" * size)
        sys.stderr.write("y" * size)
        return size

    def leave(self) -> None:
        raise SystemExit(3)

    def freeze(self) -> None:
        ctypes.PyDLL(None).usleep(1_600_000)
"""


def _open(host: HostProcess, *names: str, **settings: object) -> None:
    objects = [scene_object(name, "Device", **settings) for name in names]
    host.send(open_scene([type_code("Device", DEVICE)], *objects))
    host.expect(m.SceneOpened)


def _wait_for_note(notes: Path, text: str) -> None:
    """Wait until a device has written a note."""
    wait_for(lambda: text in notes.read_text())


def test_arguments_are_decoded_by_type_hints_and_results_returned(host: HostProcess) -> None:
    _open(host, "a")
    pose = {"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    assert host.call("obj_a", "echo", value=2, pose=pose, joints=[{"name": "j", "value": 1}]) == [2.0, pose]
    wrong = host.call("obj_a", "echo", value="text", pose=pose, joints=[])
    assert (wrong.code, wrong.object_id) == ("invalid_data", "obj_a")
    assert "value" in wrong.message.text
    assert "a" in wrong.message.text
    assert host.call("obj_a", "echo", value=1).code == "invalid_data"
    assert host.call("obj_a", "_open").code == "invalid_data"
    assert host.call("obj_none", "quick").code == "not_found"


def test_a_hanging_call_fails_in_time_without_delaying_other_devices(host: HostProcess, tmp_path: Path) -> None:
    _open(host, "a", "b")
    (tmp_path / "hanging").touch()
    hang = host.begin("obj_a", "hang_while", deadline=1.0, file=str(tmp_path / "hanging"))
    waiting = host.begin("obj_a", "quick")
    other = host.begin("obj_b", "quick")
    error = host.answer(hang)
    assert host.answer(other) == "quick"
    answers = [one.id for one in host.seen if isinstance(one, m.CallDone | m.CallFailed)]
    assert answers.index(other) < answers.index(hang)
    assert error.code == "device_timeout"
    assert all(part in error.message.text for part in ("a", "hang", "1 s"))
    assert "hang" in host.answer(waiting).message.text
    refused = host.call("obj_a", "quick")
    assert refused.code == "device_timeout"
    assert "still busy with hang" in refused.message.text
    (tmp_path / "hanging").unlink()
    wait_for(lambda: host.call("obj_a", "quick") == "quick")  # the device answers again, with the right answer


def test_stop_reaches_the_device_during_an_action(host: HostProcess, tmp_path: Path) -> None:
    _open(host, "a", file=str(tmp_path / "notes"))
    move = host.begin("obj_a", "move")
    queued = host.begin("obj_a", "quick")
    _wait_for_note(tmp_path / "notes", "move")
    host.send(m.StopMotion(99, "obj_a"))
    assert host.answer(queued).code == "cancelled"
    assert host.answer(move).code == "cancelled"
    assert host.answer(99) is None
    assert host.call("obj_a", "quick") == "quick"


def test_a_command_that_arrives_after_the_stop_is_stopped_too(host: HostProcess, tmp_path: Path) -> None:
    # This device forgets a stop that precedes its motion, like one whose frames cross on the wire.
    source = DEVICE.replace('self.note("move")', 'self.note("move"); time.sleep(0.03); self.stopped.clear()')
    host.send(open_scene([type_code("Device", source)], scene_object("a", "Device", file=str(tmp_path / "notes"))))
    host.expect(m.SceneOpened)
    move = host.begin("obj_a", "move")
    _wait_for_note(tmp_path / "notes", "move")
    host.send(m.StopMotion(99, "obj_a"))
    assert host.answer(move).code == "cancelled"
    assert (tmp_path / "notes").read_text().count("stop") == 2


def test_a_stop_while_control_is_taken_prevents_the_action(host: HostProcess, tmp_path: Path) -> None:
    # Longer than a second stop would wait; this device also ignores stops from before its motion.
    taking = """
    def control_owner(self):
        return None

    def take_control(self) -> None:
        self.note("taking")
        time.sleep(0.5)
        self.note("taken")
"""
    source = DEVICE.replace('self.note("move")', 'self.note("move"); self.stopped.clear()') + taking
    notes = tmp_path / "notes"
    host.send(open_scene([type_code("Device", source)], scene_object("a", "Device", file=str(notes))))
    host.expect(m.SceneOpened)
    host.send(m.Call(77, "obj_a", "move", control=True))
    _wait_for_note(notes, "taking")
    host.send(m.StopMotion(99, "obj_a"))
    error = host.answer(77)
    assert error.code == "cancelled"
    _wait_for_note(notes, "taken")
    assert host.call("obj_a", "quick") == "quick"  # after the call that takes control
    assert "move" not in notes.read_text()


def test_twenty_devices_connect_concurrently(host: HostProcess, tmp_path: Path) -> None:
    """Each device waits until all have started to connect."""
    waiting = """self.note("connecting")
        while Path(self.settings.file).read_text().count("connecting") < 20:
            time.sleep(0.01)
"""
    source = DEVICE.replace("time.sleep(self.settings.connect_takes)\n", waiting).replace(
        "timeout: float = 5.0", "timeout: float = 20.0"
    )
    objects = [scene_object(f"d{number}", "Device", file=str(tmp_path / "notes")) for number in range(20)]
    host.send(open_scene([type_code("Device", source)], *objects))
    host.expect(m.SceneOpened)
    assert (tmp_path / "notes").read_text().count("connected") == 20


@pytest.mark.parametrize(("fail", "words"), [("refused", "192.0.2.1:30004"), ("odd", "ZeroDivisionError")])
def test_one_failed_device_closes_the_others(host: HostProcess, tmp_path: Path, fail: str, words: str) -> None:
    notes = tmp_path / "notes"
    source = DEVICE.replace(
        "connect(self, timeout: float = 5.0) -> None:\n",
        f"""connect(self, timeout: float = 30.0) -> None:
        while self.settings.fail and not Path({str(notes)!r}).exists():
            time.sleep(0.01)
""",
    )
    objects = [scene_object("good", "Device", file=str(notes)), scene_object("bad", "Device", fail=fail)]
    host.send(open_scene([type_code("Device", source)], *objects))
    error = host.expect(m.SceneFailed).error
    assert error.object_id == "obj_bad"
    assert "bad" in error.message.text
    assert words in error.message.text
    assert host.gone() == 0
    assert (tmp_path / "notes").read_text().splitlines() == ["good connected", "good disconnected"]


def test_a_device_that_hangs_while_connecting_is_named(host: HostProcess) -> None:
    source = DEVICE.replace("timeout: float = 5.0", "timeout: float = 0.2")
    host.send(open_scene([type_code("Device", source)], scene_object("slow", "Device", connect_takes=30)))
    error = host.expect(m.SceneFailed).error
    assert error.code == "device_timeout"
    assert "slow" in error.message.text


@pytest.mark.parametrize(
    ("settings", "words"),
    [({"nonsense": 1}, "nonsense"), ({"connect_takes": "long"}, "connect_takes")],
)
def test_an_invalid_setting_is_named(host: HostProcess, settings: dict[str, object], words: str) -> None:
    host.send(open_scene([type_code("Device", DEVICE)], scene_object("a", "Device", **settings)))
    error = host.expect(m.SceneFailed).error
    assert (error.code, error.object_id) == ("invalid_data", "obj_a")
    assert words in error.message.text


def test_overrides_replace_parameters(host: HostProcess, tmp_path: Path) -> None:
    override = SceneObjectOverride("obj_a", [Parameter("file", "string", f'"{tmp_path}/over"')])
    objects = [scene_object("a", "Device", file=str(tmp_path / "under"))]
    host.send(open_scene([type_code("Device", DEVICE)], *objects, overrides=[override]))
    host.expect(m.SceneOpened)
    assert [p.name for p in tmp_path.iterdir()] == ["over"]


def test_references_to_secrets_are_replaced(host: HostProcess, tmp_path: Path) -> None:
    reference = new_reference()
    objects = [scene_object("a", "Device", file=reference)]
    message = open_scene([type_code("Device", DEVICE)], *objects)
    host.send(msgspec.structs.replace(message, secrets={"obj_a": ObjectSecrets({"file": str(tmp_path / "secret")})}))
    host.expect(m.SceneOpened)
    assert [p.name for p in tmp_path.iterdir()] == ["secret"]


def test_a_missing_secret_is_named(host: HostProcess) -> None:
    host.send(open_scene([type_code("Device", DEVICE)], scene_object("a", "Device", file=new_reference())))
    error = host.expect(m.SceneFailed).error
    assert error.object_id == "obj_a"
    assert error.message.text == (
        "a: the secret setting file is not stored on this server. Enter it in the settings of a, or in the cell file."
    )


def test_a_secret_for_another_address_is_withheld(host: HostProcess) -> None:
    message = open_scene([type_code("Device", DEVICE)], scene_object("a", "Device", file=new_reference()))
    withheld = ObjectSecrets(problem=Message.of("Enter the file again."))
    host.send(msgspec.structs.replace(message, secrets={"obj_a": withheld}))
    error = host.expect(m.SceneFailed).error
    assert (error.object_id, error.code, error.message.text) == ("obj_a", "address_changed", "Enter the file again.")


def test_a_source_that_cannot_be_imported_is_named(host: HostProcess) -> None:
    host.send(open_scene([type_code("Device", "def broken(:\n")], scene_object("a", "Device")))
    error = host.expect(m.SceneFailed).error
    assert "Device" in error.message.text
    assert "SyntaxError" in error.message.text


def test_types_of_the_older_convention_work(host: HostProcess, tmp_path: Path) -> None:
    source = f"""
    class OldBox(GenericWithPose):
        _ABSTRACT = False
        def __init__(self, obj_id, name, pose, settings=None):
            super().__init__(obj_id, name, pose, settings)
            Path({str(tmp_path / "old")!r}).write_text("open")
        def cleanup(self):
            Path({str(tmp_path / "old")!r}).write_text("closed")
    """
    host.send(open_scene([type_code("OldBox", source)], scene_object("old", "OldBox", pose=True)))
    host.expect(m.SceneOpened)
    assert (tmp_path / "old").read_text() == "open"
    host.send(m.CloseScene())
    assert host.expect(m.SceneClosed).error is None
    assert host.gone() == 0
    assert (tmp_path / "old").read_text() == "closed"


def test_the_host_stops_devices_and_exits_when_the_server_ends(host: HostProcess, tmp_path: Path) -> None:
    notes = tmp_path / "notes"
    _open(host, "a", "b", file=str(notes))
    host.begin("obj_a", "move")
    host.begin("obj_b", "hang", seconds=60)
    _wait_for_note(notes, "move")
    host.socket.close()
    host.gone()
    lines = notes.read_text().splitlines()
    assert lines.index("a stop") < lines.index("a disconnected")
    assert "b stop" in lines
    assert "b disconnected" in lines  # despite its hung lane


def test_the_host_stops_devices_and_exits_on_sigterm(host: HostProcess, tmp_path: Path) -> None:
    notes = tmp_path / "notes"
    _open(host, "a", file=str(notes))
    host.begin("obj_a", "move")
    _wait_for_note(notes, "move")
    os.kill(host.process.pid, signal.SIGTERM)
    host.gone()
    assert notes.read_text().splitlines()[-2:] == ["a stop", "a disconnected"]


def test_prints_and_warnings_of_drivers_do_not_break_the_host(host: HostProcess) -> None:
    _open(host, "a")
    left = host.call("obj_a", "leave")
    assert "SystemExit" in left.message.text
    # More than a pipe holds, so that the test must read meanwhile; no newline at the end of the second one.
    number = host.begin("obj_a", "shout", size=300_000)
    text = ""

    def read() -> int:
        nonlocal text
        text += host.output()
        return text.count("y")

    wait_for(read, lambda count: count >= 300_000)
    assert text.count("x") == text.count("y") == 300_000
    assert host.answer(number) == 300_000
    assert host.call("obj_a", "quick") == "quick"


def test_a_call_that_blocks_the_interpreter_does_not_end_the_host(host: HostProcess) -> None:
    _open(host, "a")
    start = time.monotonic()
    host.begin("obj_a", "freeze")
    assert host.call("obj_a", "quick") == "quick"
    assert time.monotonic() - start > 1.5


def test_the_end_of_the_host_is_detected(host: HostProcess) -> None:
    _open(host, "a")
    host.begin("obj_a", "crash")
    with pytest.raises(EOFError):
        host.expect(m.CallDone)
    assert host.gone() == 7


REACHING = """
class Reaching(Generic):
    _ABSTRACT = False

    def attach(self, find) -> None:
        self.find = find

    def connect(self, timeout: float = 5.0) -> None:
        until = time.monotonic() + timeout
        while True:  # all devices connect concurrently
            try:
                self.other = self.find("b")
                return
            except NotConnected:
                assert time.monotonic() < until
                time.sleep(0.01)

    def ask(self, name: str) -> str:
        return self.find(name).quick()

    def count(self) -> int:
        return threading.active_count()
"""


def test_an_object_calls_another_one_that_is_busy(host: HostProcess) -> None:
    objects = [scene_object("a", "Reaching"), scene_object("b", "Device", connect_takes=0.2)]
    host.send(open_scene([type_code("Device", DEVICE), type_code("Reaching", REACHING)], *objects))
    host.expect(m.SceneOpened)
    hang = host.begin("obj_b", "hang", seconds=1.0)
    assert host.call("obj_a", "ask", name="b") == "quick"
    assert host.call("obj_a", "ask", name="obj_b") == "quick"
    assert host.call("obj_a", "ask", name="c").code == "not_found"
    assert host.answer(hang) == "late", "b was busy all the time"


def test_a_polled_service_does_not_fill_the_log(host: HostProcess) -> None:
    source = """
    import logging

    class Poller(Generic):
        _ABSTRACT = False

        def poll(self) -> None:
            logging.getLogger("httpx").info("HTTP Request: POST http://127.0.0.1/orders/next")
            logging.getLogger("httpx").warning("httpx warns")
            logging.getLogger("poller").info("an order")
    """
    host.send(open_scene([type_code("Poller", source)], scene_object("poller", "Poller")))
    host.expect(m.SceneOpened)
    assert host.call("obj_poller", "poll") is None
    lines = [each.text for each in host.seen if isinstance(each, m.LogLine)]
    assert lines == ["httpx: httpx warns", "poller: an order"]

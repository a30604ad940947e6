"""The cell host recognises devices: another device than the confirmed one is observed, but not commanded."""

import json
from pathlib import Path

import msgspec

from arcor2_hw.data.device import Identity
from arcor2_hw.data.project import Project
from arcor2_hw.runtime import messages as m

from .conftest import HostProcess, Package, open_scene, scene_object, type_code

DEVICE = """
import json
from arcor2_hw.data.device import Connection, Identity
from arcor2_hw.objects.observing import Observing

@dataclass
class UnitSettings(Settings):
    file: str

class Unit(Generic):
    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: UnitSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.life = Observing(name, lambda _: self.check(), self.watch, lambda: None)

    def state(self):
        with open(self.settings.file) as f:
            return json.load(f)

    def check(self):
        if self.state().get("unplugged"):
            raise ConnectionLost("unplugged")

    def watch(self, stopping):
        while not stopping.wait(0.01):
            self.check()

    def connect(self, timeout: float = 5.0) -> None:
        self.life.start(timeout)
    def disconnect(self) -> None:
        self.life.stop()
    @property
    def connection(self): return self.life.state
    def identify(self) -> Identity:
        state = self.state()
        if state.get("silent"):
            raise DeviceTimeout("no answer")
        return Identity("Maker", "Unit 5", state["serial"], state["firmware"])
    def take_control(self) -> None:
        self.note("control")
    def control_owner(self): return None
    def note(self, text):
        with open(self.settings.file + ".log", "a") as f:
            f.write(text + "\\n")

    @action
    def act(self, *, an: str | None = None) -> None:
        self.note("act")
    def read(self) -> int: return 7
"""
KNOWN = Identity("Maker", "Unit 5", "A1", "1.0")


def write_unit(directory: Path, **state: object) -> Path:
    file = directory / "unit.json"
    part = file.with_suffix(".part")
    part.write_text(json.dumps({"serial": "A1", "firmware": "1.0"} | state))
    part.replace(file)  # the device may be reading it
    return file


def log(directory: Path) -> list[str]:
    file = directory / "unit.json.log"
    return file.read_text().split() if file.exists() else []


def scene(directory: Path, known: Identity | None = None) -> m.OpenScene:
    where = scene_object("unit", "Unit", file=str(directory / "unit.json"))
    identities = {} if known is None else {"obj_unit": known}
    return open_scene([type_code("Unit", DEVICE)], where, identities=identities)


def refusal(host: HostProcess) -> m.ErrorData:
    host.send(m.Call(77, "obj_unit", "act", control=True))
    return host.expect(m.CallFailed, lambda failed: failed.id == 77).error


def test_another_serial_number_is_refused_until_it_is_confirmed(host: HostProcess, tmp_path: Path) -> None:
    write_unit(tmp_path, serial="B2")
    host.send(scene(tmp_path, KNOWN))
    report = host.expect(m.DeviceChanged, lambda report: bool(report.alarms))  # also before SceneOpened
    assert [alarm.code for alarm in report.alarms] == ["different_device"]
    other = Identity("Maker", "Unit 5", "B2", "1.0")
    error = refusal(host)
    assert [each.identity for each in host.seen if isinstance(each, m.DeviceIdentified)] == [other]
    assert error.code == "different_device"
    assert "a different Unit 5: serial number B2 instead of A1" in error.message.text
    assert log(tmp_path) == [], "control was taken, or the action ran"
    assert host.call("obj_unit", "read") == 7, "the device can be observed"

    host.send(m.ConfirmIdentity("obj_unit", other))
    host.expect(m.DeviceChanged, lambda report: not report.alarms)
    host.send(m.Call(78, "obj_unit", "act", control=True))
    host.expect(m.CallDone, lambda done: done.id == 78)
    assert log(tmp_path) == ["control", "act"]


def test_a_device_exchanged_during_a_loss_is_refused(host: HostProcess, tmp_path: Path) -> None:
    write_unit(tmp_path)
    host.send(scene(tmp_path, KNOWN))
    host.expect(m.SceneOpened)
    host.send(m.Call(1, "obj_unit", "act", control=True))
    host.expect(m.CallDone, lambda done: done.id == 1)
    write_unit(tmp_path, serial="B2", unplugged=True)
    host.expect(m.DeviceChanged, lambda report: report.connection == "lost")
    write_unit(tmp_path, serial="B2")
    host.expect(m.DeviceChanged, lambda report: report.connection == "back")
    assert refusal(host).code == "different_device"
    assert log(tmp_path) == ["control", "act"]


def test_a_confirmed_device_without_an_answer_is_not_commanded(host: HostProcess, tmp_path: Path) -> None:
    write_unit(tmp_path, silent=True)
    host.send(scene(tmp_path, KNOWN))
    assert "no answer" in str(host.expect(m.DeviceIdentified).problem)
    error = refusal(host)
    assert error.code == "refused"
    assert "it may be another device: no answer" in error.message.text
    assert log(tmp_path) == []
    write_unit(tmp_path)
    host.send(m.Call(78, "obj_unit", "act", control=True))
    host.expect(m.CallDone, lambda done: done.id == 78)


def test_an_unknown_device_is_only_reported(host: HostProcess, tmp_path: Path) -> None:
    write_unit(tmp_path)
    host.send(scene(tmp_path))
    assert host.expect(m.DeviceIdentified).identity == KNOWN
    host.send(m.Call(78, "obj_unit", "act", control=True))
    host.expect(m.CallDone, lambda done: done.id == 78)


def test_a_program_does_not_start_with_another_firmware(host: HostProcess, package: Package, tmp_path: Path) -> None:
    write_unit(tmp_path, firmware="1.1")
    where = scene_object("unit", "Unit", file=str(tmp_path / "unit.json"))
    body = 'res.objects["obj_unit"].act(an="act")'
    directory = package.write({"Unit": DEVICE}, [where], Project("project", "scn_1", id="pro_1"), body)
    host.send(m.RunPackage("pkg_1", str(directory), identities={"obj_unit": KNOWN}))
    ended = host.expect_state("stopped")
    assert ended.error is not None
    assert ended.error.code == "different_device"
    assert "another firmware: 1.1 instead of 1.0" in ended.error.message.text
    assert ended.error.object_id == "obj_unit"
    assert log(tmp_path) == []


def test_differences_ignore_fields_missing_on_one_side() -> None:
    assert KNOWN.differences(Identity("", "Unit 5", "", "1.0")) == []
    assert KNOWN.differences(msgspec.structs.replace(KNOWN, serial="B2", firmware="2.0")) == ["serial", "firmware"]

"""`arcor2-hw device new --from-map`: the generated driver on independent fakes and on the fake of the map."""

import importlib
import os
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.analysis import Library, SourceFile
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects.mapped_device import MappedDevice
from arcor2_hw.testing.fake_bench import modbus_address
from arcor2_server.cli.main import app
from tests.fakes.conftest import FakeProcess
from tests.server.cli.generated import run_tests

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "docs" / "examples"
Screwdriver = Any
"""The generated class, which mypy cannot know."""


def generate(folder: Path, name: str, text: str = "") -> Path:
    """Write the driver of a map, and return its folder."""
    file = folder / f"{name}.yaml"
    file.write_text(text or (EXAMPLES / f"{name}.yaml").read_text())
    assert app(["device", "new", name, "--from-map", str(file), "--directory", str(folder)]) == 0
    return folder / name


def changed(old: str, new: str) -> str:
    """Return the map of the screwdriver with a text replaced."""
    text = (EXAMPLES / "screwdriver.yaml").read_text()
    assert old in text
    return text.replace(old, new)


@pytest.fixture(scope="module")
def one_fake() -> Iterator[FakeProcess]:
    with FakeProcess(EXAMPLES / "screwdriver_fake.py") as fake:
        yield fake


@pytest.fixture
def fake(one_fake: FakeProcess) -> FakeProcess:
    one_fake.control.do("heal")
    one_fake.control.do("rest")
    return one_fake


def registers(fake: FakeProcess) -> dict[str, Any]:
    found: dict[str, Any] = fake.truth()["registers"]
    return found


@pytest.fixture
def make(tmp_path: Path, fake: FakeProcess, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Screwdriver]]:
    """Return ``make(map)``: the generated driver of a map, connected to the independent fake and in control."""
    made: list[MappedDevice] = []

    def build(text: str = "") -> Screwdriver:
        root = generate(tmp_path, "screwdriver", text)
        monkeypatch.syspath_prepend(str(root))
        for module in [each for each in sys.modules if each.partition(".")[0] == "screwdriver"]:
            monkeypatch.delitem(sys.modules, module)
        importlib.invalidate_caches()
        module_ = importlib.import_module("screwdriver.screwdriver")
        settings = module_.ScrewdriverSettings(**modbus_address(fake.ready["address"]))
        device = module_.Screwdriver("id", "driver", settings)
        made.append(device)
        device.connect(5.0)
        device.take_control()
        return device

    yield build
    for device in made:
        device.disconnect()


@pytest.fixture
def device(make: Callable[..., Screwdriver]) -> Screwdriver:
    return make()


def run_in_thread(call: Callable[[], object]) -> tuple[threading.Thread, list[Exception | object]]:
    outcome: list[Exception | object] = []

    def run() -> None:
        try:
            outcome.append(call())
        except Exception as error:
            outcome.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, outcome


# ------------------------------------------------------------------------------------------------ generated code
def test_the_actions_are_visible_to_the_analysis(tmp_path: Path) -> None:
    path = generate(tmp_path, "screwdriver") / "screwdriver" / "screwdriver.py"
    file = SourceFile("Screwdriver", "screwdriver.screwdriver", path.read_bytes(), str(path), False)
    found = Library([file]).analyse("Screwdriver")
    assert found.problem is None
    assert (found.meta.display_name, found.meta.abstract, found.meta.disabled) == (
        "Screwdriver controller",
        False,
        False,
    )
    assert found.meta.description == "Tightens screws with a program, and measures torque and angle."
    assert {each.name for each in found.meta.settings} >= {"host", "port", "serial_port", "parity", "unit_id"}
    actions = {action.name: action for action in found.actions}
    assert set(actions) == {
        *("get_state", "get_fault", "get_torque", "get_angle", "get_screw", "wait_for_screw", "get_light", "set_light"),
        *("tighten", "reset_fault"),
    }
    tighten = actions["tighten"]
    assert tighten.description == "Tighten one screw, and return its torque and angle."
    assert tighten.returns == ["double", "double"]
    program, limit = tighten.parameters
    assert (program.type, program.extra) == ("string_enum", '{"allowed_values":["soft","hard"]}')
    assert (limit.type, limit.extra) == ("double", '{"minimum":0.1,"maximum":12.0,"unit":"N m"}')
    assert program.description == "the tightening program"
    assert [actions[f"get_{name}"].returns for name in ("state", "fault", "torque", "screw")] == [
        ["string"], ["integer"], ["double"], ["boolean"],
    ]  # fmt: skip
    assert all(not action.disabled and action.description for action in found.actions)


@pytest.mark.parametrize("name", ["dispenser", "screwdriver"])
def test_generated_code_is_clean_and_typed(tmp_path: Path, pytestconfig: pytest.Config, name: str) -> None:
    root = generate(tmp_path, name)
    cache = getattr(pytestconfig, "cache", None)
    mypy_cache = cache.mkdir("typed-starters") if cache is not None else tmp_path / "mypy"
    for command in (
        ["ruff", "check", "--no-cache", "."],
        ["ruff", "format", "--check", "--no-cache", "."],
        ["mypy", "--strict", "--python-version", "3.11", f"{name}/{name}.py"],
    ):
        environment = os.environ | {"MYPYPATH": str(ROOT), "MYPY_CACHE_DIR": str(mypy_cache)}
        run = [sys.executable, "-m", *command]
        done = subprocess.run(run, cwd=root, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


# ------------------------------------------------------------------------------------------------ the suite
def test_with_the_fake_of_the_map_the_driver_reaches_bronze(tmp_path: Path) -> None:
    out = run_tests(generate(tmp_path, "dispenser"))
    assert "Dispenser: bronze (claimed bronze)" in out
    assert "the fake is written from the same source as the driver" in out
    assert set(re.findall(r"SKIPPED .*: Dispenser: (.*)", out)) == {
        "the bench has no hook readings",
        "the bench has no hook results",
        "the bench has no hook beyond_limits",
        "the device does not report who has control",
    }


def test_with_an_independent_fake_the_driver_reaches_silver(tmp_path: Path) -> None:
    root = generate(tmp_path, "screwdriver")
    quality = root / "screwdriver" / "quality.yaml"
    quality.write_text(quality.read_text().replace("level: bronze", "level: silver"))
    shutil.copy(EXAMPLES / "screwdriver_fake.py", root / "screwdriver")
    shutil.copy(EXAMPLES / "screwdriver_suite.py", root / "tests" / "test_screwdriver.py")
    out = run_tests(root)
    assert re.search(r"Screwdriver: silver \(claimed silver\), \d+ passed; next: quality.yaml names no report", out), (
        out
    )


# ------------------------------------------------------------------------------------------------ actions
def test_a_command_writes_its_parameters_and_returns_its_results(device: Screwdriver, fake: FakeProcess) -> None:
    torque, angle = device.tighten("hard", 2.5)
    end = registers(fake)
    assert torque == end["torque"] == 2.5
    assert angle == pytest.approx(end["angle"] / 10.0, abs=0.06)
    assert (end["program"], end["limit"], end["start"]) == (2, 2.5, 0)
    written = [name for name, _ in fake.truth()["written"]]
    assert written == ["watchdog", "program", "limit", "start", "start"]


def test_points_are_read_in_their_units(device: Screwdriver, fake: FakeProcess) -> None:
    fake.control.do("set", torque=3.25, angle=-70000, screw=False, fault=0, state=3)
    assert device.get_torque() == 3.25
    assert device.get_angle() == -7000.0
    assert device.get_state() == "not_ok"
    assert device.read("torque").age < 2.0


def test_a_setting_is_verified(device: Screwdriver, fake: FakeProcess) -> None:
    device.set_light(True)
    assert registers(fake)["light"] is True
    assert device.get_light() is True
    device.set_light(False)
    assert registers(fake)["light"] is False


def test_a_point_is_read_in_the_word_order_of_the_map(make: Callable[..., Screwdriver], fake: FakeProcess) -> None:
    device = make(
        changed("type: float32, unit: N m, text: the torque of", "type: float32, word_order: high_first, text: t")
    )
    fake.control.do("set", torque=1.0)  # 3F80 0000, the low word first
    assert device.get_torque() == pytest.approx(2.278e-41, rel=1e-3)  # 0000 3F80


def test_a_lost_answer_to_a_heartbeat_does_not_end_control(device: Screwdriver, fake: FakeProcess) -> None:
    write, lost = device._write, [True]

    def lose_one(point: object, words: object) -> None:
        write(point, words)
        if lost:
            raise DeviceTimeout(str(lost.pop()))

    device._write = lose_one
    fake.control.wait_until(lambda _: not lost)
    del device._write
    assert device.tighten("hard", 2.0)[0] == 2.0


def test_an_unknown_number_of_an_enumeration_is_a_fault(device: Screwdriver, fake: FakeProcess) -> None:
    fake.control.do("set", state=9)
    with pytest.raises(ConnectionLost) as error:
        device.get_state()
    assert "sent invalid values: state is 9, which is none of 0, 1, 2, 3" in str(error.value.detail)
    fake.control.do("set", state=0)
    fake.control.wait_until(lambda _: device.connection is Connection.BACK or device.connection is Connection.ONLINE)
    assert device.get_state() == "idle"


def test_values_that_are_not_allowed_are_refused_before_anything_is_written(
    device: Screwdriver, fake: FakeProcess
) -> None:
    before = fake.truth()["written"]
    for call, expected in (
        (lambda: device.tighten("medium", 5.0), "driver at .*: program must be one of soft, hard, not 'medium'"),
        (lambda: device.put("a test", {"program": "soft", "limit": 13.0}), "limit must be 0.1 to 12 N m, not 13.0"),
        (lambda: device.put("a test", {"program": "soft", "start": 1}), "start must be true or false, not 1"),
    ):
        with pytest.raises(OutOfRange, match=expected):
            call()
    assert fake.truth()["written"] == before


def test_a_short_change_of_a_debounced_input_does_not_count(
    make: Callable[..., Screwdriver], fake: FakeProcess
) -> None:
    device = make(changed("debounce: 0.05", "debounce: 10"))
    fake.control.do("set", screw=False)
    assert device.get_screw() is True
    with pytest.raises(DeviceTimeout, match=r"screw becoming False took longer than 0\.2 s"):
        device.wait_for_screw(False, 0.2)


def test_waiting_for_an_input_ends_with_its_value_or_is_cancelled(device: Screwdriver, fake: FakeProcess) -> None:
    thread, outcome = run_in_thread(lambda: device.wait_for_screw(False, 10.0))
    fake.control.do("set", screw=False)
    thread.join()
    assert outcome == [None]
    thread, outcome = run_in_thread(lambda: device.wait_for_screw(True, 10.0))
    fake.control.wait_until(lambda _: device._polled._waiting > 0)
    device.stop()
    thread.join()
    assert isinstance(outcome[0], Cancelled)


# ------------------------------------------------------------------------------------------------ handshake and faults
def test_a_command_that_is_not_acknowledged_times_out(device: Screwdriver, fake: FakeProcess) -> None:
    fake.control.do("misbehave", deaf=True)
    with pytest.raises(DeviceTimeout, match=r"^driver at .*: accepting tighten took longer than 1 s"):
        device.tighten("hard", 2.0)
    assert registers(fake)["start"] is False


def test_a_command_that_does_not_end_is_stopped(make: Callable[..., Screwdriver], fake: FakeProcess) -> None:
    device = make(changed("within: 20.0", "within: 0.6"))
    fake.control.do("misbehave", stuck=True)
    with pytest.raises(DeviceTimeout, match=r"tighten took longer than 0\.6 s"):
        device.tighten("hard", 2.0)
    end = registers(fake)
    assert (end["state"], end["working"], end["start"]) == (0, False, False)


def test_a_fault_during_a_command_is_raised_and_can_be_reset(device: Screwdriver, fake: FakeProcess) -> None:
    fake.control.do("misbehave", slips_at=1.0)
    with pytest.raises(DeviceFault, match="tighten failed") as error:
        device.tighten("hard", 2.0)
    assert error.value.fault_code == 1
    assert device.health is Health.FAILURE
    assert [(alarm.code, alarm.text) for alarm in device.alarms()] == [("1", "the screw slipped")]
    device.reset_fault()
    assert device.get_fault() == 0
    assert device.alarms() == []
    fake.control.do("misbehave")
    assert device.tighten("hard", 2.0)[0] == 2.0


def test_a_command_that_ends_without_success_is_a_fault(
    device: Screwdriver, fake: FakeProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait, accepted = device.wait, threading.Event()

    def signalling_wait(holds: Any, timeout: float, what: str, *options: Any) -> Any:
        if what == "tighten":  # the wait before is for its acknowledgement
            accepted.set()
        return wait(holds, timeout, what, *options)

    monkeypatch.setattr(device, "wait", signalling_wait)
    thread, outcome = run_in_thread(lambda: device.tighten("soft", 10.0))
    assert accepted.wait(30.0)
    fake.control.do("set", state=3, working=False)
    thread.join()
    assert isinstance(outcome[0], DeviceFault)
    assert "tighten failed: state is not_ok" in str(outcome[0])


def test_a_busy_device_refuses_a_command(device: Screwdriver, fake: FakeProcess) -> None:
    fake.control.do("set", state=1)
    with pytest.raises(Refused, match="is busy: tighten is refused"):
        device.tighten("hard", 2.0)
    assert not registers(fake)["start"]


def test_stop_ends_a_command_and_the_device(device: Screwdriver, fake: FakeProcess) -> None:
    thread, outcome = run_in_thread(lambda: device.tighten("soft", 10.0))
    fake.control.wait_until(lambda truth: truth["busy"])
    device.stop()
    assert fake.truth()["busy"] is False
    thread.join()
    assert isinstance(outcome[0], Cancelled)
    assert device.tighten("hard", 2.0)[0] == 2.0


# ----------------------------------------------------------------------------------- connection loss and control
def test_without_the_heartbeat_the_device_stops(device: Screwdriver, fake: FakeProcess) -> None:
    thread, outcome = run_in_thread(lambda: device.tighten("soft", 10.0))
    fake.control.wait_until(lambda truth: truth["busy"])
    fake.control.do("silence")
    thread.join()
    assert isinstance(outcome[0], ConnectionLost | DeviceTimeout)
    assert fake.control.wait_until(lambda truth: not truth["busy"])["registers"]["state"] == 0
    fake.control.do("heal")
    fake.control.wait_until(lambda _: device.connection in (Connection.BACK, Connection.ONLINE))
    with pytest.raises(NotInControl):
        device.tighten("hard", 2.0)
    device.take_control()
    assert device.tighten("hard", 2.0)[0] == 2.0


def test_the_heartbeat_keeps_control(device: Screwdriver, fake: FakeProcess) -> None:
    beats = set()

    def enough(truth: dict[str, Any]) -> bool:
        beats.add(truth["registers"]["life"])
        return len(beats) > 10  # for more than twice the time of the watchdog

    assert fake.control.wait_until(enough)["registers"]["owner"] == 1


def test_control_ends_when_the_panel_takes_it(device: Screwdriver, fake: FakeProcess) -> None:
    fake.control.do("panel", on=True)
    fake.control.wait_until(lambda _: device.control_owner() == "the operator panel")
    with pytest.raises(NotInControl, match="tighten is refused"):
        device.tighten("hard", 2.0)
    assert (device.connection, device.observing.losses) == (Connection.ONLINE, 0)


def test_control_cannot_be_taken_from_the_panel(device: Screwdriver, fake: FakeProcess) -> None:
    device.release_control()
    assert registers(fake)["owner"] == 0
    fake.control.do("panel", on=True)
    fake.control.wait_until(lambda _: device.control_owner() == "the operator panel")
    with pytest.raises(NotInControl, match="the operator panel has it"):
        device.take_control()

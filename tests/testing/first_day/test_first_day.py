"""`arcor2-hw device check --real` on fakes that play the real device, with a person at a pseudo terminal."""

import gzip
import json
import shutil
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_fakes.control import BlockingControlClient
from arcor2_hw.testing import quality, report
from arcor2_hw.testing.first_day import plan
from arcor2_hw.testing.outcomes import Kind
from arcor2_hw.testing.report import DeviceRun, Report
from tests import commands
from tests.drivers.universal_robots.conftest import FakeUr
from tests.fakes.conftest import FakeProcess
from tests.testing.first_day.operator_at_device import Operator
from tests.waiting import wait_for

FULL, SMALL = 1.0472, 0.0873  # rad, as in first_day.yaml of the arm
MOVING = 1e-3  # rad/s
PULL = "Pull the cable of the device now."


@pytest.fixture
def arm() -> Iterator[FakeUr]:
    fake = FakeUr("--time-scale", "0.1", "--powered-off")
    yield fake
    fake.end()


@pytest.fixture
def block() -> Iterator[FakeProcess]:
    fake = FakeProcess("remote_io")
    fake.control.do("set_input", number=0, on=True)
    yield fake
    fake.end()


@contextmanager
def operator(folder: Path, name: str, kind: str, **settings: Any) -> Iterator[Operator]:
    entry = {"name": name, "type": kind, "real": True, "settings": settings}
    (folder / "cell.yaml").write_bytes(msgspec.yaml.encode({"devices": [entry]}))
    found = Operator(folder, name)
    try:
        yield found
    finally:
        found.close()


def at_arm(folder: Path, arm: FakeUr) -> Any:
    return operator(folder, "arm", "UR5e", host=arm.host, payload_mass=1.0, tcp_z=0.1)


def at_block(folder: Path, block: FakeProcess) -> Any:
    host, _, port = str(block.ready["modbus"]).rpartition(":")
    points = "part=DI0; valve=DO4"
    return operator(folder, "block", "RemoteIO", host=host, port=int(port), points=points, watchdog_ms=1000)


def written(folder: Path) -> DeviceRun:
    found = msgspec.json.decode((folder / "report" / "report.json").read_bytes(), type=Report)
    assert len(found.devices) == 1
    return found.devices[0]


def results(run: DeviceRun, kind: Kind) -> set[str]:
    return {case for case, each in run.cases.items() if each.result is kind}


def recorded(folder: Path) -> list[dict[str, Any]]:
    content = gzip.decompress((folder / "report" / "wire.jsonl.gz").read_bytes())
    return [json.loads(line) for line in content.splitlines()]


class Pendant:
    """Actions of the person at the arm's pendant when the terminal requests them. Everything else is confirmed."""

    def __init__(self, arm: FakeUr, by_hand: bool = False) -> None:
        self.arm, self.by_hand, self.lists = arm, by_hand, 0

    def __call__(self, question: str) -> str:
        if question == "Is all of this done?":
            self.lists += 1
            if self.lists == 2:
                assert self.arm.truth()["robot_mode"] == "POWER_OFF", "the brakes were on until now"
                self.arm.do("brake_release")
                self.arm.control.wait_until(lambda truth: truth["robot_mode"] == "RUNNING")
        elif "local control" in question or "remote control" in question:
            self.arm.do("remote_control", on="remote" in question)
            return ""
        elif "by hand" in question:
            return "y" if self.by_hand else "n"
        return "y"


@contextmanager
def watched(arm: FakeUr) -> Iterator[list[float]]:
    """Record the values of joint 6 on another connection."""
    values: list[float] = []
    over = threading.Event()
    client = BlockingControlClient(arm.ready["control"])

    def watch() -> None:
        while not over.wait(0.05):
            values.append(client.do("truth")["q"][5])

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield values
    finally:
        over.set()
        thread.join()
        client.close()


# ------------------------------------------------------------------------------------------------ a robot
def test_the_whole_day_with_an_arm_becomes_evidence(tmp_path: Path, arm: FakeUr) -> None:
    pendant = Pendant(arm)
    first_motion: list[str] = []

    def answer(question: str) -> str:
        if question == "Run this case?" and not first_motion:
            first_motion.append(question)
            assert max(joints) - min(joints) < 1e-6, "nothing has moved before the first confirmation"
        return pendant(question)

    with watched(arm) as joints, at_arm(tmp_path, arm) as person:
        status = person.answers(answer)
    assert status == 0, person.shown
    for shown in ("firmware", "power: off", "shoulder_pan_joint", "no frame that acts on the device"):
        assert shown in person.shown
    assert "max_tcp_speed       1.0" in person.shown, "the limits are shown with their values"
    assert min(joints) > -0.01
    assert SMALL < max(joints) < FULL + SMALL + 0.01, "joint 6 stayed within the confirmed range"

    run = written(tmp_path)
    assert run.real
    assert (run.identity.vendor, run.identity.firmware) == ("Universal Robots", "5.25.0.0")
    assert run.address.startswith(arm.host)
    assert run.limits["payload_mass"] == 1.0
    assert results(run, Kind.LACKING) == {"capabilities_work", "results_are_current"}
    assert results(run, Kind.PASSED) == set(plan.ALL) - results(run, Kind.LACKING)
    assert run.cases["stop_passes"].seconds > 0.1
    lines = recorded(tmp_path)
    assert {"reading", "stop_passes", "nothing_resumes"} <= {line["case"] for line in lines}
    assert any(bytes.fromhex(line["hex"]).startswith(b"get serial number") for line in lines if "hex" in line)
    assert all((tmp_path / "report" / name).stat().st_size < 2_000_000 for name in ("report.json", "wire.jsonl.gz"))

    driver = tmp_path / "universal_robots"
    source = Path(sys.modules["arcor2_drivers.universal_robots"].__path__[0])
    shutil.copytree(source, driver, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(tmp_path / "report", driver / "evidence")
    claims = quality.read(driver / quality.FILE)
    tried = msgspec.structs.replace(claims.versions_tried, hardware=f"{run.identity.model}, firmware 5.25.0.0")
    reason = "needs a bench that knows more about the arm"
    claims = msgspec.structs.replace(
        claims,
        report="evidence/report.json",
        versions_tried=tried,
        not_on_hardware={"capabilities_work": reason, "results_are_current": reason},
    )
    passed = dict.fromkeys(plan.ALL, (Kind.PASSED, ""))
    assert report.unmatched(driver, claims, "UR5e", passed) == []
    changed = (driver / "rtde.py").read_bytes().replace(b"Final = 2\n", b"Final = 1\n", 1)
    (driver / "rtde.py").write_bytes(changed)
    assert report.unmatched(driver, claims, "UR5e", passed) == [
        "the files of the driver have changed since the report was written"
    ]


@pytest.mark.parametrize(
    "end",
    [
        pytest.param(None, id="ctrl-c"),
        pytest.param(signal.SIGHUP, id="terminal closed", marks=pytest.mark.matrix),
        pytest.param(signal.SIGKILL, id="killed"),
    ],
)
def test_the_arm_is_stopped_and_the_report_is_written_when_the_session_ends(
    tmp_path: Path, arm: FakeUr, end: signal.Signals | None
) -> None:
    pendant = Pendant(arm, by_hand=True)

    def answer(question: str) -> str:
        if question.startswith("Run the group"):
            return "y" if "Connection loss" in question else "n"
        if question == "Run this case?":
            return "y" if "\nnothing_resumes: An" in person.shown else "n"
        if "cable, then" in question or "cable in" in question or "cable of" in question:
            arm.do("silence") if question.startswith("Pull") else arm.do("heal")
            return ""
        return pendant(question)

    def pulled() -> None:
        if "\nnothing_resumes: An" not in person.shown:
            arm.do("silence")
            return
        arm.control.wait_until(lambda truth: max(map(abs, truth["qd"])) > MOVING)
        person.ctrl_c() if end is None else person.process.send_signal(end)

    with at_arm(tmp_path, arm) as person:
        person.reactions[PULL] = pulled
        status = person.answers(answer)
        wait_for(lambda: max(map(abs, arm.truth()["qd"])) <= MOVING)
        wait_for(lambda: arm.truth()["rtde_clients"] == 0)
        wait_for(lambda: "nothing_resumes" in written(tmp_path).cases)
    if end is not signal.SIGKILL:
        assert status == 130, person.shown
        assert "Stopping the device and disconnecting." in person.shown
    assert arm.truth()["q"][5] < FULL / 2, "it was stopped, and not at the end of the motion"
    run = written(tmp_path)
    assert run.cases["nothing_resumes"].reason == "interrupted by the person at the device"
    assert run.cases["loss_reaction"].reason == "the session ended before"
    assert run.cases["stop_passes"].reason == "declined by the person at the device"
    assert run.cases["observation_comes_back"].result is Kind.PASSED, "the cable was pulled by hand"
    assert run.recording is not None


def test_nothing_is_connected_without_a_yes(tmp_path: Path, arm: FakeUr) -> None:
    with at_arm(tmp_path, arm) as person:
        assert person.answers(lambda _: "") == 0
    assert "Nothing was connected." in person.shown
    assert arm.truth()["samples_sent"] == 0
    assert results(written(tmp_path), Kind.NOT_RUN) == set(plan.ALL)


def test_powered_drives_are_named(tmp_path: Path, arm: FakeUr) -> None:
    arm.do("brake_release")
    arm.control.wait_until(lambda truth: truth["robot_mode"] == "RUNNING")
    with at_arm(tmp_path, arm) as person:
        person.answers(lambda question: "n" if question.startswith("The drives are powered.") else "y")
    assert "Switch the drives off, then start again." in person.shown
    assert results(written(tmp_path), Kind.NOT_RUN) == set(plan.ALL)


# ------------------------------------------------------------------------------------------------ a Modbus device
def test_a_declined_motion_of_a_block_is_in_the_report(tmp_path: Path, block: FakeProcess) -> None:
    def answer(question: str) -> str:
        if question.startswith("Which output"):
            return "valve"
        return "n" if question == "Run this case?" and "stop_passes: stop()" in person.shown else "y"

    with at_block(tmp_path, block) as person:
        person.reactions[PULL] = lambda: block.control.do("silence")
        person.reactions["Plug the cable in again, then press Enter."] = lambda: block.control.do("heal")
        person.reactions["Pull the cable of the device, then press Enter."] = lambda: block.control.do("silence")
        status = person.answers(answer)
    assert status == 0, person.shown
    run = written(tmp_path)
    assert run.cases["command_needs_control"].result is Kind.PASSED
    assert run.cases["connecting_observes"].result is Kind.PASSED
    assert run.cases["observation_comes_back"].result is Kind.PASSED
    declined = {"stop_passes", "one_act_at_a_time", "cancelling_leaves_the_line_usable", "nothing_resumes"}
    assert {run.cases[case].reason for case in declined} == {"declined by the person at the device"}
    assert results(run, Kind.FAILED) == set()


def test_a_cable_that_is_pulled_during_a_motion_fails_the_case(tmp_path: Path, block: FakeProcess) -> None:
    def answer(question: str) -> str:
        if question.startswith("Which output"):
            return "valve"
        if question == "Run this case?" and "stop_passes: stop()" in person.shown:
            puller.start()
        return "n" if question.startswith("The case failed.") else "y"

    def pull() -> None:
        with BlockingControlClient(block.ready["control"]) as client:
            client.wait_until(lambda data: data["outputs"][4], command="outputs")
            client.do("silence")

    puller = threading.Thread(target=pull)
    with at_block(tmp_path, block) as person:
        status = person.answers(answer)
    puller.join()
    assert status == 1, person.shown
    run = written(tmp_path)
    assert run.cases["stop_passes"].result is Kind.FAILED
    assert run.cases["nothing_resumes"].reason == "the session ended before"
    wait_for(lambda: not block.control.do("outputs")["outputs"][4])


# ------------------------------------------------------------------------------------------------ a serial device
def test_the_whole_day_with_a_scale_on_a_serial_port(tmp_path: Path) -> None:
    fake = FakeProcess("scale", "--link", str(tmp_path / "ttySCALE"), "--settling", "0.1")
    try:
        fake.control.do("put", kg=0.5)
        fake.control.wait_until(lambda truth: truth["stable"])
        with operator(tmp_path, "balance", "MtSicsScale", port=str(fake.ready["port"]), answer_timeout=0.8) as person:
            status = person.answers(lambda question: "n" if "by hand" in question else "y")
    finally:
        fake.end()
    assert status == 0, person.shown
    run = written(tmp_path)
    assert run.address == str(fake.ready["port"])
    assert run.identity.model
    assert results(run, Kind.FAILED) == set()
    assert {"connecting_observes", "units_and_frames", "half_a_frame", "observation_comes_back"} <= results(
        run, Kind.PASSED
    )
    assert "the scale has no control" in run.cases["command_needs_control"].reason
    assert b"I2\r\n" in b"".join(
        bytes.fromhex(line["hex"]) for line in recorded(tmp_path) if line.get("by") == "driver"
    )


# ------------------------------------------------------------------------------------------------ the command
@pytest.mark.parametrize(
    ("arguments", "status", "expected"),
    [
        (["--real", "arm"], 2, "--real needs a terminal, because a person at the device confirms what moves."),
        (["--plan"], 2, "--plan and --report need --real NAME"),
        (["--real", "arm", "--plan"], 0, "Joint 6 turns by up to +60° and back"),
        (["--real", "leg", "--plan"], 11, "cell.yaml has no device leg"),
    ],
)
def test_the_command_without_a_terminal(tmp_path: Path, arguments: list[str], status: int, expected: str) -> None:
    settings = {"host": "192.0.2.7", "payload_mass": 1.0}
    cell = {"devices": [{"name": "arm", "type": "UR5e", "settings": settings}]}
    (tmp_path / "cell.yaml").write_bytes(msgspec.yaml.encode(cell))
    words = ("device", "check", "cell.yaml", *arguments)
    done = commands.run(commands.CLI, *words, cwd=tmp_path, given="y\n" * 50)
    assert (done.returncode, expected in done.stdout + done.stderr) == (status, True), done.stdout + done.stderr
    assert [each.name for each in tmp_path.iterdir()] == ["cell.yaml"]


def test_an_absent_device_is_named(tmp_path: Path) -> None:
    with operator(tmp_path, "block", "RemoteIO", host="127.0.0.1", port=9, points="part=DI0") as person:
        assert person.answers(lambda _: "y") == 12, person.shown
    assert "block" in person.shown
    assert results(written(tmp_path), Kind.NOT_RUN) == set(plan.ALL)

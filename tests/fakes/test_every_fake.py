"""Features of every installed fake: wire faults, a power cycle, and a faster pace."""

from collections.abc import Iterator
from typing import Any

import pytest

from arcor2_fakes.two_axis_robot.servo import Servo
from arcor2_hw.testing.addresses import own_loopback
from arcor2_server.cli.installed_fakes import InstalledFake, installed_fakes
from tests.fakes.conftest import FakeProcess, run_fake

FAULTS = {"silence", "reset", "half_frame", "garbage", "slow", "refuse", "heal"}
ARGUMENTS = {name: ("--host", own_loopback()) for name in ("ur", "abb_yumi")}
"""These controllers have fixed ports, so each gets its own address."""
WORLD = "cell"
"""The world is not a device: it has a control channel and no wire."""

NO_CHECKSUM = {
    "abb_yumi": "HTTP and text over TCP",
    "barcode_reader": "lines of text",
    "conveyor": "a CAN controller drops such frames itself",
    "erp": "HTTP",
    "functional_tester": "Modbus TCP has none",
    "label_printer": "ZPL has none",
    "opcua_plc": "TCP's, and the library's own above it",
    "remote_io": "Modbus TCP has none; with --serial there is one",
    "scale": "MT-SICS has none",
    "screwdriver": "Open Protocol has none",
    "ur": "RTDE has none",
}
NO_PACE = {
    "barcode_reader": "reads within 0.15 s; its own time-out is --timeout",
    "erp": "none of its operations takes time",
    "label_printer": "--duration is its only time",
    "remote_io": "it has no motion; the host sets pulses and watchdogs",
    "scale": "--settling is its only time",
}
FOUND = [fake for fake in installed_fakes() if fake.module.startswith("arcor2_fakes.") and fake.name != WORLD]


@pytest.fixture(scope="module", params=FOUND, ids=[fake.name for fake in FOUND])
def running(request: pytest.FixtureRequest) -> Iterator[tuple[InstalledFake, FakeProcess]]:
    fake: InstalledFake = request.param
    process = FakeProcess(fake.name, *ARGUMENTS.get(fake.name, ()))
    process.truth()  # opens the control channel
    yield fake, process
    process.end()


def test_every_fake_has_the_common_faults(running: tuple[InstalledFake, FakeProcess]) -> None:
    fake, process = running
    commands = set(process.control.do("commands"))
    assert commands >= FAULTS | {"power_cycle", "truth"}
    assert ("wrong_checksum" in commands) is (fake.name not in NO_CHECKSUM)


def test_every_command_describes_its_parameters(running: tuple[InstalledFake, FakeProcess]) -> None:
    _, process = running
    described: list[dict[str, Any]] = process.control.do("describe")
    assert {each["name"] for each in described} | {"commands", "describe", "subscribe", "unsubscribe"} == set(
        process.control.do("commands")
    )
    slow = next(each for each in described if each["name"] == "slow")
    assert slow == {
        "name": "slow",
        "takes": ["[wire]", "seconds=1.0"],
        "text": "Let the wire send everything so many seconds late.",
    }


def test_every_fake_survives_a_power_cycle_and_all_faults(running: tuple[InstalledFake, FakeProcess]) -> None:
    _, process = running
    for fault in (*sorted(FAULTS - {"heal"}), "heal"):
        process.control.do(fault)
    process.control.do("power_cycle", within=30.0)
    process.truth()
    assert process.process.poll() is None


def test_fakes_with_durations_can_run_faster() -> None:
    names = {fake.name for fake in FOUND}
    offering = {name for name in names if "--time-scale" in run_fake(name, "--help").stdout}
    assert names - offering == set(NO_PACE) & names


class Clock:
    """A clock controlled by the test, and the factor by which the servo's clock is faster."""

    def __init__(self, scale: float) -> None:
        self.now, self.scale = 100.0, scale

    def __call__(self) -> float:
        return self.now * self.scale


def test_the_pace_does_not_affect_the_watchdog_of_the_servos() -> None:
    times, trips = [], []
    for clock in (Clock(1.0), Clock(10.0)):
        servo = Servo(1, clock, time_scale=clock.scale)
        assert servo.write(64, b"\x01") == 0
        assert servo.write(112, (100).to_bytes(4, "little")) == 0
        assert servo.write(116, (3000).to_bytes(4, "little")) == 0
        began = clock.now
        while servo.speed or servo.position != 3000:
            clock.now += 0.001
            servo.advance()
        times.append(clock.now - began)
        servo.restart_watchdog()
        assert servo.write(98, b"\x0a") == 0  # 0.2 s
        began = clock.now
        while servo["watchdog"] != 0xFF:
            clock.now += 0.005
            servo.advance()
        trips.append(clock.now - began)
    assert times[0] / times[1] == pytest.approx(10.0, rel=0.1)
    assert trips == pytest.approx([0.2, 0.2], abs=0.011)

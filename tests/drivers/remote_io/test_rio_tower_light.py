"""The tower light on the fake block: colours, blinking, patterns, and the state after a connection loss."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import TowerLightSettings
from arcor2_drivers.remote_io.tower_light import LampColor, TowerLight
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import DeviceFault, NotInControl, OutOfRange
from arcor2_hw.objects import MachineState
from arcor2_hw.objects.machine import MachineStateName
from tests.fakes.conftest import FakeProcess

LAMPS = {"red": "DO0", "amber": "DO1", "green": "DO2", "buzzer": "DO3"}


@pytest.fixture
def tower(fake: FakeProcess) -> Iterator[TowerLight]:
    host, _, port = fake.ready["modbus"].rpartition(":")
    settings = TowerLightSettings(
        host, int(port), watchdog=1, watchdog_ms=400, request_timeout=0.1, on_loss="red", blink_period=0.2, **LAMPS
    )
    tower = TowerLight("tower_id", "tower", settings)
    tower.connect()
    yield tower
    tower.disconnect()


def lamps(fake: FakeProcess) -> list[bool]:
    outputs = fake.truth()["outputs"]
    assert isinstance(outputs, list)
    return outputs[:3]


def test_colours_are_switched(fake: FakeProcess, tower: TowerLight) -> None:
    with pytest.raises(NotInControl, match="showing red is refused: nobody has control"):
        tower.show(LampColor.RED)
    assert fake.truth()["writes"] == 0
    tower.take_control()
    tower.show(LampColor.RED)
    assert lamps(fake) == [True, False, False]
    tower.show(LampColor.GREEN)
    assert lamps(fake) == [False, False, True]
    assert tower.lit() == {"red": False, "amber": False, "green": True}
    assert tower.shown_values == {"red": 0.0, "amber": 0.0, "green": 1.0}
    with pytest.raises(OutOfRange, match="has no blue lamp; there are red, amber, green"):
        tower.show(LampColor.BLUE)
    tower.off()
    assert lamps(fake) == [False, False, False]


def test_colours_blink(fake: FakeProcess, tower: TowerLight, wait_for: Callable[..., Any]) -> None:
    tower.take_control()
    tower.show(LampColor.AMBER, blinking=True)
    history = wait_for(lambda: fake.truth()["history"], lambda history: len(history) >= 8)
    assert [(change["output"], change["on"]) for change in history[:8]] == [(1, True), (1, False)] * 4
    period = (history[6]["time"] - history[0]["time"]) / 3.0
    assert period == pytest.approx(0.2, abs=0.1)
    tower.show(LampColor.RED)
    count = len(fake.truth()["history"])
    tower.buzz(0.3)
    after = fake.truth()["history"][count:]
    assert [(change["output"], change["on"]) for change in after] == [(3, True), (3, False)]  # no lamp blinks any more


def test_patterns_follow_states(fake: FakeProcess, tower: TowerLight, wait_for: Callable[..., Any]) -> None:
    tower.take_control()
    tower.show_state(MachineStateName.EXECUTE)
    assert lamps(fake) == [False, False, True]
    tower.show_state(MachineStateName.ABORTED)
    wait_for(lambda: lamps(fake), lambda lit: lit == [False, False, False])
    wait_for(lambda: lamps(fake), lambda lit: lit == [True, False, False])
    with pytest.raises(OutOfRange, match="no pattern for the state idle"):  # that pattern needs a white lamp
        tower.show_state(MachineStateName.IDLE)
    assert {state.value for state in MachineStateName} == {state.name.lower() for state in MachineState}


def test_the_safe_pattern_is_shown_after_a_loss(
    fake: FakeProcess, tower: TowerLight, wait_for: Callable[..., Any]
) -> None:
    tower.take_control()
    tower.show(LampColor.GREEN, blinking=True)
    fake.control.do("silence")
    wait_for(lambda: lamps(fake), lambda lit: lit == [True, False, False])
    fake.control.do("heal")
    wait_for(lambda: tower.connection, lambda state: state is Connection.BACK)
    tower.take_control()
    assert lamps(fake) == [True, False, False]
    tower.show(LampColor.GREEN)
    tower.disconnect()
    assert lamps(fake) == [True, False, False]


def test_a_tower_without_a_running_watchdog_stays_dark(fake: FakeProcess, tower: TowerLight) -> None:
    fake.control.do("watchdogs_start", on=False)
    with pytest.raises(DeviceFault, match=r"watchdog 1 does not run \(input register 10 is 0\)"):
        tower.take_control()
    for act in (lambda: tower.show(LampColor.GREEN), lambda: tower.buzz(0.1)):
        with pytest.raises(NotInControl, match="watchdog 1 does not run"):
            act()
    assert fake.truth()["history"] == []


def test_a_tower_light_and_a_block_share_a_device(
    fake: FakeProcess, tower: TowerLight, make: Callable[..., RemoteIO], wait_for: Callable[..., Any]
) -> None:
    block = make(fake.ready["modbus"])
    block.connect()
    block.take_control()
    tower.take_control()
    tower.show(LampColor.GREEN)
    block.write_digital("lamp", True)
    block.disconnect()
    outputs = fake.truth()["outputs"]
    assert (outputs[2], outputs[4]) == (True, False)
    assert tower.control_owner() == "us"


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({}, "^one of red, amber, green, blue, white must be the output of a lamp"),
        ({"red": "DI0"}, "^red must be a digital output"),
        ({"red": "DO99"}, "^red must use DO0 to DO15"),
        ({"red": "DO1", "green": "DO1"}, "^green must not use DO1"),
        ({"red": "DO1", "on_loss": "green"}, "^on_loss must be one of red"),
        ({"red": "DO1", "blink_period": 0.0}, "^blink_period must be 0.2 to 10"),
        ({"red": "DO1", "patterns": "idle"}, "^patterns must be a list of name="),
        ({"red": "DO1", "patterns": "sleeping=red"}, "^patterns must name a state of .*'sleeping'"),
        ({"red": "DO1", "patterns": "idle=red; idle=off"}, "^patterns must contain each name once"),
        ({"red": "DO1", "patterns": "idle=green blinking"}, "^patterns: 'green' for idle is not one of red, off"),
    ],
)
def test_tower_settings_name_the_parameter(settings: dict[str, Any], problem: str) -> None:
    with pytest.raises(OutOfRange, match=problem):
        TowerLightSettings(host="127.0.0.1", **settings)

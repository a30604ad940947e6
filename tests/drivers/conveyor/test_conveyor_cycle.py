"""The conveyor's driver against the fake: connecting, homing, moving, running, stopping and faults."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from arcor2_drivers.conveyor import cia402, emergencies
from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, NotFound, NotInControl, OutOfRange, Refused
from tests.drivers.background_call import BackgroundCall
from tests.fakes.conftest import FakeProcess

COUNTS = 10000


@contextmanager
def under_way(fake: FakeProcess, act: Callable[[], None]) -> Iterator[BackgroundCall]:
    """Run `act` in a thread and wait until the belt moves at 0.3 m/s."""
    doing = BackgroundCall(act)
    try:
        fake.control.wait_until(lambda t: abs(t["velocity"]) > 2900)
        yield doing
    finally:
        doing.outcome()


def test_connecting_observes_and_writes_nothing(fake: FakeProcess, observed: Conveyor) -> None:
    assert observed.connection is Connection.ONLINE
    assert observed.position().value == 0.0
    assert observed.position().age < 1.0
    assert observed.identify().serial == "1005"
    truth = fake.truth()
    assert truth["writes"] == []
    # the driver sends only read requests: initiate upload
    assert {f["data"][:2] for f in truth["frames"] if f["from_host"]} == {"40"}
    assert {f["id"] for f in truth["frames"] if f["from_host"]} == {0x605}
    with pytest.raises(NotInControl, match=r"^belt at socket://\S+ node 5: run with 0.1 m/s .*nobody has"):
        observed.run(0.1)


def test_the_heartbeat_monitor_is_armed_before_enabling(fake: FakeProcess, belt: Conveyor) -> None:
    truth = fake.truth()
    assert truth["consumer"] == 127 << 16 | 1000
    assert truth["abort_option"] == 3
    assert truth["nmt"] == 5
    assert truth["parameters"]["quick_stop_deceleration"] == 5 * COUNTS
    assert not [w for w in truth["writes"] if w["index"] == 0x6040]
    belt.release_control()
    assert fake.truth()["consumer"] == 0
    assert belt.control_owner() is None


def test_a_belt_homes_moves_runs_and_halts(fake: FakeProcess, make: Callable[..., Conveyor]) -> None:
    belt = make(fake.ready["can"], homing_method=19, homing_speed=1.0, max_speed=2.0, acceleration=10.0)
    belt.connect()
    belt.take_control()
    with pytest.raises(Refused, match=r"move_to 0.1 m is refused .*not homed"):
        belt.move_to(0.1)
    belt.home()
    assert belt.homed
    assert fake.truth()["belt"] == pytest.approx(4000, abs=1)  # the position of its switch
    belt.move_to(0.05, 1.0)
    assert fake.truth()["position"] == 500
    belt.move_by(-0.08, 1.0)
    assert fake.truth()["position"] == -300
    assert belt.belt_position() == pytest.approx(-0.03)
    belt.run(0.2)
    assert fake.truth()["velocity"] == pytest.approx(2000)
    assert belt.velocity().value == pytest.approx(0.2)
    assert belt.shown_values == {"velocity": 0.2}
    belt.run(-0.1)
    assert fake.truth()["velocity"] == pytest.approx(-1000)
    with pytest.raises(Refused, match=r"move_by .* while the belt moves"):
        belt.move_by(0.1)
    with pytest.raises(Refused, match="release_control"):
        belt.release_control()
    belt.halt()
    truth = fake.truth()
    assert (truth["velocity"], truth["state"]) == (0.0, "switched_on")
    belt.halt()
    belt.move_to(0.0, 0.5)
    assert fake.truth()["position"] == 0


def test_units_and_direction_are_scaled(fake: FakeProcess, make: Callable[..., Conveyor]) -> None:
    belt = make(fake.ready["can"], counts_per_metre=-20000.0)
    belt.connect()
    belt.take_control()
    belt.home()
    belt.move_to(0.02, 0.2)
    assert fake.truth()["position"] == -400
    assert fake.truth()["parameters"]["profile_velocity"] == 4000
    assert belt.belt_position() == pytest.approx(0.02)


@pytest.mark.parametrize("how", ["stop", "quick_stop"])
def test_stop_cancels_a_move_for_good(fake: FakeProcess, belt: Conveyor, how: str) -> None:
    with under_way(fake, lambda: belt.move_by(5.0, 0.3)) as doing:
        getattr(belt, how)()
        stood = fake.truth()
    assert stood["velocity"] == 0.0
    assert isinstance(doing.outcome(), Cancelled)
    assert stood["state"] == {"stop": "switched_on", "quick_stop": "switch_on_disabled"}[how]
    belt.move_by(0.01, 0.3)  # after enabling again only this move happens
    assert fake.truth()["belt"] == pytest.approx(stood["belt"] + 100, abs=2)


def test_a_fault_ends_the_move_with_its_text_and_is_reset(fake: FakeProcess, belt: Conveyor) -> None:
    belt.run(0.3)
    fake.control.do("follow_error")
    fake.control.wait_until(lambda t: t["state"] == "fault")
    with pytest.raises(DeviceFault, match="refused in state Fault: fault 8611h, following error; check that"):
        belt.run(0.1)
    assert belt.health is Health.FAILURE
    (alarm,) = belt.alarms()
    assert (alarm.code, alarm.text) == ("8611h", "following error")
    with pytest.raises(NotFound, match="4210h"):
        belt.acknowledge("4210h")
    fake.control.do("follow_error", on=False)
    belt.acknowledge("8611h")
    assert belt.alarms() == []
    assert fake.truth()["velocity"] == 0.0
    fake.control.do("emergency", code=0x4310, stands=True)
    fake.control.wait_until(lambda t: t["state"] == "fault")
    with pytest.raises(Refused, match="fault_reset is refused in state Fault"):
        belt.fault_reset()
    fake.control.do("cause_gone")
    belt.fault_reset()
    belt.fault_reset()  # has no effect without a fault


def test_an_emergency_message_ends_a_move(fake: FakeProcess, belt: Conveyor) -> None:
    with under_way(fake, lambda: belt.move_by(5.0, 0.3)) as doing:
        fake.control.do("emergency", code=0x2310)
    assert isinstance(doing.outcome(), DeviceFault)
    assert doing.outcome().fault_code == "2310h"
    assert "move_by 5 m ended: fault 2310h, continuous overcurrent" in str(doing.outcome())


def test_failed_homing_is_reported(fake: FakeProcess, belt: Conveyor) -> None:
    belt.home()
    fake.control.do("homing_fails")
    with pytest.raises(DeviceFault, match="homing error \\(method 37\\)"):
        belt.home()
    assert not belt.homed


def test_a_rejected_set_point_is_reported(fake: FakeProcess, belt: Conveyor) -> None:
    fake.control.do("handshake_stuck")
    with pytest.raises(DeviceTimeout, match=r"node 5: move_by 0.1 m: taking the set-point took longer than 1 s"):
        belt.move_by(0.1)
    assert fake.truth()["belt"] == 0.0
    fake.control.do("handshake_stuck", on=False)
    belt.move_by(0.01)


def test_out_of_range_is_refused_before_anything_is_sent(fake: FakeProcess, belt: Conveyor) -> None:
    written = len(fake.truth()["writes"])
    for act in (lambda: belt.move_to(101.0), lambda: belt.move_by(0.1, 0.6), lambda: belt.run(0.51)):
        with pytest.raises(OutOfRange, match=r"^belt at socket://\S+ node 5: "):
            act()
    assert len(fake.truth()["writes"]) == written


def test_control_is_refused_while_another_master_has_it(
    fake: FakeProcess, make: Callable[..., Conveyor], belt: Conveyor, wait_for: Callable[..., Any]
) -> None:
    other = make(fake.ready["can"], master_id=126)
    other.connect()
    wait_for(lambda: other._observer.received_heartbeat(127, 0.9))
    with pytest.raises(NotInControl, match="node 127, whose heartbeat the drive monitors, has it"):
        other.take_control()
    belt.run(0.05)
    belt.halt()
    belt.release_control()
    wait_for(lambda: not other._observer.received_heartbeat(127, 1.0))
    other.take_control()
    assert other.control_owner() == "us"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("channel", "socket://nowhere"),
        ("bitrate", 123),
        ("node_id", 0),
        ("master_id", 5),
        ("counts_per_metre", 0.0),
        ("max_speed", float("nan")),
        ("quick_stop_deceleration", 0.5),
        ("max_position", -200.0),
        ("homing_speed", 0.6),
        ("heartbeat_ms", 1001),
        ("sdo_timeout", 0.5),
    ],
)
def test_settings_are_checked_by_name(name: str, value: Any) -> None:
    with pytest.raises(OutOfRange, match=f"^{name} must"):
        ConveyorSettings(**({"channel": "/dev/ttyACM0"} | {name: value}))


def test_status_words_and_error_codes_are_decoded() -> None:
    assert cia402.power(0x0637) is cia402.Power.ENABLED
    assert cia402.power(0x0250) is cia402.Power.SWITCH_ON_DISABLED
    assert cia402.power(0x0218) is cia402.Power.FAULT
    assert cia402.power(0x0217) is cia402.Power.QUICK_STOP
    with pytest.raises(ValueError, match="006Fh"):
        cia402.power(0x006F)
    assert emergencies.fault_of(0x4123).text == "temperature"

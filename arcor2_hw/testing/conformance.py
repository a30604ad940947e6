"""Conformance: the cases that every driver has to pass, on each bench of a subclass.

class TestMyDrivers(Conformance):
    benches = (PressBench, OvenBench)
"""

import subprocess
import time
from collections.abc import Iterable
from typing import ClassVar, Final, cast

import pytest

from arcor2_hw.data.device import Connection, LossKind
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    Refused,
    Stale,
)
from arcor2_hw.objects import Generic
from arcor2_hw.testing import described
from arcor2_hw.testing.bench import Bench, knows_control, needs
from arcor2_hw.testing.life import (
    POLL,
    SLACK,
    Beside,
    held,
    left_behind,
    named,
    raised,
    stays,
    timed,
    wait_until,
)

DISCONNECTS_WITHIN: Final = 1.0
"""s that disconnect may take, whatever the wire does."""
WATCHED: Final = 0.5
"""s for which nothing may begin to move again."""
STARTS_WITHIN: Final = 15.0
"""s until a long act is seen to be under way; a process that imports a vendor's library needs some."""
GONE: Final = (NotConnected, ConnectionLost, DeviceTimeout, Stale)
"""What a call on a device that does not answer may raise."""
UP: Final = (Connection.ONLINE, Connection.BACK)


class Conformance:
    """The cases. A subclass named Test... sets `benches`; each needs the hooks named at it."""

    benches: ClassVar[Iterable[type[Bench]]] = ()

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        """Run every case on every bench."""
        if "arcor2_running_bench" in metafunc.fixturenames:
            benches = list(type(self).benches)
            names = [bench.type_name() for bench in benches]
            metafunc.parametrize("arcor2_running_bench", benches, indirect=True, ids=names, scope="class")

    # -------------------------------------------------------------------------------- what is written
    def test_described(self, arcor2_bench: Bench) -> None:
        """Metadata, docstrings, stop and state, loss_reaction and quality.yaml are in order; nothing is abstract."""
        wrong = described.faults(described.source_of(arcor2_bench.object_type))
        assert not wrong, "; ".join(wrong)
        assert not arcor2_bench.object_type.abstract()

    # -------------------------------------------------------------------------------- connecting
    def test_constructor_opens_nothing(self, arcor2_bench: Bench) -> None:
        """The constructor stores; there is no thread, no socket and no connection after it."""
        before = held()
        device = timed(arcor2_bench.new, 0.5, "the constructor")
        assert not (new := held() - before), f"the constructor opened {', '.join(sorted(new))}"
        assert device.connection is Connection.OFFLINE, f"it is {device.connection} before it was connected"

    def test_connect_is_idempotent(self, arcor2_bench: Bench) -> None:
        """Connecting twice is once, within the time-out."""
        device = arcor2_bench.new()
        for what in ("connect", "a second connect"):
            timed(lambda: device.connect(arcor2_bench.connect_timeout), arcor2_bench.connect_timeout, what)
            assert device.connection is Connection.ONLINE, f"after {what} it is {device.connection}"
            now = held()
            if what == "connect":
                before = now
        assert not (new := now - before), f"a second connect opened {', '.join(sorted(new))}"

    def test_disconnect_is_idempotent(self, arcor2_bench: Bench) -> None:
        """Disconnecting is harmless at any time, takes 1 s at most, and the object can be connected again."""
        device = arcor2_bench.new()
        device.disconnect()
        for _ in range(2):
            device.connect(arcor2_bench.connect_timeout)
            for what in ("disconnect", "a second disconnect"):
                timed(device.disconnect, DISCONNECTS_WITHIN, what)
                assert device.connection is Connection.OFFLINE, f"after {what} it is {device.connection}"

    def test_nothing_is_left_behind(self, arcor2_bench: Bench) -> None:
        """After disconnect there is no thread, socket or port left of three connections."""
        before = held()
        for _ in range(3):
            device = arcor2_bench.controlled()
            device.disconnect()
        left = left_behind(before)
        assert not left, f"after disconnect there is still {', '.join(sorted(left))}"

    @needs("writes")
    def test_connecting_observes(self, arcor2_bench: Bench) -> None:
        """Connecting, reading and disconnecting write, switch and move nothing (rule 1)."""
        before = arcor2_bench.writes()
        device = arcor2_bench.connected()
        if arcor2_bench.has("observe"):
            arcor2_bench.observe(device)
        assert arcor2_bench.writes() == before, "connecting acted on the device"
        if knows_control(type(device)):
            assert device.control_owner() != "us", "connecting took control"
        device.disconnect()
        assert arcor2_bench.writes() == before, "disconnecting acted on a device that was only observed"

    @needs("absent")
    def test_absent_device(self, arcor2_bench: Bench) -> None:
        """Where there is no device, connect says so within the time-out, naming object and address."""
        device, address = arcor2_bench.absent()
        arcor2_bench.keep(device)
        before = held()
        error = raised(
            lambda: device.connect(1.0), NotConnected, DeviceTimeout, within=1.0, what="connecting to nothing"
        )
        named(error, device.name, address, "connecting to nothing")
        assert device.connection is Connection.FAILED, f"it is {device.connection} after that"
        device.disconnect()
        left = left_behind(before)
        assert not left, f"an attempt that failed left {', '.join(sorted(left))}"

    @needs("cut", "heal")
    def test_connecting_to_a_silent_device(self, arcor2_bench: Bench) -> None:
        """A device that does not answer is a typed error within the time-out; once it answers, connect works."""
        device = arcor2_bench.new()
        arcor2_bench.cut()
        error = raised(lambda: device.connect(1.0), *GONE, within=1.0, what="connecting to a silent device")
        named(error, device.name, arcor2_bench.address, "connecting to a silent device")
        arcor2_bench.heal()
        device.connect(arcor2_bench.connect_timeout)
        assert device.connection is Connection.ONLINE

    # -------------------------------------------------------------------------------- losing the device
    @needs("cut", "heal", "ask")
    def test_silence_in_a_call(self, arcor2_bench: Bench) -> None:
        """A call on a device that fell silent raises a typed error in time, naming object and address."""
        device = arcor2_bench.controlled()
        arcor2_bench.cut()
        error = raised(lambda: arcor2_bench.ask(device), *GONE, within=arcor2_bench.call_within, what="the call")
        named(error, device.name, arcor2_bench.address, "a call on a silent device")
        timed(device.disconnect, DISCONNECTS_WITHIN, "disconnecting from a silent device")

    @needs("cut", "heal", "observe")
    def test_stale_is_an_error(self, arcor2_bench: Bench) -> None:
        """A reading from before the silence is not given out after `stale_after` s (rule 6)."""
        device = arcor2_bench.connected()
        arcor2_bench.observe(device)
        arcor2_bench.cut()
        time.sleep(arcor2_bench.stale_after)
        error = raised(
            lambda: arcor2_bench.observe(device), *GONE, within=arcor2_bench.call_within, what="an old reading"
        )
        named(error, device.name, arcor2_bench.address, "a stale reading")

    @needs("cut", "heal", "observe")
    def test_observation_comes_back(self, arcor2_bench: Bench) -> None:
        """A loss is told as lost; when the device answers again, observing goes on by itself."""
        device = arcor2_bench.connected()
        _lose(arcor2_bench, device)
        arcor2_bench.heal()
        _back(arcor2_bench, device)
        wait_until(lambda: _observed(arcor2_bench, device), arcor2_bench.back_within, "reading again after the loss")

    @needs("cut", "heal", "command")
    def test_control_does_not_come_back(self, arcor2_bench: Bench) -> None:
        """After a loss commands are refused until a person takes control again (rules 1 and 3)."""
        device = arcor2_bench.controlled()
        assert device.control_owner() == "us"
        _lose(arcor2_bench, device)
        arcor2_bench.heal()
        _back(arcor2_bench, device)
        assert device.control_owner() != "us", "control came back by itself"
        error = raised(
            lambda: arcor2_bench.command(device),
            NotInControl,
            within=arcor2_bench.call_within,
            what="a command without control",
        )
        assert device.name in str(error)

    @needs("cut", "heal", "run_long", "running")
    def test_nothing_resumes(self, arcor2_bench: Bench) -> None:
        """An act that was cut off ends with a typed error; when the device is back, nothing begins again (rule 3)."""
        device = arcor2_bench.controlled()
        act = _under_way(arcor2_bench, device)
        arcor2_bench.cut()
        error = act.outcome(arcor2_bench.lost_within + arcor2_bench.call_within, "an act on a device that is lost")
        assert isinstance(error, DeviceError), f"the act that was cut off gave {error!r}"
        if type(device).loss_reaction.kind is LossKind.STOPS_WITHIN:
            limit = type(device).loss_reaction.within
            wait_until(lambda: not arcor2_bench.running(), limit + SLACK, "the device's own reaction to the loss")
        arcor2_bench.heal()
        _back(arcor2_bench, device)
        stays(lambda: not arcor2_bench.running(), WATCHED, "it went on by itself when it was back")

    @needs("orphan", "running")
    def test_loss_reaction(self, arcor2_bench: Bench) -> None:
        """When the driver's process is killed in an act, the device reacts as declared (rule 2)."""
        reaction = arcor2_bench.object_type.loss_reaction
        process = subprocess.Popen(arcor2_bench.orphan())  # noqa: S603 - the bench's own words
        try:
            wait_until(arcor2_bench.running, STARTS_WITHIN, "the act of the process that will be killed")
        finally:
            process.kill()
            process.wait()
        if reaction.kind is LossKind.STOPS_WITHIN:
            wait_until(lambda: not arcor2_bench.running(), reaction.within + SLACK, "standing after the process died")
            stays(lambda: not arcor2_bench.running(), WATCHED, "it began again after its owner had died")
        elif reaction.kind is LossKind.CONTINUES:
            assert arcor2_bench.running(), "it is declared to continue, and stopped"

    # -------------------------------------------------------------------------------- control and stop
    @needs("foreign", "writes")
    def test_control_is_refused(self, arcor2_bench: Bench) -> None:
        """Control that somebody else has is refused, naming who, and nothing is written (rule 1)."""
        device = arcor2_bench.connected()
        with arcor2_bench.foreign():
            wait_until(lambda: device.control_owner() not in (None, "us"), 2.0, "seeing that somebody else has control")
            owner = device.control_owner()
            before = arcor2_bench.writes()
            error = raised(
                device.take_control, NotInControl, within=arcor2_bench.call_within, what="taking another's control"
            )
            assert str(owner) in str(error), f"the refusal does not name {owner!r}: {error}"
            assert arcor2_bench.writes() == before, "refused control acted on the device"

    @needs("command", "writes")
    def test_command_needs_control(self, arcor2_bench: Bench) -> None:
        """A command without control is refused and does nothing; with control it acts."""
        device = arcor2_bench.connected()
        before = arcor2_bench.writes()
        raised(
            lambda: arcor2_bench.command(device),
            NotInControl,
            within=arcor2_bench.call_within,
            what="a command without control",
        )
        assert arcor2_bench.writes() == before, "a command acted without control"
        device.take_control()
        arcor2_bench.command(device)
        assert arcor2_bench.writes() != before, "the bench's command does not act, or `writes` does not see it"

    @needs("run_long", "running")
    def test_stop_passes(self, arcor2_bench: Bench) -> None:
        """stop() comes past a running act, which ends as cancelled; the device stands and stays (rule 5)."""
        device = arcor2_bench.controlled()
        stop = getattr(device, "stop", None)
        assert callable(stop), "what runs for long needs a stop()"
        for pause in (0.0, 0.13):
            act = _under_way(arcor2_bench, device)
            time.sleep(pause)
            timed(stop, arcor2_bench.stops_within, "stop")
            assert not arcor2_bench.running(), "stop returned before the device stood"
            error = act.outcome(arcor2_bench.stops_within, "the act that was stopped")
            assert isinstance(error, Cancelled), f"the act that was stopped gave {error!r}, not Cancelled"
        stays(lambda: not arcor2_bench.running(), WATCHED, "it began again after the stop")

    @needs("run_long", "running")
    def test_one_act_at_a_time(self, arcor2_bench: Bench) -> None:
        """A second act beside the first is refused, and the first goes on (rule 8)."""
        device = arcor2_bench.controlled()
        act = _under_way(arcor2_bench, device)
        raised(
            lambda: arcor2_bench.run_long(device), Refused, within=arcor2_bench.call_within, what="a second act beside"
        )
        assert not act.over, f"the first act ended by that: {act.error!r}"
        cast("Stopping", device).stop()
        act.outcome(arcor2_bench.stops_within, "the first act")

    @needs("run_long", "running")
    def test_disconnecting_ends_an_act(self, arcor2_bench: Bench) -> None:
        """disconnect in the middle of an act takes 1 s at most; the act ends, typed, and nobody waits for ever."""
        device = arcor2_bench.controlled()
        act = _under_way(arcor2_bench, device)
        timed(device.disconnect, DISCONNECTS_WITHIN, "disconnecting in an act")
        error = act.outcome(arcor2_bench.call_within, "the act whose connection was closed")
        assert isinstance(error, DeviceError), f"the act whose connection was closed gave {error!r}"


class Stopping(Generic):
    """What has a stop; for the type checker."""

    def stop(self) -> None:
        """Stop."""


def _under_way(bench: Bench, device: Generic) -> Beside:
    act = Beside(lambda: bench.run_long(device))
    wait_until(lambda: bench.running() or act.over, STARTS_WITHIN, "the act of run_long")
    assert not act.over, f"the act of run_long ended at once: {act.error!r}"
    return act


def _lose(bench: Bench, device: Generic) -> None:
    bench.cut()
    wait_until(lambda: device.connection is Connection.LOST, bench.lost_within, "telling that the connection is lost")


def _back(bench: Bench, device: Generic) -> None:
    wait_until(lambda: device.connection in UP, bench.back_within, "being connected again")


def _observed(bench: Bench, device: Generic) -> bool:
    try:
        bench.observe(device)
    except (Stale, ConnectionLost):  # the first reading is still to come
        time.sleep(POLL)
        return False
    return True

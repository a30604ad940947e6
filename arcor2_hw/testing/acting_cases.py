"""Test cases of actions: control, stop, cancellation, one action at a time."""

import contextlib
import random
import time
from functools import partial
from typing import Final

from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceFault, NotInControl, Refused
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.methods import STOP_RACE_TIME
from arcor2_hw.testing.bench import Bench, needs
from arcor2_hw.testing.connecting_cases import DISCONNECT_TIMEOUT
from arcor2_hw.testing.life import TIME_TOLERANCE, require_error, require_in_time, require_throughout, wait_until
from arcor2_hw.testing.steps import START_TIMEOUT, WATCH_TIME, on_lanes, start_action, stop_of

ASK_TIMEOUT: Final = 20.0
"""Time limit of `ask` of a bench, s. For some devices it is a motion."""


class ActingCases:
    """Cases of control and stopping."""

    @needs("foreign", "writes")
    def test_control_is_refused(self, arcor2_bench: Bench) -> None:
        """Taking control is refused while another client has it; the error names it, nothing is written (rule 1)."""
        device = arcor2_bench.connected()
        with arcor2_bench.foreign():
            wait_until(lambda: device.control_owner() not in (None, "us"), 2.0, "reporting the other owner of control")
            owner = device.control_owner()
            before = arcor2_bench.writes()
            error = require_error(
                device.take_control,
                NotInControl,
                within=arcor2_bench.call_within,
                what="taking control from another client",
            )
            assert str(owner) in str(error), f"the error does not name {owner!r}: {error}"
            assert arcor2_bench.writes() == before, "taking control was refused, but acted on the device"

    @needs("command", "writes")
    def test_command_needs_control(self, arcor2_bench: Bench) -> None:
        """A command without control is refused without effect; with control it acts."""
        device = arcor2_bench.connected()
        before = arcor2_bench.writes()
        require_error(
            lambda: arcor2_bench.command(device),
            NotInControl,
            within=arcor2_bench.call_within,
            what="a command without control",
        )
        assert arcor2_bench.writes() == before, "a command without control acted on the device"
        device.take_control()
        arcor2_bench.command(device)
        assert arcor2_bench.writes() != before, "`command` of the bench does not act, or `writes` does not detect it"

    @needs("run_long", "running")
    def test_stop_passes(self, arcor2_bench: Bench) -> None:
        """stop() interrupts an action, which ends as cancelled. The device stops and remains stopped (rule 5)."""
        device = arcor2_bench.controlled()
        stop = stop_of(device)
        for pause in (0.0, 0.13):
            act = start_action(arcor2_bench, device)
            time.sleep(pause)
            require_in_time(stop, arcor2_bench.stops_within, "stop")
            assert not arcor2_bench.running(), "stop() returned before the device was at standstill"
            error = act.outcome(arcor2_bench.stops_within, "the stopped action")
            assert isinstance(error, Cancelled), f"the stopped action ended with {error!r}, not Cancelled"
        require_throughout(lambda: not arcor2_bench.running(), WATCH_TIME, "the device started again after the stop")

    @needs("run_long", "running")
    def test_one_act_at_a_time(self, arcor2_bench: Bench) -> None:
        """A second action during the first is refused, and the first continues (rule 8)."""
        device = arcor2_bench.controlled()
        act = start_action(arcor2_bench, device)
        require_error(
            lambda: arcor2_bench.run_long(device), Refused, within=arcor2_bench.call_within, what="a second action"
        )
        assert not act.over, f"the second action ended the first: {act.error!r}"
        stop_of(device)()
        act.outcome(arcor2_bench.stops_within, "the first action")

    @needs("run_long", "running")
    def test_disconnecting_ends_an_act(self, arcor2_bench: Bench) -> None:
        """disconnect() during an action takes at most 1 s, and the action ends with a typed error."""
        device = arcor2_bench.controlled()
        act = start_action(arcor2_bench, device)
        require_in_time(device.disconnect, DISCONNECT_TIMEOUT, "disconnecting during an action")
        error = act.outcome(arcor2_bench.call_within, "the disconnected action")
        assert isinstance(error, DeviceError), f"the disconnected action ended with {error!r}"

    @needs("run_long", "running", like="stop_passes")
    def test_stop_at_random_phases(self, arcor2_bench: Bench, arcor2_phases: random.Random) -> None:
        """A stop at any moment ends the action as cancelled. The device stops and remains stopped."""
        device = arcor2_bench.controlled()
        held = on_lanes(device)
        try:
            for phase in (arcor2_phases.uniform(STOP_RACE_TIME, 0.6) for _ in range(3)):
                act = Job("act", lambda: arcor2_bench.run_long(device))
                held.lane.submit(act)
                time.sleep(phase)
                when = f"{phase:.3f} s after the start of the action"
                assert not act.ended, f"the action had ended {when}: {act.error!r}"
                stop, _ = held.begin_stop() or (None, None)
                assert stop is not None, "a device with run_long must have a stop()"
                wait_until(partial(stop.wait, 0.0), arcor2_bench.stops_within + TIME_TOLERANCE, f"stop {when}")
                stop.outcome()
                wait_until(
                    partial(act.wait, 0.0),
                    arcor2_bench.stops_within + TIME_TOLERANCE,
                    f"the action after a stop {when}",
                )
                assert isinstance(act.error, Cancelled), (
                    f"stopped {when}, the action ended with {act.error!r}, not Cancelled"
                )
                assert not arcor2_bench.running(), f"stopped {when}, the device still runs"
        finally:
            held.release_lanes()
        require_throughout(
            lambda: not arcor2_bench.running(), WATCH_TIME / 2, "the device started again after the stop"
        )

    @needs("run_long", "running", "observe", like="stop_passes")
    def test_cancelling_leaves_the_line_usable(self, arcor2_bench: Bench) -> None:
        """After a call was cancelled, the next calls get their own answers (rule 8)."""
        device = arcor2_bench.controlled()
        kinds = type(arcor2_bench.observe(device))
        held = on_lanes(device)
        try:
            act = Job("act", lambda: arcor2_bench.run_long(device))
            held.lane.submit(act)
            wait_until(lambda: arcor2_bench.running() or act.ended, START_TIMEOUT, "run_long")
            stop, _ = held.begin_stop() or (None, None)
            assert stop is not None, "a device with run_long must have a stop()"
            wait_until(partial(stop.wait, 0.0), arcor2_bench.stops_within + TIME_TOLERANCE, "stop")
            wait_until(partial(act.wait, 0.0), arcor2_bench.stops_within + TIME_TOLERANCE, "the action after the stop")
            for _ in range(3):
                given = held.lane.call(
                    "observe", lambda: arcor2_bench.observe(device), deadline=arcor2_bench.call_within + TIME_TOLERANCE
                )
                assert type(given) is kinds, (
                    f"after the cancelled call a reading returned {given!r}, the answer of another call"
                )
            if arcor2_bench.has("ask"):
                with contextlib.suppress(Refused, DeviceFault):  # a refusal is an answer too
                    held.lane.call("ask", lambda: arcor2_bench.ask(device), deadline=ASK_TIMEOUT)
        finally:
            held.release_lanes()

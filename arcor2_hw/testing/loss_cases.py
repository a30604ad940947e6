"""Test cases of connection loss: silence, reset, half a frame, a killed process; nothing resumes by itself."""

import time

from arcor2_hw.data.device import LossKind
from arcor2_hw.exceptions import DeviceError, NotInControl
from arcor2_hw.testing.bench import Bench, needs
from arcor2_hw.testing.connecting_cases import DISCONNECT_TIMEOUT
from arcor2_hw.testing.life import TIME_TOLERANCE, named, require_error, require_in_time, require_throughout, wait_until
from arcor2_hw.testing.steps import (
    LOSS_ERRORS,
    START_TIMEOUT,
    WATCH_TIME,
    await_connection,
    await_reading,
    cut_and_await_loss,
    observed,
    require_continuation,
    start_action,
)


class LossCases:
    """Cases in which the device is lost and comes back."""

    @needs("cut", "heal", "ask")
    def test_silence_in_a_call(self, arcor2_bench: Bench) -> None:
        """A call of a silent device raises a typed error in time, which names object and address."""
        device = arcor2_bench.controlled()
        arcor2_bench.cut()
        error = require_error(
            lambda: arcor2_bench.ask(device), *LOSS_ERRORS, within=arcor2_bench.call_within, what="the call"
        )
        named(error, device.name, arcor2_bench.address, "a call of a silent device")
        require_in_time(device.disconnect, DISCONNECT_TIMEOUT, "disconnecting from a silent device")

    @needs("cut", "heal", "observe")
    def test_stale_is_an_error(self, arcor2_bench: Bench) -> None:
        """A reading from before the cut is not returned after `stale_after` (rule 6)."""
        device = arcor2_bench.connected()
        arcor2_bench.observe(device)
        arcor2_bench.cut()
        time.sleep(arcor2_bench.stale_after)
        error = require_error(
            lambda: arcor2_bench.observe(device), *LOSS_ERRORS, within=arcor2_bench.call_within, what="an old reading"
        )
        named(error, device.name, arcor2_bench.address, "a stale reading")

    @needs("cut", "heal", "observe")
    def test_observation_comes_back(self, arcor2_bench: Bench) -> None:
        """A loss is reported as lost; when the device answers again, observation resumes by itself."""
        device = arcor2_bench.connected()
        cut_and_await_loss(arcor2_bench, device)
        arcor2_bench.heal()
        await_connection(arcor2_bench, device)
        wait_until(lambda: observed(arcor2_bench, device), arcor2_bench.back_within, "a reading after the loss")

    @needs("cut", "heal", "command")
    def test_control_does_not_come_back(self, arcor2_bench: Bench) -> None:
        """After a loss, commands are refused until a user takes control again (rules 1 and 3)."""
        device = arcor2_bench.controlled()
        assert device.control_owner() == "us"
        cut_and_await_loss(arcor2_bench, device)
        arcor2_bench.heal()
        await_connection(arcor2_bench, device)
        assert device.control_owner() != "us", "control was taken again without a request"
        error = require_error(
            lambda: arcor2_bench.command(device),
            NotInControl,
            within=arcor2_bench.call_within,
            what="a command without control",
        )
        assert device.name in str(error)

    @needs("cut", "heal", "run_long", "running")
    def test_nothing_resumes(self, arcor2_bench: Bench) -> None:
        """An interrupted action ends with a typed error. When the device is back, nothing starts again (rule 3)."""
        device = arcor2_bench.controlled()
        act = start_action(arcor2_bench, device)
        arcor2_bench.cut()
        error = act.outcome(arcor2_bench.lost_within + arcor2_bench.call_within, "an action of a lost device")
        assert isinstance(error, DeviceError), f"the interrupted action ended with {error!r}"
        if type(device).loss_reaction.kind is LossKind.STOPS_WITHIN:
            limit = type(device).loss_reaction.within
            wait_until(
                lambda: not arcor2_bench.running(), limit + TIME_TOLERANCE, "the reaction of the device to the loss"
            )
        arcor2_bench.heal()
        await_connection(arcor2_bench, device)
        if type(device).loss_reaction.kind is LossKind.CONTINUES:
            wait_until(lambda: not arcor2_bench.running(), arcor2_bench.back_within, "the end of the continued action")
        require_throughout(
            lambda: not arcor2_bench.running(), WATCH_TIME, "the device continued by itself after the loss"
        )

    @needs("orphan", "running", "holding", "progress")
    def test_loss_reaction(self, arcor2_bench: Bench) -> None:
        """When the process of the driver is killed during an action, the device reacts as declared (rule 2)."""
        reaction = arcor2_bench.object_type.loss_reaction
        holds = reaction.kind is LossKind.HOLDS

        process = arcor2_bench.start_orphan()

        def acts() -> bool:
            nonlocal process
            if process.poll() is not None:  # on a busy computer it may have lost the device
                process = arcor2_bench.start_orphan()
            return bool(arcor2_bench.holding()) and not arcor2_bench.running() if holds else arcor2_bench.running()

        try:
            wait_until(acts, START_TIMEOUT, "the action of the process to be killed")
            held = arcor2_bench.holding() if holds else None
        finally:
            process.kill()
            process.wait()
        if reaction.kind is LossKind.CONTINUES:
            require_continuation(arcor2_bench)
            return
        if holds:
            what = f"the device is declared to hold, but after the process was killed it no longer holds {held!r}"
            require_throughout(lambda: arcor2_bench.holding() == held, arcor2_bench.loss_watched, what)
        else:
            wait_until(
                lambda: not arcor2_bench.running(),
                reaction.within + TIME_TOLERANCE,
                "standstill after the process was killed",
            )
        require_throughout(
            lambda: not arcor2_bench.running(), WATCH_TIME, "the device started again after the process was killed"
        )

    @needs("reset_link", "observe", for_silver=True)
    def test_reset_and_back(self, arcor2_bench: Bench) -> None:
        """A connection that was reset is opened again, even if the loss was too short to be reported."""
        device = arcor2_bench.connected()
        arcor2_bench.observe(device)
        arcor2_bench.reset_link()
        time.sleep(arcor2_bench.stale_after)  # until then, a reading may be older than the reset
        await_reading(arcor2_bench, device)

    @needs("half_frame", "heal", "ask", "observe", for_silver=True)
    def test_half_a_frame(self, arcor2_bench: Bench) -> None:
        """An incomplete answer raises a typed error in time. Afterwards everything works again."""
        device = arcor2_bench.controlled()
        arcor2_bench.observe(device)
        arcor2_bench.half_frame()
        require_error(
            lambda: arcor2_bench.ask(device), DeviceError, within=arcor2_bench.call_within, what="an incomplete answer"
        )
        arcor2_bench.heal()
        await_reading(arcor2_bench, device)

"""Test cases of connection loss: silence, reset, half a frame, a killed process; nothing resumes by itself."""

import subprocess
import time

from arcor2_hw.data.device import LossKind
from arcor2_hw.exceptions import DeviceError, NotInControl
from arcor2_hw.testing.bench import Bench, needs
from arcor2_hw.testing.connecting_cases import DISCONNECTS_WITHIN
from arcor2_hw.testing.life import SLACK, named, raised, stays, timed, wait_until
from arcor2_hw.testing.steps import GONE, STARTS_WITHIN, WATCHED, back, lose, observed, seen_again, under_way


class LossCases:
    """Cases in which the device is lost and comes back."""

    @needs("cut", "heal", "ask")
    def test_silence_in_a_call(self, arcor2_bench: Bench) -> None:
        """A call on a silent device raises a typed error in time that names object and address."""
        device = arcor2_bench.controlled()
        arcor2_bench.cut()
        error = raised(lambda: arcor2_bench.ask(device), *GONE, within=arcor2_bench.call_within, what="the call")
        named(error, device.name, arcor2_bench.address, "a call on a silent device")
        timed(device.disconnect, DISCONNECTS_WITHIN, "disconnecting from a silent device")

    @needs("cut", "heal", "observe")
    def test_stale_is_an_error(self, arcor2_bench: Bench) -> None:
        """A reading from before the silence is not returned after `stale_after` (rule 6)."""
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
        """A loss is reported as lost; when the device answers again, observation resumes by itself."""
        device = arcor2_bench.connected()
        lose(arcor2_bench, device)
        arcor2_bench.heal()
        back(arcor2_bench, device)
        wait_until(lambda: observed(arcor2_bench, device), arcor2_bench.back_within, "reading again after the loss")

    @needs("cut", "heal", "command")
    def test_control_does_not_come_back(self, arcor2_bench: Bench) -> None:
        """After a loss, commands are refused until a user takes control again (rules 1 and 3)."""
        device = arcor2_bench.controlled()
        assert device.control_owner() == "us"
        lose(arcor2_bench, device)
        arcor2_bench.heal()
        back(arcor2_bench, device)
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
        """An interrupted act ends with a typed error; when the device is back, nothing starts again (rule 3)."""
        device = arcor2_bench.controlled()
        act = under_way(arcor2_bench, device)
        arcor2_bench.cut()
        error = act.outcome(arcor2_bench.lost_within + arcor2_bench.call_within, "an act on a device that is lost")
        assert isinstance(error, DeviceError), f"the act that was cut off gave {error!r}"
        if type(device).loss_reaction.kind is LossKind.STOPS_WITHIN:
            limit = type(device).loss_reaction.within
            wait_until(lambda: not arcor2_bench.running(), limit + SLACK, "the device's own reaction to the loss")
        arcor2_bench.heal()
        back(arcor2_bench, device)
        stays(lambda: not arcor2_bench.running(), WATCHED, "it went on by itself when it was back")

    @needs("orphan", "running")
    def test_loss_reaction(self, arcor2_bench: Bench) -> None:
        """When the driver's process is killed during an act, the device reacts as declared (rule 2)."""
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

    @needs("reset_link", "observe", for_silver=True)
    def test_reset_and_back(self, arcor2_bench: Bench) -> None:
        """A connection that is reset is opened again by itself, even if the loss was too short to be reported."""
        device = arcor2_bench.connected()
        arcor2_bench.observe(device)
        arcor2_bench.reset_link()
        time.sleep(arcor2_bench.stale_after)  # until then, a reading may be from before
        seen_again(arcor2_bench, device)

    @needs("half_frame", "heal", "ask", "observe", for_silver=True)
    def test_half_a_frame(self, arcor2_bench: Bench) -> None:
        """An incomplete answer is a typed error in time, never a value; afterwards everything works again."""
        device = arcor2_bench.controlled()
        arcor2_bench.observe(device)
        arcor2_bench.half_frame()
        raised(lambda: arcor2_bench.ask(device), DeviceError, within=arcor2_bench.call_within, what="half an answer")
        arcor2_bench.heal()
        seen_again(arcor2_bench, device)

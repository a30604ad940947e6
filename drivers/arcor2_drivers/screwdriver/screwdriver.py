"""The object type of a screwdriver: a tightening tool whose controller speaks Open Protocol."""

import contextlib
import time
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import Timestamp, now
from arcor2_hw.data.device import Alarm, Health, Identity, LossReaction, Severity
from arcor2_hw.exceptions import DeviceError, DeviceFault, NotFound, Refused
from arcor2_hw.messages import Message, translatable
from arcor2_hw.objects import Generic
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.polled_control import PolledControl

from .controller import Controller, State, Unsupported
from .settings import OpenProtocolScrewdriverSettings
from .telegrams import Mid, Result

MAX_TIGHTENING_TIME: Final = 3600.0
"""Longest time that a program may wait for results in one call, s."""
MARGIN: Final = 15.0
"""Time beyond MAX_TIGHTENING_TIME for enabling and disabling the tool with the longest allowed time limits, s."""
LATE_RESULT: Final = 1.0
"""Time in which the result of an interrupted tightening arrives, s. No other tightening starts until then."""
TWO_DIGITS: Final = 99
"""Highest job number of revision 1 of MID 0038."""


class OpenProtocolScrewdriver(PolledControl[State], Generic):
    """A screwdriver or nutrunner whose controller speaks Open Protocol, of Atlas Copco and others."""

    _ABSTRACT = False
    display_name = "Screwdriver (Open Protocol)"
    category = "Machines"
    icon = "machine"
    # The controller finishes a tightening and leaves the tool as it is, unless it is configured to lock the tool.
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"tighten": "stop"}

    def __init__(self, obj_id: str, name: str, settings: OpenProtocolScrewdriverSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._controller = Controller(name, settings, self.on_lost)
        self.use_link(self._controller.line, self._controller)
        self._alarms_since: dict[str, Timestamp] = {}
        self._late_until = 0.0

    # -------------------------------------------------------------------------------- condition
    def identify(self) -> Identity:
        """Return the identity that the controller reported at the start of communication, if it still answers."""
        self.fresh()
        return self._controller.identity

    def counters(self) -> dict[str, int]:
        """Read the tightenings of the tool, and those since its service if the controller reports them."""
        self.fresh()
        try:
            return self._controller.tool_counters()
        except Unsupported:
            return {}

    def condition(self) -> Health:
        """Return whether alarms are active, and whether they block the controller or the tool."""
        state = self.newest() or State()
        return Health.NORMAL if not state.alarms else Health.CHECK_FUNCTION if state.ready else Health.FAILURE

    def alarms(self) -> list[Alarm]:
        """Return the active alarms of the controller."""
        present = self.current().alarms
        self._alarms_since = {alarm.code: self._alarms_since.get(alarm.code, now()) for alarm in present}
        remedy = translatable("see the manual of the controller, then acknowledge")
        return [
            Alarm.of(
                alarm.code,
                Severity.WARNING if alarm.ready else Severity.ERROR,
                alarm.text or Message.of("alarm {code} of the controller", code=alarm.code),
                remedy,
                self._alarms_since[alarm.code],
            )
            for alarm in present
        ]

    def acknowledge(self, code: str) -> None:
        """Acknowledge an alarm at the controller. Raises NotFound, NotInControl, Refused, DeviceTimeout."""
        if code not in {alarm.code for alarm in self.fresh().alarms}:
            raise NotFound("{device} has no alarm {code}", device=self.who, code=code)
        what = f"acknowledging alarm {code}"
        self.send(what, lambda: self._controller.request(Mid.CLEAR_ALARM))
        self.wait(
            lambda state: code not in {alarm.code for alarm in state.alarms}, self._controller.answers_within, what
        )

    # -------------------------------------------------------------------------------- control
    def is_busy(self, state: State) -> bool:
        """Return whether the tool was enabled."""
        return state.enabled

    def send_stop(self) -> None:
        """Disable the tool."""
        self._controller.enable(False)

    def leave(self) -> None:
        """Disable the tool while disconnecting, without waiting for the reply."""
        if self.in_control and (newest := self.newest()) is not None and newest.enabled:
            self.stop_waiting()
            self._controller.send(Mid.DISABLE_TOOL)

    # -------------------------------------------------------------------------------- actions
    @action
    def select_program(self, program: int, *, an: str | None = None) -> None:
        """Select the tightening program (parameter set) of the controller.

        :param program: number of the program
        """
        assert 1 <= program <= 999

        self._request(Mid.SELECT_PROGRAM, b"%03d" % program)

    @action
    def select_job(self, job: int, *, an: str | None = None) -> None:
        """Select a job, a sequence of tightenings that is stored in the controller.

        :param job: number of the job; 0: no job
        """
        assert 0 <= job <= 9999

        if job <= TWO_DIGITS:
            self._request(Mid.SELECT_JOB, b"%02d" % job)
        else:
            self._request(Mid.SELECT_JOB, b"%04d" % job, revision=2)

    @action
    def enable_tool(self, *, an: str | None = None) -> None:
        """Enable the tool: its trigger starts a tightening."""
        self._require_ready("enable_tool")
        self.send("enable_tool", lambda: self._controller.enable(True))

    @action
    def disable_tool(self, *, an: str | None = None) -> None:
        """Disable the tool."""
        self.send("disable_tool", lambda: self._controller.enable(False))

    @action(deadline=MAX_TIGHTENING_TIME + MARGIN)
    def tighten(self, count: int = 1, timeout: float = 60.0, *, an: str | None = None) -> tuple[bool, float, float]:
        """Enable the tool, wait for tightenings and disable it; return whether all are OK, and torque and angle.

        Torque, in N m, and angle, in °, are those of the last tightening.

        :param count: number of tightenings
        :param timeout: time limit for all of them, s
        """
        assert 1 <= count <= 99
        assert 1.0 <= timeout <= 3600.0

        with self.act("tighten") as go_on:
            results = self._tighten(count, timeout, go_on)
        return all(result.ok for result in results), results[-1].torque, results[-1].angle_degrees

    def _tighten(self, count: int, timeout: float, go_on: GoOn) -> tuple[Result, ...]:
        what = "one tightening" if count == 1 else f"{count} tightenings"
        self._await_late_result(go_on)
        before = self._require_ready("tighten").total
        self.send("tighten", lambda: self._controller.enable(True), go_on)

        def finished(state: State) -> bool:
            if not state.ready:
                raise self._blocked(state, what)
            return state.total - before >= count

        try:
            after = self.wait(finished, timeout, what, go_on)
        except BaseException:
            self._late_until = time.monotonic() + LATE_RESULT
            with contextlib.suppress(DeviceError):  # after a connection loss the controller decides
                self._controller.enable(False)
            raise
        self._controller.enable(False)
        return after.results_since(before)[:count]

    @action(quick=True, again="safe")
    def last_result(self, *, an: str | None = None) -> tuple[bool, float, float]:
        """Return whether the last tightening is OK, its torque in N m and its angle in °."""
        state = self.current()
        if not state.results:
            raise Refused("{device} has reported no result yet", device=self.who)
        last = state.results[-1]
        return last.ok, last.torque, last.angle_degrees

    @action(quick=True, again="safe")
    def ready(self, *, an: str | None = None) -> bool:
        """Return whether no alarm blocks the controller or the tool."""
        return self.current().ready

    # -------------------------------------------------------------------------------- checks
    def _request(self, mid: Mid, data: bytes, revision: int = 1) -> None:
        self.send(mid.name.lower(), lambda: self._controller.request(mid, data, revision))

    def _require_ready(self, operation: str) -> State:
        self.require_control(operation)
        state = self.current()
        if not state.ready:
            raise self._blocked(state, operation)
        return state

    def _blocked(self, state: State, operation: str) -> DeviceFault:
        alarm = next(each for each in state.alarms if not each.ready)
        return DeviceFault(
            "{device}: {what} is not possible: alarm {code} {text}",
            fault_code=alarm.code,
            device=self.who,
            what=operation,
            code=alarm.code,
            text=alarm.text,
        )

    def _await_late_result(self, go_on: GoOn) -> None:
        while time.monotonic() < self._late_until:
            go_on()
            time.sleep(0.02)

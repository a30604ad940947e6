"""A scale with MT-SICS commands as an object type: weighs, tares and zeroes, and never gives an old value for a new."""

import contextlib
import math
import time
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction, Reading, Severity
from arcor2_hw.exceptions import (
    Cancelled,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotFound,
    OutOfRange,
    Refused,
    Stale,
)
from arcor2_hw.objects import Scale
from arcor2_hw.objects.asked_line import AskedLine
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from . import sics
from .settings import MtSicsScaleSettings
from .sics import Answer

STATUS_PERIOD: Final = 0.5
"""s between looks at the scale while nobody asks."""
LOOK_AGAIN: Final = 0.03
"""s between questions whether the load has come to rest; a scale makes some 20 values a second."""
OUTSIDE_FOR: Final = 0.5
"""s outside the range before that is a fault: a part that is put down hits the pan harder than it weighs."""
DEADLINE: Final = 90.0
CANCEL: Final = b"@\r\n"
"""Forgets what is asked and not answered, and the tare as well: never sent but after a tare or zero that failed."""

TARE_TOLERANCE: Final = 1.5e-5
"""kg: rounding, when the unit was switched at the scale."""

OVERLOAD, UNDERLOAD, TARE_LOST = "overload", "underload", "tare_lost"
_COMPLAINTS: Final = {
    OVERLOAD: ("the load is above the weighing range", "take the load off"),
    UNDERLOAD: ("the load is below the weighing range", "put the pan in its place and zero the scale"),
    TARE_LOST: ("the scale has lost its tare, by a restart or at its keys", "tare it again, or acknowledge this"),
}


class MtSicsScale(Scale):
    """A scale with MT-SICS commands, on a serial line or TCP."""

    _ABSTRACT = False
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"weight": "stop", "weight_within": "stop"}

    def __init__(self, obj_id: str, name: str, settings: MtSicsScaleSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._line = AskedLine(
            f"{name} at {settings.port}",
            settings.port,
            settings.baud_rate,
            settings.answer_timeout,
            self._greet,
            self._look,
            STATUS_PERIOD,
            self._unasked,
        )
        self._who = self._line.who
        self._answer_timeout, self._stable_timeout = settings.answer_timeout, settings.stable_timeout
        self._stops = 0
        self._newest: Reading[float] | None = None
        self._tare: float | None = None  # kg, as the scale said when we tared or zeroed; None before
        self._alarms: dict[str, Alarm] = {}

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Open the port and ask the scale who it is and what it shows, within `timeout` s; nothing is changed by that.

        Raises NotConnected or DeviceTimeout naming the port.
        """
        self._line.observing.start(timeout)

    def disconnect(self) -> None:
        """Close; harmless when closed. Tare and zero stay in the scale."""
        self._stops += 1
        self._line.close()
        self._newest = None

    @property
    def connection(self) -> Connection:
        """Tell how the line is."""
        return self._line.observing.state

    @property
    def health(self) -> Health:
        """Give failure when the scale is lost, off_spec outside its range, check_function with the tare lost."""
        if self.connection in (Connection.LOST, Connection.FAILED):
            return Health.FAILURE
        if {OVERLOAD, UNDERLOAD} & self._alarms.keys():
            return Health.OFF_SPEC
        return Health.CHECK_FUNCTION if self._alarms else Health.NORMAL

    def alarms(self) -> list[Alarm]:
        """Give overload, underload and tare_lost; the first two end with their cause."""
        return list(self._alarms.values())

    def acknowledge(self, code: str) -> None:
        """Accept the tare that the scale has now (code tare_lost). Raises NotFound for another code."""
        if code != TARE_LOST or TARE_LOST not in self._alarms:
            raise NotFound(f"{self._who} has no alarm {code!r} to be acknowledged")
        self._tare = None
        self._alarm(TARE_LOST, False)

    def identify(self) -> Identity:
        """Ask the scale who it is; MT-SICS has no word for the vendor."""
        with self._line.held():
            model, firmware, serial = (self._ask(command).text for command in ("I2", "I3", "I4"))
        return Identity("", model, serial, firmware)

    # -------------------------------------------------------------------------------- weighing
    def weigh(self, stable: bool = True) -> Reading[float]:
        """Give the net weight, kg, measured after this call; with `stable`, wait until it stands.

        Raises DeviceTimeout when it does not come to rest in time, DeviceFault with fault_code overload, underload or
        unit, Refused when the tare was lost, Stale for an answer that took too long, Cancelled by `stop`.
        """
        with self._line.held():
            self._needs_tare()
            if stable:
                return self._at_rest()
            answer, began = self._value()
            if answer.mark in ("+", "-"):
                raise self._complaint(answer)
            if answer.value is None:
                raise Refused(f"{self._who} is busy and gives no weight now", f"S {answer.mark}")
            return self._reading(answer, began)

    def _at_rest(self) -> Reading[float]:
        """Ask until the value is stable. Not by S: that would leave a question open in the scale when we give up."""
        stops, deadline = self._stops, time.monotonic() + self._stable_timeout
        inside = time.monotonic()
        while True:
            answer, began = self._value()
            self._needs_tare()
            if answer.mark not in ("+", "-"):
                inside = began
            elif began - inside > OUTSIDE_FOR:
                raise self._complaint(answer)
            if answer.mark == "S":
                return self._reading(answer, began)
            if self._stops != stops:
                raise Cancelled(f"{self._who}: weighing was stopped")
            if time.monotonic() >= deadline:
                raise DeviceTimeout(f"{self._who}: the load has not come to rest within {self._stable_timeout:g} s")
            time.sleep(LOOK_AGAIN)

    def _value(self) -> tuple[Answer, float]:
        """Ask for the value at once; gives the answer and when it was asked for. Raises as `weigh` does."""
        began = time.monotonic()
        answer = self._ask("SI")
        self._watch_range(answer)
        if answer.mark in ("S", "D") and answer.value is None:
            raise DeviceFault(f"{self._who} weighs in {answer.unit}; set it to kg, g or mg", answer.unit, "unit")
        return answer, began

    def _reading(self, answer: Answer, began: float) -> Reading[float]:
        assert answer.value is not None
        if not self._line.observing.online:  # closed or lost while the answer was on its way
            raise Stale(f"{self._who}: the connection was closed while weighing")
        self._line.observing.settled()
        # As old as its question: when in between it was measured, nobody tells.
        reading = Reading(answer.value, now(), began)
        self._newest = reading
        return reading

    def newest(self, max_age: float) -> Reading[float]:
        """Give the newest weight seen, kg, without asking. Raises Stale when it is older than `max_age` s."""
        reading = self._newest
        age = math.inf if reading is None else reading.age
        if reading is None or not age <= max_age:
            raise Stale(f"{self._who}: the newest weight is older than {max_age:g} s", f"age {age:.3f} s")
        return reading

    # -------------------------------------------------------------------------------- actions
    @action(deadline=DEADLINE)
    def weight(self, stable: bool = True, *, an: str | None = None) -> float:
        """Give the net weight in kg.

        :param stable: wait until the load has come to rest
        """
        return self.weigh(stable).value

    @action(deadline=DEADLINE)
    def weight_within(self, lowest: float, highest: float, *, an: str | None = None) -> bool:
        """Weigh at rest and tell whether the net weight lies between two limits, both included.

        :param lowest: kg
        :param highest: kg
        """
        if not lowest <= highest:
            raise OutOfRange(f"{self._who}: lowest must not be above highest: {lowest!r}, {highest!r}")
        return lowest <= self.weigh().value <= highest

    @action(deadline=DEADLINE)
    def tare(self, *, an: str | None = None) -> None:
        """Take the present load as the container's. Refused in motion or outside the range."""
        self._set("T", "S")

    @action(deadline=DEADLINE)
    def zero(self, *, an: str | None = None) -> None:
        """Take the present load as nothing; clears the tare. Refused in motion or too far from the scale's zero."""
        self._set("Z", "A")

    def stop(self) -> None:
        """End a weighing that waits; called past everything else."""
        self._stops += 1

    def _set(self, command: str, done: str) -> None:
        name = "tare" if command == "T" else "zero"
        stops = self._stops
        with self._line.held():
            before = self._ask("SI")
            if before.mark == "D":
                raise Refused(f"{self._who}: {name} is refused while the load is in motion", "S D")
            if self._stops != stops:
                raise Cancelled(f"{self._who}: {name} was stopped")
            limit = self._answer_timeout + self._stable_timeout
            try:
                answer = self._line.ask(
                    command.encode() + b"\r\n", lambda data: self._found(data, command, command), command, limit
                )
            except DeviceTimeout:
                with contextlib.suppress(DeviceError):
                    self._line.send(CANCEL)  # else it could be done when nobody expects it any more
                raise
            if answer.mark != done:
                why = {"I": "the load is in motion, or the scale is busy", "+": "too much load", "-": "too little load"}
                raise Refused(f"{self._who}: {name} is refused: {why.get(answer.mark, answer.mark)}", answer.mark)
            self._newest = None  # it was measured against another zero
            self._tare = self._ask("TA").value
            self._alarm(TARE_LOST, False)

    # -------------------------------------------------------------------------------- asking
    def _ask(self, command: str) -> Answer:
        """Ask what is answered at once. Raises DeviceTimeout, ConnectionLost, DeviceFault with ES, ET or EL."""
        wanted = "S" if command == "SI" else command
        return self._line.ask(
            command.encode("ascii") + b"\r\n", lambda data: self._found(data, wanted, command), command
        )

    def _found(self, data: bytes, wanted: str, command: str) -> Answer | None:
        for answer in sics.answers(data):
            if answer.command == wanted:
                return answer
            if answer.command in sics.ERRORS:
                raise DeviceFault(
                    f"{self._who} {sics.ERRORS[answer.command]} {command}", answer.command, answer.command
                )
            self._hello(answer)
        return None

    def _unasked(self, data: bytes) -> None:
        for answer in sics.answers(data):
            self._hello(answer)

    def _hello(self, answer: Answer) -> None:
        """Note a restart: a scale says its serial number when it is switched on, and has no tare then."""
        if answer.command == "I4" and self._tare:
            self._alarm(TARE_LOST, True)

    def _needs_tare(self) -> None:
        if TARE_LOST in self._alarms:
            text, remedy = _COMPLAINTS[TARE_LOST]
            raise Refused(f"{self._who}: {text}; {remedy}", TARE_LOST)

    # -------------------------------------------------------------------------------- observing
    def _greet(self, deadline: float) -> None:
        """See who is there. What somebody left half typed is ended first; its answer is not heard."""
        self._newest = None
        limit = min(self._answer_timeout, max((deadline - time.monotonic()) / 2.0, 0.01))

        def who(data: bytes) -> bool | None:
            return any(answer.command == "I4" for answer in sics.answers(data)) or None

        self._line.ask(b"\r\nI4\r\n", who, "I4", limit)
        self._check_tare()

    def _look(self) -> None:
        """See what it shows, and that the tare is still ours."""
        began = time.monotonic()
        answer = self._ask("SI")
        self._watch_range(answer)
        if answer.mark in ("S", "D") and answer.value is not None:
            self._newest = Reading(answer.value, now(), began)
        self._check_tare()

    def _check_tare(self) -> None:
        if self._tare is None:
            return
        tare = self._ask("TA").value
        if tare is None or not math.isclose(tare, self._tare, abs_tol=TARE_TOLERANCE):
            self._alarm(TARE_LOST, True)

    def _watch_range(self, answer: Answer) -> None:
        self._alarm(OVERLOAD, answer.mark == "+")
        self._alarm(UNDERLOAD, answer.mark == "-")

    def _alarm(self, code: str, on: bool) -> None:
        if not on:
            self._alarms.pop(code, None)
        elif code not in self._alarms:
            self._alarms[code] = Alarm(code, Severity.WARNING, *_COMPLAINTS[code], now())

    def _complaint(self, answer: Answer) -> DeviceFault:
        code = OVERLOAD if answer.mark == "+" else UNDERLOAD
        text, remedy = _COMPLAINTS[code]
        return DeviceFault(f"{self._who}: {text}; {remedy}", code, code)

"""The object type of a scale with MT-SICS commands: weighing, tare and zero."""

import contextlib
import math
import time
from collections.abc import Mapping
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Health, Identity, LossReaction, Observation, Quality, Reading, Severity
from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure
from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, NotFound, OutOfRange, Refused, Stale
from arcor2_hw.messages import Message, translatable
from arcor2_hw.objects import Scale
from arcor2_hw.objects.connected import AlarmText
from arcor2_hw.objects.line_device import LineDevice

from . import sics
from .settings import MtSicsScaleSettings
from .sics import Answer

STATUS_PERIOD: Final = 0.5
"""Time between status requests while the line is free, s."""
MAX_SHOWN_AGE: Final = 2.0
"""Maximum age of a weight that is shown as present, s."""
STABLE_PERIOD: Final = 0.03
"""Time between requests while waiting for a stable value, s; a scale measures about 20 times per second."""
OUT_OF_RANGE_TIME: Final = 0.5
"""Time outside the range after which a fault is raised, s: placing a part exceeds its weight for a moment."""
DEADLINE: Final = 90.0
CANCEL: Final = b"@\r\n"
"""Cancel command, which also clears the tare: sent only after a failed tare or zero."""

TARE_TOLERANCE: Final = 1.5e-5
"""Tolerance of the tare, kg: rounding when the unit was switched at the scale."""

OVERLOAD, UNDERLOAD, TARE_LOST = "overload", "underload", "tare_lost"


class MtSicsScale(LineDevice, Scale):
    """A scale with MT-SICS commands, on a serial line or TCP."""

    _ABSTRACT = False
    display_name = "Mettler Toledo scale"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"weight": "stop", "weight_within": "stop"}
    ALARMS: ClassVar[Mapping[str, AlarmText]] = {
        OVERLOAD: AlarmText("the load is above the weighing range", "remove the load", Severity.WARNING),
        UNDERLOAD: AlarmText(
            "the load is below the weighing range", "put the pan in its place and zero the scale", Severity.WARNING
        ),
        TARE_LOST: AlarmText(
            "the tare of the scale was lost by a restart or changed at its keys",
            "tare again, or acknowledge the alarm",
            Severity.WARNING,
        ),
    }
    poll_period = STATUS_PERIOD

    def __init__(self, obj_id: str, name: str, settings: MtSicsScaleSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.use_line(settings.port, settings.baud_rate, settings.answer_timeout)
        self._stable_timeout = settings.stable_timeout
        self._newest: Reading[float] | None = None
        self._tare: float | None = None  # tare that the scale reported at our last tare or zero, kg; None before

    # -------------------------------------------------------------------------------- connection
    def disconnect(self) -> None:
        """Close; does nothing when closed. Tare and zero stay in the scale."""
        self.stop()
        super().disconnect()
        self._newest = None

    def condition(self) -> Health:
        """Return off_spec outside the range, check_function when the tare was lost."""
        codes = {alarm.code for alarm in self.alarms()}
        if codes & {OVERLOAD, UNDERLOAD}:
            return Health.OFF_SPEC
        return Health.CHECK_FUNCTION if codes else Health.NORMAL

    def acknowledge(self, code: str) -> None:
        """Accept the present tare of the scale (code tare_lost). Raises NotFound for another code."""
        if code != TARE_LOST or not self._tare_is_lost:
            raise NotFound("{device} has no alarm {code!r} that can be acknowledged", device=self.who, code=code)
        self._tare = None
        self.set_alarm(TARE_LOST, False)

    def identify(self) -> Identity:
        """Ask the scale for its identity; MT-SICS does not report the vendor."""
        with self.held():
            model, firmware, serial = (self._ask(command).text for command in ("I2", "I3", "I4"))
        return Identity("", model, serial, firmware)

    # -------------------------------------------------------------------------------- parameters
    def parameters_dump(self) -> list[DeviceParameter]:
        """Read the settings of the scale; those that the model does not have are left out."""
        with self.held():
            found = {name: self._setting(command) for command, name in sics.PARAMETERS.items()}
        return [DeviceParameter(name, number) for name, number in found.items() if number is not None]

    def parameters_restore(self, parameters: list[DeviceParameter]) -> list[ParameterFailure]:
        """Write settings, and read each one again."""
        with self.held():
            reasons = {each.name: self._write_setting(each) for each in parameters}
        return [
            ParameterFailure(name, reason.text, **reason.translation())
            for name, reason in reasons.items()
            if reason is not None
        ]

    def _setting(self, command: str) -> int | None:
        """Return the value of a setting, None if the model does not have it."""
        try:
            return self._ask(command).number
        except DeviceFault as error:
            if error.fault_code not in sics.ERRORS:
                raise
            return None

    def _write_setting(self, parameter: DeviceParameter) -> Message | None:
        """Write a setting. Return the reason if the scale does not use it, otherwise None."""
        commands = {name: command for command, name in sics.PARAMETERS.items()}
        command, value = commands.get(parameter.name), parameter.value
        if command is None or self._setting(command) is None:
            return Message.of("The scale has no setting {parameter}.", parameter=parameter.name)
        if type(value) is not int or not 0 <= value <= 999:
            return Message.of("{value} cannot be sent to the scale.", value=value)
        request = f"{command} {value}\r\n".encode("ascii")
        self.ask(request, lambda data: self._found(data, command, command), command)
        stored = self._setting(command)
        if stored == value:
            return None
        return Message.of("The scale did not accept {value} and keeps {stored}.", value=value, stored=stored)

    # -------------------------------------------------------------------------------- weighing
    def weigh(self, stable: bool = True) -> Reading[float]:
        """Return the net weight, kg, measured after this call; with `stable`, wait until it is stable.

        Raises DeviceTimeout when it does not become stable in time, DeviceFault with fault_code overload, underload or
        unit, Refused when the tare was lost, Stale for an answer that took too long, Cancelled by `stop`.
        """
        with self.held():
            self._needs_tare()
            if stable:
                return self._at_rest()
            answer, began = self._value()
            if answer.mark in ("+", "-"):
                raise self._complaint(answer)
            if answer.value is None:
                raise Refused("{device} is busy and cannot measure now", f"S {answer.mark}", device=self.who)
            return self._reading(answer, began)

    def _at_rest(self) -> Reading[float]:
        """Request the value until it is stable. The command S would stay pending in the scale after a timeout."""
        go_on, deadline = self.begin("weighing"), time.monotonic() + self._stable_timeout
        inside = time.monotonic()
        while True:
            answer, began = self._value()
            self._needs_tare()
            if answer.mark not in ("+", "-"):
                inside = began
            elif began - inside > OUT_OF_RANGE_TIME:
                raise self._complaint(answer)
            if answer.mark == "S":
                return self._reading(answer, began)
            go_on()
            if time.monotonic() >= deadline:
                raise DeviceTimeout(
                    "{device}: the load did not become stable within {stable_timeout:g} s",
                    device=self.who,
                    stable_timeout=self._stable_timeout,
                )
            time.sleep(STABLE_PERIOD)

    def _value(self) -> tuple[Answer, float]:
        """Request the present value. Return the answer and the time of the request. Raises as `weigh` does."""
        began = time.monotonic()
        answer = self._ask("SI")
        self._watch_range(answer)
        if answer.mark in ("S", "D") and answer.value is None:
            raise DeviceFault(
                "{device} weighs in {unit}. Set it to kg, g or mg.",
                answer.unit,
                "unit",
                device=self.who,
                unit=answer.unit,
            )
        return answer, began

    def _reading(self, answer: Answer, began: float) -> Reading[float]:
        assert answer.value is not None
        if not self.observing.online:  # closed or lost while the answer was on its way
            raise Stale("{device}: the connection was closed while weighing", device=self.who)
        self.observing.settled()
        # The scale does not report when it measured: the time of the request is used.
        reading = Reading(answer.value, now(), began)
        self._newest = reading
        return reading

    def newest(self, max_age: float) -> Reading[float]:
        """Return the newest weight, kg, without asking. Raises Stale when it is older than `max_age` s."""
        reading = self._newest
        age = math.inf if reading is None else reading.age
        if reading is None or not age <= max_age:
            raise Stale(
                "{device}: the newest weight is older than {max_age:g} s",
                f"age {age:.3f} s",
                device=self.who,
                max_age=max_age,
            )
        return reading

    def observations(self) -> list[Observation]:
        """Return the newest weight. It is uncertain when the scale has not been asked recently."""
        self.observing.check()
        newest = self._newest
        if newest is None:
            return [Observation(translatable("Net weight"), None, "kg", Quality.BAD)]
        quality = newest.quality if newest.age <= MAX_SHOWN_AGE else Quality.UNCERTAIN
        return [Observation(translatable("Net weight"), newest.value, "kg", quality)]

    # -------------------------------------------------------------------------------- actions
    @action(deadline=DEADLINE, again="safe")
    def weight(self, stable: bool = True, *, an: str | None = None) -> float:
        """Return the net weight in kg.

        :param stable: whether to wait until the load is stable
        """
        return self.weigh(stable).value

    @action(deadline=DEADLINE, again="safe")
    def weight_within(self, lowest: float, highest: float, *, an: str | None = None) -> bool:
        """Wait for a stable weight and return whether the net weight is between two limits, both included.

        :param lowest: lower limit, kg
        :param highest: upper limit, kg
        """
        if not lowest <= highest:
            raise OutOfRange(
                "{device}: lowest must not be above highest: {lowest!r}, {highest!r}",
                device=self.who,
                lowest=lowest,
                highest=highest,
            )
        return lowest <= self.weigh().value <= highest

    @action(deadline=DEADLINE)
    def tare(self, *, an: str | None = None) -> None:
        """Tare: the present load counts as the container. Refused while the load is unstable or outside the range."""
        self._set("T", "S")

    @action(deadline=DEADLINE)
    def zero(self, *, an: str | None = None) -> None:
        """Zero: the present load counts as 0; clears the tare. Refused while unstable or too far from zero."""
        self._set("Z", "A")

    def stop(self) -> None:
        """Cancel a weighing that waits."""
        self.stop_waiting()

    def _set(self, command: str, done: str) -> None:
        name = "tare" if command == "T" else "zero"
        with self.held():
            go_on = self.begin(name)
            before = self._ask("SI")
            if before.mark == "D":
                raise Refused(
                    "{device}: {name} is refused while the load is in motion", "S D", device=self.who, name=name
                )
            go_on()
            limit = self.line.answer_timeout + self._stable_timeout
            try:
                answer = self.ask(
                    command.encode() + b"\r\n", lambda data: self._found(data, command, command), command, limit
                )
            except DeviceTimeout:
                with contextlib.suppress(DeviceError):
                    self.line.send(CANCEL)  # otherwise the scale could execute it later
                raise
            if answer.mark != done:
                why = {"I": "the load is in motion, or the scale is busy", "+": "too much load", "-": "too little load"}
                raise Refused(
                    "{device}: {name} is refused: {mark}",
                    answer.mark,
                    device=self.who,
                    name=name,
                    mark=why.get(answer.mark, answer.mark),
                )
            self._newest = None  # the stored weight refers to another zero
            self._tare = self._ask("TA").value
            self.set_alarm(TARE_LOST, False)

    # -------------------------------------------------------------------------------- asking
    def _ask(self, command: str) -> Answer:
        """Send a command with an immediate answer. Raises DeviceTimeout, ConnectionLost, DeviceFault (ES, ET, EL)."""
        wanted = "S" if command == "SI" else command
        return self.ask(command.encode("ascii") + b"\r\n", lambda data: self._found(data, wanted, command), command)

    def _found(self, data: bytes, wanted: str, command: str) -> Answer | None:
        for answer in sics.answers(data):
            if answer.command == wanted:
                return answer
            if answer.command in sics.ERRORS:
                raise DeviceFault(
                    "{device} {errors} {command}",
                    answer.command,
                    answer.command,
                    device=self.who,
                    errors=sics.ERRORS[answer.command],
                    command=command,
                )
            self._on_greeting(answer)
        return None

    def on_unasked(self, data: bytes) -> None:
        """Detect a restart."""
        for answer in sics.answers(data):
            self._on_greeting(answer)

    def _on_greeting(self, answer: Answer) -> None:
        """Detect a restart: a scale sends its serial number when it is switched on, and has no tare then."""
        if answer.command == "I4" and self._tare:
            self.set_alarm(TARE_LOST, True)

    @property
    def _tare_is_lost(self) -> bool:
        return any(alarm.code == TARE_LOST for alarm in self.alarms())

    def _needs_tare(self) -> None:
        if self._tare_is_lost:
            text, remedy, _ = self.ALARMS[TARE_LOST]
            raise Refused(
                "{device}: {text}; {remedy}",
                TARE_LOST,
                device=self.who,
                text=Message.of(text),
                remedy=Message.of(remedy),
            )

    # -------------------------------------------------------------------------------- observing
    def greet(self, deadline: float) -> None:
        """Ask for the serial number, after ending a half-sent command of another client."""
        self._newest = None
        limit = min(self.line.answer_timeout, max((deadline - time.monotonic()) / 2.0, 0.01))

        def serial_number(data: bytes) -> bool | None:
            return any(answer.command == "I4" for answer in sics.answers(data)) or None

        self.ask(b"\r\nI4\r\n", serial_number, "I4", limit)
        self._check_tare()

    def poll(self) -> None:
        """Read the displayed weight, and check that the tare is still ours."""
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
            self.set_alarm(TARE_LOST, True)

    def _watch_range(self, answer: Answer) -> None:
        self.set_alarm(OVERLOAD, answer.mark == "+")
        self.set_alarm(UNDERLOAD, answer.mark == "-")

    def _complaint(self, answer: Answer) -> DeviceFault:
        code = OVERLOAD if answer.mark == "+" else UNDERLOAD
        text, remedy, _ = self.ALARMS[code]
        return DeviceFault(
            "{device}: {text}; {remedy}", code, code, device=self.who, text=Message.of(text), remedy=Message.of(remedy)
        )

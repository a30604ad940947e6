"""The object type of a ZPL label printer: it sends each label once, and confirms it by the counter of the printer."""

import dataclasses
import time
from collections.abc import Mapping
from typing import ClassVar, Final

from arcor2_hw.actions import action, observation
from arcor2_hw.data.device import Health, Identity, LossReaction
from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure
from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceFault, DeviceTimeout, NotFound, OutOfRange, Refused
from arcor2_hw.messages import Message, translatable
from arcor2_hw.objects import Printer
from arcor2_hw.objects.connected import AlarmText
from arcor2_hw.objects.line_device import LineDevice
from arcor2_hw.objects.observing import GoOn

from . import zpl
from .settings import ZplPrinterSettings
from .zpl import BadLabel, Status

STATUS_PERIOD: Final = 1.0
"""Time between status requests while no label is printed, s."""
CONFIRM_PERIOD: Final = 0.05
DEADLINE: Final = 110.0

NO_REPLY, UNCONFIRMED = "no_reply", "unconfirmed"
_ALARMS: Final = {
    "paper_out": AlarmText("it is out of labels", "load labels and close the head"),
    "head_open": AlarmText("its head is open", "close the head"),
    "ribbon_out": AlarmText("it is out of ribbon", "load ribbon and close the head"),
    "paused": AlarmText("it is paused", "press PAUSE on the printer"),
    "too_hot": AlarmText("its head is too hot", "let it cool down"),
    "too_cold": AlarmText("its head is too cold", "let it warm up"),
    "partial_format": AlarmText("it has received a partial label", "switch it off and on"),
    NO_REPLY: AlarmText("it does not answer", "load labels, close the head, check its power and cable"),
    UNCONFIRMED: AlarmText(
        "it is unknown whether the last label was printed", "look for it, then run last_came_out or acknowledge"
    ),
}
_BLOCKING: Final = tuple(field.name for field in dataclasses.fields(Status) if field.name in _ALARMS)


class NoReply(DeviceFault, DeviceTimeout):
    """The printer does not answer: it is out of labels, its head is open, or the line is broken."""


class ZplPrinter(LineDevice, Printer):
    """A label printer that speaks ZPL, on a serial line or TCP."""

    _ABSTRACT = False
    display_name = "ZPL label printer"
    loss_reaction: ClassVar[LossReaction] = LossReaction.continues()  # the printer finishes what it has received
    ALARMS: ClassVar[Mapping[str, AlarmText]] = _ALARMS
    poll_period = STATUS_PERIOD

    def __init__(self, obj_id: str, name: str, settings: ZplPrinterSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.use_line(settings.port, settings.baud_rate, settings.answer_timeout)
        self._print_timeout, self._template = settings.print_timeout, settings.template
        self._unconfirmed: int | None = None  # the counter before a label that may or may not be printed

    # -------------------------------------------------------------------------------- connection
    def condition(self) -> Health:
        """Return check_function while the printer cannot print or a label is unconfirmed."""
        return Health.CHECK_FUNCTION if self.alarms() else Health.NORMAL

    @observation
    def can_print(self) -> bool:
        """Return whether labels are loaded, the head is closed, and nothing else prevents printing."""
        return not self.alarms()

    def acknowledge(self, code: str) -> None:
        """Acknowledge a label that may or may not be printed (code unconfirmed). Raises NotFound for another code."""
        if code != UNCONFIRMED or self._unconfirmed is None:
            raise NotFound("{device} has no alarm {code!r} that can be acknowledged", device=self.who, code=code)
        self._settle()

    def identify(self) -> Identity:
        """Ask the printer for its identity; ZPL does not report the vendor."""
        with self.held():
            model, firmware = self.ask(zpl.IDENTIFY, zpl.identity, "~HI")
            serial = self.ask(zpl.getvar(zpl.UNIQUE_ID), zpl.variable, f"getvar {zpl.UNIQUE_ID}")
        return Identity("", model, serial, firmware)

    def counters(self) -> dict[str, int]:
        """Read the number of labels that the printer has ever printed."""
        return {translatable("labels printed"): self.counter()}

    # -------------------------------------------------------------------------------- parameters
    def parameters_dump(self) -> list[DeviceParameter]:
        """Read the settings of the printer by SGD; those that the model does not have are left out."""
        with self.held():
            values = {name: self._getvar(name) for name in zpl.PARAMETERS}
        units = zpl.PARAMETERS
        return [DeviceParameter(name, value, units[name]) for name, value in values.items() if value != zpl.UNKNOWN]

    def parameters_restore(self, parameters: list[DeviceParameter]) -> list[ParameterFailure]:
        """Write settings by SGD, and read each one again. Raises Refused while labels are being printed."""
        with self.held():
            if not self._ask_status().idle:
                raise Refused("{device} is printing. Try again when it has finished.", device=self.who)
            reasons = {each.name: self._setvar(each) for each in parameters}
        return [
            ParameterFailure(name, reason.text, **reason.translation())
            for name, reason in reasons.items()
            if reason is not None
        ]

    def _getvar(self, name: str) -> str:
        return self.ask(zpl.getvar(name), zpl.variable, f"getvar {name}")

    def _setvar(self, parameter: DeviceParameter) -> Message | None:
        """Write a setting. Return the reason if the printer does not use it, otherwise None."""
        name, value = parameter.name, str(parameter.value)
        if name not in zpl.PARAMETERS or self._getvar(name) == zpl.UNKNOWN:
            return Message.of("The printer has no setting {parameter}.", parameter=name)
        try:
            command = zpl.setvar(name, value)
        except ValueError:
            return Message.of("{value} cannot be sent to the printer.", value=value)
        self.line.send(command)
        stored = self._getvar(name)
        if stored == value:
            return None
        return Message.of("The printer did not accept {value} and keeps {stored}.", value=value, stored=stored)

    # -------------------------------------------------------------------------------- state
    def status(self) -> str:
        """Return the state of the printer: ready, printing, or why it cannot print (paper_out, paused ...)."""
        with self.held():
            found = self._ask_status()
        blocked = self._blocked_by(found)
        return blocked or ("ready" if found.idle else "printing")

    def counter(self) -> int:
        """Return the number of labels that the printer has ever printed."""
        with self.held():
            return self._ask_counter()

    # -------------------------------------------------------------------------------- printing
    def print(self, label: str) -> str:
        """Send one label in ZPL, once, and return the id of the job when the printer has counted it.

        Raises:
            OutOfRange: The text is not a single label.
            DeviceFault: The printer cannot print.
            Refused: It prints labels of another client, or the last label is unconfirmed.
            Cancelled, DeviceTimeout, ConnectionLost: If this happens after sending, the label may or may not be
                printed, and no other label is printed before a user has acknowledged that.
        """
        go_on = self.begin("printing")
        try:
            data = zpl.check_label(label)
        except BadLabel as e:
            raise OutOfRange("{device}: the label {reason}", device=self.who, reason=e) from e
        with self.held(self._print_timeout):
            if self._unconfirmed is not None:
                text, remedy, _ = _ALARMS[UNCONFIRMED]
                raise Refused("{device}: {text}; {remedy}", UNCONFIRMED, device=self.who, text=text, remedy=remedy)
            found = self._ask_status()
            self._raise_if_blocked(found, "nothing was sent")
            if found.buffer_full or not found.idle:
                raise Refused("{device} is printing labels of another client; nothing was sent", device=self.who)
            before = self._ask_counter()
            self._check_not_stopped(go_on, "nothing was sent")
            self._unconfirmed = before
            try:
                self.line.send(data)
                job = self._confirm(before, go_on)
            except BaseException:
                self.set_alarm(UNCONFIRMED, True)
                raise
            self._settle()
            self.observing.settled()
            return job

    def stop(self) -> None:
        """Cancel the wait for a label; the printer finishes what it has received."""
        self.stop_waiting()

    @staticmethod
    def _check_not_stopped(go_on: GoOn, consequence: str) -> None:
        try:
            go_on()
        except Cancelled as error:
            raise Cancelled("{reason}; {consequence}", reason=error, consequence=consequence) from None

    def _confirm(self, before: int, go_on: GoOn) -> str:
        """Wait until the printer has counted the label; return the id of the job."""
        deadline = time.monotonic() + self._print_timeout
        while True:
            self._check_not_stopped(go_on, "the label was sent and may come out; it is not sent again")
            found = self._ask_status()
            counted = self._ask_counter() - before
            if counted == 1 and found.idle:
                return f"{self.name}-{before + 1}"
            if counted not in (0, 1):
                raise DeviceFault(
                    "{device} has counted {counted} labels instead of 1: another client uses it",
                    "",
                    "counter",
                    device=self.who,
                    counted=counted,
                )
            if counted == 0:
                self._raise_if_blocked(found, "the label was sent and may come out later; it is not sent again")
            if time.monotonic() >= deadline:
                raise DeviceTimeout(
                    "{device} has not counted the label within {print_timeout:g} s; it is not sent again",
                    f"counter {before}, formats waiting {found.formats_waiting}",
                    device=self.who,
                    print_timeout=self._print_timeout,
                )
            time.sleep(CONFIRM_PERIOD)

    # -------------------------------------------------------------------------------- actions
    @action(deadline=DEADLINE, serial="code")
    def print_label(self, title: str, text: str, code: str, *, an: str | None = None) -> str:
        """Print one label and return the id of the job when the printer has counted it.

        :param title: first line
        :param text: second line
        :param code: content of the barcode (ASCII)
        """
        if not code:
            raise OutOfRange("{device}: code must not be empty", device=self.who)
        try:
            label = zpl.fill(self._template, {"title": title, "text": text, "code": code})
        except BadLabel as e:
            raise OutOfRange("{device}: {reason}", device=self.who, reason=e) from e
        return self.print(label)

    @action
    def last_came_out(self, *, an: str | None = None) -> bool:
        """Return whether an unconfirmed label was printed after all; then printing is possible again.

        Raises Refused while it is still waiting in the printer, and when there is no such label.
        """
        with self.held():
            before = self._unconfirmed
            if before is None:
                raise Refused("{device}: every label was confirmed", device=self.who)
            found = self._ask_status()
            counted = self._ask_counter() - before
            if not found.idle:
                blocked = self._blocked_by(found)
                why = f": {_ALARMS[blocked].text}; {_ALARMS[blocked].remedy}" if blocked else ""
                raise Refused(
                    "{device}: the label is still waiting in the printer{reason}", device=self.who, reason=why
                )
            if counted not in (0, 1):
                raise DeviceFault(
                    "{device} has counted {counted} labels since. Look for the label, then acknowledge the alarm.",
                    "",
                    "counter",
                    device=self.who,
                    counted=counted,
                )
            self._settle()
            return counted == 1

    @action(again="safe")
    def labels_printed(self, *, an: str | None = None) -> int:
        """Return the number of labels that the printer has ever printed."""
        return self.counter()

    @action(again="safe")
    def ready(self, *, an: str | None = None) -> bool:
        """Return whether it would print a label now."""
        return self.status() == "ready" and self._unconfirmed is None

    # -------------------------------------------------------------------------------- asking
    def _ask_status(self) -> Status:
        """Ask for the status. Raises DeviceFault no_reply: without labels or with an open head it may not answer."""
        found = self.ask(zpl.HOST_STATUS, zpl.status, "~HS")
        blocked = self._blocked_by(found)
        for code in (*_BLOCKING, NO_REPLY):
            self.set_alarm(code, code == blocked)
        return found

    def _ask_counter(self) -> int:
        return self.ask(zpl.getvar(zpl.COUNTER), zpl.number, f"getvar {zpl.COUNTER}")

    def overdue(self, error: DeviceTimeout) -> NoReply:
        """Return the error of a printer that does not answer."""
        self.set_alarm(NO_REPLY, True)
        return NoReply(
            "{device} does not answer: it is out of labels, its head is open, or the line is broken; {remedy}",
            f"{error} {error.detail}".strip(),
            NO_REPLY,
            device=self.who,
            remedy=_ALARMS[NO_REPLY].remedy,
        )

    @staticmethod
    def _blocked_by(found: Status) -> str:
        """Return why the printer cannot print; empty when it can. A partial format has the lowest priority."""
        order = ("head_open", "paper_out", "ribbon_out", "too_hot", "too_cold", "paused", "partial_format")
        return next((name for name in order if getattr(found, name)), "")

    def _raise_if_blocked(self, found: Status, consequence: str) -> None:
        if blocked := self._blocked_by(found):
            text, remedy, _ = _ALARMS[blocked]
            raise DeviceFault(
                "{device}: {text}; {remedy}; {consequence}",
                blocked,
                blocked,
                device=self.who,
                text=text,
                remedy=remedy,
                consequence=consequence,
            )

    # -------------------------------------------------------------------------------- observing
    def greet(self, deadline: float) -> None:
        """Ask for the status."""
        limit = min(self.line.answer_timeout, max(deadline - time.monotonic(), 0.01))
        self.ask(zpl.HOST_STATUS, zpl.status, "~HS", limit)
        self.set_alarm(NO_REPLY, False)

    def poll(self) -> None:
        """Ask for the status."""
        self._ask_status()

    def on_lost(self, error: DeviceError) -> None:
        """Raise the alarm of a printer that does not answer."""
        super().on_lost(error)
        if not isinstance(error, DeviceFault):
            self.set_alarm(NO_REPLY, True)

    def _settle(self) -> None:
        self._unconfirmed = None
        self.set_alarm(UNCONFIRMED, False)

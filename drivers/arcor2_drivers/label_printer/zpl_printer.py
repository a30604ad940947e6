"""A ZPL label printer as an object type: a label is sent once, and done when the printer has counted it."""

import dataclasses
import time
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction, Severity
from arcor2_hw.exceptions import Cancelled, DeviceError, DeviceFault, DeviceTimeout, NotFound, OutOfRange, Refused
from arcor2_hw.objects import Printer
from arcor2_hw.objects.asked_line import AskedLine
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from . import zpl
from .settings import ZplPrinterSettings
from .zpl import BadLabel, Status

STATUS_PERIOD: Final = 1.0
"""s between looks at the printer while nobody prints."""
LOOK_AGAIN: Final = 0.05
DEADLINE: Final = 110.0

NO_REPLY, UNCONFIRMED = "no_reply", "unconfirmed"
_COMPLAINTS: Final = {
    "paper_out": ("it is out of labels", "load labels and close the head"),
    "head_open": ("its head is open", "close the head"),
    "ribbon_out": ("it is out of ribbon", "load ribbon and close the head"),
    "paused": ("it is paused", "press PAUSE on the printer"),
    "too_hot": ("its head is too hot", "let it cool down"),
    "too_cold": ("its head is too cold", "let it warm up"),
    "partial_format": ("half a label is in it", "switch it off and on"),
    NO_REPLY: ("it does not answer", "load labels, close the head, check that it is switched on and its cable"),
    UNCONFIRMED: ("whether the last label came out is not known", "look for it; then ask last_came_out or acknowledge"),
}
_BLOCKING: Final = tuple(field.name for field in dataclasses.fields(Status) if field.name in _COMPLAINTS)


class NoReply(DeviceFault, DeviceTimeout):
    """The printer says nothing: it is out of labels, its head is open, or the line is broken; nobody can tell which."""


class ZplPrinter(Printer):
    """A label printer that speaks ZPL, on a serial line or TCP."""

    _ABSTRACT = False
    loss_reaction: ClassVar[LossReaction] = LossReaction.continues()  # it finishes what it has received

    def __init__(self, obj_id: str, name: str, settings: ZplPrinterSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._line = AskedLine(
            f"{name} at {settings.port}",
            settings.port,
            settings.baud_rate,
            settings.answer_timeout,
            self._greet,
            self._look,
            STATUS_PERIOD,
            lost=self._lost,
            overdue=self._silent,
        )
        self._who = self._line.who
        self._answer_timeout, self._print_timeout = settings.answer_timeout, settings.print_timeout
        self._template = settings.template
        self._unconfirmed: int | None = None  # the counter before a label of which we don't know what became
        self._alarms: dict[str, Alarm] = {}
        self._stops = 0

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Open the port and ask the printer how it is, within `timeout` s; nothing is printed by that.

        Raises NotConnected naming the port; DeviceFault with fault_code no_reply when nobody answers there.
        """
        self._line.observing.start(timeout)

    def disconnect(self) -> None:
        """Close; harmless when closed. The printer finishes what it has received."""
        self._line.close()

    @property
    def connection(self) -> Connection:
        """Tell how the line is."""
        return self._line.observing.state

    @property
    def health(self) -> Health:
        """Give failure when it does not answer, check_function while it cannot print or a label is unconfirmed."""
        if self.connection in (Connection.LOST, Connection.FAILED):
            return Health.FAILURE
        return Health.CHECK_FUNCTION if self._alarms else Health.NORMAL

    def alarms(self) -> list[Alarm]:
        """Give what keeps it from printing, each with its remedy. All but unconfirmed end with their cause."""
        return list(self._alarms.values())

    def acknowledge(self, code: str) -> None:
        """Take note of a label whose fate is unknown (code unconfirmed). Raises NotFound for another code."""
        if code != UNCONFIRMED or self._unconfirmed is None:
            raise NotFound(f"{self._who} has no alarm {code!r} to be acknowledged")
        self._settle()

    def identify(self) -> Identity:
        """Ask the printer who it is; ZPL has no word for the vendor."""
        with self._line.held():
            model, firmware = self._line.ask(zpl.IDENTIFY, zpl.identity, "~HI")
            serial = self._line.ask(zpl.getvar(zpl.UNIQUE_ID), zpl.variable, f"getvar {zpl.UNIQUE_ID}")
        return Identity("", model, serial, firmware)

    # -------------------------------------------------------------------------------- state
    def status(self) -> str:
        """Tell how the printer is: ready, printing, or what keeps it from printing (paper_out, paused ...)."""
        with self._line.held():
            found = self._ask_status()
        blocked = self._blocked_by(found)
        return blocked or ("ready" if found.idle else "printing")

    def counter(self) -> int:
        """Give the number of labels printed in the printer's life."""
        with self._line.held():
            return self._ask_counter()

    # -------------------------------------------------------------------------------- printing
    def print(self, label: str) -> str:
        """Send one label in ZPL, once, and give the job's id when the printer has counted it.

        Raises OutOfRange for what is no single label, DeviceFault naming what keeps the printer from printing, Refused
        while it prints others' labels or the last one is unconfirmed, Cancelled by `stop`, DeviceTimeout or
        ConnectionLost in between: then the label may come out or not, and nothing more is printed before somebody has
        taken note of that.
        """
        stops = self._stops
        try:
            data = zpl.check_label(label)
        except BadLabel as e:
            raise OutOfRange(f"{self._who}: the label {e}") from e
        with self._line.held(self._print_timeout):
            if self._unconfirmed is not None:
                text, remedy = _COMPLAINTS[UNCONFIRMED]
                raise Refused(f"{self._who}: {text}; {remedy}", UNCONFIRMED)
            found = self._ask_status()
            self._raise_if_blocked(found, "nothing was sent")
            if found.buffer_full or not found.idle:
                raise Refused(f"{self._who} is printing labels of somebody else; nothing was sent")
            before = self._ask_counter()
            self._check_not_stopped(stops, "nothing was sent")
            self._unconfirmed = before
            self._alarm(UNCONFIRMED, True)
            self._line.send(data)
            job = self._confirm(before, stops)
            self._settle()
            self._line.observing.settled()
            return job

    def stop(self) -> None:
        """End the wait for a label, which then raises Cancelled; the printer finishes what it has received."""
        self._stops += 1

    def _check_not_stopped(self, stops: int, and_: str) -> None:
        if self._stops != stops:
            raise Cancelled(f"{self._who}: printing was stopped; {and_}")

    def _confirm(self, before: int, stops: int) -> str:
        """Wait until the printer has counted the label; gives the job's id."""
        deadline = time.monotonic() + self._print_timeout
        while True:
            self._check_not_stopped(stops, "the label was sent and may come out; it is not sent again")
            found = self._ask_status()
            counted = self._ask_counter() - before
            if counted == 1 and found.idle:
                return f"{self.name}-{before + 1}"
            if counted not in (0, 1):
                raise DeviceFault(
                    f"{self._who} has counted {counted} labels instead of 1: somebody else prints on it", "", "counter"
                )
            if counted == 0:
                self._raise_if_blocked(found, "the label was sent and may come out later; it is not sent again")
            if time.monotonic() >= deadline:
                raise DeviceTimeout(
                    f"{self._who} has not counted the label within {self._print_timeout:g} s; it is not sent again",
                    f"counter {before}, formats waiting {found.formats_waiting}",
                )
            time.sleep(LOOK_AGAIN)

    # -------------------------------------------------------------------------------- actions
    @action(deadline=DEADLINE)
    def print_label(self, title: str, text: str, code: str, *, an: str | None = None) -> str:
        """Print one label and give the job's id, when the printer has counted it.

        :param title: first line
        :param text: second line
        :param code: content of the bar code (ASCII)
        """
        if not code:
            raise OutOfRange(f"{self._who}: code must not be empty")
        try:
            label = zpl.fill(self._template, {"title": title, "text": text, "code": code})
        except BadLabel as e:
            raise OutOfRange(f"{self._who}: {e}") from e
        return self.print(label)

    @action
    def last_came_out(self, *, an: str | None = None) -> bool:
        """Tell whether a label that was not confirmed has come out after all; printing is then possible again.

        Refused while it still waits in the printer, and when there is no such label.
        """
        with self._line.held():
            before = self._unconfirmed
            if before is None:
                raise Refused(f"{self._who}: every label was confirmed")
            found = self._ask_status()
            counted = self._ask_counter() - before
            if not found.idle:
                blocked = self._blocked_by(found)
                why = f": {_COMPLAINTS[blocked][0]}; {_COMPLAINTS[blocked][1]}" if blocked else ""
                raise Refused(f"{self._who}: the label still waits in the printer{why}")
            if counted not in (0, 1):
                raise DeviceFault(
                    f"{self._who} has counted {counted} labels since; look for the label, then acknowledge",
                    "",
                    "counter",
                )
            self._settle()
            return counted == 1

    @action
    def labels_printed(self, *, an: str | None = None) -> int:
        """Give the number of labels printed in the printer's life."""
        return self.counter()

    @action
    def ready(self, *, an: str | None = None) -> bool:
        """Tell whether it would print a label now."""
        return self.status() == "ready" and self._unconfirmed is None

    # -------------------------------------------------------------------------------- asking
    def _ask_status(self) -> Status:
        """Ask how it is. Raises DeviceFault no_reply: a printer out of labels or with an open head may say nothing."""
        found = self._line.ask(zpl.HOST_STATUS, zpl.status, "~HS")
        blocked = self._blocked_by(found)
        for code in (*_BLOCKING, NO_REPLY):
            self._alarm(code, code == blocked)
        return found

    def _ask_counter(self) -> int:
        return self._line.ask(zpl.getvar(zpl.COUNTER), zpl.number, f"getvar {zpl.COUNTER}")

    def _silent(self, error: DeviceError) -> NoReply:
        self._alarm(NO_REPLY, True)
        return NoReply(
            f"{self._who} does not answer: it is out of labels, its head is open, or the line is broken; "
            f"{_COMPLAINTS[NO_REPLY][1]}",
            f"{error} {error.detail}".strip(),
            NO_REPLY,
        )

    @staticmethod
    def _blocked_by(found: Status) -> str:
        """Give what keeps the printer from printing; empty for nothing. Half a format counts when nothing else does."""
        order = ("head_open", "paper_out", "ribbon_out", "too_hot", "too_cold", "paused", "partial_format")
        return next((name for name in order if getattr(found, name)), "")

    def _raise_if_blocked(self, found: Status, and_: str) -> None:
        if blocked := self._blocked_by(found):
            text, remedy = _COMPLAINTS[blocked]
            raise DeviceFault(f"{self._who}: {text}; {remedy}; {and_}", blocked, blocked)

    # -------------------------------------------------------------------------------- observing
    def _greet(self, deadline: float) -> None:
        limit = min(self._answer_timeout, max(deadline - time.monotonic(), 0.01))
        self._line.ask(zpl.HOST_STATUS, zpl.status, "~HS", limit)
        self._alarm(NO_REPLY, False)

    def _look(self) -> None:
        self._ask_status()

    def _lost(self, error: DeviceError) -> None:
        if not isinstance(error, DeviceFault):
            self._alarm(NO_REPLY, True)

    def _settle(self) -> None:
        self._unconfirmed = None
        self._alarm(UNCONFIRMED, False)

    def _alarm(self, code: str, on: bool) -> None:
        if not on:
            self._alarms.pop(code, None)
        elif code not in self._alarms:
            self._alarms[code] = Alarm(code, Severity.ERROR, *_COMPLAINTS[code], now())

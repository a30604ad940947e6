"""The object type of a barcode reader: each trigger reads one code."""

import threading
import time
from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.device import Health, Identity, LossReaction, Severity
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, Refused
from arcor2_hw.objects import Code, NoRead, Reader
from arcor2_hw.objects.connected import AlarmText
from arcor2_hw.objects.line_device import LineDevice
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.settings import within

from . import lines
from .settings import BarcodeReaderSettings

MAX_SCAN_TIME: Final = 60.0
"""Longest time a program may wait for a code in one call, s."""
MARGIN: Final = 30.0
"""Time beyond MAX_SCAN_TIME for resetting the reader before and after, with the longest allowed timeouts, s."""


class BarcodeReader(LineDevice, Reader):
    """A fixed-mount barcode reader on a serial line or TCP."""

    _ABSTRACT = False
    display_name = "Barcode reader"
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(1.0)  # by the timeout of the reader
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"scan": "stop", "code_present": "stop"}
    ALARMS: ClassVar[Mapping[str, AlarmText]] = {
        "dirty": AlarmText("the window is dirty", "clean the window", Severity.WARNING),
        "hot": AlarmText("the reader is too hot", "improve its ventilation", Severity.WARNING),
        "fail": AlarmText("the reader has failed", "replace the reader"),
    }

    def __init__(self, obj_id: str, name: str, settings: BarcodeReaderSettings) -> None:
        super().__init__(obj_id, name, settings)
        self.use_line(settings.port, settings.baud_rate, settings.answer_timeout)
        self._reading = threading.Lock()
        self._health = Health.NORMAL
        self._present_code = ""

    # -------------------------------------------------------------------------------- connection
    def greet(self, deadline: float) -> None:
        """Request the status repeatedly, because the buffer of the reader may contain a part of an earlier command."""
        while True:
            left = max(deadline - time.monotonic(), 0.01)
            try:
                return self._read_status(min(self.line.answer_timeout, left))
            except DeviceTimeout:
                if left <= self.line.answer_timeout:
                    raise
                self.line.loss = None

    def poll(self) -> None:
        """Ask for the status."""
        self._read_status()

    def _read_status(self, timeout: float = 0.0) -> None:
        status = self._ask(lines.STATUS, lambda line: lines.status(line) is not None, timeout)
        found = lines.status(status)
        assert found is not None
        self._health = found.health
        for code in self.ALARMS:
            self.set_alarm(code, code == found.word.lower())

    def condition(self) -> Health:
        """Return the condition that the reader last reported."""
        return self._health

    def disconnect(self) -> None:
        """End a running reading and close the connection. Do nothing if it is closed."""
        self.stop_waiting()
        super().disconnect()

    def identify(self) -> Identity:
        """Ask the reader for its identity."""
        with self.held():
            found = lines.identity(self._ask(lines.IDENTIFY, lambda line: lines.identity(line) is not None))
        assert found is not None
        return found

    # -------------------------------------------------------------------------------- reading
    def trigger(self, timeout: float) -> Code | NoRead:
        """Read one code. Earlier codes and late ones of other readings do not count.

        Raises ConnectionLost, which names the port, DeviceTimeout when the reader does not answer, Cancelled by `stop`.
        """
        within(f"{self.who}: timeout", timeout, 0.05, MAX_SCAN_TIME, "s")
        self.check()
        go_on = self.begin("reading")
        if not self._reading.acquire(blocking=False):
            raise Refused("{device} is reading already", device=self.who)
        try:
            with self.held():
                self._present_code = ""
                self._reset()
                code = self._read_until(time.monotonic() + timeout, go_on)
                if code is None:
                    self._reset()  # this ends the reading; the answer comes after a code that was decoded just now
                    go_on()
                    return NoRead("timeout")
                self.observing.settled()
                return Code(code)
        finally:
            self._reading.release()

    def _read_until(self, deadline: float, go_on: GoOn) -> str | None:
        """Trigger repeatedly, because the timeout of the reader is shorter. Return None if no code was read."""
        buffer = lines.LineBuffer()
        self.line.send(lines.TRIGGER.encode("ascii") + lines.CR)
        while time.monotonic() < deadline:
            for line in buffer.feed(self.line.receive()):
                if lines.is_code(line):
                    return self._unless_stopped(line, go_on)
                if line == lines.NO_CODE:
                    self.line.send(lines.TRIGGER.encode("ascii") + lines.CR)
            if self._unless_stopped("", go_on) is None:
                return None
        return None

    @staticmethod
    def _unless_stopped(code: str, go_on: GoOn) -> str | None:
        """Return the code; None if the reading was stopped. The caller then resets the reader."""
        try:
            go_on()
        except Cancelled:
            return None
        return code

    def stop(self) -> None:
        """Cancel the reading; a code that was being decoded is discarded.

        Returns when the reader has ended it. Raises DeviceTimeout.
        """
        self.stop_waiting()
        timeout = 3.0 * self.line.answer_timeout
        if not self._reading.acquire(timeout=timeout):
            raise DeviceTimeout(
                "{device} did not end its reading within {timeout:g} s", device=self.who, timeout=timeout
            )
        self._reading.release()

    # -------------------------------------------------------------------------------- commands
    def _reset(self) -> None:
        """Reset the reader. Codes that it sends before its answer do not belong to a later trigger."""
        self._ask(lines.RESET, lambda line: line == lines.RESET_DONE)

    def _ask(self, command: str, answers: Callable[[str], bool], timeout: float = 0.0) -> str:
        """Send a command and return the line that answers it. Raises DeviceFault when the reader rejects it."""

        def found(came: bytes) -> str | None:
            for line in lines.LineBuffer().feed(came):
                if lines.refused(line, command):
                    raise DeviceFault("{device} rejected the command {command}", line, device=self.who, command=command)
                if answers(line):
                    return line
            return None

        return self.ask(command.encode("ascii") + lines.CR, found, command, timeout)

    # -------------------------------------------------------------------------------- actions
    @action(deadline=MAX_SCAN_TIME + MARGIN, again="safe", identifies=True)
    def scan(self, timeout: float = 2.0, *, an: str | None = None) -> str:
        """Read the code in front of the reader; it is an error if there is none.

        :param timeout: time limit, s
        """
        assert 0.05 <= timeout <= 60.0

        code = self.trigger(timeout)
        if isinstance(code, NoRead):
            raise DeviceFault(
                "{device}: no code was read within {timeout:g} s",
                fault_code="no_read",
                device=self.who,
                timeout=timeout,
            )
        return code.text

    @action(deadline=MAX_SCAN_TIME + MARGIN, again="safe")
    def code_present(self, timeout: float = 1.0, *, an: str | None = None) -> bool:
        """Return whether a code is in front of the reader; last_code then returns it, once.

        :param timeout: time limit, s
        """
        assert 0.05 <= timeout <= 60.0

        code = self.trigger(timeout)
        if isinstance(code, Code):
            self._present_code = code.text
        return isinstance(code, Code)

    @action
    def last_code(self, *, an: str | None = None) -> str:
        """Return the code that code_present found, once. A new reading discards it."""
        code, self._present_code = self._present_code, ""
        if not code:
            raise Refused("{device}: no new code has been read. Call code_present first.", device=self.who)
        return code

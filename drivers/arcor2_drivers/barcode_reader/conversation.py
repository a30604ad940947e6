"""The conversation with the reader: one thread hears all that comes, one asker at a time asks and waits."""

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Final

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Severity
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected, Refused
from arcor2_hw.objects.observing import Observing

from . import lines
from .line import SerialLine
from .settings import BarcodeReaderSettings

STATUS_PERIOD: Final = 1.0
"""s between questions how the reader is, while nothing is read."""
INBOX: Final = 64
"""Lines kept for an asker; who is that far behind has nobody who asks."""

LAST_WORD: Final = 0.2
"""s for one who reads to end it before the line is closed."""

_COMPLAINTS: Final = {
    "DIRTY": ("the window is dirty", "clean the window", Severity.WARNING),
    "HOT": ("the reader is too hot", "see that air gets to the reader", Severity.WARNING),
    "FAIL": ("the reader has failed", "replace the reader", Severity.ERROR),
}


class Conversation:
    """Asks the reader, and hears it.

    When an answer is overdue the line is given up and opened anew: what comes late answers nothing.
    """

    def __init__(self, name: str, settings: BarcodeReaderSettings) -> None:
        self.who = f"{name} at {settings.port}"
        self.observing = Observing(self.who, self._open, self._watch, self._close, self._give_up)
        self.alarm: Alarm | None = None
        self._name, self._settings = name, settings
        self._line: SerialLine | None = None
        self._busy = threading.Lock()
        self._reading = False
        self._came = threading.Condition()
        self._inbox: deque[str] = deque(maxlen=INBOX)
        self._loss: DeviceError | None = None
        self._condition = Health.NORMAL

    @property
    def health(self) -> Health:
        """Give the condition the reader told last; failure when it does not tell any more."""
        return Health.FAILURE if self.observing.state in (Connection.LOST, Connection.FAILED) else self._condition

    def close(self) -> None:
        """Stop listening; harmless when closed. Whoever reads has a moment to tell the reader that it may end."""
        self.interrupt()
        if self._busy.acquire(timeout=LAST_WORD):
            self._busy.release()
        self.observing.stop()

    # -------------------------------------------------------------------------------- asking
    @contextlib.contextmanager
    def held(self, reading: bool = False) -> Iterator[None]:
        """Have the conversation alone. Raises NotConnected, ConnectionLost, DeviceTimeout; Refused while one reads."""
        self._check()
        # A question is over soon; a reading is not.
        if self._reading or not self._busy.acquire(timeout=2.0 * self._settings.answer_timeout):
            raise Refused(f"{self.who} is reading already")
        self._reading = reading
        try:
            yield
        finally:
            self._reading = False
            self._busy.release()

    def rest(self) -> None:
        """Return when nobody reads any more. Raises DeviceTimeout."""
        if not self._reading:
            return
        within = 3.0 * self._settings.answer_timeout
        if not self._busy.acquire(timeout=within):
            raise DeviceTimeout(f"{self.who} did not end its reading within {within:g} s")
        self._busy.release()

    def send(self, command: str) -> None:
        """Send a command that has no answer of its own. Raises ConnectionLost."""
        line = self._line
        if line is None or self._loss is not None:
            raise self._lost()
        line.write(command)

    def ask(self, command: str, answers: Callable[[str], bool]) -> str:
        """Send a command and give its answer; what came before it is thrown away. Raises DeviceTimeout, DeviceFault."""
        with self._came:
            self._inbox.clear()
        self.send(command)
        limit = self._settings.answer_timeout
        found = self.next_line(
            time.monotonic() + limit, lambda line: answers(line) or lines.refused(line, command), lambda: False
        )
        if found is None:
            error = DeviceTimeout(f"{self.who} did not answer {command} within {limit:g} s")
            self._give_up(error)
            raise error
        if lines.refused(found, command):
            raise DeviceFault(f"{self.who} does not know the command {command}", found)
        return found

    def next_line(self, deadline: float, wanted: Callable[[str], bool], enough: Callable[[], bool]) -> str | None:
        """Give the next line that is wanted, dropping others; None at the deadline, or when it is `enough`."""
        with self._came:
            while True:
                while self._inbox:
                    if wanted(line := self._inbox.popleft()):
                        return line
                if self._loss is not None or not self.observing.online:
                    raise self._lost()
                left = deadline - time.monotonic()
                if left <= 0.0 or enough():
                    return None
                self._came.wait(left)

    def interrupt(self) -> None:
        """Let the asker look whether it is to give up."""
        with self._came:
            self._came.notify_all()

    def _check(self) -> None:
        try:
            self.observing.check()
        except ConnectionLost:
            raise self._lost() from None
        except NotConnected as error:
            raise NotConnected(f"{self.who} is not connected", error.detail) from None

    def _lost(self) -> DeviceError:
        """Give the error for a line that is given up: what it was given up for."""
        loss = self._loss
        if loss is None:
            return NotConnected(f"{self.who} is not connected")
        return type(loss)(str(loss), loss.detail)

    def _give_up(self, error: DeviceError) -> None:
        with self._came:
            self._loss = self._loss or error
            self._came.notify_all()

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        line = SerialLine(self._name, self._settings.port, self._settings.baud_rate, timeout)
        self._line = line
        # The first question may meet half a command that somebody else has left in the reader.
        for until in (min(deadline, time.monotonic() + self._settings.answer_timeout), deadline):
            line.write(lines.STATUS)
            while time.monotonic() < until:
                if any(self._hear_status(text) for text in line.read()):
                    with self._came:
                        self._inbox.clear()
                        self._loss = None
                    return
        raise DeviceTimeout(f"{self.who} does not answer within {timeout:g} s")

    def _close(self) -> None:
        line, self._line = self._line, None
        if line is not None:
            line.close()

    def _watch(self, stopping: threading.Event) -> None:
        line = self._line
        assert line is not None
        asked = answered = time.monotonic()
        pending = False
        while not stopping.is_set():
            for text in line.read():
                if self._hear_status(text):
                    pending, answered = False, time.monotonic()
                    continue
                with self._came:
                    self._inbox.append(text)
                    self._came.notify_all()
            if self._loss is not None:
                raise self._loss
            clock = time.monotonic()
            if pending and clock - asked > 2.0 * self._settings.answer_timeout:
                raise DeviceTimeout(f"{self.who} has fallen silent")
            if not pending and clock - answered > STATUS_PERIOD and self._busy.acquire(blocking=False):
                try:
                    line.write(lines.STATUS)
                    pending, asked = True, clock
                finally:
                    self._busy.release()

    def _hear_status(self, text: str) -> bool:
        status = lines.status(text)
        if status is None:
            return False
        self._condition = status.health
        complaint = _COMPLAINTS.get(status.word)
        if complaint is None:
            self.alarm = None
        elif self.alarm is None or self.alarm.code != status.word.lower():
            text, remedy, severity = complaint
            self.alarm = Alarm(status.word.lower(), severity, text, remedy, now())
        return True

"""The barcode reader as an object type: reads one code when it is told to, each code once."""

import time
from typing import ClassVar, Final

from arcor2_hw.actions import action
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction
from arcor2_hw.exceptions import Cancelled, DeviceFault, OutOfRange, Refused
from arcor2_hw.objects import Code, NoRead, Reader
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from . import lines
from .conversation import Conversation
from .settings import BarcodeReaderSettings

LONGEST_SCAN: Final = 60.0
"""s a program may wait for a code in one call."""
MARGIN: Final = 30.0
"""s beyond it: coming into step before and after, each with the longest time-out a setting allows."""
NO_READ: Final = "no_read"


class BarcodeReader(Reader):
    """A fixed-mount barcode reader on a serial line or TCP."""

    _ABSTRACT = False
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(1.0)  # by the reader's own time-out
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"scan": "stop", "code_present": "stop"}

    def __init__(self, obj_id: str, name: str, settings: BarcodeReaderSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._conversation = Conversation(name, settings)
        self._who = self._conversation.who
        self._stops = 0
        self._kept = ""

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Open the port and ask how the reader is, within `timeout` s; nothing is read by that.

        Raises NotConnected or DeviceTimeout naming the port.
        """
        self._conversation.observing.start(timeout)

    def disconnect(self) -> None:
        """Close; harmless when closed. A reading under way is ended first."""
        self._stops += 1
        self._conversation.close()

    @property
    def connection(self) -> Connection:
        """Tell how the line is."""
        return self._conversation.observing.state

    @property
    def health(self) -> Health:
        """Give the condition the reader told last; failure when it does not tell any more."""
        return self._conversation.health

    def identify(self) -> Identity:
        """Ask the reader who it is."""
        with self._conversation.held():
            found = lines.identity(
                self._conversation.ask(lines.IDENTIFY, lambda line: lines.identity(line) is not None)
            )
        assert found is not None
        return found

    def alarms(self) -> list[Alarm]:
        """Give the reader's complaint, if it has one. It ends when its cause does; nobody has to acknowledge it."""
        alarm = self._conversation.alarm
        return [] if alarm is None else [alarm]

    # -------------------------------------------------------------------------------- reading
    def trigger(self, timeout: float) -> Code | NoRead:
        """Read one code now. Codes from before this call do not count, nor do late ones after it.

        Raises ConnectionLost naming the port, DeviceTimeout when the reader does not answer, Cancelled by `stop`.
        """
        if not 0.05 <= timeout <= LONGEST_SCAN:
            raise OutOfRange(f"{self._who}: timeout must be 0.05 to {LONGEST_SCAN:g} s, not {timeout!r}")
        stops = self._stops
        talk = self._conversation
        self._kept = ""
        with talk.held(reading=True):
            self._come_into_step()
            deadline = time.monotonic() + timeout
            code = self._read_until(deadline, stops)
            if code is not None and self._stops == stops:
                talk.observing.settled()
                return Code(code)
            # RST ends the reading too, and its answer comes behind a code that was decoded just now.
            self._come_into_step()
        if self._stops != stops:
            raise Cancelled(f"{self._who}: reading was stopped")
        return NoRead("timeout")

    def _come_into_step(self) -> None:
        """Have the reader drop what it is doing; what comes before its answer belongs to no trigger to come."""
        self._conversation.ask(lines.RESET, lambda line: line == lines.RESET_DONE)

    def _read_until(self, deadline: float, stops: int) -> str | None:
        """Trigger again and again, since the reader gives up earlier than we may; None when nothing was read."""
        while self._stops == stops and time.monotonic() < deadline:
            self._conversation.send(lines.TRIGGER)
            line = self._conversation.next_line(
                deadline, lambda text: lines.is_code(text) or text == lines.NO_CODE, lambda: self._stops != stops
            )
            if line is None or line != lines.NO_CODE:
                return line
        return None

    def stop(self) -> None:
        """End a reading under way; called past everything else. What it would still have read is thrown away.

        Returns when the reader has ended it. Raises DeviceTimeout.
        """
        self._stops += 1
        self._conversation.interrupt()
        self._conversation.rest()

    # -------------------------------------------------------------------------------- actions
    @action(deadline=LONGEST_SCAN + MARGIN)
    def scan(self, timeout: float = 2.0, *, an: str | None = None) -> str:
        """Read the code in front of the reader; fails when there is none.

        :param timeout: seconds after which it fails
        """
        assert 0.05 <= timeout <= 60.0

        code = self.trigger(timeout)
        if isinstance(code, NoRead):
            raise DeviceFault(f"{self._who}: no code was read within {timeout:g} s", fault_code=NO_READ)
        return code.text

    @action(deadline=LONGEST_SCAN + MARGIN)
    def code_present(self, timeout: float = 1.0, *, an: str | None = None) -> bool:
        """Tell whether a code is in front of the reader; last_code then gives it, once.

        :param timeout: seconds to look for one
        """
        assert 0.05 <= timeout <= 60.0

        code = self.trigger(timeout)
        if isinstance(code, Code):
            self._kept = code.text
        return isinstance(code, Code)

    @action
    def last_code(self, *, an: str | None = None) -> str:
        """Give the code that code_present found. It is given once, and not after another reading has begun."""
        code, self._kept = self._kept, ""
        if not code:
            raise Refused(f"{self._who}: last_code is refused: code_present has found none that was not given already")
        return code

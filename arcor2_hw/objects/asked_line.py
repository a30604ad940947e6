"""A line on which we ask and the device answers: a serial port or `socket://host:port`, one question at a time."""

import contextlib
import socket
import threading
import time
import urllib.parse
from collections.abc import Callable, Iterator
from typing import Final, TypeVar

import serial

from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    OutOfRange,
    Refused,
)
from arcor2_hw.objects.observing import Observing
from arcor2_hw.objects.settings import check_serial_port

T = TypeVar("T")

LOOK: Final = 0.02
"""s a read waits for the first byte before it looks at the clock."""
WRITE_TIMEOUT: Final = 0.5
LONGEST_ANSWER: Final = 65536
"""Bytes; what is longer is noise."""
LAST_WORD: Final = 0.3
"""s a question under way has to end before the line is closed."""


class AskedLine:
    """Keeps the line open and watched, and gives it to one asker at a time.

    An answer that is overdue gives the line up; it is then opened anew, and what comes late is thrown away.
    greet(deadline) is called when the line was opened, poll() every `period` s while nobody asks; both ask by `ask`
    and raise DeviceError. unasked(data) gets what has come without a question; overdue(error)
    gives the error that a missing answer is.
    """

    def __init__(
        self,
        who: str,
        port: str,
        baud_rate: int,
        answer_timeout: float,
        greet: Callable[[float], None],
        poll: Callable[[], None],
        period: float,
        unasked: Callable[[bytes], None] = lambda _: None,
        lost: Callable[[DeviceError], None] = lambda _: None,
        overdue: Callable[[DeviceTimeout], DeviceError] = lambda error: error,
    ) -> None:
        check_serial_port("port", port)
        self.who = who
        self.answer_timeout = answer_timeout
        self.observing = Observing(who, self._open, self._watch, self._close, self._give_up)
        self._port, self._baud_rate = port, baud_rate
        self._greet, self._poll, self._period, self._unasked = greet, poll, period, unasked
        self._tell_lost, self._overdue = lost, overdue
        self._one = threading.RLock()
        self._serial: serial.Serial | None = None
        self._socket: socket.socket | None = None
        self._loss: DeviceError | None = None

    # -------------------------------------------------------------------------------- asking
    @contextlib.contextmanager
    def held(self, patience: float = 0.0) -> Iterator[None]:
        """Have the line alone. Raises NotConnected or what it was lost by; Refused while another asks."""
        self.check()
        if not self._one.acquire(timeout=patience or 4.0 * self.answer_timeout):
            raise Refused(f"{self.who} is busy with another call")
        try:
            self.check()
            yield
        finally:
            self._one.release()

    def check(self) -> None:
        """Return when the device is observed. Raises NotConnected or what the connection was lost by."""
        try:
            self.observing.check()
        except ConnectionLost as error:
            raise self._lost() or error from None
        except NotConnected as error:
            raise NotConnected(f"{self.who} is not connected", error.detail) from None
        if (lost := self._lost()) is not None:
            raise lost

    def send(self, data: bytes) -> None:
        """Send what has no answer. Raises ConnectionLost, DeviceTimeout."""
        line = self._serial
        if line is None:
            raise self._lost() or NotConnected(f"{self.who} is not connected")
        try:
            line.write(data)
        except serial.SerialTimeoutException as e:
            raise self._failed(DeviceTimeout(f"{self.who} takes no bytes", str(e))) from e
        except (serial.SerialException, OSError, TypeError) as e:
            raise self._failed(self._cut(e)) from e

    def ask(self, question: bytes, answer: Callable[[bytes], T | None], name: str, timeout: float = 0.0) -> T:
        """Send a question and give what `answer` makes of all that came since; what came before is thrown away.

        Raises DeviceTimeout naming the device and the question, or what `overdue` makes of it; ConnectionLost.
        """
        limit = timeout or self.answer_timeout
        self._drain()
        self.send(question)
        deadline = time.monotonic() + limit
        came = b""
        while time.monotonic() < deadline:
            if data := self._read():
                came = (came + data)[-LONGEST_ANSWER:]
                if (found := answer(came)) is not None:
                    return found
        what = "sensibly " if came else ""
        late = DeviceTimeout(f"{self.who} did not answer {what}to {name} within {limit:g} s", repr(came[-200:]))
        raise self._failed(self._overdue(late))

    def close(self) -> None:
        """Stop watching and close; harmless when closed."""
        if self._one.acquire(timeout=LAST_WORD):
            self._one.release()
        self.observing.stop()

    def _lost(self) -> DeviceError | None:
        loss = self._loss
        if loss is None:
            return None
        if isinstance(loss, DeviceFault):
            return type(loss)(str(loss), loss.detail, loss.fault_code)
        return type(loss)(str(loss), loss.detail)

    def _failed(self, error: DeviceError) -> DeviceError:
        self._loss = self._loss or error
        return error

    def _cut(self, error: Exception) -> ConnectionLost:
        return ConnectionLost(f"{self.who}: the connection was lost: unplugged, or the port was closed", str(error))

    def _read(self) -> bytes:
        line = self._serial
        if line is None:
            raise self._lost() or NotConnected(f"{self.who} is not connected")
        try:
            data: bytes = line.read(1)
            return data + line.read(line.in_waiting) if data else b""
        except (serial.SerialException, OSError, TypeError) as e:  # TypeError: closed by another thread meanwhile
            raise self._failed(self._cut(e)) from e

    def _drain(self) -> None:
        line = self._serial
        try:
            waiting = 0 if line is None else line.in_waiting
        except (serial.SerialException, OSError, TypeError) as e:
            raise self._failed(self._cut(e)) from e
        if waiting:
            self._unasked(self._read())

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        if self._port.startswith("socket://"):
            _reach(self.who, self._port, timeout)
        try:
            self._serial = serial.serial_for_url(
                self._port,
                baudrate=self._baud_rate,
                timeout=LOOK,
                write_timeout=WRITE_TIMEOUT,
                exclusive=None if "://" in self._port else True,
            )
        except (serial.SerialException, OSError, ValueError) as e:
            why = "is used by another program" if "exclusively" in str(e) else "cannot be opened"
            raise NotConnected(f"{self.who}: the port {why}", str(e)) from e
        self._socket = getattr(self._serial, "_socket", None)
        with self._one:
            before, self._loss = self._loss, None
            try:
                self._greet(deadline)
            except DeviceError:
                self._loss = before or self._loss
                raise
            self._loss = None

    def _close(self) -> None:
        line, self._serial = self._serial, None
        if line is not None:
            with contextlib.suppress(serial.SerialException, OSError):
                line.close()
        below, self._socket = self._socket, None
        if below is not None:
            below.close()  # pyserial forgets a socket that its peer has reset, without closing it

    def _give_up(self, error: DeviceError) -> None:
        self._loss = self._loss or error
        self._tell_lost(error)

    def _watch(self, stopping: threading.Event) -> None:
        asked = time.monotonic()
        while not stopping.wait(LOOK):
            if self._loss is not None:
                raise self._loss
            if time.monotonic() - asked >= self._period and self._one.acquire(blocking=False):
                try:
                    self._poll()
                finally:
                    self._one.release()
                asked = time.monotonic()


def _reach(who: str, port: str, timeout: float) -> None:
    """See that somebody listens: pyserial itself waits five seconds for that, whatever it is told."""
    where = urllib.parse.urlsplit(port)
    try:
        if where.hostname is None or where.port is None:
            raise ValueError("it must be socket://host:port")
        socket.create_connection((where.hostname, where.port), timeout).close()
    except TimeoutError:
        raise DeviceTimeout(f"{who} cannot be reached within {timeout:.1f} s") from None
    except (OSError, ValueError) as e:
        raise NotConnected(f"{who}: the port cannot be opened", str(e)) from e


def check_line(port: str, baud_rate: int, answer_timeout: float) -> None:
    """Check the settings of a line. Raises OutOfRange with the setting's name."""
    check_serial_port("port", port)
    if not 300 <= baud_rate <= 921600:
        raise OutOfRange(f"baud_rate must be 300 to 921600, not {baud_rate!r}")
    if not 0.1 <= answer_timeout <= 10.0:
        raise OutOfRange(f"answer_timeout must be 0.1 to 10 s, not {answer_timeout!r}")

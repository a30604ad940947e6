"""The process of one device: creates the instance and serves the calls of the cell host.

The cell host starts it with one end of a socket pair (`--fd N`). When the cell host dies, the device is stopped and
disconnected, as the cell host does when the server dies.
"""

import argparse
import contextlib
import faulthandler
import logging
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any, Final

from arcor2_hw.exceptions import Cancelled, InvalidData
from arcor2_hw.objects import Axis, Generic
from arcor2_hw.objects.observing import Observing, listening
from arcor2_hw.runtime.creation import prepare_for_sources
from arcor2_hw.runtime.methods import OBSERVING, STOP_RACE_TIME, stop_of
from arcor2_hw.runtime.own_process import state
from arcor2_hw.runtime.own_process.peer import Header, Kind, Message, Peer

EXIT_TIMEOUT: Final = 1.7
"""Time from the end of the cell host to the exit of this process, even if a call hangs, s."""
STOP_TIMEOUT: Final = 0.5
"""Time limit of a stop before the device is disconnected, s."""
CLOSE_TIMEOUT: Final = 1.0
"""Time limit of disconnecting, s."""
STATE_PERIOD: Final = 0.02
"""Period of the check whether the state of the instance has changed, s."""
STATE_WAIT: Final = 0.1
"""Time that an answer waits until the state has been read, s."""


class _Calls:
    """The running calls of the instance: start time, and an event that is set at the end."""

    def __init__(self) -> None:
        self._running: dict[object, tuple[float, threading.Event]] = {}

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """Count a call as running in this context."""
        key, ended = object(), threading.Event()
        self._running[key] = time.monotonic(), ended
        try:
            yield
        finally:
            del self._running[key]
            ended.set()

    def since(self, moment: float) -> list[threading.Event]:
        """Return the events of the running calls that started after a time."""
        return [ended for start, ended in list(self._running.values()) if start > moment]

    def wait(self, timeout: float) -> None:
        """Wait until no call runs, at most `timeout` s."""
        deadline = time.monotonic() + timeout
        for ended in self.since(0.0):
            ended.wait(max(0.0, deadline - time.monotonic()))


class DeviceServer(Peer):
    """Serve the calls of one instance."""

    def __init__(self, sock: socket.socket) -> None:
        super().__init__(sock, idle=None)  # a driver may require that all calls of a lane run on one thread
        self._instance: Generic | None = None
        self._names: list[str] = []
        self._connected = False
        self._closing = False
        """Whether disconnecting was requested."""
        self._epoch = 0
        """Number of stops so far. A call that arrived before a stop and has not started is cancelled."""
        self._calls = _Calls()
        self._connections: list[Observing] = []
        self._publishing = threading.RLock()
        self._published = b""

    # -------------------------------------------------------------------------------- calls
    def arrived(self, message: Message) -> None:
        """Record the number of stops before a call."""
        if self._is_stop(message.header):
            self._epoch += 1
        message.epoch = self._epoch
        if self._is_own(message.header) and message.header.name in ("cleanup", "connect", "disconnect"):
            self._closing = message.header.name != "connect"

    def _is_stop(self, header: Header) -> bool:
        stops = header.name == ("halt" if isinstance(self._instance, Axis) else "stop")
        return stops and self._is_own(header)

    def _is_own(self, header: Header) -> bool:
        return header.kind is Kind.CALL and header.target == 0 and bool(header.name)

    def execute(self, message: Message) -> Any:
        """Serve a call of the instance, or of an object that was sent as a reference."""
        header = message.header
        if self._instance is None:
            return self._make(message.payload)
        if not self._is_own(header):
            return self.perform(message)
        if self._is_stop(header):
            return self._stop(message)
        if header.name in OBSERVING:
            return self.perform(message)
        with self._calls.running():
            if message.epoch != self._epoch:
                raise Cancelled(
                    "{name}: {method} was stopped before it started", name=self._instance.name, method=header.name
                )
            if self._connected:
                value = self.perform(message)
            else:
                with listening(self._connection_changed):
                    value = self.perform(message)
        self._connected = self._connected or header.name == "connect"
        return value

    def _make(self, payload: bytes) -> tuple[int, frozenset[str]]:
        """Create the instance. Return its number and the names of its public attributes."""
        path, directory, given = self.codec.decode(payload)
        sys.path[:] = path
        os.chdir(directory)
        prepare_for_sources()
        cls, arguments, keywords = self.codec.decode(given)
        with listening(self._connection_changed):
            instance = cls(*arguments, **keywords)
        attributes = frozenset(name for name in getattr(instance, "__dict__", ()) if not name.startswith("_"))
        number = self.codec.export(instance)
        if number != 0:
            raise InvalidData("{cls}: the constructor passed a reference to another process", cls=cls.__name__)
        self._names = state.names_of(cls, attributes)
        self._instance = instance
        threading.Thread(target=self._publish_changes, name="state", daemon=True).start()
        return number, attributes

    def _stop(self, message: Message) -> Any:
        """Stop the device, and stop it again if a call that started just before has not returned.

        The command of such a call may have reached the device after the first stop.
        """
        moment = time.monotonic()
        value = self.perform(message)
        deadline = time.monotonic() + STOP_RACE_TIME / 2
        started = self._calls.since(moment - STOP_RACE_TIME)
        if not all(ended.wait(max(0.0, deadline - time.monotonic())) for ended in started):
            value = self.perform(message)
        return value

    # -------------------------------------------------------------------------------- state
    def flush(self) -> None:
        """Send the state if it has changed."""
        self._publish(STATE_WAIT)

    def _publish(self, within: float = -1) -> None:
        if self._instance is None or not self._publishing.acquire(timeout=within):
            return
        try:
            found = self.codec.encode({name: self._read_state(name) for name in self._names})
            if found != self._published:
                self._published = found
                self.send(Header(Kind.STATE), found)
        except (InvalidData, OSError):
            pass  # the state cannot be pickled, or the cell host has ended
        finally:
            self._publishing.release()

    def _read_state(self, name: str) -> tuple[bool, Any]:
        try:
            value = getattr(self._instance, name)
            if name == "connection_reason":
                value = value or next((each.reason for each in self._connections if each.reason), "")
        except Exception as error:  # noqa: BLE001 - a driver may raise anything
            return False, InvalidData("{name}: {type}: {reason}", name=name, type=type(error).__name__, reason=error)
        return True, value

    def _publish_changes(self) -> None:
        while not self._closed:
            self._publish()
            time.sleep(STATE_PERIOD)

    def _connection_changed(self, connection: Observing) -> None:
        if connection not in self._connections:
            self._connections.append(connection)
        self._publish()

    # -------------------------------------------------------------------------------- end
    def leave(self) -> None:
        """Stop and disconnect the device in bounded time, unless the cell host has done so."""
        instance = self._instance
        if instance is None or self._closing:
            self._calls.wait(STOP_TIMEOUT / 2)
            return
        if (stop := stop_of(instance)) is not None:
            _within(STOP_TIMEOUT, stop)
        self._calls.wait(STOP_TIMEOUT / 2)
        _within(CLOSE_TIMEOUT, instance.cleanup)


def _within(seconds: float, function: Any) -> None:
    """Run a function on a new thread and wait for it, at most `seconds`."""

    def run() -> None:
        with contextlib.suppress(Exception):
            function()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(seconds)


class _LogHandler(logging.Handler):
    """Send the log records of the driver to the cell host."""

    def __init__(self, server: DeviceServer) -> None:
        super().__init__()
        self._server = server

    def emit(self, record: logging.LogRecord) -> None:
        line = record.name, record.levelno, self.format(record)[:65536]
        with contextlib.suppress(OSError):
            self._server.send(Header(Kind.LOG), self._server.codec.encode(line))


def main() -> None:
    """Serve the socket that was inherited as `--fd` until the cell host closes it."""
    parser = argparse.ArgumentParser(description="Run one device. The cell host starts this process.")
    parser.add_argument("--fd", type=int, required=True, help="inherited socket to the cell host")
    options = parser.parse_args()
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # only the cell host ends this process
        signal.signal(each, signal.SIG_IGN)
    faulthandler.enable()
    sys.setswitchinterval(0.0005)  # a call that computes must not delay a stop
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(line_buffering=True, errors="backslashreplace")
    server = DeviceServer(socket.socket(fileno=options.fd))
    logging.basicConfig(level=logging.INFO, handlers=[_LogHandler(server)])
    server.receive()
    faulthandler.dump_traceback_later(EXIT_TIMEOUT, exit=True)  # works even if C code holds the interpreter lock
    server.leave()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(0)


if __name__ == "__main__":
    main()

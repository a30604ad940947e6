"""The cell host's side of the child process of one device: starts it, calls it and reports its end."""

import contextlib
import logging
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, NotConnected, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.objects import Generic
from arcor2_hw.runtime.own_process import state
from arcor2_hw.runtime.own_process.peer import Kind, Message as PeerMessage, Peer
from arcor2_hw.runtime.own_process.stubs import object_stub, stub_class

START_TIMEOUT: Final = 10.0
"""Time for the process to start and import the object type, s. It takes 0.3 s on an idle computer."""
EXIT_WAIT: Final = 0.3
"""Time that the process has to exit after its device was disconnected, s. Then it is killed."""
CLOSE_METHODS: Final = frozenset({"cleanup", "disconnect"})
"""Methods that do nothing after the process has ended."""


class DeviceProcess(Peer):
    """A child process with one instance of an object type.

    The process runs a new interpreter, because a fork may copy a lock that another thread holds.

    Args:
        cls: Object type of the device.
        name: Name of the device, for messages.
        changed: Called, on any thread, when the connection of the device changes.
    """

    def __init__(self, cls: type[Generic], name: str, changed: Callable[[], None] = lambda: None) -> None:
        ours, theirs = socket.socketpair()
        super().__init__(ours)
        self._cls, self._name, self._changed = cls, name, changed
        self._state: state.State = {}
        self._ending = False
        self._end_reason: Message | None = None
        self._end_known = threading.Event()
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 - it runs our own module
                [sys.executable, "-P", "-m", "arcor2_hw.runtime.own_process.child", "--fd", str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
            )
        threading.Thread(target=self._run, name=f"from the process of {name}", daemon=True).start()

    @property
    def pid(self) -> int:
        """Return the process id."""
        return self._process.pid

    # -------------------------------------------------------------------------------- life
    def make(self, arguments: tuple[Any, ...], keywords: Mapping[str, Any]) -> Generic:
        """Call the constructor in the process and return a stub of the instance. Raises what the constructor raises."""
        given = self.codec.encode((self._cls, arguments, dict(keywords)))
        place = self.codec.encode((sys.path, str(Path.cwd()), given))
        ref, attributes = self.request(Kind.CALL, 0, "", place)
        names = state.names_of(self._cls, attributes)
        settings = keywords.get("settings")
        members = {name: self._mirrored(name) for name in names} | {"settings": property(_settings)}
        cls = stub_class(self._cls, attributes, members)
        stub = object_stub(cls, self, ref, settings)
        self.adopt(ref, stub)
        instance: Generic = stub
        return instance

    def _mirrored(self, name: str) -> property:
        def write(_: Any, value: Any) -> None:
            self.write(0, name, value)

        return property(lambda _: state.value_of(self._state, name), write)

    def end(self) -> None:
        """End the process of a disconnected device, and kill it if it does not exit. Further calls do nothing."""
        self._ending = True
        self._end_process()

    def _end_process(self) -> None:
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        try:
            self._process.wait(EXIT_WAIT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _run(self) -> None:
        """Read until the process ends, then report the device as failed."""
        self.receive()
        if not self._ending:  # the process may still run if it closed its end or sent an invalid message
            self._end_process()
        code = self._process.wait()
        self._socket.close()
        self._end_reason = _end_message(self._name, code)
        self._end_known.set()
        if self._ending:
            return
        logging.getLogger(__name__).error("%s", self._end_reason)
        after: dict[str, Any] = {
            "connection": Connection.FAILED,
            "connection_reason": self._end_reason,
            "health": Health.FAILURE,
        }
        if "move_in_progress" in self._state:
            after["move_in_progress"] = False
        self._state = {**self._state, **{name: (True, value) for name, value in after.items()}}
        self._changed()

    # -------------------------------------------------------------------------------- calls
    def request(self, kind: Kind, target: int, name: str, payload: bytes = b"") -> Any:
        """Send a request and wait for the answer.

        Raises:
            NotConnected: The process had ended before the request.
            ConnectionLost: The process ended before it answered.
        """
        if self._closed:
            if name in CLOSE_METHODS:
                return None
            raise NotConnected(self._end_text(), "Try the device again, or start the scene again.")
        return super().request(kind, target, name, payload)

    def lost(self) -> Arcor2Error:
        """Return the error of a call that was not answered."""
        return ConnectionLost(self._end_text())

    def _end_text(self) -> Message:
        self._end_known.wait(2.0 * EXIT_WAIT)
        return self._end_reason or Message.of("{name}: the process of the device has ended", name=self._name)

    def notified(self, message: PeerMessage) -> None:
        """Store a new state of the instance, or log a record of the process."""
        content = self.codec.decode(message.payload)
        if message.header.kind is Kind.LOG:
            logger, level, text = content
            logging.getLogger(logger).log(level, "%s", text)
            return
        before, self._state = self._state, content
        watched = ("connection", "connection_reason")
        if [before.get(name) for name in watched] != [content.get(name) for name in watched]:
            self._changed()


def _settings(stub: Any) -> Any:
    if stub._settings is None:
        raise NotFound("{name} has no settings", name=stub.name)
    return stub._settings


def _end_message(name: str, code: int) -> Message:
    if code >= 0:
        return Message.of("{name}: the process of the device ended with status {code}", name=name, code=code)
    try:
        which: str | Message = signal.Signals(-code).name
    except ValueError:
        which = Message.of("signal {number}", number=-code)
    return Message.of("{name}: the process of the device was killed by {signal}", name=name, signal=which)

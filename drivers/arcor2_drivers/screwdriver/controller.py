"""Controller: the connection to a tightening controller, its newest state, and one request at a time."""

import contextlib
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple, TypeVar

from arcor2_hw.data.base import now
from arcor2_hw.data.device import Identity
from arcor2_hw.exceptions import DeviceError, DeviceFault, DeviceTimeout, NotConnected, NotInControl, Refused
from arcor2_hw.keep_alive import RunningTime
from arcor2_hw.messages import Message, device_at, translatable
from arcor2_hw.objects.line import READ_PERIOD, Line
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.state_observer import Snapshot, StateObserver

from . import telegrams
from .settings import OpenProtocolScrewdriverSettings
from .telegrams import AlarmReport, Mid, Result, Telegram

R = TypeVar("R")
S = TypeVar("S")

MAX_RESULTS: Final = 200
"""Number of results that are stored."""
MIN_REQUEST_TIMEOUT: Final = 0.01
"""Shortest time limit of a request while connecting, s."""

ACKNOWLEDGES: Final = {
    Mid.RESULT: Mid.RESULT_ACKNOWLEDGE,
    Mid.ALARM: Mid.ALARM_ACKNOWLEDGE,
    Mid.ALARM_CLEARED: Mid.ALARM_CLEARED_ACKNOWLEDGE,
    Mid.ALARM_STATUS: Mid.ALARM_STATUS_ACKNOWLEDGE,
}


class Unsupported(Refused):
    """The controller does not support a message, or its revision."""


class State(NamedTuple):
    """What the controller has reported."""

    enabled: bool = False
    """Whether the tool was enabled over this connection. The controller does not report it."""
    total: int = 0
    """Number of results since the first connection."""
    results: tuple[Result, ...] = ()
    """The latest results, at most MAX_RESULTS, in order."""
    alarms: tuple[AlarmReport, ...] = ()

    @property
    def ready(self) -> bool:
        """Return whether no alarm blocks the controller or the tool."""
        return all(alarm.ready for alarm in self.alarms)

    def results_since(self, total: int) -> tuple[Result, ...]:
        """Return the stored results after the first `total`."""
        return self.results[len(self.results) - min(self.total - total, len(self.results)) :]


class Controller(StateObserver[State]):
    """Receives results and alarms, acknowledges them, and sends keep-alive messages.

    Args:
        name: Name of the screwdriver.
        settings: The settings.
        lost: Called once per connection loss.
    """

    period = 0.0  # `read` waits for data itself
    busy_period = 0.005

    def __init__(
        self, name: str, settings: OpenProtocolScrewdriverSettings, lost: Callable[[DeviceError], None]
    ) -> None:
        host = f"[{settings.host}]" if ":" in settings.host else settings.host
        who = device_at(name, f"{host}:{settings.port}")
        self.line = Line(who, f"socket://{host}:{settings.port}", answer_timeout=settings.answer_timeout)
        super().__init__(who)
        self._notify_lost, self._keep_alive = lost, settings.keep_alive
        self.fresh_for = self.answers_within = settings.keep_alive + 2.0 * settings.answer_timeout
        self.identity = Identity()
        self._state = State()
        self._one_request, self._one_sender = threading.Lock(), threading.Lock()
        self._replied = threading.Condition()
        self._awaited: int | None = None
        self._reply: Telegram | None = None
        self._opening = False
        self._ask_at_once = False
        self._asked: float | None = None
        self._sent = 0.0

    # -------------------------------------------------------------------------------- connection
    def open(self, timeout: float) -> Snapshot[State]:
        """Open the connection, start the communication, and subscribe to results and alarms."""
        deadline = time.monotonic() + timeout
        self._buffer = telegrams.TelegramBuffer()
        self._asked = None
        self._state = self._state._replace(enabled=False, alarms=())
        self.line.open(timeout)
        self._opening = True
        try:
            start = self._negotiate(Mid.START, telegrams.START_REVISIONS, deadline)
            self.identity = self._decoded(telegrams.identity, start)
            self._negotiate(Mid.SUBSCRIBE_RESULTS, telegrams.RESULT_REVISIONS, deadline)
            with contextlib.suppress(Unsupported):
                self._negotiate(Mid.SUBSCRIBE_ALARMS, telegrams.ALARM_REVISIONS, deadline)
        finally:
            self._opening = False
        return Snapshot(self._state, time.monotonic(), now())

    def _negotiate(self, mid: Mid, revisions: Sequence[int], deadline: float) -> Telegram:
        """Send a message in the highest of some revisions that the controller supports. Raises Unsupported."""
        for revision in revisions[:-1]:
            with contextlib.suppress(Unsupported):
                return self.request(mid, revision=revision, timeout=self._left(deadline))
        return self.request(mid, revision=revisions[-1], timeout=self._left(deadline))

    def _left(self, deadline: float) -> float:
        return min(max(deadline - time.monotonic(), MIN_REQUEST_TIMEOUT), self.line.answer_timeout)

    def close(self) -> None:
        """Stop the communication and close the connection."""
        if self.line.loss is None:
            with contextlib.suppress(DeviceError):
                self.send(Mid.STOP)
        self.line.close()

    def interrupt(self) -> None:
        """End a reading in progress, because the device is being disconnected."""
        self.close()

    def on_lost(self, error: DeviceError) -> None:
        """Report a connection loss."""
        self._notify_lost(error)

    # -------------------------------------------------------------------------------- requests
    def send(self, mid: int, data: bytes = b"", revision: int = 1) -> None:
        """Send a telegram without waiting for a reply. Raises ConnectionLost, DeviceTimeout, NotConnected."""
        with self._one_sender:
            self.line.send(telegrams.encode(mid, data, revision))
            self._sent = time.monotonic()

    def request(self, mid: Mid, data: bytes = b"", revision: int = 1, timeout: float = 0.0) -> Telegram:
        """Send a request and return its reply. A missing reply ends the connection.

        Args:
            mid: The message.
            data: Its data field.
            revision: Its revision.
            timeout: Time in which the controller has to answer, s; 0 for that of the settings.

        Raises:
            DeviceTimeout: The controller did not answer in time.
            Refused: It rejected the request.
            NotInControl: Its commands are disabled, or another client has control.
        """
        with self._one_request:
            with self._replied:
                self._awaited, self._reply = mid, None
            self.send(mid, data, revision)
            reply = self._await_reply(mid, timeout or self.line.answer_timeout)
        if reply.mid == Mid.ERROR:
            code = self._decoded(telegrams.rejected, reply)[1]
            if code not in telegrams.ALREADY_SUBSCRIBED:
                raise self._refusal(mid, code)
        return reply

    def _await_reply(self, mid: Mid, timeout: float) -> Telegram:
        clock = RunningTime()
        while (reply := self._reply) is None:
            if (loss := self.line.loss_again()) is not None:
                raise loss
            if clock() > timeout:
                text = "{device} did not answer {request} within {timeout:.3g} s"
                late = DeviceTimeout(text, device=self.who, request=telegrams.title(mid), timeout=timeout)
                raise self.line.broken(late)
            if self._opening:
                self._receive()
            else:
                with self._replied:
                    self._replied.wait_for(lambda: self._reply is not None, READ_PERIOD)
        return reply

    def _refusal(self, mid: Mid, code: int) -> DeviceError:
        why = Message.of(telegrams.ERRORS.get(code, translatable("see the manual of the controller")))
        if code in telegrams.CLIENT_CONNECTED:
            closed = "{device} refused the connection: {reason} (error {code})"
            return NotConnected(closed, device=self.who, reason=why, code=code)
        kind: type[DeviceError] = Refused
        if code in telegrams.UNSUPPORTED:
            kind = Unsupported
        elif code in telegrams.NO_CONTROL:
            kind, why = NotInControl, Message.of("{owner} has control", owner=why)
        text = "{device} refused {request}: {reason} (error {code})"
        return kind(text, device=self.who, request=telegrams.title(mid), reason=why, code=code)

    def tool_counters(self) -> dict[str, int]:
        """Request the counters of the tool. Raises Unsupported, DeviceTimeout, ConnectionLost."""
        deadline = time.monotonic() + self.answers_within
        data = self._negotiate(Mid.TOOL_DATA_REQUEST, telegrams.TOOL_DATA_REVISIONS, deadline)
        return self._decoded(telegrams.tool_counters, data)

    def enable(self, on: bool) -> None:
        """Enable or disable the tool."""
        asked = time.monotonic()
        self.request(Mid.ENABLE_TOOL if on else Mid.DISABLE_TOOL)
        self._change(asked, enabled=on)

    def wait(
        self, holds: Callable[[State], bool], timeout: float, operation: str, go_on: GoOn | None = None
    ) -> Snapshot[State]:
        """Send a keep-alive message at once, and return the first state for which `holds` is true."""
        self._ask_at_once = True
        return super().wait(holds, timeout, operation, go_on)

    # -------------------------------------------------------------------------------- on the observing thread
    def read(self) -> State | None:
        """Process received telegrams, and send a keep-alive message when it is due. States are stored by `put`."""
        if (loss := self.line.loss_again()) is not None:
            raise loss
        self._receive()
        present = time.monotonic()
        if self._asked is None:
            if self._ask_at_once or present - self._sent >= self._keep_alive:
                self._ask_at_once, self._asked = False, present
                self.send(Mid.KEEP_ALIVE)
        elif present - self._asked > self.line.answer_timeout:
            text = "{device} did not answer the keep-alive message within {timeout:.3g} s"
            raise self.line.broken(DeviceTimeout(text, device=self.who, timeout=self.line.answer_timeout))
        return None

    def _receive(self) -> None:
        for telegram in self._decoded(self._buffer.feed, self.line.receive()):
            self._handle(telegram)

    def _handle(self, telegram: Telegram) -> None:
        """Process a telegram. Events are acknowledged after they are stored, so that none is lost."""
        arrived, state = time.monotonic(), self._state
        match telegram.mid:
            case Mid.START_ACKNOWLEDGE:
                self._match(Mid.START, telegram)
            case Mid.TOOL_DATA:
                self._match(Mid.TOOL_DATA_REQUEST, telegram)
            case Mid.ACCEPTED:
                self._match(self._decoded(telegrams.accepted, telegram), telegram)
            case Mid.ERROR:
                self._match(self._decoded(telegrams.rejected, telegram)[0], telegram)
            case Mid.KEEP_ALIVE if self._asked is not None:
                asked, self._asked = self._asked, None
                self._change(asked)
            case Mid.RESULT:
                result = self._decoded(telegrams.result, telegram)
                if result not in state.results:  # the controller sends it again if our acknowledgement was lost
                    results = (*state.results, result)[-MAX_RESULTS:]
                    self._change(arrived, total=state.total + 1, results=results)
            case Mid.ALARM | Mid.ALARM_STATUS:
                alarm = self._decoded(telegrams.alarm, telegram)
                others = [each for each in state.alarms if alarm is not None and each.code != alarm.code]
                self._change(arrived, alarms=(*others, *([alarm] if alarm else [])))
            case Mid.ALARM_CLEARED:
                code = telegrams.cleared(telegram)
                self._change(arrived, alarms=tuple(each for each in state.alarms if each.code != code))
        if (acknowledge := ACKNOWLEDGES.get(telegram.mid)) is not None:  # type: ignore[call-overload]
            self.send(acknowledge)

    def _match(self, mid: int, reply: Telegram) -> None:
        """Pass a reply to the thread that awaits it. Other replies are ignored."""
        with self._replied:
            if mid == self._awaited:
                self._awaited, self._reply = None, reply
                self._replied.notify_all()

    def _change(self, asked: float, **changes: Any) -> None:
        """Store a state that is valid since `asked` (monotonic, s)."""
        with self.taking:
            self._state = self._state._replace(**changes)
            if not self._opening:
                self.put(self._state, asked)

    def _decoded(self, decode: Callable[[S], R], data: S) -> R:
        """Decode data of the controller. Invalid data ends the connection."""
        try:
            return decode(data)
        except ValueError as error:
            text = "{device} sent invalid data: {reason}"
            raise self.line.broken(DeviceFault(text, device=self.who, reason=error)) from error

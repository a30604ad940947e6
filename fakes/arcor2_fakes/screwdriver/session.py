"""The session of one client: commands, subscriptions, acknowledgements and the keep-alive timeout."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import TYPE_CHECKING

import msgspec

from arcor2_fakes.screwdriver.telegram import BadHeader, Message, build, numbered, take

if TYPE_CHECKING:
    from arcor2_fakes.screwdriver.controller import Controller
    from arcor2_fakes.screwdriver.tool import Alarm, Tightening
    from arcor2_fakes.wire import Connection

_ATTEMPTS = 4
_SILENT = frozenset({62, 72, 75, 77})  # acknowledgements, which get no reply


class Event(msgspec.Struct, frozen=True):
    """A telegram that the client has to acknowledge."""

    telegram: bytes
    acknowledge: int
    no_ack: bool = False


class Session:
    """A TCP connection of a client. Only MID 0001 is answered before the communication has started."""

    def __init__(self, controller: Controller, connection: Connection) -> None:
        self._controller, self._connection = controller, connection
        self._loop = asyncio.get_running_loop()
        self._stream = bytearray()
        self._events: deque[Event] = deque()
        self._attempts = 0
        self._resend: asyncio.TimerHandle | None = None
        self._quiet: asyncio.TimerHandle | None = None
        self.started = False
        self.results: tuple[int, bool] | None = None  # revision and no-ack flag of the subscription
        self.alarms: int | None = None
        connection.received = self.feed
        connection.closed = self.end
        controller.clients.add(self)

    @property
    def unacknowledged(self) -> int:
        """Return the number of events that the client has not acknowledged."""
        return len(self._events)

    def end(self) -> None:
        """End the session, because the connection is closed."""
        was_started, self.started = self.started, False
        for timer in (self._resend, self._quiet):
            if timer is not None:
                timer.cancel()
        self._events.clear()
        self._controller.left(self, was_started)

    # ------------------------------------------------------------------------------------------------ receiving

    def feed(self, data: bytes) -> None:
        """Receive bytes."""
        self._stream += data
        try:
            while (message := take(self._stream)) is not None:
                self._heard()
                self._obey(message)
        except BadHeader:
            self._connection.close()

    def _heard(self) -> None:
        """Restart the keep-alive timeout."""
        if self._quiet is not None:
            self._quiet.cancel()
        self._quiet = self._loop.call_later(self._controller.keep_alive_timeout, self._connection.close)

    def _obey(self, message: Message) -> None:
        self._controller.received.append(f"{message.mid:04d}")
        if not self.started and message.mid != 1:
            return
        if message.mid in _SILENT:
            self._acknowledged(message.mid)
            return
        if message.mid == 9999:
            self._send(build(9999))
            return
        error = self._controller.refusal(self, message)
        if error:
            self._send(build(4, f"{message.mid:04d}{error:02d}"))
        elif message.mid == 1:
            self.started = True
            self._send(build(2, self._controller.introduction(message.revision), message.revision))
        elif message.mid == 40:
            self._send(build(41, self._controller.tool_data(message.revision), message.revision))
        else:
            self._send(build(5, f"{message.mid:04d}"))
            self._controller.execute(self, message)

    # ------------------------------------------------------------------------------------------------ sending

    def _send(self, telegram: bytes) -> None:
        self._connection.send(telegram)

    def close(self) -> None:
        """Stop the communication; MID 0001 starts it again."""
        self.started = False
        self.results = self.alarms = None
        self._events.clear()
        if self._resend is not None:
            self._resend.cancel()

    def report(self, event: Event) -> None:
        """Send an event after the acknowledgement of the previous events."""
        if event.no_ack:
            self._send(event.telegram)
            return
        self._events.append(event)
        if len(self._events) == 1:
            self._attempts = 0
            self._attempt()

    def _attempt(self) -> None:
        if self._attempts == _ATTEMPTS:
            self._connection.close()
            return
        self._attempts += 1
        self._send(self._events[0].telegram)
        self._resend = self._loop.call_later(self._controller.response_timeout, self._attempt)

    def _acknowledged(self, mid: int) -> None:
        if self._controller.deaf > 0:  # this acknowledgement is lost
            self._controller.deaf -= 1
            return
        if not self._events or self._events[0].acknowledge != mid:
            return
        self._events.popleft()
        if self._resend is not None:
            self._resend.cancel()
        self._attempts = 0
        if self._events:
            self._attempt()

    def report_result(self, result: Tightening) -> None:
        """Send a result to a client that has subscribed."""
        if self.results is not None:
            revision, no_ack = self.results
            data = self._controller.result_data(result, revision)
            self.report(Event(build(61, data, revision), 62, no_ack))

    def report_alarm(self, alarm: Alarm) -> None:
        """Send an alarm that has just been raised."""
        if self.alarms is not None:
            self.report(Event(build(71, _alarm_fields(alarm, self.alarms, text=True), self.alarms), 72))

    def report_alarm_status(self, alarm: Alarm) -> None:
        """Send an alarm that was active before the subscription."""
        revision = self.alarms or 1
        data = _alarm_fields(alarm, revision, text=False, status="1")
        self.report(Event(build(76, data, revision), 77))

    def report_cleared(self, alarm: Alarm) -> None:
        """Report that an alarm was acknowledged at the controller."""
        if self.alarms is not None:
            self.report(Event(build(74, _code(alarm, self.alarms), self.alarms), 75))


def _code(alarm: Alarm, revision: int) -> str:
    return alarm.code.ljust(4 if revision == 1 else 5)


def _alarm_fields(alarm: Alarm, revision: int, *, text: bool, status: str = "") -> bytes:
    values = [status] if status else []
    values += [_code(alarm, revision), str(int(alarm.controller_ready)), str(int(alarm.tool_ready))]
    values.append(alarm.at.strftime("%Y-%m-%d:%H:%M:%S"))
    if text and revision > 1:
        values.append(alarm.text.ljust(50)[:50])
    return numbered(*values)

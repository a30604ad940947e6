"""One end of a session between a server and a node, over NATS."""

import asyncio
import struct
import time
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final, Protocol

import msgspec
from nats.aio.client import Client
from nats.aio.msg import Msg
from nats.errors import Error as NatsError

from arcor2_hw.exceptions import ConnectionLost
from arcor2_hw.messages import Message
from arcor2_server.nodes.confirmation import confirm_sent
from arcor2_server.nodes.content import Content
from arcor2_server.nodes.lanes import END, Header, Lane, LaneReader, LaneWriter, MessageLost
from arcor2_server.nodes.session_clock import SessionClock

BEAT_PERIOD: Final = 0.1
"""Period of the beats in both directions, s."""
SILENCE_TIMEOUT: Final = 0.35
"""Time without a beat after which a session ends, s: motion stops within 0.5 s after a cut."""
CHECK_PERIOD: Final = 0.02
"""Period of the check for silence, s."""
WINDOW: Final = 8
"""Number of parts that are sent on the lane of frames before the receiver has confirmed them."""
MAX_WAITING: Final = 64
"""Number of waiting messages of the lane of frames from which values that may be dropped are dropped."""
FLUSH_TIMEOUT: Final = 1.0
"""Time to send the last messages, s."""
FILES_TIMEOUT: Final = 5.0
"""Time limit for the peer to answer which files it lacks, s."""
FILES_PERIOD: Final = 0.05
"""Period of these requests while files are being sent, s."""
MAX_SUSPENSION: Final = 0.2
"""Growth of the difference between the clocks with and without suspension that ends a session, s."""
_BEAT: Final = struct.Struct("<ddd")
_reason = msgspec.msgpack.Decoder(Message).decode

Connections = Mapping[Lane, Client]
"""The connections of a session, by lane."""


class Handler(Protocol):
    """The user of an end."""

    def received(self, lane: Lane, header: Header, body: bytes) -> None:
        """Handle a message of the peer."""

    def ended(self, reason: Message, by_peer: bool) -> None:
        """Handle the end of the session. This is the last call."""


class SessionEnd:
    """One end of a session. It starts with `open` and ends once, with a reason.

    Args:
        connections: one for each lane. The session ends when one of them ends.
        subject: the subject of the session.
        ours: name of this end in subjects.
        theirs: name of the peer's end in subjects.
        peer: name of the peer for messages.
        handler: receives messages and the end.
        silence: time without a beat after which the session ends, s.
    """

    def __init__(
        self,
        connections: Connections,
        subject: str,
        ours: str,
        theirs: str,
        peer: Message,
        handler: Handler,
        silence: float = SILENCE_TIMEOUT,
    ) -> None:
        self.clock = SessionClock()
        self._connections = connections
        self._out, self._in = f"{subject}.{ours}", f"{subject}.{theirs}"
        self._peer = peer
        self._handler = handler
        self._silence = silence
        self._queues: dict[Lane, asyncio.Queue[tuple[int, float, int, bytes]]] = {
            lane: asyncio.Queue() for lane in Lane
        }
        self._readers = {lane: LaneReader() for lane in Lane}
        self._unconfirmed = asyncio.Semaphore(WINDOW)
        self._number = 0
        self._beat_at = 0.0
        self._beat = (0.0, 0.0)
        """When the peer sent the last beat, on its clock, and when it arrived, on ours."""
        self._suspended_at_start = _suspension()
        self._synchronised = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []
        self._subscriptions: list[Any] = []
        self._over = False

    # -------------------------------------------------------------------------------- life
    async def open(self) -> None:
        """Subscribe, and start to send beats. The peer has to send its first one within the silence limit."""
        for lane in Lane:
            await self._subscribe(lane, f"{self._in}.{lane}", self._receiver(lane))
        await self._subscribe(Lane.STOP, f"{self._in}.beat", self._beat_received)
        await self._subscribe(Lane.FRAMES, f"{self._in}.confirmed", self._confirmed)
        for client in self._connections.values():
            await confirm_sent(client)
        self._beat_at = time.monotonic()

    async def _subscribe(self, lane: Lane, subject: str, handle: Callable[[Msg], Awaitable[None]]) -> None:
        self._subscriptions.append(await self._connections[lane].subscribe(subject, cb=handle))

    def start(self) -> None:
        """Start the tasks. The peer must have opened its end."""
        self._beat_at = time.monotonic()
        name = f"of session {self._out}"
        self._tasks = [asyncio.create_task(self._send(lane), name=f"{lane} {name}") for lane in Lane]
        self._tasks += [
            asyncio.create_task(self._send_beats(), name=f"beats {name}"),
            asyncio.create_task(self._watch(), name=f"silence {name}"),
        ]

    async def synchronised(self) -> None:
        """Wait until times of the peer can be converted, or the session has ended."""
        await self._synchronised.wait()

    def end(self, reason: Message, *, by_peer: bool = False) -> None:
        """End the session."""
        if self._over:
            return
        self._over = True
        for task in self._tasks:
            task.cancel()
        self._synchronised.set()
        self._handler.ended(reason, by_peer)

    def send_end(self, reason: Message) -> None:
        """Ask the peer to end the session."""
        self.send(Lane.CALLS, msgspec.msgpack.encode(reason), END)

    async def finish(self, reason: Message) -> None:
        """Send the waiting messages and the reason, then end the session."""
        if self._over:
            return
        try:
            async with asyncio.timeout(FLUSH_TIMEOUT):
                await self._queues[Lane.FRAMES].join()
                self.send_end(reason)
                await self._queues[Lane.STOP].join()
                await self._queues[Lane.CALLS].join()
                await confirm_sent(self._connections[Lane.CALLS])
        except (TimeoutError, NatsError, OSError):
            pass  # the peer notices the silence
        self.end(reason)

    async def close(self) -> None:
        """Remove the subscriptions after the end."""
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for subscription in self._subscriptions:
            try:
                await subscription.unsubscribe()
            except (NatsError, OSError):
                continue  # the connection has ended

    # -------------------------------------------------------------------------------- sending
    def next_number(self) -> int:
        """Return the number of a message that is sent later, but before which a stop counts as later."""
        self._number += 1
        return self._number

    def send(
        self, lane: Lane, body: bytes, flags: int = 0, *, number: int | None = None, may_drop: bool = False
    ) -> None:
        """Queue a message. Messages of a lane stay in order.

        Args:
            lane: the lane.
            body: the message.
            flags: END for a reason.
            number: its number from `next_number`; None for the next one.
            may_drop: drop the message if the peer does not keep up.
        """
        queue = self._queues[lane]
        if self._over or (may_drop and queue.qsize() >= MAX_WAITING):
            return
        queue.put_nowait((self.next_number() if number is None else number, time.monotonic(), flags, body))

    # -------------------------------------------------------------------------------- files
    async def answer_files(self, missing: Callable[[list[str]], list[str]]) -> None:
        """Answer requests of the peer which of some files are missing here."""

        async def answer(message: Msg) -> None:
            await message.respond(msgspec.json.encode(missing(msgspec.json.decode(message.data, type=list[str]))))

        await self._subscribe(Lane.FRAMES, f"{self._in}.files", answer)

    async def send_files(self, content: Content) -> None:
        """Send the files that the peer does not have.

        Raises:
            ConnectionLost: the peer does not answer.
            OSError: a file cannot be read.
        """
        hashes, sent = content.hashes, set[str]()
        while hashes:
            try:
                answer = await self._connections[Lane.FRAMES].request(
                    f"{self._out}.files", msgspec.json.encode(hashes), FILES_TIMEOUT
                )
            except (NatsError, OSError) as error:
                raise ConnectionLost("Files cannot be sent to {peer}.", str(error), peer=self._peer) from error
            hashes = msgspec.json.decode(answer.data, type=list[str])
            for digest in hashes:
                if digest not in sent:
                    sent.add(digest)
                    self.send(Lane.FRAMES, bytes.fromhex(digest) + content.read(digest))
            if hashes:
                await asyncio.sleep(FILES_PERIOD)

    async def _send(self, lane: Lane) -> None:
        client, queue, writer, subject = (
            self._connections[lane],
            self._queues[lane],
            LaneWriter(),
            f"{self._out}.{lane}",
        )
        try:
            while True:
                number, sent, flags, body = await queue.get()
                for part in writer.parts(number, sent, flags, body):
                    if lane is Lane.FRAMES:
                        await self._unconfirmed.acquire()
                    await client.publish(subject, part)
                queue.task_done()
        except (NatsError, OSError):
            self.connection_lost()

    async def _send_beats(self) -> None:
        client, subject = self._connections[Lane.STOP], f"{self._out}.beat"
        try:
            while True:
                await client.publish(subject, _BEAT.pack(time.monotonic(), *self._beat))
                await asyncio.sleep(BEAT_PERIOD)
        except (NatsError, OSError):
            self.connection_lost()

    # -------------------------------------------------------------------------------- receiving
    def _receiver(self, lane: Lane) -> Callable[[Msg], Awaitable[None]]:
        reader = self._readers[lane]

        async def receive(message: Msg) -> None:
            if self._over:
                return
            try:
                if lane is Lane.FRAMES:
                    await self._connections[lane].publish(f"{self._out}.confirmed", b"")
                found = reader.message(message.data)
            except MessageLost:
                self.end(Message.of("a message of {peer} was lost", peer=self._peer))
                return
            except (NatsError, OSError):
                self.connection_lost()
                return
            if found is None:
                return
            header, body = found
            if header.flags & END:
                self.end(_reason(body), by_peer=True)
            else:
                self._handler.received(lane, header, body)

        return receive

    async def _confirmed(self, _: Msg) -> None:
        self._unconfirmed.release()

    async def _beat_received(self, message: Msg) -> None:
        now = time.monotonic()
        sent, echoed, arrived = _BEAT.unpack(message.data)
        self._beat, self._beat_at = (sent, now), now
        if echoed:
            self.clock.exchanged(echoed, arrived, now)
            self._synchronised.set()

    def local_time(self, moment: float) -> float:
        """Return the earliest possible time on this computer's clock of a time of the peer's clock, s."""
        return self.clock.earliest(moment, time.monotonic())

    def age(self, header: Header) -> float:
        """Return the largest possible age of a message, s."""
        return time.monotonic() - self.local_time(header.sent)

    # -------------------------------------------------------------------------------- loss
    def connection_lost(self) -> None:
        """End the session because a connection has ended."""
        self.end(Message.of("the connection to {peer} was lost: the broker closed it", peer=self._peer))

    async def _watch(self) -> None:
        checked, waited = time.monotonic(), False
        while True:
            await asyncio.sleep(CHECK_PERIOD)
            now = time.monotonic()
            late, checked = now - checked > 3.0 * CHECK_PERIOD, now
            silent = now - self._beat_at > self._silence
            # After a delay of this process, beats that wait in the socket are read first, once.
            wait, waited = silent and late and not waited, silent
            if _suspension() - self._suspended_at_start > MAX_SUSPENSION:
                self.end(Message.of("the connection to {peer} was lost: this computer was suspended", peer=self._peer))
            elif silent and not wait:
                self.end(
                    Message.of(
                        "the connection to {peer} was lost: nothing was received for {seconds:.2f} s",
                        peer=self._peer,
                        seconds=now - self._beat_at,
                    )
                )


def _suspension() -> float:
    """Return for how long this computer was suspended since its start, s."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.monotonic()

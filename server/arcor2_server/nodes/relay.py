"""The process that the server starts in place of a cell host that runs on a node.

It passes the messages between the server's socket (`--fd N`) and the node on, and stores what a run records. Beats, and
the detection of a lost node, do not depend on the load of the server. If the server ends, so does the session, and the
node stops all motion.
"""

import argparse
import asyncio
import contextlib
import os
import secrets
import signal
import socket
import sys
from typing import Final

import msgspec
import uvloop
from nats.errors import Error as NatsError, NoRespondersError, TimeoutError as NatsTimeoutError

from arcor2_hw.exceptions import Arcor2Error, message_of
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.ring import Ring
from arcor2_server.nodes import connections as broker
from arcor2_server.nodes.content import WITH_FILES, Content
from arcor2_server.nodes.conversion import STOPS, for_server, outline
from arcor2_server.nodes.credentials import of_environment
from arcor2_server.nodes.lanes import Header, Lane
from arcor2_server.nodes.opening import Opened, Opening
from arcor2_server.nodes.presence import own_version
from arcor2_server.nodes.run_records import INTERCEPTED, RunRecords
from arcor2_server.nodes.session import SILENCE_TIMEOUT, Connections, SessionEnd
from arcor2_server.nodes.stream import MessageStream

OPEN_TIMEOUT: Final = 3.0
"""Time limit for a node to answer the request to open a session, s."""
END_TIMEOUT: Final = 2.5
"""Time limit for the host on the node to end after the server closed the connection, s."""
STORE_TIMEOUT: Final = 1.0
"""Time limit for the last checkpoint to be stored before the end is reported, s."""
NICENESS: Final = -5
"""Niceness of this process: stops and beats pass through it."""


class Relay:
    """Passes the messages of one session on.

    Args:
        node: name of the node.
        sock: socket to the server.
        ring: the ring of the server; None if nothing is recorded.
    """

    def __init__(self, node: str, sock: socket.socket, ring: Ring | None = None) -> None:
        self._node = node
        self._socket = sock
        self._name = Message.of("the node {node}", node=node)
        self._stream = MessageStream(self._from_server, self.server_closed)
        self._end: SessionEnd | None = None
        self._over: asyncio.Future[Message] = asyncio.get_running_loop().create_future()
        self._closing: asyncio.Task[None] | None = None
        self._waiting: list[tuple[int, str, bytes]] = []
        """Messages that wait until the files of the first one are sent: number, type, message."""
        self._transfer: asyncio.Task[None] | None = None
        self._ring = ring
        self._records: RunRecords | None = None

    async def run(self, silence: float) -> None:
        """Serve until the session ends. Report the reason to the server."""
        await asyncio.get_running_loop().create_unix_connection(lambda: self._stream, sock=self._socket)
        connections: Connections = {}
        try:
            connections = await broker.connect(of_environment(os.environ), self._node, self._broker_lost)
            await self._open(connections, silence)
            reason = await self._over
        except Arcor2Error as error:
            reason = error.message
        if self._records is not None:  # first, because the server reads the checkpoint after the end
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(STORE_TIMEOUT):
                    await self._records.close()
        self._stream.send(msgspec.msgpack.encode(m.HostLost(reason)))
        self._stream.close()
        if self._end is not None:
            await self._end.close()
        await broker.close(connections)

    async def _open(self, connections: Connections, silence: float) -> None:
        """Open the session at the node. Raise Arcor2Error if that is impossible."""
        opening = Opening(secrets.token_hex(8), own_version(), silence)
        subject = broker.session_subject(self._node, opening.session)
        end = self._end = SessionEnd(connections, subject, "server", "node", self._name, self, silence)
        self._records = RunRecords(self._ring, lambda body: end.send(Lane.CALLS, body), end.local_time)
        try:
            await end.open()
            answer = await connections[Lane.CALLS].request(
                broker.open_subject(self._node), msgspec.json.encode(opening), OPEN_TIMEOUT
            )
        except (NoRespondersError, NatsTimeoutError) as error:
            raise Arcor2Error("The node {node} is not connected.", str(error), node=self._node) from error
        except (NatsError, OSError) as error:
            raise Arcor2Error(
                "The node {node} cannot be reached: the broker failed.", str(error), node=self._node
            ) from error
        opened = msgspec.json.decode(answer.data, type=Opened)
        if opened.refusal is not None:
            raise Arcor2Error(opened.refusal)
        end.start()

    # -------------------------------------------------------------------------------- between server and node
    def _from_server(self, body: bytes) -> None:
        if self._end is None:
            return  # the server sends nothing before the host is ready
        kind = outline(body).type
        if kind in STOPS:
            self._end.send(Lane.STOP, body)
        elif kind in WITH_FILES or self._waiting:
            self._waiting.append((self._end.next_number(), kind, body))
            if len(self._waiting) == 1:
                self._transfer = asyncio.create_task(self._send_waiting(self._end), name="transfer of files")
        else:
            self._end.send(Lane.CALLS, body)

    async def _send_waiting(self, end: SessionEnd) -> None:
        """Send the waiting messages, each after its files."""
        while self._waiting:
            number, kind, body = self._waiting[0]
            if kind in WITH_FILES:
                content = Content()
                try:
                    if kind == "RunPackage" and self._records is not None:
                        await asyncio.to_thread(self._records.begin, m.decode_host_bound(body))
                    body = await asyncio.to_thread(content.packed, body)
                    await end.send_files(content)
                except (Arcor2Error, OSError) as error:
                    reason = message_of(error)
                    end.send_end(reason)
                    self.ended(reason, False)
                    return
            end.send(Lane.CALLS, body, number=number)
            del self._waiting[0]

    def received(self, lane: Lane, header: Header, body: bytes) -> None:  # noqa: ARG002 - its order does not matter here
        """Pass a message of the node on."""
        assert self._end is not None
        assert self._records is not None
        kind = outline(body).type
        if kind in INTERCEPTED:
            self._records.handle(kind, body)
            return
        if kind == "ProgramChanged":
            self._records.program_changed(m.decode_server_bound(body))
        self._stream.send(for_server(kind, body, self._end.local_time))

    # -------------------------------------------------------------------------------- end
    def ended(self, reason: Message, by_peer: bool) -> None:  # noqa: ARG002
        """Handle the end of the session."""
        if not self._over.done():
            self._over.set_result(reason)

    def _broker_lost(self) -> None:
        if self._end is not None:
            self._end.connection_lost()

    def server_closed(self) -> None:
        """Handle the end of the server."""
        if self._closing is None:
            self._closing = asyncio.create_task(self._close(), name="end of the session")

    async def _close(self) -> None:
        """End the session; wait until the host on the node has ended."""
        reason = Message.of("the server closed the connection")
        if self._end is not None:
            self._end.send_end(reason)
            if self._records is not None and not self._over.done():
                await self._records.server_ended()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(END_TIMEOUT):
                    await asyncio.shield(self._over)
        self.ended(reason, False)


async def _main(node: str, sock: socket.socket, silence: float, ring: Ring | None) -> None:
    relay = Relay(node, sock, ring)
    # A service manager ends all processes of the server.
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, relay.server_closed)
    await relay.run(silence)


def main() -> None:
    """Serve the socket that was inherited as `--fd`."""
    parser = argparse.ArgumentParser(description="Pass messages to a node on. The server starts this process.")
    parser.add_argument("--fd", type=int, required=True, help="inherited socket to the server")
    parser.add_argument("--node", required=True, help="name of the node")
    parser.add_argument(
        "--silence", type=float, default=SILENCE_TIMEOUT, help="time without a beat until the session ends, s"
    )
    parser.add_argument("--ring", type=int, help="inherited memory of the ring of recent values")
    options = parser.parse_args()
    with contextlib.suppress(OSError):  # not permitted without LimitNICE in the service file
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    ring = None if options.ring is None else Ring(options.ring)
    uvloop.run(_main(options.node, socket.socket(fileno=options.fd), options.silence, ring))
    sys.stdout.flush()


if __name__ == "__main__":
    main()

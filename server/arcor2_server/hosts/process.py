"""One cell host process: its socket, calls, heartbeat and end."""

import asyncio
import contextlib
import itertools
import os
import signal
import socket
from collections.abc import Mapping
from typing import Any, Final, Protocol, TypeVar, cast

import msgspec
import structlog

from arcor2_hw.actions.json_values import encode
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, DeviceTimeout
from arcor2_hw.runtime import messages as m
from arcor2_server.child_process import ChildProcess, describe_exit

log = structlog.get_logger(__name__)
T = TypeVar("T", bound=m.ToServer)

COMMAND: Final = ("-P", "-m", "arcor2_hw.runtime.host")
GOES_WITHIN: Final = 3.0
"""Time limit for a host to end by itself before it is killed, s."""
DEVICES_END_WITHIN: Final = 2.0
"""Time limit for the processes of devices to end after their host, before they are killed, s."""
LAST_WORDS: Final = 0.2
"""Time between the two signs of the end, closed socket and ended process, s."""
HELD_WITHIN: Final = 15.0
"""Time limit for the start of a hold, including taking control, or for a robot to stop, s."""
STOPPED_WITHIN: Final = 3.0
"""Time limit for stopping all devices, s; the host allows the devices two."""
ANSWERS_WITHIN: Final = 5.0
"""Time after the deadline of a call at which the host is reported as not answering, s."""


class CellError(Arcor2Error):
    """An error in the cell host, with the code and type that it has there."""

    def __init__(self, data: m.ErrorData) -> None:
        super().__init__(data.message, data.detail)
        self.code = data.code  # type: ignore[misc]
        self.type = data.type
        self.object_id = data.object_id


class HostUser(Protocol):
    """The user of a host. It receives all messages that answer no call."""

    def host_message(self, host: "CellHost", message: m.ServerBound) -> None:
        """Take a message."""

    def host_silent(self, host: "CellHost", silent: bool) -> None:
        """Handle that the host does not answer, or answers again."""

    def host_ended(self, host: "CellHost", reason: str) -> None:
        """Handle the end of the host; called once, as the last call."""


class _Connection(asyncio.Protocol):
    """Splits the stream into messages."""

    def __init__(self) -> None:
        self.host: CellHost | None = None
        self._buffer = bytearray()
        self.transport: asyncio.Transport | None = None
        self.pieces = 0
        """How often something has come."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast("asyncio.Transport", transport)

    def data_received(self, data: bytes) -> None:
        host, buffer = self.host, self._buffer
        self.pieces += 1
        buffer += data
        if host is None:
            return  # `start` looks again
        start = 0
        try:
            while len(buffer) - start >= m.PREFIX_SIZE:
                end = start + m.PREFIX_SIZE + m.body_length(bytes(buffer[start : start + m.PREFIX_SIZE]))
                if len(buffer) < end:
                    break
                host._receive(m.decode_server_bound(bytes(buffer[start + m.PREFIX_SIZE : end])))
                start = end
        except (msgspec.MsgspecError, ValueError):
            log.exception("the cell host sent what is no message", pid=host.pid)
            host.kill()
            return
        del buffer[:start]

    def connection_lost(self, error: Exception | None) -> None:  # noqa: ARG002 - the process tells why
        if self.host is not None:
            self.host._disconnected()


class CellHost:
    """A running cell host."""

    def __init__(self, process: ChildProcess, connection: _Connection) -> None:
        self.process = process
        self.user: HostUser | None = None
        self.ready: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.ended: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.reason = ""
        """Why the host has ended; empty while it runs."""
        self._connection = connection
        self._number = itertools.count(1)
        self._calls: dict[int, asyncio.Future[bytes]] = {}
        self._waiting: list[tuple[type[m.ToServer], asyncio.Future[Any]]] = []
        self._received_at = asyncio.get_running_loop().time()
        self._silent = False
        self._lost = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []

    @classmethod
    async def start(cls, environment: Mapping[str, str] = os.environ) -> "CellHost":
        """Start the process; it is usable once `ready` is done."""
        ours, theirs = socket.socketpair()
        connection = _Connection()
        try:
            # First the wire, then the process: nothing is awaited between a process and the tasks that look after it.
            await asyncio.get_running_loop().create_unix_connection(lambda: connection, sock=ours)
            process = await ChildProcess.start(COMMAND, theirs, environment)
        except BaseException:
            if connection.transport is not None:
                connection.transport.abort()
            ours.close()
            theirs.close()
            raise
        host = cls(process, connection)
        connection.host = host
        host._tasks = [
            asyncio.create_task(host._read_output(), name=f"output of cell host {process.pid}"),
            asyncio.create_task(host._watch_end(), name=f"end of cell host {process.pid}"),
            asyncio.create_task(host._watch_silence(), name=f"silence of cell host {process.pid}"),
        ]
        connection.data_received(b"")
        return host

    @property
    def pid(self) -> int:
        """Return the process id."""
        return self.process.pid

    @property
    def alive(self) -> bool:
        """Return whether the host has not ended."""
        return not self.reason

    # -------------------------------------------------------------------------------- saying
    def send(self, message: m.ToHost) -> None:
        """Send a message. It is dropped if the host has ended, which is reported to its user."""
        transport = self._connection.transport
        if transport is not None and not transport.is_closing():
            transport.write(m.encode(message))

    async def expect(self, kind: type[T], timeout: float | None = None) -> T:
        """Wait for the next message of a kind; raise ConnectionLost when the host ends before, TimeoutError."""
        future: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        if self.reason:
            raise ConnectionLost(self.reason)
        self._waiting.append((kind, future))
        async with asyncio.timeout(timeout):
            return await future

    async def call(
        self,
        object_id: str,
        method: str,
        arguments: Mapping[str, bytes] | None = None,
        *,
        control: bool = False,
        cancel: bool = False,
        deadline: float | None = None,
    ) -> bytes:
        """Call a method of a device, or cancel it; return the result as JSON, empty for None.

        Raise CellError if the device reports an error, ConnectionLost if the host ends.
        """
        number = next(self._number)
        message = m.Call(number, object_id, method, dict(arguments or {}), control, cancel, deadline)
        return await self._ask(number, message, deadline)

    async def stop_motion(self, object_id: str) -> None:
        """Stop a device past whatever it does. Raise CellError or ConnectionLost if that is impossible."""
        number = next(self._number)
        await self._ask(number, m.StopMotion(number, object_id), None)

    async def stop_all(self) -> list[m.DeviceStop]:
        """Stop the program and all devices; return what became of each.

        Raise ConnectionLost or DeviceTimeout if that is impossible.
        """
        number = next(self._number)
        try:
            async with asyncio.timeout(STOPPED_WITHIN):
                raw = await self._ask(number, m.StopAll(number), None)
        except TimeoutError:
            raise DeviceTimeout("The cell host does not answer.", f"pid {self.pid}") from None
        return msgspec.json.decode(raw, type=list[m.DeviceStop])

    async def lease(self, object_id: str, hold: int, kind: HoldKind, until: float, **motion: Any) -> bytes:
        """Allow a robot to move until a time of the monotonic clock, 0: release it. Return the scale as JSON, or empty.

        motion: the further fields of the message. CellError, ConnectionLost, DeviceTimeout.
        """
        number = next(self._number)
        return await self._ask(number, m.Lease(number, object_id, hold, kind, until, **motion), HELD_WITHIN)

    async def retry(self, object_id: str) -> None:
        """Create and connect a failed object again. Raise CellError or ConnectionLost if that is impossible."""
        number = next(self._number)
        await self._ask(number, m.RetryObject(number, object_id), None)

    async def _ask(self, number: int, message: m.ToHost, deadline: float | None) -> bytes:
        if self.reason:
            raise ConnectionLost(self.reason)
        future: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self._calls[number] = future
        self.send(message)
        try:
            async with asyncio.timeout(None if deadline is None else deadline + ANSWERS_WITHIN):
                return await future
        except TimeoutError:
            raise DeviceTimeout("The cell host does not answer.", f"pid {self.pid}") from None
        finally:
            self._calls.pop(number, None)

    # -------------------------------------------------------------------------------- ending
    def kill(self) -> None:
        """Kill the process."""
        self.process.kill()

    async def close(self, timeout: float = GOES_WITHIN) -> None:
        """Close the socket: the host stops motion, disconnects and ends; killed when it does not. Waits for the end."""
        if self._connection.transport is not None:
            self._connection.transport.close()
        await self.gone(timeout)

    async def gone(self, timeout: float = GOES_WITHIN) -> None:
        """Wait until the process has ended, and kill it after `timeout` s."""
        try:
            async with asyncio.timeout(timeout):
                await asyncio.shield(self.ended)
        except TimeoutError:
            log.warning("cell host killed: it did not end by itself", pid=self.pid)
            self.kill()
            await asyncio.shield(self.ended)
        finally:
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def _disconnected(self) -> None:
        self._lost.set()

    async def _watch_end(self) -> None:
        """Report the end as soon as the process has ended or its socket is closed."""
        waiting = asyncio.create_task(self.process.wait())
        lost = asyncio.create_task(self._lost.wait())
        try:
            await asyncio.wait({waiting, lost}, return_when=asyncio.FIRST_COMPLETED)
            # What it said last is still on its way when the process is gone; the exit status when the socket is.
            received = -1
            while not (lost.done() and waiting.done()) and received != self._connection.pieces:
                # A busy server may have much to take in yet.
                received = self._connection.pieces
                await asyncio.wait({waiting if lost.done() else lost}, timeout=LAST_WORDS)
            if not waiting.done():
                self._report_end("the cell host closed its connection")
                _, late = await asyncio.wait({waiting}, timeout=GOES_WITHIN)
                if late:
                    self.kill()
            self._report_end(f"the cell host {describe_exit(await waiting)}")
        finally:
            self.kill()
            waiting.cancel()
            lost.cancel()
            if self._connection.transport is not None:
                self._connection.transport.abort()
            self.ended.set_result(None)
            asyncio.get_running_loop().call_later(DEVICES_END_WITHIN, self._kill_rest)

    def _kill_rest(self) -> None:
        """Kill processes of devices that a C call keeps from ending, which hold the output of the host open."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)  # the host was the leader of its process group

    def _report_end(self, reason: str) -> None:
        if self.reason:
            return
        self.reason = reason
        error = ConnectionLost(reason)
        for future in [*self._calls.values(), *(future for _, future in self._waiting), self.ready]:
            if not future.done():
                future.set_exception(error)
                future.exception()  # nobody may be waiting
        self._waiting.clear()
        if self.user is not None:
            self.user.host_ended(self, reason)

    # -------------------------------------------------------------------------------- hearing
    def _receive(self, message: m.ServerBound) -> None:
        self._received_at = asyncio.get_running_loop().time()
        if self._silent:
            self._report_silence(False)
        match message:
            case m.Heartbeat():
                return
            case m.Ready():
                if not self.ready.done():
                    self.ready.set_result(None)
                return
            case m.CallDone():
                if (future := self._calls.get(message.id)) is not None and not future.done():
                    future.set_result(message.value)
                return
            case m.CallFailed():
                if (future := self._calls.get(message.id)) is not None and not future.done():
                    future.set_exception(CellError(message.error))
                return
        for waiting in self._waiting:
            kind, expected = waiting
            if isinstance(message, kind):
                self._waiting.remove(waiting)
                if not expected.done():
                    expected.set_result(message)
                break
        if self.user is not None:
            self.user.host_message(self, message)

    async def _watch_silence(self) -> None:
        loop = asyncio.get_running_loop()
        while self.alive and not self._lost.is_set():
            if not self._silent and self.ready.done() and loop.time() - self._received_at > m.SILENCE_LIMIT:
                self._report_silence(True)
            try:
                async with asyncio.timeout(m.HEARTBEAT_PERIOD):
                    await self._lost.wait()
            except TimeoutError:
                continue

    def _report_silence(self, silent: bool) -> None:
        self._silent = silent
        if self.user is not None:
            self.user.host_silent(self, silent)

    async def _read_output(self) -> None:
        """Log what the script, the drivers and vendor libraries print."""
        async for line in self.process.output():
            if self.user is not None:
                self.user.host_message(self, m.LogLine("info", line))
            else:
                log.info("cell host", pid=self.pid, text=line)


def json_of(value: Any) -> bytes:
    """Return an argument of a call as it travels."""
    if isinstance(value, msgspec.Raw):
        return bytes(value)
    return encode(value).encode()

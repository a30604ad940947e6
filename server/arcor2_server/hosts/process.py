"""A cell host process: its socket, calls, heartbeat and end."""

import asyncio
import contextlib
import itertools
import os
import signal
import socket
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Protocol, TypeVar, cast

import msgspec
import structlog

from arcor2_hw.actions.json_values import encode
from arcor2_hw.data.held import HoldChoice
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.parts import ConfirmedPart
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, DeviceTimeout, OutcomeUnknown
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m, ring
from arcor2_hw.runtime.ring import Ring
from arcor2_server.child_process import ChildProcess, describe_exit

log = structlog.get_logger(__name__)
T = TypeVar("T", bound=m.ToServer)

COMMAND: Final = ("-P", "-m", "arcor2_hw.runtime.host")
RELAY_COMMAND: Final = ("-P", "-m", "arcor2_server.nodes.relay")
"""The process in place of a host that runs on a node."""
EXIT_TIMEOUT: Final = 3.0
"""Time limit for a host to end by itself before it is killed, s."""
DEVICE_EXIT_TIMEOUT: Final = 2.0
"""Time limit for the processes of devices to end after their host, before they are killed, s."""
LATE_TIMEOUT: Final = 0.2
"""Time limit between the two signs of the end, closed socket and exit of the process, s."""
HOLD_TIMEOUT: Final = 15.0
"""Time limit for the start of a hold, including taking control, or for a robot to stop, s."""
STOP_TIMEOUT: Final = 3.0
"""Time limit for stopping all devices, s; the host allows the devices 2 s."""
ANSWER_TIMEOUT: Final = 5.0
"""Time after the deadline of a call at which the host is reported as not answering, s."""


class CellError(Arcor2Error):
    """An error of the cell host, with its code and type."""

    def __init__(self, data: m.ErrorData) -> None:
        super().__init__(data.message, data.detail)
        self.data = data
        self.code = data.code  # type: ignore[misc]
        self.type = data.type
        self.object_id = data.object_id


class HostUser(Protocol):
    """The user of a host. It receives all messages that are not answers to calls."""

    def host_message(self, host: "CellHost", message: m.ServerBound) -> None:
        """Handle a message."""

    def host_silent(self, host: "CellHost", silent: bool) -> None:
        """Handle that the host has stopped answering, or answers again."""

    def host_ended(self, host: "CellHost", reason: Message) -> None:
        """Handle the end of the host. This is the last call."""


class _Connection(asyncio.Protocol):
    """Splits the stream into messages."""

    def __init__(self) -> None:
        self.host: CellHost | None = None
        self._buffer = bytearray()
        self.transport: asyncio.Transport | None = None
        self.chunks = 0
        """Number of received chunks."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast("asyncio.Transport", transport)

    def data_received(self, data: bytes) -> None:
        host, buffer = self.host, self._buffer
        self.chunks += 1
        buffer += data
        if host is None:
            return  # `start` calls again
        start = 0
        try:
            while len(buffer) - start >= m.PREFIX_SIZE:
                end = start + m.PREFIX_SIZE + m.body_length(bytes(buffer[start : start + m.PREFIX_SIZE]))
                if len(buffer) < end:
                    break
                host._receive(m.decode_server_bound(bytes(buffer[start + m.PREFIX_SIZE : end])))
                start = end
        except (msgspec.MsgspecError, ValueError):
            log.exception("invalid message of the cell host", pid=host.pid)
            host.kill()
            return
        del buffer[:start]

    def connection_lost(self, error: Exception | None) -> None:  # noqa: ARG002 - the exit status has the reason
        if self.host is not None:
            self.host._lost.set()


class CellHost:
    """A running cell host."""

    def __init__(self, process: ChildProcess, connection: _Connection, ring: Ring, node: str = "") -> None:
        self.process = process
        self.node = node
        """Name of the node on which the host runs; empty for this computer."""
        self.ring = ring
        """The recent values of the devices, also after the end of the host."""
        self.user: HostUser | None = None
        self.ready: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.ended: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.reason: Message | None = None
        """Why the host has ended; empty while it runs."""
        self._connection = connection
        self._number = itertools.count(1)
        self._calls: dict[int, asyncio.Future[m.CallDone]] = {}
        self._waiting: list[tuple[type[m.ToServer], asyncio.Future[Any]]] = []
        self._received_at = asyncio.get_running_loop().time()
        self._silent = False
        self._lost = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []

    @classmethod
    async def start(cls, environment: Mapping[str, str] = os.environ, node: str = "") -> "CellHost":
        """Start the process. It can be used when `ready` is done.

        Args:
            environment: its environment.
            node: name of the node on which the host runs; empty for this computer.
        """
        ours, theirs = socket.socketpair()
        connection = _Connection()
        memory = ring.create()
        try:
            # The connection first: nothing may be awaited between the start of the process and of its tasks.
            await asyncio.get_running_loop().create_unix_connection(lambda: connection, sock=ours)
            command = (*RELAY_COMMAND, "--node", node) if node else COMMAND
            process = await ChildProcess.start(
                (*command, "--ring", str(memory)), theirs, environment, inherited=[memory]
            )
        except BaseException:
            os.close(memory)
            if connection.transport is not None:
                connection.transport.abort()
            ours.close()
            theirs.close()
            raise
        host = cls(process, connection, ring.Ring(memory), node)
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
        """Whether the host has not ended."""
        return self.reason is None

    # -------------------------------------------------------------------------------- sending
    def send(self, message: m.ToHost) -> None:
        """Send a message. It is dropped if the host has ended."""
        transport = self._connection.transport
        if transport is not None and not transport.is_closing():
            transport.write(m.encode(message))

    async def expect(self, kind: type[T], timeout: float | None = None) -> T:
        """Wait for the next message of a type.

        Raises:
            ConnectionLost: the host ended.
            TimeoutError: no message was received within the time limit.
        """
        future: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        if self.reason is not None:
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
        """Call a method of a device, or cancel the call; return the result as JSON, empty for None.

        Raises the same errors as `ask`.
        """
        done = await self.ask(object_id, method, arguments, control=control, cancel=cancel, deadline=deadline)
        return done.value

    async def ask(
        self,
        object_id: str,
        method: str,
        arguments: Mapping[str, bytes] | None = None,
        *,
        control: bool = False,
        cancel: bool = False,
        deadline: float | None = None,
    ) -> m.CallDone:
        """Call a method of a device, or cancel the call; return the answer.

        Raises:
            CellError: the device refused the call or failed.
            ConnectionLost: the host ended.
            DeviceTimeout: the host did not answer in time.
        """
        limit = None if deadline is None else deadline + ANSWER_TIMEOUT
        return await self._ask(m.Call, object_id, method, dict(arguments or {}), control, cancel, deadline, limit=limit)

    async def stop_motion(self, object_id: str) -> None:
        """Stop a device, also while it executes a call. Raise CellError or ConnectionLost if that is impossible."""
        await self._request(m.StopMotion, object_id)

    async def stop_all(self) -> list[m.DeviceStop]:
        """Stop the program and all devices; return the outcome for each device.

        Raises:
            ConnectionLost: the host ended.
            DeviceTimeout: the host did not answer in time.
        """
        return msgspec.json.decode(await self._request(m.StopAll, limit=STOP_TIMEOUT), type=list[m.DeviceStop])

    async def lease(self, object_id: str, hold: int, kind: HoldKind, until: float, **motion: Any) -> bytes:
        """Allow a robot to move until a time of the monotonic clock, s; 0 releases it.

        Args:
            object_id: the robot.
            hold: number of the hold.
            kind: kind of the motion.
            until: end of the lease.
            motion: further fields of the message.

        Returns:
            The scale of the motion as JSON, empty after a release.

        Raises:
            CellError: the robot refused the motion or failed.
            ConnectionLost: the host ended.
            DeviceTimeout: the host did not answer in time.
        """
        limit = HOLD_TIMEOUT + ANSWER_TIMEOUT
        return await self._request(m.Lease, object_id, hold, kind, until, limit=limit, **motion)

    async def force(self, object_id: str, point: str, force: int, value: bool | float, until: float) -> bytes:
        """Force an output.

        Args:
            object_id: the device.
            point: name of the output.
            force: number of the force.
            value: the value.
            until: time of the monotonic clock at which it ends, s.

        Returns:
            ForceStarted as JSON.

        Raises:
            CellError: the output cannot be forced.
            ConnectionLost: the host ended.
            DeviceTimeout: the host did not answer in time.
        """
        limit = HOLD_TIMEOUT + ANSWER_TIMEOUT
        return await self._request(m.ForcePoint, object_id, point, force, value, until, limit=limit)

    async def end_force(self, force: int) -> None:
        """End a force. Raise CellError if the output could not be switched back, ConnectionLost, DeviceTimeout."""
        await self._request(m.EndForce, force, limit=HOLD_TIMEOUT + ANSWER_TIMEOUT)

    async def decide(self, number: int, choice: HoldChoice, results: Sequence[str], exit_id: str) -> None:
        """Continue a held program.

        Args:
            number: the number of the action at which it is held.
            choice: the decision.
            results: for `result`, the results of the action, each as JSON.
            exit_id: for `error_exit`, the id of the logic item; empty for the first exit.

        Raises:
            CellError: the program is not held at this action, or the decision is not possible.
            ConnectionLost: the host ended.
            DeviceTimeout: the host did not answer in time.
        """
        await self._request(m.DecideHeld, number, choice, list(results), exit_id, limit=ANSWER_TIMEOUT)

    async def confirm_parts(self, parts: Sequence[ConfirmedPart]) -> None:
        """Record the places where a person has found parts.

        Raises:
            CellError: an action is running, or the parts contradict each other.
            ConnectionLost: the host ended.
            DeviceTimeout: the host did not answer in time.
        """
        await self._request(m.ConfirmParts, list(parts), limit=ANSWER_TIMEOUT)

    async def retry(self, object_id: str) -> None:
        """Create and connect a failed object again. Raise CellError or ConnectionLost if that is impossible."""
        await self._request(m.RetryObject, object_id)

    async def add(self, opening: m.OpenScene) -> None:
        """Create and connect the only object of a scene in addition to the present ones.

        Raises:
            CellError: the object cannot be created or connected; it is reported as failed.
            ConnectionLost: the host ended.
        """
        await self._request(m.AddObject, opening)

    async def _request(
        self, message: Callable[..., m.ToHost], *fields: Any, limit: float | None = None, **more: Any
    ) -> bytes:
        """Send a message with a new number, and return the value of the answer."""
        return (await self._ask(message, *fields, limit=limit, **more)).value

    async def _ask(
        self, message: Callable[..., m.ToHost], *fields: Any, limit: float | None = None, **more: Any
    ) -> m.CallDone:
        """Send a message with a new number and wait for the answer at most `limit` s."""
        if self.reason is not None:
            raise ConnectionLost(self.reason)
        number = next(self._number)
        future: asyncio.Future[m.CallDone] = asyncio.get_running_loop().create_future()
        self._calls[number] = future
        self.send(message(number, *fields, **more))
        try:
            async with asyncio.timeout(limit):
                return await future
        except TimeoutError:
            raise DeviceTimeout(
                "The cell host (the process with the devices) does not answer.", f"pid {self.pid}"
            ) from None
        finally:
            self._calls.pop(number, None)

    # -------------------------------------------------------------------------------- end
    def kill(self) -> None:
        """Kill the process."""
        self.process.kill()

    async def close(self, timeout: float = EXIT_TIMEOUT) -> None:
        """Close the socket and wait for the end. The host stops all motion, disconnects and ends."""
        if self._connection.transport is not None:
            self._connection.transport.close()
        await self.wait_or_kill(timeout)

    async def wait_or_kill(self, timeout: float = EXIT_TIMEOUT) -> None:
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

    async def _watch_end(self) -> None:
        """Report the end when the process has ended or its socket is closed."""
        waiting = asyncio.create_task(self.process.wait())
        lost = asyncio.create_task(self._lost.wait())
        try:
            await asyncio.wait({waiting, lost}, return_when=asyncio.FIRST_COMPLETED)
            # Wait for the other event, too: the last messages may arrive after the exit of the process, and the exit
            # status after the end of the connection. Repeat while data arrives, which takes time on a busy server.
            received = -1
            while not (lost.done() and waiting.done()) and received != self._connection.chunks:
                received = self._connection.chunks
                await asyncio.wait({waiting if lost.done() else lost}, timeout=LATE_TIMEOUT)
            if not waiting.done():
                self._report_end(Message.of("the cell host closed its connection"))
                _, late = await asyncio.wait({waiting}, timeout=EXIT_TIMEOUT)
                if late:
                    self.kill()
            self._report_end(Message.of("the cell host {end}", end=describe_exit(await waiting)))
        finally:
            self.kill()
            waiting.cancel()
            lost.cancel()
            if self._connection.transport is not None:
                self._connection.transport.abort()
            self.ended.set_result(None)
            asyncio.get_running_loop().call_later(DEVICE_EXIT_TIMEOUT, self._kill_rest)

    def _kill_rest(self) -> None:
        """Kill processes of devices that hang in a C call and keep the output of the host open."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)  # the host was the leader of their process group

    def _report_end(self, reason: Message) -> None:
        if self.reason is not None:
            return
        self.reason = reason
        error = ConnectionLost(reason)
        unanswered = error
        if self.node:
            unanswered = OutcomeUnknown(
                "It is not known whether the call was executed: {reason}. Check the device before you repeat it.",
                reason=reason,
            )
        failed: list[tuple[asyncio.Future[Any], ConnectionLost]] = [(each, unanswered) for each in self._calls.values()]
        for future, why in [*failed, *((each, error) for _, each in self._waiting), (self.ready, error)]:
            if not future.done():
                future.set_exception(why)
                future.exception()  # marks the exception as retrieved, in case no caller awaits it
        self._waiting.clear()
        if self.user is not None:
            self.user.host_ended(self, reason)

    # -------------------------------------------------------------------------------- receiving
    def _receive(self, message: m.ServerBound) -> None:
        self._received_at = asyncio.get_running_loop().time()
        if self._silent:
            self._report_silence(False)
        match message:
            case m.Heartbeat():
                return
            case m.HostLost():
                self._report_end(message.reason)
                return
            case m.Ready():
                if not self.ready.done():
                    self.ready.set_result(None)
                return
            case m.CallDone() | m.CallFailed():
                future = self._calls.get(message.id)
                if future is None or future.done():
                    return
                if isinstance(message, m.CallDone):
                    future.set_result(message)
                else:
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
        """Log the output of the script, drivers and libraries."""
        async for line in self.process.output():
            if self.user is not None:
                self.user.host_message(self, m.LogLine("info", line))
            else:
                log.info("cell host output", pid=self.pid, text=line)


def json_of(value: Any) -> bytes:
    """Return an argument of a call as JSON."""
    if isinstance(value, msgspec.Raw):
        return bytes(value)
    return encode(value).encode()

"""Hold-to-run: assigns moving robots to users, and refuses messages that arrive too late.

The cell host stops the robot when a lease expires (deadman timeout). This module handles users, presses of the button
and connections.
"""

import asyncio
import itertools
import math
from collections.abc import Awaitable, Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.events import HandTeachingModeData, NotificationData, NotificationLevel
from arcor2_hw.data.operation import HoldKind, RobotHoldData
from arcor2_hw.data.rpc import HoldHandTeachingArgs, JogRobotArgs
from arcor2_hw.data.rpc.operation import MAX_LEASE_MS
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.background import BackgroundTasks
from arcor2_server.collaboration.locks import Locks
from arcor2_server.errors import RequestRefused
from arcor2_server.events import Connection, EventHub, make_event
from arcor2_server.hosts.session import HostSession
from arcor2_server.workspace.robots import SceneRobots

log = structlog.get_logger(__name__)

DELAY_WINDOW: Final = 30.0
"""Time window for finding the fastest message, s; the present and the previous window count."""

HoldArgs = JogRobotArgs | HoldHandTeachingArgs


class Delay:
    """Measures the delay of a client's messages relative to its fastest message in the last minute.

    The clocks of client and server may differ and drift.
    """

    def __init__(self) -> None:
        self._window_start = -math.inf
        self._smallest_offsets = [math.inf, math.inf]

    def of(self, sent_ms: float, arrived: float) -> float:
        """Return the delay of a message, s.

        Args:
            sent_ms: time at which it was sent, by the clock of the client, ms.
            arrived: time at which it arrived, by the clock of the server, s.
        """
        offset = arrived - sent_ms / 1e3
        windows = (arrived - self._window_start) / DELAY_WINDOW
        if windows >= 1.0:
            self._window_start = arrived
            self._smallest_offsets = [self._smallest_offsets[1] if windows < 2.0 else math.inf, math.inf]
        self._smallest_offsets[1] = min(self._smallest_offsets[1], offset)
        return offset - min(self._smallest_offsets)


class _Press:
    """One press of the hold-to-run button."""

    def __init__(self, client: Connection, user: str, kind: HoldKind, args: HoldArgs, number: int) -> None:
        loop = asyncio.get_running_loop()
        self.client = client
        self.user = user
        self.kind = kind
        self.robot_id = args.robot_id
        self.arm_id = args.arm_id
        self.press = args.hold
        self.number = number
        self.started = False
        self.over = False
        self.reason: Message | None = None
        """Reason if the server ended the press; None otherwise, for example after a release of the button."""
        self.allowed: asyncio.Future[None] = loop.create_future()
        self.ended: asyncio.Future[None] = loop.create_future()

    def state(self, held: bool, reason: Message | None = None) -> RobotHoldData:
        """Return the data of the event RobotHold."""
        data = RobotHoldData(self.robot_id, self.kind, self.user, held, arm_id=self.arm_id)
        return data if reason is None else replace(data, reason=reason.text, **reason.translation())


class _Scale(Data, frozen=True):
    scale: float


@dataclass(frozen=True, eq=False, slots=True)
class HoldToRun:
    """The active holds, at most one per robot."""

    _host: HostSession
    _hub: EventHub
    _locks: Locks
    _robots: SceneRobots
    _moving: set[str]
    _background: BackgroundTasks
    _numbers: Iterator[int] = field(init=False, default_factory=lambda: itertools.count(1))
    _held: dict[str, _Press] = field(init=False, default_factory=dict)
    _spent: dict[Connection, int] = field(init=False, default_factory=dict)
    """Number of the newest ended press by client. Messages of this press and of earlier ones are refused."""
    _delays: dict[Connection, Delay] = field(init=False, default_factory=dict)
    _taught: dict[tuple[str, str], tuple[Connection, str]] = field(init=False, default_factory=dict)
    """Client and user who switched on the hand teaching mode, by robot and arm."""

    def holder(self, robot_id: str) -> str | None:
        """Return the user who holds a robot, None if it is not held."""
        press = self._held.get(robot_id)
        return None if press is None else press.user

    def states(self) -> list[RobotHoldData]:
        """Return the states of the started holds."""
        return [press.state(True) for press in self._held.values() if press.started]

    # -------------------------------------------------------------------------------- leases
    async def lease(
        self,
        client: Connection,
        user: str,
        args: HoldArgs,
        kind: HoldKind,
        motion: Mapping[str, Any],
        allow: Callable[[], Awaitable[None]],
    ) -> float:
        """Start, renew or end a hold.

        Args:
            client: the client.
            user: its user.
            args: arguments of the request.
            kind: kind of the motion.
            motion: further fields of the lease.
            allow: raises an error if a new hold must not start.

        Returns:
            The scale of the motion, 0 after a release.

        Raises:
            RequestRefused: the robot cannot be held, or the message is too late.
            CellError: the robot refused the motion or failed.
        """
        arrived = asyncio.get_running_loop().time()
        if not 0 <= args.valid_ms <= MAX_LEASE_MS:
            raise RequestRefused(
                "valid_ms must be 0 to {longest_lease_ms}, not {valid_ms}.",
                longest_lease_ms=MAX_LEASE_MS,
                valid_ms=args.valid_ms,
            )
        if args.valid_ms == 0:
            await self._let_go(client, args)
            return 0.0
        delay = self._delays.setdefault(client, Delay()).of(args.sent_ms, arrived)
        until = arrived + args.valid_ms / 1e3 - delay
        if until <= arrived:
            raise RequestRefused("The request arrived {delay:.0f} ms late and was ignored.", delay=delay * 1000.0)
        press = self._held.get(args.robot_id)
        if press is None or press.client is not client or press.press != args.hold or press.kind is not kind:
            press = await self._start(client, user, args, kind, until, allow)
        elif not self._locks.holds(user, args.robot_id):
            self._end(press, Message.of("{user} no longer holds the lock", user=user))
            self._require_lock(user, args.robot_id)
        else:
            await asyncio.shield(press.allowed)
        return await self._send_lease(press, until, motion)

    async def _send_lease(self, press: _Press, until: float, motion: Mapping[str, Any]) -> float:
        if press.over:
            reason = press.reason or Message.of("the button was released")
            raise RequestRefused("The motion was stopped: {reason}.", reason=reason)
        try:
            raw = await self._host.require_online().lease(
                press.robot_id,
                press.number,
                press.kind,
                until,
                **motion,
                arm_id=None if isinstance(press.arm_id, Unset) else press.arm_id,
            )
        except Arcor2Error:
            if not (press.started or press.over):  # the host may not know the hold
                press.reason = Message.of("it could not start")
                await self._release(press, quietly=True)
            raise
        if not press.started and not press.over:
            press.started = True
            self._publish(press, True)
        return msgspec.json.decode(raw, type=_Scale).scale

    async def _start(
        self,
        client: Connection,
        user: str,
        args: HoldArgs,
        kind: HoldKind,
        until: float,
        allow: Callable[[], Awaitable[None]],
    ) -> _Press:
        """Start a hold, after the robot has stopped if the same client held it before."""
        robot_id, loop = args.robot_id, asyncio.get_running_loop()
        name = self._robots.robot(robot_id).name
        self._require_unspent(client, args.hold)
        if (former := self._held.get(robot_id)) is not None and former.client is client:
            self._end(former, None if former.press < args.hold else Message.of("another button was pressed"))
            await asyncio.wait({former.ended}, timeout=until - loop.time())
            if loop.time() >= until:
                raise RequestRefused("{name} is still stopping. Try again when it has stopped.", name=name)
            self._require_unspent(client, args.hold)
        if (former := self._held.get(robot_id)) is not None:
            raise RequestRefused("{name} is being moved by {user}.", name=name, user=former.user)
        self._require_lock(user, robot_id)
        press = self._held[robot_id] = _Press(client, user, kind, args, next(self._numbers))
        try:
            await allow()
            if press.over:
                raise RequestRefused("The motion was stopped: {reason}.", reason=press.reason)
        except BaseException as error:
            self._finish(press, None)
            refusal = error if isinstance(error, Arcor2Error) else RequestRefused("The motion could not start.")
            press.allowed.set_exception(refusal)
            press.allowed.exception()  # marks the exception as retrieved, in case no caller awaits it
            raise
        self._moving.add(robot_id)
        press.allowed.set_result(None)
        return press

    def _require_unspent(self, client: Connection, press: int) -> None:
        if press <= self._spent.get(client, -1):
            raise RequestRefused("That motion has ended. Release the button and press it again.")

    def _require_lock(self, user: str, robot_id: str) -> None:
        locks = self._locks
        if not locks.holds(user, robot_id):
            name, writer = self._robots.robot(robot_id).name, locks.writer_of(robot_id)
            if writer:
                raise RequestRefused("{name} is locked by {user}.", name=name, user=writer)
            raise RequestRefused("Lock {name} before you move it.", name=name)

    # -------------------------------------------------------------------------------- ends
    async def _let_go(self, client: Connection, args: HoldArgs) -> None:
        """End a press and return when the robot has stopped. Do nothing if the press has ended."""
        press = self._held.get(args.robot_id)
        if press is None or press.client is not client or press.press != args.hold:
            self._spent[client] = max(self._spent.get(client, -1), args.hold)
            return
        await self._release(press)

    def _end(self, press: _Press, reason: Message | None) -> None:
        """Start stopping the robot, with a reason for the user."""
        if not press.over:
            press.over, press.reason = True, press.reason or reason
            self._background.spawn(self._release(press, quietly=True), f"end of a hold of {press.robot_id}")

    async def _release(self, press: _Press, *, quietly: bool = False) -> None:
        press.over = True
        try:
            await self._host.require_online().lease(press.robot_id, press.number, press.kind, 0.0)
        except Arcor2Error as error:
            log.warning("held robot not released", robot=press.robot_id, reason=str(error), detail=error.detail)
            if not quietly:
                raise
        finally:
            self._finish(press, press.reason)  # no effect if the host has reported the end

    def ended(self, message: m.HoldEnded) -> None:
        """Finish the hold of a robot that has stopped."""
        press = self._held.get(message.object_id)
        if press is not None and press.number == message.hold:
            self._finish(press, None if message.error is None else message.error.message)

    def _finish(self, press: _Press, reason: Message | None) -> None:
        if press.ended.done():
            return
        press.over = True
        press.reason = press.reason or reason
        press.ended.set_result(None)
        self._spent[press.client] = max(self._spent.get(press.client, -1), press.press)
        if self._held.get(press.robot_id) is press:
            del self._held[press.robot_id]
            self._moving.discard(press.robot_id)
        if press.client not in self._hub.clients:
            self._spent.pop(press.client, None)
        if press.started:
            self._publish(press, False, press.reason)

    def _publish(self, press: _Press, held: bool, reason: Message | None = None) -> None:
        hub, why = self._hub, str(reason or "")
        log.info(
            "hold-to-run motion", robot=press.robot_id, kind=press.kind.value, user=press.user, held=held, reason=why
        )
        hub.broadcast(make_event("RobotHold", press.state(held, reason)))
        if press.kind is HoldKind.HAND_TEACHING:
            data = HandTeachingModeData(press.robot_id, held, press.arm_id)
            hub.broadcast(make_event("HandTeachingMode", data))

    # -------------------------------------------------------------------------------- hand teaching mode
    def teaching_changed(self, client: Connection, user: str, data: HandTeachingModeData) -> None:
        """Record the client that switched hand teaching mode on, so that the mode ends with the connection."""
        key = data.robot_id, data.arm_id or ""
        if data.enabled:
            self._taught[key] = client, user
        else:
            self._taught.pop(key, None)

    def _end_teaching(self, client: Connection, reason: Message) -> None:
        """Switch off the hand teaching modes of a client."""
        for key in [key for key, (owner, _) in self._taught.items() if owner is client]:
            del self._taught[key]
            self._background.spawn(self._switch_off(*key, reason), f"end of hand teaching of {key[0]}")

    async def _switch_off(self, robot_id: str, arm_id: str, reason: Message) -> None:
        arm = {"arm_id": arm_id} if arm_id else {}
        try:
            await self._host.call(robot_id, "set_hand_teaching_mode", {"enabled": False} | arm)
        except Arcor2Error as error:
            log.error("hand teaching cannot be switched off", robot=robot_id, reason=str(error))
            return
        text = Message.of("Hand teaching of {name} was switched off: {reason}.", name=self._robots.robot(robot_id).name,
                          reason=reason)  # fmt: skip
        self._publish_teaching_end(robot_id, arm_id, text)

    def _publish_teaching_end(self, robot_id: str, arm_id: str, reason: Message) -> None:
        hub = self._hub
        hub.broadcast(make_event("HandTeachingMode", HandTeachingModeData(robot_id, False, arm_id or UNSET)))
        notification = NotificationData(reason.text, NotificationLevel.WARN, **reason.translation())
        hub.broadcast(make_event("Notification", notification))

    def teaching_ended(self, message: m.HandTeachingEnded) -> None:
        """Publish that hand teaching mode ended without a request."""
        log.warning("hand teaching ended", robot=message.object_id, reason=message.error.message.text)
        self._taught.pop((message.object_id, message.arm_id or ""), None)
        self._publish_teaching_end(message.object_id, message.arm_id or "", message.error.message)

    # -------------------------------------------------------------------------------- clients
    def forget(self, client: Connection) -> None:
        """Release the robots of a client that disconnected."""
        self._delays.pop(client, None)
        self._spent.pop(client, None)
        for press in [press for press in self._held.values() if press.client is client]:
            self._end(press, Message.of("{user} is no longer connected", user=press.user))
        user = next((user for owner, user in self._taught.values() if owner is client), "")
        self._end_teaching(client, Message.of("{user} is no longer connected", user=user))

    def logged_off(self, client: Connection, reason: Message) -> None:
        """Release the robots of a client at which a person was logged off."""
        for press in [press for press in self._held.values() if press.client is client]:
            self._end(press, reason)
        self._end_teaching(client, reason)

    def stop(self, by: str) -> None:
        """End all holds because a user sent StopAll."""
        reason = Message.of("{user} stopped all motion", user=by) if by else Message.of("all motion was stopped")
        for press in list(self._held.values()):
            self._end(press, reason)

    def offline(self, reason: Message | None) -> None:
        """Finish all holds after the scene went offline. The host has stopped the robots."""
        self._taught.clear()
        for press in list(self._held.values()):
            self._finish(press, reason or Message.of("the scene is offline"))

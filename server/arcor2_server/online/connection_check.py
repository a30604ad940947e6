"""Checks the connection to a device before it is added to a scene, in a cell host of its own."""

import asyncio
import time
from dataclasses import dataclass
from typing import Final

import msgspec

from arcor2_hw.data.device import Alarm, Health, Identity
from arcor2_hw.data.rpc import CheckConnectionData
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.pool import CellHosts
from arcor2_server.hosts.process import CellError, CellHost
from arcor2_server.hosts.session import READ_TIMEOUT
from arcor2_server.online.scene_opening import SceneOpening

CHECK_TIMEOUT: Final = 30.0
"""Time limit for importing the object type and connecting the device, s; the host has a shorter limit."""


class _Outcome:
    """Receives the messages of the host."""

    def __init__(self) -> None:
        self.opened: asyncio.Future[m.ErrorData | None] = asyncio.get_running_loop().create_future()
        self.health = Health.NORMAL
        self.alarms: list[Alarm] = []

    def host_message(self, host: CellHost, message: m.ServerBound) -> None:  # noqa: ARG002
        match message:
            case m.DeviceChanged():
                self.health, self.alarms = message.health, message.alarms
            case m.SceneOpened() if not self.opened.done():
                self.opened.set_result(None)
            case m.SceneFailed() if not self.opened.done():
                self.opened.set_result(message.error)
            case _:
                pass

    def host_silent(self, host: CellHost, silent: bool) -> None:
        """Do nothing, because the time limit ends the check."""

    def host_ended(self, host: CellHost, reason: Message) -> None:  # noqa: ARG002
        if not self.opened.done():
            self.opened.set_exception(ConnectionLost("Connection to the devices lost: {reason}.", reason=reason))


@dataclass(frozen=True, slots=True)
class ConnectionCheck:
    """Connects a device, reads its state, and disconnects it. Nothing is switched or moved."""

    _pool: CellHosts
    _opening: SceneOpening

    async def run(self, obj: SceneObject) -> CheckConnectionData:
        """Check the connection to a device that need not be in the scene.

        Raises:
            Arcor2Error: the device cannot be connected; the message states the reason.
        """
        message, _ = await self._opening.prepare(Scene("", objects=[obj]), False)
        began = time.monotonic()
        outcome = _Outcome()
        host = await self._pool.take(outcome, self._pool.node_of(obj))
        try:
            host.send(message)
            try:
                async with asyncio.timeout(CHECK_TIMEOUT):
                    error = await outcome.opened
            except TimeoutError:
                raise RequestRefused("The device was not connected within {limit:g} s.", limit=CHECK_TIMEOUT) from None
            if error is not None:
                raise CellError(error)
            seconds = time.monotonic() - began
            try:
                identity = msgspec.json.decode(
                    await host.call(obj.id, "identify", deadline=READ_TIMEOUT) or b"{}", type=Identity
                )
            except (Arcor2Error, msgspec.MsgspecError):  # not every type can be identified
                identity = Identity()
            return CheckConnectionData(identity, outcome.health, outcome.alarms, seconds)
        finally:
            await host.close()
            self._pool.prepare()

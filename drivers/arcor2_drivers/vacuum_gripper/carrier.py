"""Carrier: the robot or I/O block whose points the gripper uses, found in the scene by its name."""

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Final, cast

from arcor2_hw.data.device import Connection, Reading
from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceTimeout,
    InvalidData,
    NotConnected,
    NotInControl,
    OutOfRange,
    Refused,
    Stale,
)
from arcor2_hw.keep_alive import RunningTime
from arcor2_hw.messages import Message
from arcor2_hw.objects import Generic
from arcor2_hw.objects.small import HasPoints, IOPoint, OnLoss, PointDirection, PointKind

ONLINE: Final = (Connection.ONLINE, Connection.BACK)
POLL: Final = 0.01
"""Time between two checks whether the carrier is connected, s."""
_RENAMED: Final = (ConnectionLost, DeviceTimeout, NotConnected, NotInControl, OutOfRange, Refused, Stale)


class Carrier:
    """Access to the points of the carrier. Its errors name the gripper and the carrier."""

    def __init__(self, gripper: str, name: str) -> None:
        self.gripper, self.name = gripper, name
        self._find: Callable[[str], Generic] | None = None
        self._found: Generic | None = None

    def attach(self, find: Callable[[str], Generic]) -> None:
        """Store the function that finds objects of the scene."""
        self._find = find

    @contextlib.contextmanager
    def _named_errors(self) -> Iterator[None]:
        try:
            yield
        except _RENAMED as e:
            if str(e).startswith(self.gripper):
                raise
            raise type(e)(
                "{gripper} on {carrier}: {reason}", e.detail, gripper=self.gripper, carrier=self.name, reason=e
            ) from e

    # -------------------------------------------------------------------------------- connection
    def open(self, point: str, timeout: float, abandoned: Callable[[], bool]) -> None:
        """Find the carrier and wait until it is connected and its points can be read.

        Args:
            point: A point that is read; whether it exists is checked by `require`.
            timeout: Time limit, s.
            abandoned: Returns whether the gripper is being disconnected, which ends the wait.

        Raises:
            NotFound: The scene has no object of its name.
            InvalidData: The object has no points.
            NotConnected: It is not connected in time, or the wait was abandoned.
            DeviceTimeout: It does not answer.
        """
        reason = ""
        clock, reading = RunningTime(), 0.0

        def online() -> bool:
            nonlocal reason
            try:
                self._found = self._look_up()
            except NotConnected as e:  # the scene is still creating the carrier
                reason = str(e)
                return False
            reason = f"{self.name} is {self._found.connection.value}"
            return self._found.connection in ONLINE and readable()

        def readable() -> bool:
            nonlocal reason, reading
            began = time.monotonic()
            try:
                self.read(point)
            except (ConnectionLost, NotConnected) as e:  # the carrier is about to reconnect
                reason = str(e)
                reading += time.monotonic() - began  # the clock counts only the beginning of a long call
                return False
            except OutOfRange:  # the carrier has no such point
                pass
            return True

        while abandoned() or not online():
            if abandoned() or clock() + reading >= timeout:
                raise NotConnected(
                    "{gripper}: {carrier} is not connected. Connect it first.",
                    reason,
                    gripper=self.gripper,
                    carrier=self.name,
                )
            time.sleep(POLL)

    def _look_up(self) -> Generic:
        if self._find is None:
            raise InvalidData("{gripper} needs a scene with {carrier}.", gripper=self.gripper, carrier=self.name)
        found = self._find(self.name)
        if not isinstance(found, HasPoints):
            raise InvalidData(
                "{gripper}: {carrier} ({type}) has no inputs and outputs.",
                gripper=self.gripper,
                carrier=self.name,
                type=type(found).__name__,
            )
        return found

    def close(self) -> None:
        """Forget the carrier, which stays as it is."""
        self._found = None

    def check_online(self) -> None:
        """Raise NotConnected before `open`, ConnectionLost while the carrier is not connected."""
        if (state := self.object.connection) not in ONLINE:
            raise ConnectionLost(
                "{gripper}: {carrier} is {state}.", gripper=self.gripper, carrier=self.name, state=state.value
            )

    @property
    def object(self) -> Generic:
        """Return the carrier. Raise NotConnected before `open`."""
        if self._found is None:
            raise NotConnected("{gripper} is not connected to {carrier}.", gripper=self.gripper, carrier=self.name)
        return self._found

    @property
    def _points(self) -> HasPoints:
        return cast("HasPoints", self.object)

    # -------------------------------------------------------------------------------- points
    def require(self, name: str, direction: PointDirection, kind: PointKind) -> IOPoint:
        """Return a point of the carrier. Raise InvalidData without a point of this name, direction and kind."""
        points = {p.name: p for p in self._points.points() if p.direction is direction and p.kind is kind}
        if name not in points:
            raise InvalidData(
                "{gripper}: {carrier} has no {kind_of_point} {point!r}; it has {points}.",
                gripper=self.gripper,
                carrier=self.name,
                kind_of_point=f"{kind.value} {direction.value}",
                point=name,
                points=", ".join(points) or Message.of("none"),
            )
        return points[name]

    def require_holding(self, name: str) -> None:
        """Raise InvalidData unless an output keeps its state when the connection to the carrier is lost."""
        point = self.require(name, PointDirection.OUTPUT, PointKind.DIGITAL)
        if point.on_loss is not OnLoss.HOLD:
            raise InvalidData(
                "{gripper}: {point} of {carrier} goes {state} on a loss of the connection. Set it to hold.",
                "otherwise a gripped part would fall",
                gripper=self.gripper,
                point=name,
                carrier=self.name,
                state=point.on_loss,
            )

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point. Raise NotConnected, ConnectionLost, DeviceTimeout or Stale."""
        with self._named_errors():
            return self._points.read(name)

    def write(self, name: str, on: bool) -> None:
        """Switch an output. Raise NotInControl, or as `read`."""
        with self._named_errors():
            self._points.write(name, on)

    # -------------------------------------------------------------------------------- control
    def control_owner(self) -> str | None:
        """Return who has control of the carrier."""
        with self._named_errors():
            return self.object.control_owner()

    def take_control(self) -> None:
        """Take control of the carrier. Raise as the carrier does."""
        with self._named_errors():
            self.object.take_control()

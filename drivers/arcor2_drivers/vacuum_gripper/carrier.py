"""The robot or I/O block whose points the gripper uses, found in the scene by its name."""

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Final, cast

from arcor2_hw.data.device import Connection, Reading
from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceTimeout,
    InvalidData,
    NotConnected,
    NotInControl,
    OutOfRange,
    Refused,
    Stale,
)
from arcor2_hw.objects import Generic
from arcor2_hw.objects.small import HasPoints, IOPoint, OnLoss, PointDirection, PointKind

UP: Final = (Connection.ONLINE, Connection.BACK)
POLL: Final = 0.01
_NAMED: Final = (ConnectionLost, DeviceTimeout, NotConnected, NotInControl, OutOfRange, Refused, Stale)


class Carrier:
    """The way to the points; every error names the gripper and the carrier."""

    def __init__(self, name: str, carrier: str) -> None:
        self.name = name
        self.carrier = carrier
        self._find: Callable[[str], Generic] | None = None
        self._found: Generic | None = None

    def attach(self, find: Callable[[str], Generic]) -> None:
        """Take what finds objects."""
        self._find = find

    @contextlib.contextmanager
    def _naming(self) -> Iterator[None]:
        try:
            yield
        except _NAMED as e:
            if str(e).startswith(self.name):
                raise
            raise type(e)(f"{self.name} on {self.carrier}: {e}", e.detail) from e

    # -------------------------------------------------------------------------------- life
    def connect(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until the carrier is connected and `check` passes.

        A carrier whose connection is lost during the check is waited for, too: it reports the loss a little later.

        Raises:
            NotConnected: The carrier was not connected within `timeout` s.
            NotFound, InvalidData: There is no such carrier, or it does not pass the check.
        """
        until = time.monotonic() + timeout
        while True:
            try:
                self._found = self._look()
                check()
                return
            except (NotConnected, ConnectionLost) as e:
                left = until - time.monotonic()
                if left <= 0.0:
                    raise NotConnected(
                        "{name}: {carrier} is not connected", str(e), name=self.name, carrier=self.carrier
                    ) from None
            time.sleep(min(POLL, left))

    def _look(self) -> Generic:
        if self._find is None:
            raise InvalidData("{name} stands alone: there is no {carrier}", name=self.name, carrier=self.carrier)
        found = self._find(self.carrier)
        if not isinstance(found, HasPoints):
            raise InvalidData(
                "{name}: {carrier} ({type}) has no points to use",
                name=self.name,
                carrier=self.carrier,
                type=type(found).__name__,
            )
        if found.connection not in UP:
            raise NotConnected("{carrier} is {value}", carrier=self.carrier, value=found.connection.value)
        return found

    def disconnect(self) -> None:
        """Let go of the carrier, which stays as it is."""
        self._found = None

    @property
    def object(self) -> Generic:
        """Return the carrier; NotConnected before `connect`."""
        if self._found is None:
            raise NotConnected("{name} is not connected to {carrier}", name=self.name, carrier=self.carrier)
        return self._found

    @property
    def connection(self) -> Connection:
        """Return the state of the carrier's connection."""
        return Connection.OFFLINE if self._found is None else self._found.connection

    def require_up(self) -> None:
        """Return while the carrier is connected. Raises NotConnected, ConnectionLost."""
        if self.object.connection not in UP:
            raise ConnectionLost(
                "{name}: {carrier} is {value}",
                self.reason(),
                name=self.name,
                carrier=self.carrier,
                value=self.connection.value,
            )

    @property
    def _points(self) -> HasPoints:
        return cast("HasPoints", self.object)

    # -------------------------------------------------------------------------------- points
    def require(self, name: str, direction: PointDirection, kind: PointKind) -> IOPoint:
        """Return a point of the carrier; InvalidData when there is none of that name and kind."""
        for point in self._points.points():
            if point.name == name and point.direction is direction and point.kind is kind:
                return point
        wanted = f"{kind.value} {direction.value}"
        there = ", ".join(p.name for p in self._points.points() if p.direction is direction and p.kind is kind)
        raise InvalidData(
            "{name}: {carrier} has no {wanted} {other_name!r}; it has {there}",
            name=self.name,
            carrier=self.carrier,
            wanted=wanted,
            other_name=name,
            there=there or "none",
        )

    def require_holding(self, name: str) -> None:
        """InvalidData unless an output keeps its state when the carrier loses us: a part would fall."""
        point = self.require(name, PointDirection.OUTPUT, PointKind.DIGITAL)
        if point.on_loss is not OnLoss.HOLD:
            raise InvalidData(
                "{name}: {other_name} of {carrier} goes {on_loss} on a loss; it must hold",
                "a part that is held would fall when the hub is gone",
                name=self.name,
                other_name=name,
                carrier=self.carrier,
                on_loss=point.on_loss,
            )

    def read(self, name: str) -> Reading[bool | float]:
        """Read a point. Raises NotConnected, ConnectionLost, DeviceTimeout, Stale."""
        with self._naming():
            return self._points.read(name)

    def write(self, name: str, on: bool) -> None:
        """Switch an output. Raises NotInControl, and as `read`."""
        with self._naming():
            self._points.write(name, on)

    # -------------------------------------------------------------------------------- control
    def control_owner(self) -> str | None:
        """Return who has control of the carrier."""
        with self._naming():
            return self.object.control_owner()

    def take_control(self) -> None:
        """Take control of the carrier. Raises as the carrier does."""
        with self._naming():
            self.object.take_control()

    def reason(self) -> str:
        """Return why the carrier's connection is lost."""
        with contextlib.suppress(DeviceError):
            return self.object.connection_reason
        return ""

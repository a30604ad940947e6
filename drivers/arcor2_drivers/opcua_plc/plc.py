"""Plc: connection, life signs in both directions, control and points of a PLC."""

import contextlib
import threading
import time
from collections import deque
from typing import Any, Final, NamedTuple

from asyncua import ua

from arcor2_hw.data.device import Quality
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    OutOfRange,
    Refused,
    Stale,
)
from arcor2_hw.objects.observing import Observing

from .edges import Edges
from .link import Link, status_name
from .points import Point, parse_handshake, parse_points
from .settings import OpcUaPlcSettings
from .values import INTEGERS, fits, quality, raw, stamp, type_of

BEATS: Final = 5
"""Number of changes of our life sign within the shorter of both timeouts."""
SERVER_STATE: Final = 2259
LONGEST_MEMORY: Final = 1000
"""Number of notifications that are stored for calls that wait."""
IDLE_WITHIN: Final = 1.0
LEAVING: Final = 0.3
"""Time limit for releasing control when the connection is closed, s."""


class Handshake(NamedTuple):
    """The variables of the handshake that the PLC writes, read in one request."""

    owner: int
    busy: bool
    done: bool
    error: bool
    code: int


class Plc:
    """Connection, life signs, control and points. `Jobs` runs the handshake of a job."""

    def __init__(self, name: str, settings: OpcUaPlcSettings) -> None:
        self.settings = settings
        self.who = f"{name} at {settings.url}"
        self.points = parse_points(settings.points)
        self.handshake_nodes = parse_handshake(settings.handshake)
        self.observing = Observing(self.who, self._open, self._watch, self._close, self._lost)
        self.edges = Edges()
        self.in_control = False
        self.why_not = "nobody has control"
        self.stops = 0
        self.program_stopped = False
        self._owner = 0
        self._link: Link | None = None
        self._types: dict[str, ua.VariantType] = {}
        self._newest: dict[str, ua.DataValue] = {}
        self._notifications: deque[tuple[str, ua.DataValue]] = deque(maxlen=LONGEST_MEMORY)
        self._notified = 0
        self._value_changed = threading.Condition()
        self._commands = threading.Lock()
        self._losses = 0
        self._loss: DeviceError | None = None
        self._life = 0
        self._plc_life: tuple[Any, float] = (None, 0.0)

    # -------------------------------------------------------------------------------- connection
    def disconnect(self) -> None:
        """Release control, which stops a running job, and close; does nothing when closed."""
        link = self._link
        if self.in_control and link is not None and self.observing.online:
            self._drop("nobody has control")
            with contextlib.suppress(DeviceError):  # else the PLC detects the missing life sign
                link.write(self._release_values(), LEAVING)
        self._drop("nobody has control")
        self.stop_waiting()
        self.observing.stop()

    def stop_waiting(self) -> None:
        """End the calls that wait, with Cancelled."""
        with self._value_changed:
            self.stops += 1
            self._value_changed.notify_all()

    @property
    def link(self) -> Link:
        """Return the connection. Raises NotConnected, ConnectionLost."""
        self.observing.check()
        link = self._link
        if link is None:
            raise ConnectionLost("{device}: the connection was lost", str(self._loss or ""), device=self.who)
        return link

    def check_loss(self, losses: int) -> None:
        """Raise ConnectionLost when the connection was lost since `losses`."""
        if losses != self._losses:
            raise ConnectionLost("{device}: the connection was lost", str(self._loss or ""), device=self.who)

    @property
    def losses(self) -> int:
        """Return how often the connection was lost."""
        return self._losses

    # -------------------------------------------------------------------------------- control
    def _release_values(self) -> dict[str, ua.Variant]:
        return {"request": self.variant("request", False), "owner": self.variant("owner", 0)}

    def take_control(self) -> None:
        """Write our number to owner and start our life sign. Raises NotInControl, which names the owner."""
        with self._commands:
            self.require_handshake()
            if self.in_control:
                return
            losses = self._losses
            self.check_program()
            if owner := self.handshake().owner:
                raise NotInControl(
                    "{device}: control is refused: {named} has it", device=self.who, named=self._named(owner)
                )
            self._life = (self._life + 1) % 65536
            number = self.settings.host_number
            self.link.write(
                {
                    "request": self.variant("request", False),
                    "host_life": self.variant("host_life", self._life),
                    "owner": self.variant("owner", number),
                }
            )
            if (owner := self.handshake().owner) != number:
                raise NotInControl(
                    "{device}: control is refused: {named} has it", device=self.who, named=self._named(owner)
                )
            with self._value_changed:
                self._owner = number
                self.in_control = True
            try:
                self.check_loss(losses)
            except ConnectionLost:
                self._drop("the connection was lost")
                raise
            self._await_idle()
            self.observing.settled()

    def _await_idle(self) -> None:
        """Wait until the PLC has ended the handshake of a former host."""
        deadline = time.monotonic() + IDLE_WITHIN
        while time.monotonic() < deadline:
            hand = self.handshake()
            if not (hand.busy or hand.done or hand.error):
                return
            time.sleep(0.02)

    def release_control(self) -> None:
        """Release control; the PLC stops a running job."""
        with self._commands:
            if self.in_control:
                self._drop("nobody has control")
                self.link.write(self._release_values())

    def control_owner(self) -> str | None:
        """Return the last known owner: "us", another host by its number, or None."""
        if self.in_control:
            return "us"
        return self._named(self._owner) if self._owner and self.observing.online else None

    def _named(self, owner: int) -> str:
        if owner == self.settings.host_number:
            return f"another program with our number {owner}, or one that has just ended,"
        return f"host {owner}" if owner else "nobody"

    def _drop(self, why: str) -> None:
        self.in_control, self.why_not = False, why
        self._owner = 0

    def require_control(self, what: str) -> None:
        """Raise NotConnected, ConnectionLost, NotInControl or Stale with the reason, unless we may write."""
        self.observing.check()
        if self.handshake_nodes and not self.in_control:
            raise NotInControl(
                "{device}: {what} is refused: {why_not}", device=self.who, what=what, why_not=self.why_not
            )
        self.check_program()

    def check_program(self) -> None:
        """Raise Stale while the program of the PLC is stopped: the values of the server are old then."""
        if self.program_stopped:
            raise Stale(
                "{device}: the program of the PLC is stopped: its life sign does not change, and its values are old",
                device=self.who,
            )

    def require_handshake(self) -> None:
        """Raise Refused for a PLC without a handshake."""
        if not self.handshake_nodes:
            raise Refused("{device}: the setting handshake is empty, so that control cannot be taken", device=self.who)

    def handshake(self) -> Handshake:
        """Read the handshake. Raises DeviceFault for a bad value."""
        names = ("owner", "busy", "done", "error", "code")
        found = self.link.read(names)
        for name, value in zip(names, found, strict=True):
            if value.Value is None or value.Value.Value is None or quality(value) is Quality.BAD:
                raise DeviceFault(
                    "{device}: {name} of the handshake is {value}",
                    "",
                    "handshake",
                    device=self.who,
                    name=name,
                    value=status_name(value),
                )
        owner, busy, done, error, code = (value.Value.Value for value in found if value.Value is not None)
        return Handshake(int(owner), bool(busy), bool(done), bool(error), int(code))

    # -------------------------------------------------------------------------------- points
    def point(self, name: str) -> Point:
        """Return a point. Raises OutOfRange."""
        point = self.points.get(name)
        if point is None:
            raise OutOfRange(
                "{device} has no point {name!r}; there are {points}",
                device=self.who,
                name=name,
                points=", ".join(self.points),
            )
        return point

    def read(self, name: str) -> ua.DataValue:
        """Read a point. Raises DeviceFault when it has no value, Stale while the program of the PLC is stopped."""
        self.point(name)
        self.check_program()
        (value,) = self.link.read([name])
        if value.Value is None or value.Value.Value is None:
            raise DeviceFault(
                "{device}: {name} has no value: {value}",
                "",
                status_name(value),
                device=self.who,
                name=name,
                value=status_name(value),
            )
        return value

    def write(self, name: str, value: bool | float) -> None:
        """Write an output. Raises Refused for an input, OutOfRange with the range, NotInControl."""
        point = self.point(name)
        if not point.output:
            raise Refused("{device}: {name} is an input", device=self.who, name=name)
        if point.digital:
            given: bool | float = bool(value)
        else:
            try:
                given = raw(float(value), point.io.scale, self._types.get(name, ua.VariantType.Double))
            except ValueError as e:
                unit = f" {point.io.unit}" if point.io.unit else ""
                raise OutOfRange(
                    "{device}: {name} {reason}{unit}, not {value!r}",
                    device=self.who,
                    name=name,
                    reason=e,
                    unit=unit,
                    value=value,
                ) from None
        self.require_control(f"writing {name}")
        self.link.write({name: self.variant(name, given)})

    def variant(self, name: str, value: bool | float) -> ua.Variant:
        """Return a value in the type of a node."""
        kind = self._types[name]
        if kind is ua.VariantType.Boolean:
            return ua.Variant(bool(value), kind)
        return ua.Variant(int(value) if kind in INTEGERS else float(value), kind)

    def wait_for(self, name: str, value: bool, timeout: float) -> None:
        """Wait until a digital point has a value. Raises DeviceTimeout after `timeout` s, Cancelled."""
        stops, losses, deadline = self.stops, self._losses, time.monotonic() + timeout
        seen = self._notified
        found = self.read(name)
        if _is(found, value):
            return
        began, what = found.SourceTimestamp, f"{name} becoming {'on' if value else 'off'}"
        while True:
            with self._value_changed:
                while seen == self._notified and (stops, losses) == (self.stops, self._losses):
                    if not self._value_changed.wait(max(deadline - time.monotonic(), 0.0)):
                        break
                count = min(self._notified - seen, len(self._notifications))
                changes = [
                    each
                    for changed, each in list(self._notifications)[len(self._notifications) - count :]
                    if changed == name
                ]
                late, seen = seen == self._notified, self._notified
            if stops != self.stops:
                raise Cancelled("{device}: waiting for {what} was stopped", device=self.who, what=what)
            self.check_loss(losses)
            self.observing.check()
            self.check_program()
            # Ignore late notifications of values from before our reading.
            if any(_is(each, value) and not _before(each.SourceTimestamp, began) for each in changes):
                return
            if late or time.monotonic() >= deadline:
                raise DeviceTimeout(
                    "{device}: {what} took longer than {timeout:g} s", device=self.who, what=what, timeout=timeout
                )

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        deadline = time.monotonic() + timeout
        self.edges.forget()
        self._types, self._newest = {}, {}
        nodes = {name: point.node for name, point in self.points.items()} | self.handshake_nodes
        link = Link(self.who, self.settings, nodes, list(self.points), self._changed)
        self._link = link
        link.open(timeout)
        names = list(nodes)
        for name, value, data_type in zip(
            names, link.read(names), link.read(names, ua.AttributeIds.DataType), strict=True
        ):
            self._check_node(name, value, data_type)
        link.watch()
        self._plc_life = (None, time.monotonic())
        self.program_stopped = False
        self._check_life(link)
        if time.monotonic() > deadline:
            raise DeviceTimeout("{device} did not answer within {timeout:.1f} s", device=self.who, timeout=timeout)

    def _check_node(self, name: str, value: ua.DataValue, data_type: ua.DataValue) -> None:
        node = self.points[name].node if name in self.points else self.handshake_nodes[name]
        if status_name(value) in ("BadNodeIdUnknown", "BadNodeIdInvalid", "BadAttributeIdInvalid"):
            raise DeviceFault(
                "{device}: {name} ({node}) does not exist: {value}",
                "",
                status_name(value),
                device=self.who,
                name=name,
                node=node,
                value=status_name(value),
            )
        kind = type_of(value, data_type)
        digital = self.points[name].digital if name in self.points else name in ("request", "busy", "done", "error")
        if kind is None or not fits(kind, digital):
            found = "of an unknown type" if kind is None else kind.name
            raise DeviceFault(
                "{device}: {name} ({node}) is {found}, not {digital}",
                device=self.who,
                name=name,
                node=node,
                found=found,
                digital="Boolean" if digital else "a number",
            )
        self._types[name] = kind

    def _watch(self, stopping: threading.Event) -> None:
        link = self._link
        assert link is not None
        pause = min(self.settings.plc_patience, self.settings.life_timeout) / BEATS
        while not stopping.wait(pause):
            try:
                self._check_life(link)
            except DeviceError:
                if not stopping.is_set():
                    raise
                return
            if (broken := link.broken) is not None:
                raise ConnectionLost("{device}: {broken}", device=self.who, broken=broken)

    def _check_life(self, link: Link) -> None:
        """Increment our life sign, and check that of the PLC."""
        if not self.handshake_nodes:
            link.read_standard(SERVER_STATE)
            return
        if self.in_control:
            self._life = (self._life + 1) % 65536
            link.write({"host_life": self.variant("host_life", self._life)})
        in_control = self.in_control
        life, owner = (None if value.Value is None else value.Value.Value for value in link.read(("plc_life", "owner")))
        present = time.monotonic()
        if life != self._plc_life[0]:
            self._plc_life = (life, present)
        self.program_stopped = present - self._plc_life[1] > self.settings.life_timeout
        if self.in_control and self.program_stopped:
            self._drop("the program of the PLC was stopped")
        elif self.in_control and in_control and owner != self.settings.host_number:
            self._drop("the PLC has taken control away" if not owner else f"{self._named(owner)} has control")
        if not self.in_control:
            self._owner = owner or 0

    def _changed(self, name: str, value: ua.DataValue) -> None:
        """Store a value from the subscription; called on the thread of the link."""
        with self._value_changed:
            self._newest[name] = value
            self._notifications.append((name, value))
            self._notified += 1
            self._value_changed.notify_all()
        if self.points[name].digital and value.Value is not None and quality(value) is not Quality.BAD:
            self.edges.take(name, bool(value.Value.Value), stamp(value), time.monotonic())

    def newest_values(self) -> dict[str, Any]:
        """Return the newest values from the subscription by name."""
        with self._value_changed:
            return dict(self._newest)

    def _close(self) -> None:
        link, self._link = self._link, None
        if link is not None:
            link.close()

    def _lost(self, error: DeviceError) -> None:
        self._drop("control ended when the connection was lost")
        with self._value_changed:
            self._loss = error
            self._losses += 1
            self._value_changed.notify_all()


def _is(found: ua.DataValue, value: bool) -> bool:
    return found.Value is not None and quality(found) is not Quality.BAD and bool(found.Value.Value) is value


def _before(one: Any, other: Any) -> bool:
    return one is not None and other is not None and one < other

"""The observed PLC: life signs both ways, control of its outputs, its points as they are now."""

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
"""How often our life sign counts within the shorter of the two patiences."""
SERVER_STATE: Final = 2259
LONGEST_MEMORY: Final = 1000
"""News of the subscription that are kept for those who wait."""
IDLE_WITHIN: Final = 1.0
LEAVING: Final = 0.3
"""Time for giving control back when the connection is closed, s."""


class Hand(NamedTuple):
    """The PLC's side of the handshake, read in one request."""

    owner: int
    busy: bool
    done: bool
    error: bool
    code: int


class Plc:
    """Keeps the connection, the life signs and control. The handshake of a job is in `jobs`."""

    def __init__(self, name: str, settings: OpcUaPlcSettings) -> None:
        self.settings = settings
        self.who = f"{name} at {settings.url}"
        self.points = parse_points(settings.points)
        self.hand_nodes = parse_handshake(settings.handshake)
        self.observing = Observing(self.who, self._open, self._watch, self._close, self._lost)
        self.edges = Edges()
        self.in_control = False
        self.why_not = "nobody has control"
        self.stops = 0
        self.program_stands = False
        self._owner = 0
        self._link: Link | None = None
        self._types: dict[str, ua.VariantType] = {}
        self._newest: dict[str, ua.DataValue] = {}
        self._told: deque[tuple[str, ua.DataValue]] = deque(maxlen=LONGEST_MEMORY)
        self._told_in_all = 0
        self._news = threading.Condition()
        self._commands = threading.Lock()
        self._losses = 0
        self._loss: DeviceError | None = None
        self._life = 0
        self._seen: tuple[Any, float] = (None, 0.0)

    # -------------------------------------------------------------------------------- life
    def disconnect(self) -> None:
        """Give control back, so that a job stops, and close; does nothing when closed."""
        link = self._link
        if self.in_control and link is not None and self.observing.online:
            self._drop("nobody has control")
            with contextlib.suppress(DeviceError):  # else its own supervision does that
                link.write(self._leaving(), LEAVING)
        self._drop("nobody has control")
        self.stop_waiting()
        self.observing.stop()

    def stop_waiting(self) -> None:
        """End whatever waits, with Cancelled."""
        with self._news:
            self.stops += 1
            self._news.notify_all()

    @property
    def link(self) -> Link:
        """Return the connection. Raises NotConnected, or ConnectionLost with what it was lost by."""
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
    def _leaving(self) -> dict[str, ua.Variant]:
        return {"request": self.variant("request", False), "owner": self.variant("owner", 0)}

    def take_control(self) -> None:
        """Put our number into owner and begin to count our life sign. Raises NotInControl naming who has control."""
        with self._commands:
            self.need_handshake()
            if self.in_control:
                return
            losses = self._losses
            self.check_program()
            if owner := self.hand().owner:
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
            if (owner := self.hand().owner) != number:
                raise NotInControl(
                    "{device}: control is refused: {named} has it", device=self.who, named=self._named(owner)
                )
            with self._news:
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
        """Return the PLC the time to see that the request of a former host has fallen."""
        deadline = time.monotonic() + IDLE_WITHIN
        while time.monotonic() < deadline:
            hand = self.hand()
            if not (hand.busy or hand.done or hand.error):
                return
            time.sleep(0.02)

    def release_control(self) -> None:
        """Give control back; a job that runs is stopped by the PLC."""
        with self._commands:
            if self.in_control:
                self._drop("nobody has control")
                self.link.write(self._leaving())

    def control_owner(self) -> str | None:
        """Return who has control as it was last seen: us, another by its number, or nobody."""
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
        """Return when the PLC obeys us. Raises NotConnected, ConnectionLost, NotInControl, Stale, with the reason."""
        self.observing.check()
        if self.hand_nodes and not self.in_control:
            raise NotInControl(
                "{device}: {what} is refused: {why_not}", device=self.who, what=what, why_not=self.why_not
            )
        self.check_program()

    def check_program(self) -> None:
        """Raise Stale while the PLC's program does not run: what the server tells is old then."""
        if self.program_stands:
            raise Stale("{device}: the life sign of its program stands still: its values are old", device=self.who)

    def need_handshake(self) -> None:
        """Raise Refused for a PLC without a handshake."""
        if not self.hand_nodes:
            raise Refused("{device}: the setting handshake is empty: there is no control to be taken", device=self.who)

    def hand(self) -> Hand:
        """Read the PLC's side of the handshake now. Raises DeviceFault for a value that is bad."""
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
        return Hand(int(owner), bool(busy), bool(done), bool(error), int(code))

    # -------------------------------------------------------------------------------- points
    def point(self, name: str) -> Point:
        """Return the point of this name. Raises OutOfRange."""
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
        """Read a point now. Raises DeviceFault when there is no value, Stale while the PLC's program stands."""
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
        """Return when a digital point has the value, as read or as told since. Raises DeviceTimeout, Cancelled."""
        stops, losses, deadline = self.stops, self._losses, time.monotonic() + timeout
        seen = self._told_in_all
        found = self.read(name)
        if _is(found, value):
            return
        began, what = found.SourceTimestamp, f"{name} becoming {'on' if value else 'off'}"
        while True:
            with self._news:
                while seen == self._told_in_all and (stops, losses) == (self.stops, self._losses):
                    if not self._news.wait(max(deadline - time.monotonic(), 0.0)):
                        break
                count = min(self._told_in_all - seen, len(self._told))
                news = [each for told, each in list(self._told)[len(self._told) - count :] if told == name]
                late, seen = seen == self._told_in_all, self._told_in_all
            if stops != self.stops:
                raise Cancelled("{device}: waiting for {what} was stopped", device=self.who, what=what)
            self.check_loss(losses)
            self.observing.check()
            self.check_program()
            # What the subscription tells late, from before our reading, is over.
            if any(_is(each, value) and not _before(each.SourceTimestamp, began) for each in news):
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
        nodes = {name: point.node for name, point in self.points.items()} | self.hand_nodes
        link = Link(self.who, self.settings, nodes, list(self.points), self._changed)
        self._link = link
        link.open(timeout)
        names = list(nodes)
        for name, value, data_type in zip(
            names, link.read(names), link.read(names, ua.AttributeIds.DataType), strict=True
        ):
            self._check_node(name, value, data_type)
        link.watch()
        self._seen = (None, time.monotonic())
        self.program_stands = False
        self._beat(link)
        if time.monotonic() > deadline:
            raise DeviceTimeout("{device} did not answer within {timeout:.1f} s", device=self.who, timeout=timeout)

    def _check_node(self, name: str, value: ua.DataValue, data_type: ua.DataValue) -> None:
        node = self.points[name].node if name in self.points else self.hand_nodes[name]
        if status_name(value) in ("BadNodeIdUnknown", "BadNodeIdInvalid", "BadAttributeIdInvalid"):
            raise DeviceFault(
                "{device}: {name} ({node}) is not there: {value}",
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
                self._beat(link)
            except DeviceError:
                if not stopping.is_set():
                    raise
                return
            if (broken := link.broken) is not None:
                raise ConnectionLost("{device}: {broken}", device=self.who, broken=broken)

    def _beat(self, link: Link) -> None:
        """Count our life sign, and look at the PLC's."""
        if not self.hand_nodes:
            link.read_standard(SERVER_STATE)
            return
        if self.in_control:
            self._life = (self._life + 1) % 65536
            link.write({"host_life": self.variant("host_life", self._life)})
        in_control = self.in_control
        life, owner = (None if value.Value is None else value.Value.Value for value in link.read(("plc_life", "owner")))
        present = time.monotonic()
        if life != self._seen[0]:
            self._seen = (life, present)
        self.program_stands = present - self._seen[1] > self.settings.life_timeout
        if self.in_control and self.program_stands:
            self._drop("the life sign of the PLC's program stood still")
        elif self.in_control and in_control and owner != self.settings.host_number:
            self._drop("the PLC has taken control away" if not owner else f"{self._named(owner)} has control")
        if not self.in_control:
            self._owner = owner or 0

    def _changed(self, name: str, value: ua.DataValue) -> None:
        """Take news of the subscription, on the link's thread."""
        with self._news:
            self._newest[name] = value
            self._told.append((name, value))
            self._told_in_all += 1
            self._news.notify_all()
        if self.points[name].digital and value.Value is not None and quality(value) is not Quality.BAD:
            self.edges.take(name, bool(value.Value.Value), stamp(value), time.monotonic())

    def told(self) -> dict[str, Any]:
        """Return the statuses the subscription told last, by name."""
        with self._news:
            return dict(self._newest)

    def _close(self) -> None:
        link, self._link = self._link, None
        if link is not None:
            link.close()

    def _lost(self, error: DeviceError) -> None:
        self._drop("control ended when the connection was lost")
        with self._news:
            self._loss = error
            self._losses += 1
            self._news.notify_all()


def _is(found: ua.DataValue, value: bool) -> bool:
    return found.Value is not None and quality(found) is not Quality.BAD and bool(found.Value.Value) is value


def _before(one: Any, other: Any) -> bool:
    return one is not None and other is not None and one < other

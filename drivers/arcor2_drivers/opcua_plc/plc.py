"""Plc: state, life signs in both directions, control and jobs of a PLC. A mixin of the object type."""

import contextlib
import time
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from asyncua import ua

from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    OutOfRange,
    Refused,
    Stale,
)
from arcor2_hw.messages import Phrase
from arcor2_hw.objects.edges import DigitalPoints
from arcor2_hw.objects.observing import GoOn
from arcor2_hw.objects.polled_control import OWNED_BY_US, PolledControl
from arcor2_hw.objects.state_observer import Snapshot

from .link import Link, status_name
from .points import parse_handshake, parse_points
from .settings import OpcUaPlcSettings
from .values import INTEGERS, content, fits, is_bad, stamp, type_of

LIFE_SIGNS_PER_TIMEOUT: Final = 5
"""Number of changes of our life sign within the shorter of both timeouts."""
SERVER_STATE: Final = 2259
IDLE_TIMEOUT: Final = 1.0
"""Time the PLC has to end the handshake of a former host, s."""
ANSWER_TIMEOUT: Final = 2.0
"""Time the PLC has to answer a request by busy, done or error, and to become idle after its end, s."""
RELEASE_TIMEOUT: Final = 0.3
"""Time limit for releasing control when the connection is closed, s."""
STATUS: Final = ("plc_life", "owner", "busy", "done", "error", "code")
"""Variables of the handshake that are read, in the order of the fields of `Handshake`."""


class Handshake(NamedTuple):
    """The handshake as the PLC reports it, read in one request; `bad` names a variable without a good value."""

    life: Any = None
    owner: int = 0
    busy: bool = False
    done: bool = False
    error: bool = False
    code: int = 0
    bad: str = ""

    @property
    def idle(self) -> bool:
        """Return whether no job runs or has ended."""
        return not (self.busy or self.done or self.error)

    def __str__(self) -> str:
        words = [name for name in ("busy", "done", "error") if getattr(self, name)]
        return f"{' and '.join(words) or 'idle'}" + (f" (code {self.code})" if self.error else "")


class Plc(PolledControl[Handshake]):
    """A PLC whose handshake is read periodically, and whose points are subscribed to."""

    busy_period = 0.05
    stands_within = 5.0
    program_stopped = False
    """Whether the life sign of the PLC does not change, so that its values are old."""

    def use_plc(self, settings: OpcUaPlcSettings) -> None:
        """Prepare the connection; called in `__init__`."""
        self._s = settings
        self.plc_points = parse_points(settings.points)
        self.handshake_nodes = parse_handshake(settings.handshake)
        nodes = {name: point.node for name, point in self.plc_points.items()} | self.handshake_nodes
        self.link = Link(self.name, settings, nodes, list(self.plc_points), self._on_value)
        self.digital_points = DigitalPoints(point.io for point in self.plc_points.values())
        self.newest_values: dict[str, ua.DataValue] = {}
        self.types: dict[str, ua.VariantType] = {}
        self.period = min(settings.plc_patience, settings.life_timeout) / LIFE_SIGNS_PER_TIMEOUT
        self.answers_within = max(self.answers_within, 3.0 * settings.request_timeout)
        self._life, self._beat = 0, 0.0
        self._plc_life: tuple[Any, float] = (None, 0.0)
        self.use_link(self.link)

    # -------------------------------------------------------------------------------- state
    def open_link(self, timeout: float) -> Snapshot[Handshake]:
        """Open a session, check the nodes, and subscribe to the points."""
        deadline = time.monotonic() + timeout
        self.digital_points.forget()
        self.newest_values.clear()
        self.link.open(timeout)
        names = list(self.link.nodes)
        kinds = self.link.read(names, ua.AttributeIds.DataType)
        for name, value, data_type in zip(names, self.link.read(names), kinds, strict=True):
            self.types[name] = self._type_of(name, value, data_type)
        self.link.watch()
        self._plc_life = (None, 0.0)
        first = self.snapshot()
        if time.monotonic() > deadline:
            raise DeviceTimeout("{device} did not answer within {timeout:.1f} s", device=self.who, timeout=timeout)
        return first

    def _type_of(self, name: str, value: ua.DataValue, data_type: ua.DataValue) -> ua.VariantType:
        point, status = self.plc_points.get(name), status_name(value)
        node = f"{name} ({point.node if point else self.handshake_nodes[name]})"
        if status in ("BadNodeIdUnknown", "BadNodeIdInvalid", "BadAttributeIdInvalid"):
            raise DeviceFault(
                "{device}: {node} does not exist: {status}", "", status, device=self.who, node=node, status=status
            )
        kind = type_of(value, data_type)
        digital = point.digital if point else name in ("request", "busy", "done", "error")
        if kind is None or not fits(kind, digital):
            found = Phrase.of("of an unknown type") if kind is None else kind.name
            wanted = "Boolean" if digital else Phrase.of("a number")
            raise DeviceFault(
                "{device}: {node} is {found}, not {wanted}", device=self.who, node=node, found=found, wanted=wanted
            )
        return kind

    def read_state(self) -> Handshake:
        """Read the handshake; without a handshake, check whether the server works."""
        if self.link.broken:
            raise ConnectionLost("{device}: the subscription has ended", device=self.who)
        if not self.handshake_nodes:
            self.link.read_standard(SERVER_STATE)
            return Handshake()
        asked = time.monotonic()
        read = dict(zip(STATUS, self.link.read(STATUS), strict=True))
        bad = [f"{name} of the handshake is {status_name(value)}" for name, value in read.items() if is_bad(value)]
        life, owner, busy, done, error, code = map(content, read.values())
        if life != self._plc_life[0]:
            self._plc_life = (life, time.monotonic())
        # The answer may be as old as the request, because this process may have been delayed since.
        self.program_stopped = asked - self._plc_life[1] > self._s.life_timeout
        return Handshake(life, int(owner or 0), bool(busy), bool(done), bool(error), int(code or 0), "; ".join(bad))

    def after_reading(self) -> None:
        """Increment our life sign while we have control."""
        if self.in_control and time.monotonic() - self._beat >= 0.9 * self.period:
            self.link.write(self._life_sign())

    def _life_sign(self) -> dict[str, ua.Variant]:
        self._life, self._beat = (self._life + 1) % 65536, time.monotonic()
        return {"host_life": self.variant("host_life", self._life)}

    def _on_value(self, name: str, value: ua.DataValue) -> None:
        """Store a value from the subscription; called on the thread of the link."""
        self.newest_values[name] = value
        if name in self.digital_points.names and not is_bad(value):
            self.digital_points.take(name, bool(content(value)), time.monotonic(), stamp(value))
            self.digital_points.notify_edges()
        self._polled.wake()

    def variant(self, name: str, value: bool | float) -> ua.Variant:
        """Return a value in the type of a node."""
        kind = self.types[name]
        if kind is ua.VariantType.Boolean:
            return ua.Variant(bool(value), kind)
        return ua.Variant(int(value) if kind in INTEGERS else float(value), kind)

    # -------------------------------------------------------------------------------- control
    def take_control(self) -> None:
        """Write our number as owner, and start our life sign; no output is written.

        Raises NotInControl, which names the owner, or Refused for a PLC without a handshake.
        """
        self.require_handshake()
        self.check_program()
        if not self.in_control:
            super().take_control()
            with contextlib.suppress(DeviceTimeout):
                self.wait(lambda hand: hand.idle, IDLE_TIMEOUT, "becoming idle")

    def arm(self) -> None:
        """Write our number and our life sign, and read the number back."""
        number = self._s.host_number
        self.link.write(self._request(False) | self._life_sign() | {"owner": self.variant("owner", number)})
        if (hand := self.read_state()).owner != number:
            owner = self._named(hand.owner)
            raise NotInControl("{device}: control is refused: {owner} has it", device=self.who, owner=owner)

    def disarm(self) -> None:
        """Release control; the PLC stops a running job."""
        self.link.write(self._request(False) | {"owner": self.variant("owner", 0)})
        self.fresh()  # an older state still names us as the owner

    def leave(self) -> None:
        """Release control because we disconnect; the PLC detects the missing life sign otherwise."""
        self.drop_control()
        self.link.write(self._request(False) | {"owner": self.variant("owner", 0)}, RELEASE_TIMEOUT)

    def owner_of(self, state: Handshake) -> str | None:
        """Return the owner: us, or another host by its number."""
        if self.in_control and state.owner == self._s.host_number:
            return OWNED_BY_US
        return self._named(state.owner) if state.owner else None

    def _named(self, owner: int) -> str:
        if owner == self._s.host_number:
            return Phrase.of("another program with our number {number}, or one that has just ended,", number=owner)
        return Phrase.of("host {number}", number=owner) if owner else Phrase.of("nobody")

    def why_control_ended(self, state: Handshake) -> str:
        """Return why the PLC no longer executes our commands; empty while it does."""
        if self.program_stopped:
            return Phrase.of("the program of the PLC was stopped")
        return super().why_control_ended(state) if state.owner else Phrase.of("the PLC has taken control away")

    def require_control(self, operation: str) -> None:
        """Raise NotConnected, ConnectionLost, NotInControl or Stale with the reason, unless we may write."""
        if self.handshake_nodes:
            super().require_control(operation)
        self.observing.check()
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
            raise Refused("{device}: the setting handshake is empty, so control cannot be taken", device=self.who)

    # -------------------------------------------------------------------------------- jobs
    def is_busy(self, state: Handshake) -> bool:
        """Return whether a job runs."""
        return state.busy

    def send_stop(self) -> None:
        """Reset the request, which stops a running job."""
        self.link.write(self._request(False))

    def _request(self, on: bool) -> dict[str, ua.Variant]:
        return {"request": self.variant("request", on)}

    def do_job(self, number: int, timeout: float) -> None:
        """Run a job to its end.

        Raises:
            Refused: Another job is running, or the PLC is not idle.
            OutOfRange: The number is outside of the range of its variable.
            DeviceFault: The PLC reports an error; `fault_code` is its code.
            DeviceTimeout: The job did not end in time.
            Cancelled: The job was stopped.
            ConnectionLost: The connection was lost.
            NotInControl: Control ended.
        """
        what = Phrase.of("job {number}", number=number)
        self.require_handshake()
        self.require_control(what)
        low, high = INTEGERS.get(self.types["number"], (0, 0))
        if not low <= number <= high:
            limits = f"{low} to {high}"
            raise OutOfRange(
                "{device}: the number of a job must be {limits}, not {number}",
                device=self.who,
                limits=limits,
                number=number,
            )
        with self.act(what) as go_on:
            if not (hand := self._checked(self.fresh())).idle:
                raise Refused("{device}: {what} is refused: the PLC is {found}", device=self.who, what=what, found=hand)
            start = {"number": self.variant("number", number)} | self._request(True)
            self.send(what, lambda: self.link.write(start), go_on)
            try:
                self._await_job(
                    lambda hand: not hand.idle, ANSWER_TIMEOUT, Phrase.of("the start of {what}", what=what), go_on
                )
                end = self._await_job(lambda hand: not (hand.idle or hand.busy), timeout, what, go_on)
            finally:
                self._end_request()
        if end.error:
            raise DeviceFault(
                "{device}: {what} ended with error {code}", "", end.code, device=self.who, what=what, code=end.code
            )

    def _await_job(self, holds: Callable[[Handshake], bool], timeout: float, operation: str, go_on: GoOn) -> Handshake:
        def reached(hand: Handshake) -> bool:
            self.check_program()
            if not self.in_control:
                why = self.why_not
                raise NotInControl("{device}: {what} was cancelled: {why}", device=self.who, what=operation, why=why)
            return holds(self._checked(hand))

        try:
            return self.wait(reached, timeout, operation, go_on)
        except DeviceTimeout as late:
            raise DeviceTimeout("{reason}; the PLC is {found}", reason=late, found=self.newest()) from late

    def _end_request(self) -> None:
        """Reset the request, which stops a running job, and wait until the PLC is idle."""
        with contextlib.suppress(DeviceError):  # otherwise the PLC stops the job because our life sign is missing
            if self.in_control:
                self.send_stop()
                self.wait(lambda hand: hand.idle, ANSWER_TIMEOUT, "becoming idle")

    def _checked(self, hand: Handshake) -> Handshake:
        if hand.bad:
            raise DeviceFault("{device}: {bad}", "", "handshake", device=self.who, bad=hand.bad)
        return hand

"""Interlocks in the cell host: conditions of actions and motions, and zones that belong to one robot at a time.

Each device whose state matters is read by a thread of its own, so that a slow driver delays no other. None of this is a
safety function.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final

from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.interlocks import Interlock, InterlockCondition, InterlockState, InterlockTarget, Unmet
from arcor2_hw.exceptions import Arcor2Error, Interlocked, Refused
from arcor2_hw.messages import Message
from arcor2_hw.objects import MultiArmRobot, Robot
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.guards import Guard, Obstruction, Track
from arcor2_hw.runtime.messages import Lease
from arcor2_hw.runtime.needs import CachedValue, Key, Verdict, key_of, read, verdict
from arcor2_hw.runtime.retreat import Retreat, ZoneExit
from arcor2_hw.runtime.stopping import send_stop
from arcor2_hw.runtime.zone_motions import ZoneBodies, extrapolated, lines_over, targets_of, tips_of
from arcor2_hw.runtime.zones import ZoneTokens

READ_PERIOD: Final = 0.05
"""Period at which observations and positions are read, s."""
POLL: Final = 0.02
"""Period at which a waiting action is checked, s."""
LOOK_AHEAD: Final = 0.3
"""Time for which a motion with an unknown target is extrapolated, s: reading, stopping and braking."""
FIRST_READING: Final = 1.0
"""Time after the start in which an action waits for the first values, s, also if it should not wait."""

JOG: Final = "jog"
"""Name of jogging in messages."""

Wait = Callable[[float], float]
"""Waits for a time, s, and returns how long the program was paused. It raises if the action is stopped."""


class Interlocks:
    """The interlocks of a scene. Any thread calls it.

    Args:
        cell: returns the devices.
        post: called with the states of all interlocks when they have changed.
    """

    def __init__(self, cell: Callable[[], Cell], post: Callable[[list[InterlockState]], None] = lambda _: None) -> None:
        self._cell, self._post = cell, post
        self._lock = threading.RLock()
        self._closed = threading.Event()
        self._interlocks: dict[str, Interlock] = {}
        self._needed: dict[str, set[Key]] = {}
        """Observations to read from each device; empty if only the position of a robot is read."""
        self._threads: dict[str, threading.Thread] = {}
        self._seen: dict[Key, CachedValue] = {}
        self._tracks: dict[str, Track] = {}
        self._tokens = ZoneTokens()
        self._bodies = ZoneBodies(cell, lambda: self._zones)
        self._guards: dict[str, Guard] = {}
        self._waiting: dict[str, set[str]] = {}
        """The interlocks for which devices wait."""
        self._posted: list[InterlockState] = []
        self._started = 0.0

    # -------------------------------------------------------------------------------- life
    def configure(self, interlocks: Iterable[Interlock] | Unset) -> None:
        """Replace the interlocks. Actions that run keep their zones."""
        found = {} if isinstance(interlocks, Unset) else {one.id: one for one in interlocks}
        cell = self._cell()
        with self._lock:
            self._interlocks = found
            self._started = time.monotonic()
            needed: dict[str, set[Key]] = {}
            for need in (need for one in found.values() for need in one.needs):
                needed.setdefault(need.object_id, set()).add(key_of(need))
            if self._zones:
                for device in cell:
                    if issubclass(device.recipe.cls, Robot):
                        needed.setdefault(device.id, set())
            self._needed = needed
            cell.updates.zones = self._zones
            for object_id in needed.keys() - self._threads.keys():
                thread = threading.Thread(
                    target=self._watch, args=(object_id,), name=f"interlocks {object_id}", daemon=True
                )
                self._threads[object_id] = thread
                thread.start()
        self.publish()

    def close(self) -> None:
        """End the threads."""
        self._closed.set()

    @property
    def _zones(self) -> frozenset[str]:
        return frozenset(one.zone for one in self._interlocks.values() if one.zone)

    # -------------------------------------------------------------------------------- reading
    def _watch(self, object_id: str) -> None:
        while not self._closed.is_set():
            with self._lock:
                if object_id not in self._needed:
                    del self._threads[object_id]
                    return
                keys = list(self._needed[object_id])
            with contextlib.suppress(Arcor2Error):  # the object has failed; it is not read until it is retried
                device = self._cell()[object_id]
                for key in keys:
                    self._seen[key] = read(device, key[1], key[2], self._seen.get(key, CachedValue()))
                if self._zones and issubclass(device.recipe.cls, Robot):
                    self._follow(device)
            self._check_guards()
            self._closed.wait(READ_PERIOD)

    def _follow(self, device: Device) -> None:
        """Read the position of a robot. Release zones that it has left, and stop it in zones that it must not enter."""
        before = self._tracks.get(device.id)
        now = time.monotonic()
        tips = tips_of(device)
        inside = self._bodies.touched((tip, tip) for tip in tips)
        self._tracks[device.id] = Track(now, tips, frozenset(inside))
        guard, error = self._guards.get(device.id), None
        if guard is None:
            with self._lock:
                if device.id not in self._guards and not any(device.id in ids for ids in self._waiting.values()):
                    self._tokens.release(device.id, keep=inside)
                    if inside and self._tokens.take(device.id, inside):
                        self._tokens.release(device.id, keep=inside)  # the robot is stopped there, and does not wait
            return
        entered = set(inside)
        if guard.leaving is not None:
            back = guard.leaving.check(tips)
            if back is not None:
                if guard.broken is None:
                    guard.stop(self._stopped(guard, back))
                return
            for zone in guard.zones - inside:
                guard.zones.discard(zone)
                if not guard.retracts:
                    guard.leaving.left(self._name(zone))
        elif before is not None and not guard.targets_known and len(tips) == len(before.tips) and now > before.at:
            share = LOOK_AHEAD / max(now - before.at, READ_PERIOD)
            entered |= self._bodies.touched(
                (b, extrapolated(a, b, share)) for a, b in zip(before.tips, tips, strict=True)
            )
        with self._lock:
            entered -= guard.zones
            if not entered or guard.broken is not None:
                return
            asked = entered if guard.leaving is not None else guard.zones | entered
            found = self._obstruction(device.id, "", asked, inside - entered)
            if found is None:
                guard.zones |= entered
                guard.watched |= self._watched(device.id, "", entered)
            else:
                error = self._stopped(guard, found.reason)
        if error is not None:
            guard.stop(error)

    # -------------------------------------------------------------------------------- checks
    def _verdicts(self, interlock: Interlock) -> Iterator[Verdict]:
        names = {device.id: device.name for device in self._cell()}
        for need in interlock.needs:
            yield verdict(need, self._seen.get(key_of(need)), names.get(need.object_id, need.object_id))

    def _unmet(self, interlock: Interlock) -> Verdict | None:
        """Return the first condition of an interlock that is not met, None if all are."""
        return next((one for one in self._verdicts(interlock) if one.state is not InterlockCondition.MET), None)

    def _concerned(self, object_id: str, method: str, entered: Iterable[str]) -> list[Interlock]:
        """Return the interlocks of an action and of zones. method: empty for no action."""
        entered = set(entered)
        return [
            one
            for one in self._interlocks.values()
            if (
                one.zone in entered
                if one.on is InterlockTarget.ZONE
                else bool(method) and one.object_id == object_id and (not one.actions or method in one.actions)
            )
        ]

    def _watched(self, object_id: str, method: str, zones: Iterable[str]) -> set[str]:
        return {one.id for one in self._concerned(object_id, method, zones) if one.during}

    def _obstruction(self, object_id: str, method: str, zones: set[str], inside: Iterable[str]) -> Obstruction | None:
        """Take zones for an action, unless a condition is not met or another robot has one of them.

        Args:
            object_id: the device.
            method: the action.
            zones: the zones that it touches.
            inside: those of them in which the robot is already; their conditions count only if they last.
        """
        inside = set(inside)
        for one in self._concerned(object_id, method, zones):
            if one.zone in inside and not one.during:
                continue
            unmet = self._unmet(one)
            if unmet is not None and unmet.text is not None:
                self._tokens.release(object_id, keep=inside)
                self._waiting.setdefault(one.id, set()).add(object_id)
                reason = Message.of("Interlock {interlock}: {reason}", interlock=one.name, reason=unmet.text)
                return Obstruction(reason, self._patience([one]))
        busy = self._tokens.take(object_id, zones)
        if busy is None:
            return None
        names = {device.id: device.name for device in self._cell()}
        zone, owner = names.get(busy.zone, busy.zone), names.get(busy.owner, busy.owner)
        users = self._concerned(object_id, "", [busy.zone])
        for one in users:
            self._waiting.setdefault(one.id, set()).add(object_id)
        if busy.deadlock:
            text = "Zone {zone}: {owner} is in it, and waits for a zone of {robot}. Neither can continue."
            return Obstruction(Message.of(text, zone=zone, owner=owner, robot=names.get(object_id, object_id)), 0.0)
        return Obstruction(Message.of("Zone {zone}: {owner} has it", zone=zone, owner=owner), self._patience(users))

    def _patience(self, interlocks: Sequence[Interlock]) -> float:
        waits = [one.within if one.otherwise is Unmet.WAIT else 0.0 for one in interlocks]
        return max(min(waits, default=0.0), self._started + FIRST_READING - time.monotonic())

    def _check_guards(self) -> None:
        """Stop actions and motions whose conditions are no longer met."""
        broken: list[tuple[Guard, Interlocked]] = []
        with self._lock:
            for guard in self._guards.values():
                if guard.broken is not None:
                    continue
                for one in (self._interlocks[key] for key in guard.watched if key in self._interlocks):
                    unmet = self._unmet(one)
                    if unmet is not None and unmet.text is not None:
                        reason = Message.of("Interlock {interlock}: {reason}", interlock=one.name, reason=unmet.text)
                        broken.append((guard, self._stopped(guard, reason)))
                        break
        for guard, error in broken:
            guard.stop(error)

    def _stopped(self, guard: Guard, reason: Message) -> Interlocked:
        guard.broken = Interlocked(
            "{device}: {what} was stopped. {reason}", device=guard.device.name, what=guard.what, reason=reason
        )
        return guard.broken

    # -------------------------------------------------------------------------------- actions
    @contextlib.contextmanager
    def guarded(self, device: Device, method: str, arguments: Iterable[Any], wait: Wait | None) -> Iterator[None]:
        """Run an action in this context as its interlocks allow it.

        Args:
            device: the device.
            method: name of the action.
            arguments: its arguments. Poses and joints of robots are its targets.
            wait: waits between two checks; None if the action does not wait.

        Raises:
            Interlocked: a condition is not met in time, or not any more; or another robot has a zone.
        """
        if not self._interlocks:
            yield
            return
        guard = self._admit(device, method, list(arguments), wait, lambda _: send_stop(device))
        try:
            yield
        except Arcor2Error as error:
            if guard.broken is not None:
                raise guard.broken from error
            raise
        finally:
            self.leave(guard)

    def longest_wait(self, device: Device, method: str) -> float:
        """Return the maximum time that an action may wait before it starts, s."""
        found = [one for one in self._interlocks.values() if one.zone or one in self._concerned(device.id, method, ())]
        return FIRST_READING + sum(one.within for one in found if one.otherwise is Unmet.WAIT) if found else 0.0

    def hold(
        self,
        device: Device,
        motion: str,
        velocity: Position | None,
        stop: Callable[[Interlocked], None],
        *,
        retract: bool = False,
    ) -> Guard | None:
        """Admit a hold-to-run motion without waiting; None without interlocks. Call `leave` at its end.

        A robot in a zone that it may not have, for example after a stop, is admitted to leave it: see `steer`.

        Args:
            device: the robot.
            motion: name of the motion.
            velocity: of the end effector in the world, m/s; None if it is unknown.
            stop: ends the motion, with the reason.
            retract: leave the zones in which the robot is; `velocity` is None.

        Raises:
            Interlocked: a condition is not met, or another robot has a zone.
            Refused: the robot is in no zone that it could leave.
        """
        if not self._interlocks and not retract:
            return None
        if retract:
            return self._admit_leaving(device, motion, stop, None)
        ahead = [] if velocity is None else [Position(*(LOOK_AHEAD * each for each in velocity))]
        try:
            return self._admit(device, motion, [], None, stop, ahead)
        except Interlocked as error:
            if motion != JOG:
                raise
            return self._admit_leaving(device, motion, stop, error)

    def _admit_leaving(
        self, device: Device, motion: str, stop: Callable[[Interlocked], None], refused: Interlocked | None
    ) -> Guard:
        """Admit a motion that only leaves zones: the refused ones, or without `refused` all."""
        robot = device.require()
        tips = tips_of(device) if self._zones and not isinstance(robot, MultiArmRobot) else []
        bodies = dict(self._bodies.present())
        touched = [self._bodies.touched([(tip, tip)]) for tip in tips]
        there = {zone: [n for n, zones in enumerate(touched) if zone in zones] for zone in bodies}
        inside = {zone for zone, found in there.items() if found}
        with self._lock:
            found = self._obstruction(device.id, motion, set(), inside)
            leaving = {zone for zone in inside if refused is None or self._obstruction(device.id, "", {zone}, inside)}
            for ids in self._waiting.values():
                ids.discard(device.id)
            if found is not None:
                raise Interlocked(
                    "{device}: {what} was not started. {reason}", device=device.name, what=motion, reason=found.reason
                )
            if not leaving:
                raise refused or Refused("{device} is in no zone that it could leave.", device=device.name)
            ways = {}
            for zone in sorted(leaving):
                paths = (one.retract for one in self._interlocks.values() if one.zone == zone and one.retract)
                ways[self._name(zone)] = Retreat(bodies[zone], next(paths, []), there[zone])
            guard = Guard(device, motion, inside, self._watched(device.id, motion, inside - leaving), False, stop)
            guard.leaving, guard.retracts = ZoneExit(device.name, ways, tips), refused is None
            self._guards[device.id] = guard
            return guard

    def steer(self, guard: Guard, lease: Lease) -> tuple[Lease, float]:
        """Return the lease limited to the permitted motion, and the scale of its velocity.

        Raises:
            Interlocked: the robot may only leave zones, and the velocity leads elsewhere.
            Cancelled: the robot has left its zone.
        """
        if guard.leaving is None:
            return lease, 1.0
        device, tips = guard.device, tips_of(guard.device)
        lease, scale = guard.leaving.steer(lease, tips)
        step = Position(*(LOOK_AHEAD * each for each in (lease.twist or ())[:3]))
        ahead = self._bodies.touched((tip, tip + step) for tip in tips) - guard.zones
        with self._lock:
            found = self._obstruction(device.id, "", ahead, guard.zones)
            for ids in self._waiting.values():
                ids.discard(device.id)
        if found is not None:
            raise Interlocked(
                "{device}: {what} was stopped. {reason}", device=device.name, what=guard.what, reason=found.reason
            )
        return lease, scale

    def _name(self, object_id: str) -> str:
        return next((device.name for device in self._cell() if device.id == object_id), object_id)

    def _admit(
        self,
        device: Device,
        method: str,
        arguments: Sequence[Any],
        wait: Wait | None,
        stop: Callable[[Interlocked], Any],
        ahead: Sequence[Position] = (),
    ) -> Guard:
        """Wait until an action may start, and return its guard. wait: None if it does not wait."""
        began = time.monotonic()
        inside: set[str] = set()
        admitted = False
        try:
            while True:
                zones: set[str] = set()
                targets: list[Position] = []
                found: Obstruction | None = None
                if self._zones and issubclass(device.recipe.cls, Robot):
                    try:
                        tips = tips_of(device)
                    except Arcor2Error as error:
                        reason = Message.of(
                            "The position of {device} is unknown: {reason}", device=device.name, reason=error
                        )
                        found = Obstruction(reason, 0.0)
                    else:
                        targets = list(targets_of(device, arguments))
                        inside = self._bodies.touched((tip, tip) for tip in tips)
                        zones = (
                            inside
                            | self._bodies.touched(lines_over(tips, targets))
                            | self._bodies.touched((tip, tip + step) for tip in tips for step in ahead)
                        )
                with self._lock:
                    for ids in self._waiting.values():
                        ids.discard(device.id)
                    found = found or self._obstruction(device.id, method, zones, inside)
                    if found is None:
                        watched = self._watched(device.id, method, zones)
                        guard = Guard(device, method, zones, watched, bool(targets), stop)
                        self._guards[device.id] = guard
                        admitted = True
                        return guard
                if wait is None or time.monotonic() - began >= found.patience:
                    raise Interlocked(
                        "{device}: {what} was not started. {reason}",
                        device=device.name,
                        what=method,
                        reason=found.reason,
                    )
                self.publish()
                began += wait(POLL)
        finally:
            with self._lock:
                for ids in self._waiting.values():
                    ids.discard(device.id)
                if not admitted:
                    self._tokens.release(device.id, keep=inside)

    def leave(self, guard: Guard) -> None:
        """End an action or motion. The robot keeps the zones in which it is, also if its position is unknown."""
        device = guard.device
        keep = set(guard.zones)
        if keep:
            with contextlib.suppress(Arcor2Error):
                keep = self._bodies.touched((tip, tip) for tip in tips_of(device))
        with self._lock:
            if self._guards.get(device.id) is guard:
                del self._guards[device.id]
                self._tokens.release(device.id, keep=keep)

    # -------------------------------------------------------------------------------- states
    def publish(self) -> None:
        """Publish the states of the interlocks if they have changed, and stop actions that they do not permit.

        This also runs while a device that does not answer blocks its reading thread, which would otherwise stop them.
        """
        self._check_guards()
        with self._lock:
            states = [self._state(one) for one in self._interlocks.values()]
            if states == self._posted:
                return
            self._posted = states
            self._post(states)

    def _state(self, interlock: Interlock) -> InterlockState:
        unmet = self._unmet(interlock)
        owner = self._tokens.owner(interlock.zone) if interlock.zone else ""
        waiting = sorted(self._waiting.get(interlock.id, ()))
        inside = sorted(key for key, track in self._tracks.items() if interlock.zone in track.inside)
        state = InterlockState(interlock.id, InterlockCondition.MET, "", owner, waiting, inside)
        if unmet is None or unmet.text is None:
            return state
        return replace(state, state=unmet.state, text=unmet.text.text, **unmet.text.translation())

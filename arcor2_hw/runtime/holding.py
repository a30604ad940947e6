"""Hold-to-run in the cell host: a robot moves as long as leases are renewed, and is stopped when a lease expires.

The clock of this process, and that of the driver, end the lease even if the client, the network or the server hangs.
"""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from arcor2_hw.actions.json_values import encode as encode_json
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.exceptions import Arcor2Error, Cancelled, Refused
from arcor2_hw.objects import Robot
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.calls import Calls, Post, error_data
from arcor2_hw.runtime.cell import CONTROL_DEADLINE, Cell
from arcor2_hw.runtime.clock import Clock
from arcor2_hw.runtime.device import Device, describe
from arcor2_hw.runtime.guards import Guard
from arcor2_hw.runtime.interlocks import JOG, Interlocks
from arcor2_hw.runtime.jogging import Jog
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.teaching import SET_MODE, Teaching

DRIVER_TIMEOUT: Final = 2.0
"""Time limit of a driver to accept a renewal or to end hand teaching, s. It usually takes milliseconds."""
EXPIRY_MARGIN: Final = 0.001
"""Time from the end of a lease to the check whether it was renewed, s."""


class _Hold:
    """One press of the button, from its first lease until the robot has stopped."""

    def __init__(self, device: Device, lease: m.Lease) -> None:
        self.device = device
        self.number = lease.hold
        self.kind = lease.kind
        self.arm: dict[str, Any] = {} if lease.arm_id is None else {"arm_id": lease.arm_id}
        self.newest = lease
        self.jog: Jog | None = None
        self.guard: Guard | None = None
        self.driver_started = False
        self.lease_ids: list[int] = []
        """Ids of the leases that are answered after the next call of the driver."""
        self.release_ids: list[int] = []
        self.job: Job | None = None
        self.ending = False
        self.error: Arcor2Error | None = None


class ActiveHolds:
    """At most one hold of each device. Leases arrive on the reader thread and expire on the clock thread."""

    def __init__(
        self,
        cell: Callable[[], Cell],
        post: Post,
        clock: Clock,
        calls: Calls,
        teaching: Teaching,
        interlocks: Interlocks,
    ) -> None:
        self._cell = cell
        self._teaching = teaching
        self._interlocks = interlocks
        self._post = post
        self._clock = clock
        self._calls = calls
        self._lock = threading.Lock()
        self._held: dict[str, _Hold] = {}
        self._ended: dict[str, int] = {}
        """Number of the last hold that has ended, by device. Leases with this or a lower number are refused."""

    @property
    def any(self) -> bool:
        """Return whether any robot is being held."""
        return bool(self._held)

    # -------------------------------------------------------------------------------- leases
    def lease(self, message: m.Lease) -> None:
        """Start, renew or end a hold. CallDone, with the scale of a jog, or CallFailed answers it."""
        former = self._held.get(message.object_id)
        if former is not None and message.until != 0.0:
            self._check_expired(former)  # after a delay of this process the lease may arrive before the clock's call
        try:
            hold = self._register(message)
        except Arcor2Error as error:
            self._post(m.CallFailed(message.id, error_data(error, message.object_id)))
            return
        if hold is None:
            self._post(m.CallDone(message.id))
        elif message.until == 0.0:
            self.end(hold, None)
        else:
            self._clock.after(message.until - time.monotonic() + EXPIRY_MARGIN, lambda: self._check_expired(hold))
            self._pass_on(hold)

    def _register(self, message: m.Lease) -> _Hold | None:
        """Record a lease and return its hold, or None if it ends a hold that has ended. Raises NotFound, Refused."""
        device = self._cell()[message.object_id]
        with self._lock:
            hold = self._held.get(message.object_id)
            if hold is not None and hold.number == message.hold:
                if message.until == 0.0:
                    hold.release_ids.append(message.id)
                    return hold
                if hold.ending:
                    raise hold.error or Refused("{name}: this hold-to-run motion is ending", name=device.name)
            elif message.until == 0.0:
                return None
            elif hold is not None:
                raise Refused("another client is already moving {name}", name=device.name)
            elif message.hold <= self._ended.get(message.object_id, 0):
                raise Refused("{name}: this hold-to-run motion has ended", name=device.name)
            if message.until <= time.monotonic():
                raise Refused("{name}: the lease had expired when it arrived", name=device.name)
            if hold is None:
                hold = self._held[message.object_id] = _Hold(device, message)
            hold.newest = message
            hold.lease_ids.append(message.id)
            return hold

    def _check_expired(self, hold: _Hold) -> None:
        """End a hold whose lease has expired."""
        if hold.newest.until <= time.monotonic():
            text = (
                "{name}: the jog was not renewed in time"
                if hold.kind is HoldKind.JOG
                else "{name}: the hold was not renewed in time"
            )
            self.end(hold, Cancelled(text, name=hold.device.name))

    # -------------------------------------------------------------------------------- calls of the driver
    def _pass_on(self, hold: _Hold) -> None:
        """Pass the newest lease to the driver, or wait until the driver has accepted the previous one."""
        with self._lock:
            if hold.ending or hold.job is not None or not hold.lease_ids:
                return
            numbers, hold.lease_ids = hold.lease_ids, []
            job = hold.job = Job(
                "jog" if hold.kind is HoldKind.JOG else SET_MODE,
                lambda: self._pass_to_driver(hold),
                notify=lambda done: self._answer_leases(hold, done, numbers),
            )
            within = DRIVER_TIMEOUT + (0.0 if hold.driver_started else CONTROL_DEADLINE)
        self._run(hold.device, job, within)

    def _run(self, device: Device, job: Job, within: float) -> None:
        """Run a call on the lane of a device with a time limit, s."""
        if device.lane.submit_or_fail(job):
            self._clock.after(within, lambda: device.lane.expire(job, within))

    def _pass_to_driver(self, hold: _Hold) -> float:
        """Call the driver and return the scale of the velocity. Runs on the lane of the device."""
        device, robot = hold.device, hold.device.require()
        assert isinstance(robot, Robot)
        if not hold.driver_started:
            what = JOG if hold.kind is HoldKind.JOG else "hand teaching"
            device.require_not_lost(what)
            twist, frame = hold.newest.twist, hold.newest.frame
            velocity = Position(*twist[:3]) if twist is not None and frame == "world" else None
            hold.guard = self._interlocks.hold(
                device, what, velocity, lambda error: self.end(hold, error), retract=hold.newest.retract
            )
            device.take_control()
            device.lane.check_wanted()
            if hold.kind is HoldKind.JOG:
                hold.jog = Jog(robot, hold.arm)
        if hold.ending:  # while control was being taken
            raise hold.error or Cancelled("{name}: the button was released before the robot moved", name=device.name)
        lease, scale = hold.newest, 1.0
        if hold.guard is not None:
            lease, scale = self._interlocks.steer(hold.guard, lease)
        if hold.jog is not None:
            return scale * hold.jog.drive(lease)
        if not hold.driver_started:
            robot.set_hand_teaching_mode(True, **hold.arm)
        return 1.0

    def _answer_leases(self, hold: _Hold, job: Job, numbers: list[int]) -> None:
        """Answer the leases that were passed to the driver."""
        device = hold.device
        if job.error is not None:
            error = (hold.error if hold.ending else None) or describe(device, job.error)
            for number in numbers:
                self._post(m.CallFailed(number, error_data(error, device.id)))
            hold.job = None
            self.end(hold, error)
            return
        if hold.kind is HoldKind.HAND_TEACHING and not hold.driver_started:
            self._teaching.set(device, hold.arm, True)
        hold.driver_started = True
        value = encode_json({"scale": job.value}).encode()
        for number in numbers:
            self._post(m.CallDone(number, value))
        hold.job = None
        self._pass_on(hold)

    # -------------------------------------------------------------------------------- end
    def stopping(self, device: Device) -> None:
        """End the hold of a device that is being stopped."""
        hold = self._held.get(device.id)
        if hold is not None:
            self.end(hold, Cancelled("{name} was stopped", name=device.name))

    def teaching_ended(self, device: Device, arm: Mapping[str, Any], error: Arcor2Error) -> None:
        """End the hold of an arm that has left hand teaching mode, or without a hold report it and reset the mode."""
        hold = self._held.get(device.id)
        if hold is not None and hold.kind is HoldKind.HAND_TEACHING:
            self.end(hold, error)
            return
        robot = device.instance
        if isinstance(robot, Robot):
            job = Job(SET_MODE, lambda: robot.set_hand_teaching_mode(False, **arm))
            self._run(device, job, DRIVER_TIMEOUT)
        self._post(m.HandTeachingEnded(device.id, error_data(error, device.id), arm.get("arm_id")))

    def end(self, hold: _Hold, error: Arcor2Error | None) -> None:
        """Stop the robot and report the end of the hold. `error`: the reason, None if the button was released."""
        with self._lock:
            if hold.ending:
                return
            hold.ending, hold.error = True, error
            self._teaching.set(hold.device, hold.arm, False)
            numbers, hold.lease_ids = hold.lease_ids, []
        why = error or Cancelled("{name}: the button was released", name=hold.device.name)
        for number in numbers:
            self._post(m.CallFailed(number, error_data(why, hold.device.id)))
        if hold.kind is HoldKind.JOG:
            self._calls.stop(hold.device, lambda _, problem: self._report_end(hold, problem))
        else:
            self._end_hand_teaching(hold)

    def _end_hand_teaching(self, hold: _Hold) -> None:
        """Switch hand teaching off after the calls in progress. If that fails, stop the robot."""
        device = hold.device
        robot = device.instance
        assert isinstance(robot, Robot)

        def done(job: Job) -> None:
            if job.error is None:
                self._report_end(hold, None)
            else:
                problem = job.error
                self._calls.stop(device, lambda _, other: self._report_end(hold, problem if other else None))

        job = Job(SET_MODE, lambda: robot.set_hand_teaching_mode(False, **hold.arm), notify=done)
        self._run(device, job, DRIVER_TIMEOUT)

    def _report_end(self, hold: _Hold, problem: BaseException | None) -> None:
        device = hold.device
        if hold.guard is not None:
            self._interlocks.leave(hold.guard)
        error = hold.error if problem is None else describe(device, problem)
        with self._lock:
            self._ended[device.id] = hold.number
            if self._held.get(device.id) is hold:
                del self._held[device.id]
            release_ids, hold.release_ids = hold.release_ids, []
        reported = None if error is None else error_data(error, device.id)
        self._post(m.HoldEnded(device.id, hold.number, reported))
        for number in release_ids:
            if problem is None:
                self._post(m.CallDone(number))
            else:
                self._post(m.CallFailed(number, error_data(describe(device, problem), device.id)))

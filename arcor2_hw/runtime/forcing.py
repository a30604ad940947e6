"""Forced outputs in the cell host: an output is forced while a lease is renewed, and is then switched back.

The clock of this process ends the lease even if the client, the network or the server hangs. If this process ends, the
device switches the output to the state that its driver declares for a lost connection.
"""

import threading
import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.actions.json_values import encode as encode_json
from arcor2_hw.data.base import Unset
from arcor2_hw.data.device import Connection
from arcor2_hw.data.points import ForceKind, LivePoint, PointUse
from arcor2_hw.exceptions import Arcor2Error, Cancelled, ConnectionLost, NotFound, NotInControl, OutOfRange, Refused
from arcor2_hw.objects import Generic
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.calls import Post, error_data
from arcor2_hw.runtime.cell import CONTROL_DEADLINE, Cell
from arcor2_hw.runtime.clock import Clock
from arcor2_hw.runtime.device import Device, describe
from arcor2_hw.runtime.holding import EXPIRY_MARGIN
from arcor2_hw.runtime.lane import Job

CHECK_PERIOD: Final = 0.25
"""Period at which the connection and the control of devices with forced outputs are checked, s."""
READ_TIMEOUT: Final = 1.0
"""Time for reading the value of an output before it is forced, s."""
READ_POLL: Final = 0.01
WRITE_TIMEOUT: Final = 2.0
"""Time limit of a driver to write an output, s."""


class _Force:
    """One forced output."""

    def __init__(self, device: Device, message: m.ForcePoint) -> None:
        self.device = device
        self.instance: Generic | None = None
        """The instance that forces the output; None before it does."""
        self.started = False
        """Whether the call that forces the output has ended."""
        self.start = message
        self.until = message.until
        self.before: bool | float = False
        self.ending = False
        self.error: Arcor2Error | None = None
        self.end_ids: list[int] = []
        """Ids of the requests that are answered when the force has ended."""
        self.over = threading.Event()

    @property
    def names(self) -> dict[str, str]:
        return {"device": self.device.name, "point": self.start.point}


class Forces:
    """All forced outputs. Requests arrive on the reader thread, leases expire on the clock thread."""

    def __init__(self, cell: Callable[[], Cell], post: Post, clock: Clock) -> None:
        self._cell = cell
        self._post = post
        self._clock = clock
        self._lock = threading.Lock()
        self._forces: dict[int, _Force] = {}

    # -------------------------------------------------------------------------------- requests
    def start(self, message: m.ForcePoint) -> None:
        """Force an output. CallDone or CallFailed answers it."""
        try:
            device = self._cell()[message.object_id]
            if busy := device.busy_with:
                raise Refused("{device} executes {method}. Wait until it has ended.", device=device.name, method=busy)
            force = self._register(device, message)
        except Arcor2Error as error:
            self._post(m.CallFailed(message.id, error_data(error, message.object_id)))
            return
        job = Job("force", lambda: self._force(force), notify=lambda done: self._started(force, done))
        within = CONTROL_DEADLINE + WRITE_TIMEOUT
        if device.lane.submit_or_fail(job):
            self._clock.after(within, lambda: device.lane.expire(job, within))

    def _register(self, device: Device, message: m.ForcePoint) -> _Force:
        with self._lock:
            for other in self._forces.values():
                if other.device.id == device.id and other.start.point == message.point:
                    raise Refused("{device}: {point} is forced already", **other.names)
            force = self._forces[message.force] = _Force(device, message)
            return force

    def renew(self, message: m.RenewForces) -> None:
        """Extend forces."""
        for number in message.forces:
            if (force := self._forces.get(number)) is not None:
                force.until = max(force.until, message.until)

    def end(self, message: m.EndForce) -> None:
        """End a force. CallDone or CallFailed answers it."""
        with self._lock:
            force = self._forces.get(message.force)
            if force is not None:
                force.end_ids.append(message.id)
        if force is None:
            self._post(m.CallDone(message.id))
        else:
            self._end(force, None)

    def end_all(self, within: float) -> None:
        """End all forces because the devices are about to be disconnected, and wait at most `within` s."""
        deadline = time.monotonic() + within
        forces = list(self._forces.values())
        for force in forces:
            self._end(force, Cancelled("{device} is being disconnected", device=force.device.name))
        for force in forces:
            force.over.wait(max(0.0, deadline - time.monotonic()))

    # -------------------------------------------------------------------------------- start
    def _force(self, force: _Force) -> m.ForceStarted:
        """Take control and write the output. Runs on the lane of the device."""
        device, message = force.device, force.start
        device.require_not_lost("force")
        instance = device.require()
        _require_forcible(force, instance)
        device.take_control()
        device.lane.check_wanted()
        point = _present(force, instance)
        if point.force is ForceKind.DIGITAL and not isinstance(message.value, bool):
            raise Refused("{device}: {point} is digital. Force it on or off.", **force.names)
        if point.force is ForceKind.ANALOG and isinstance(message.value, bool):
            raise Refused("{device}: {point} is analogue. Force it to a number.", **force.names)
        assert isinstance(point.value, bool | float | int)
        force.before = point.value
        with self._lock:
            if force.ending:
                raise force.error or Cancelled("{device}: {point}: the force was ended before it began", **force.names)
            force.instance = instance
        instance.force_point(message.point, message.value)
        return m.ForceStarted(point.value, point.unit)

    def _started(self, force: _Force, job: Job) -> None:
        if job.error is None:
            self._post(m.CallDone(force.start.id, encode_json(job.value).encode()))
        else:
            error = describe(force.device, job.error)
            self._post(m.CallFailed(force.start.id, error_data(error, force.device.id)))
            if isinstance(job.error, Refused | OutOfRange):
                force.instance = None  # nothing was written
        with self._lock:
            force.started = True
            ending = force.ending = force.ending or job.error is not None
        if ending:
            self._switch_back(force)
        else:
            self._expire_later(force)

    # -------------------------------------------------------------------------------- end
    def _expire_later(self, force: _Force) -> None:
        self._clock.after(force.until - time.monotonic() + EXPIRY_MARGIN, lambda: self._check_expired(force))

    def _check_expired(self, force: _Force) -> None:
        if force.ending:
            return
        if force.until > time.monotonic():
            self._expire_later(force)
        else:
            self._end(force, Cancelled("{device}: the force of {point} was not renewed in time", **force.names))

    def check_all(self) -> None:
        """End the forces of devices that are no longer connected or controlled."""
        for force in list(self._forces.values()):
            if not force.started or force.ending or (instance := force.instance) is None:
                continue
            name = force.device.name
            if force.device.instance is not instance or instance.connection is not Connection.ONLINE:
                self._end(force, ConnectionLost("{device}: the connection was lost", device=name))
            elif instance.control_owner() != "us":
                self._end(force, NotInControl("{device}: control was lost", device=name))

    def _end(self, force: _Force, error: Arcor2Error | None) -> None:
        """Switch an output back. `error`: the reason, None if EndForce requested it."""
        with self._lock:
            if force.ending:
                return
            force.ending, force.error = True, error
            started = force.started
        if started:  # otherwise the output is switched back when the call that forces it has ended
            self._switch_back(force)

    def _switch_back(self, force: _Force) -> None:
        instance = force.instance
        if instance is None:
            self._report(force, None)
            return
        point = force.start.point
        job = Job(
            "end of a force",
            lambda: instance.release_point(point, force.before),
            notify=lambda done: self._report(force, done.error),
        )
        lane = force.device.stop_lane  # an action may run on the other lane
        if lane.submit_or_fail(job):
            self._clock.after(WRITE_TIMEOUT, lambda: lane.expire(job, WRITE_TIMEOUT))

    def _report(self, force: _Force, problem: BaseException | None) -> None:
        device = force.device
        if isinstance(force.error, ConnectionLost | NotInControl):
            problem = None  # the device itself has switched the output
        error = force.error if problem is None else describe(device, problem)
        reported = None if error is None else error_data(error, device.id)
        with self._lock:
            self._forces.pop(force.start.force, None)
        self._post(m.ForceEnded(force.start.force, reported))
        for number in force.end_ids:
            if reported is None or problem is None:
                self._post(m.CallDone(number))
            else:
                self._post(m.CallFailed(number, reported))
        force.over.set()


def _require_forcible(force: _Force, instance: Generic) -> LivePoint:
    """Return the point with its present value. Raises NotFound, Refused."""
    names = force.names
    point: LivePoint | None = next((each for each in instance.live_points() if each.name == force.start.point), None)
    if point is None:
        raise NotFound("{device} has no point {point!r}", **names)
    if not isinstance(point.force, Unset):
        return point
    if point.use is not PointUse.OUTPUT:
        raise Refused("{device}: {point} is not an output. Only outputs can be forced.", **names)
    raise Refused(
        "{device}: {point} cannot be forced, because the device would keep the value if this computer failed", **names
    )


def _present(force: _Force, instance: Generic) -> LivePoint:
    """Return the point with a value that was read after this call. Raises Refused."""
    began = time.monotonic()
    while True:
        point = _require_forcible(force, instance)
        read_at = 0.0 if isinstance(point.age, Unset) else time.monotonic() - point.age
        if point.value is not None and read_at >= began:
            return point
        if time.monotonic() > began + READ_TIMEOUT:
            raise Refused("{device}: the present value of {point} is not known", **force.names)
        time.sleep(READ_POLL)

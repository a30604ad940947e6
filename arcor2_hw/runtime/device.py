"""A device in the cell host: the instance of the object type and its lanes."""

import contextlib
import inspect
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from arcor2_hw.actions import deadline_of, metadata_of
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import (
    Arcor2Error,
    Arcor2NotImplemented,
    ConnectionLost,
    DeviceError,
    InvalidData,
    NotConnected,
    message_of,
)
from arcor2_hw.messages import Message
from arcor2_hw.objects import CollisionObject, Generic, HoldsParts, Robot
from arcor2_hw.objects.conditions import conditions_of
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.observing import Observing, listening
from arcor2_hw.objects.surroundings import Surroundings
from arcor2_hw.runtime.creation import Recipe, shown_name
from arcor2_hw.runtime.identification import Identification
from arcor2_hw.runtime.lane import Job, Lane
from arcor2_hw.runtime.methods import OBSERVING, STOP_RACE_TIME, overrides, stop_of
from arcor2_hw.runtime.own_process.process import START_TIMEOUT, DeviceProcess
from arcor2_hw.runtime.remote_objects import CONNECT_TIMEOUT
from arcor2_hw.runtime.values import decode_arguments

CONSTRUCTION_DEADLINE: Final = 10.0
"""Time in addition to the connect timeout for constructors that connect the device (older convention), s."""
STOP_DEADLINE: Final = 2.0
"""Time limit of `stop`, s."""
STOP_GRACE: Final = 2.0
"""Time that a stopped call has to return before it is reported as cancelled, s."""
CLOSE_DEADLINE: Final = 1.2
"""Time limit of `disconnect`, s. Object types must return within 1 s."""
_IDENTIFY: Final = "identify"
"""Name of the call that reads the identity."""


def connect_timeout(cls: type[Generic]) -> float:
    """Return the time limit of `connect` of an object type, s: the default of its parameter `timeout`."""
    parameter = inspect.signature(cls.connect).parameters.get("timeout")
    default = None if parameter is None else parameter.default
    return float(default) if isinstance(default, int | float) else DEFAULT_CONNECT_TIMEOUT


class Device:
    """One object of the scene. Every call of its instance runs on one of its lanes.

    Args:
        recipe: Class and constructor arguments.
        changed: Called when the connection changes, on the thread that observes it.
        find: Returns the instance of another object of the scene by name or id.
        surroundings: Obstacles and other robots, for a robot.
        find_robot: Returns the robot that carries a gripper.
        identification: Identification of the device; None if another device is not detected.
    """

    def __init__(
        self,
        recipe: Recipe,
        changed: "Callable[[Device], None]" = lambda _: None,
        find: Callable[[str], Generic] | None = None,
        surroundings: Surroundings | None = None,
        find_robot: Callable[[str], Robot] | None = None,
        identification: Identification | None = None,
    ) -> None:
        self.recipe = recipe
        self.identification = identification
        self._find_robot = find_robot
        self._surroundings = surroundings
        self._find = find
        self._changed = changed
        self._connections: list[Observing] = []
        self.id = recipe.scene_object.id
        self.name = recipe.scene_object.name
        self.conditions_changed: Callable[[], None] = lambda: None
        """Called when the instance has reported a condition, on any thread."""
        self.state_taken: Callable[[object], None] = lambda _: None
        """Called with each new state that the driver has read, on the thread that observes the device."""
        self.instance: Generic | None = None
        self.lane = Lane(self.name)
        self.stop_lane = Lane(self.name, "stop")
        self._watch_lane: Lane | None = None
        self._creating_lane = threading.Lock()
        self.closing = False
        self._opening: Job | None = None
        self.closed_by: Job | None = None
        """The call that closes the device after a failure."""
        self._process: DeviceProcess | None = None
        """The child process of an object type that requires its own process."""
        self.failure: Arcor2Error | None = None
        """Reason why the device could not be connected, in a scene that continues without it."""

    # -------------------------------------------------------------------------------- life
    def open(self, notify: Callable[[Job], None]) -> tuple[Job, float]:
        """Start to create and connect the instance. Return the call and its deadline, s."""
        cls = self.recipe.cls
        deadline = connect_timeout(cls) + (1.0 if overrides(cls, "connect") else CONSTRUCTION_DEADLINE)
        if self.remote:
            deadline += CONNECT_TIMEOUT
        elif cls.own_process:
            deadline += START_TIMEOUT
        job = self._opening = Job("connect", self._open, notify=notify)
        self.lane.submit(job)
        self.begin_identify()
        return job, deadline

    def begin_identify(self) -> Job | None:
        """Start to read the identity, before the calls that follow. Return the call, None if there is nothing to read.

        It ends with an error if the device is not the confirmed one.
        """
        if self.identification is None:
            return None
        job = Job(_IDENTIFY, self._require_confirmed)
        return job if self.lane.submit_or_fail(job) else None

    def require_confirmed(self, lane: Lane) -> None:
        """Raise DifferentDevice or Refused unless the device may be commanded.

        After a connection loss, it reads the identity.
        """
        if self.identification is not None and not self.identification.confirmed:
            lane.call(_IDENTIFY, self._require_confirmed)

    def _require_confirmed(self) -> None:
        """Raise DifferentDevice or Refused unless the device may be commanded. Call it on the lane."""
        if self.identification is not None and self.instance is not None and not self.closing:
            self.identification.require_confirmed(self.instance)

    @property
    def remote(self) -> bool:
        """Return whether another host has the object, so that the instance is a stub."""
        return self.recipe.remotes is not None

    @property
    def busy_with(self) -> str:
        """Return the name of the running call; empty if there is none, or if it only reads the identity."""
        busy = self.lane.busy_with
        return "" if busy == _IDENTIFY else busy

    @property
    def up(self) -> bool:
        """Return whether the device is connected and not being disconnected."""
        opening = self._opening
        return opening is not None and opening.ended and opening.error is None and not self.closing

    def _open(self) -> None:
        with listening(self._connection_changed, lambda state: self.state_taken(state)):
            self.instance = instance = self._make()
            conditions_of(instance).listener = lambda: self.conditions_changed()
            if isinstance(instance, CollisionObject):
                instance.on_enabled_changed(lambda: self._changed(self))
            if self._find is not None:
                instance.attach(self._find)
                if isinstance(instance, HoldsParts) and self._find_robot is not None:
                    instance.mount(self._find, self._find_robot)
            if isinstance(instance, Robot):
                instance.on_parts_changed(lambda: self._changed(self))
            if isinstance(instance, Robot) and self._surroundings is not None:
                instance.surround(self._surroundings)
            instance.connect()
        if self.closing:  # the deadline has passed
            self.instance = None
            instance.cleanup()
            self._end_process()

    def _make(self) -> Generic:
        """Create the instance, in a child process if its type requires one."""
        recipe = self.recipe
        if self.remote or not recipe.cls.own_process:
            return recipe.make()
        self._process = DeviceProcess(recipe.cls, self.name, lambda: self._changed(self))
        return self._process.make(recipe.arguments, recipe.keywords)

    def _end_process(self) -> None:
        if self._process is not None:
            self._process.end()

    def _connection_changed(self, life: Observing) -> None:
        if life not in self._connections:
            self._connections.append(life)
        if self.identification is not None and life.state is Connection.LOST:
            self.identification.forget()  # the cable may be plugged into another device
        elif life.state is Connection.BACK and self.up:
            self.begin_identify()
        self._changed(self)

    def connection_reason(self) -> Message | None:
        """Return why the connection is lost or has failed; None without a loss or for an unknown reason."""
        given = "" if self.instance is None else self.instance.connection_reason
        if given:
            return given if isinstance(given, Message) else Message.of(given)
        return next((life.reason for life in self._connections if life.reason), None)

    def require_not_lost(self, method: str) -> None:
        """Raise ConnectionLost while the connection is lost."""
        if self.require().connection is Connection.LOST:
            raise ConnectionLost(
                "{name}: {method} was not executed, because the connection is lost",
                str(self.connection_reason() or ""),
                name=self.name,
                method=method,
            )

    def fail(self, error: Arcor2Error) -> None:
        """Mark the device as failed and start to close it."""
        self.failure = error
        try:
            self.closed_by = self.begin_close(lambda _: self.release_lanes())
            if self.closed_by is None:
                self.release_lanes()
        except Arcor2Error:  # both lanes hang
            self.release_lanes()
        self.instance = None

    def begin_close(self, notify: Callable[[Job], None] | None = None) -> Job | None:
        """Start to disconnect. Return the call, or None if there is no instance.

        If the lane is busy, the stop lane disconnects the device, so that a hanging call does not prevent it.
        """
        self.closing = True
        instance = self.instance
        if instance is None:
            return None
        job = Job("disconnect", instance.cleanup, notify=notify)  # by default this calls disconnect
        (self.stop_lane if self.lane.busy_with else self.lane).submit(job)
        return job

    def release_lanes(self) -> None:
        """End the threads and the child process of the device."""
        self._end_process()
        for lane in (self.lane, self.stop_lane, self._watch_lane):
            if lane is not None:
                lane.close()

    # -------------------------------------------------------------------------------- calls
    @property
    def watch_lane(self) -> Lane:
        """Return the lane of methods that only observe. It is created on first use."""
        with self._creating_lane:
            if self._watch_lane is None:
                self._watch_lane = Lane(self.name, "watch")
            return self._watch_lane

    def lane_for(self, method: str) -> Lane:
        """Return the lane on which a method runs."""
        if method in OBSERVING and isinstance(self.instance, Robot):
            return self.watch_lane
        return self.lane

    def require(self) -> Generic:
        """Return the instance. Raises NotConnected if the device is not connected or has failed."""
        if self.failure is not None:
            raise NotConnected(
                "{name} is not available: {failure}", self.failure.detail, name=self.name, failure=self.failure
            )
        if self.instance is None:
            raise NotConnected("{name} is not connected", name=self.name)
        return self.instance

    def take_control(self) -> None:
        """Take control unless this process has it. Call it on the lane.

        Raises:
            DifferentDevice: The device is not the confirmed one.
        """
        instance = self.require()
        self._require_confirmed()
        if instance.control_owner() != "us":
            instance.take_control()

    def prepare(
        self,
        method: str,
        arguments: Mapping[str, bytes],
        control: bool,
        notify: Callable[[Job], None],
        guard: Callable[[Mapping[str, Any]], contextlib.AbstractContextManager[None]] | None = None,
    ) -> tuple[Job, float | None]:
        """Prepare the call of a method, and return it with the deadline of the method, s.

        Args:
            method: Name of the method or property.
            arguments: JSON by name of the parameter.
            control: Whether to take control before the call.
            notify: Called with the call when it has ended.
            guard: Returns the context in which it runs, from its arguments by name.

        Raises:
            NotConnected: The device is not connected.
            InvalidData: The device has no such method, or an argument is not valid.
        """
        instance = self.require()
        if method.startswith("_") or (not hasattr(type(instance), method) and method not in vars(instance)):
            raise InvalidData(
                "{name} ({type}) has no method {method}", name=self.name, type=shown_name(type(instance)), method=method
            )
        static = inspect.getattr_static(type(instance), method, None)
        if not callable(static) and not isinstance(static, staticmethod | classmethod):
            return Job(method, getattr, (instance, method), notify=notify), deadline_of(static)
        bound = getattr(instance, method)
        keywords = decode_arguments(bound, arguments, self.name)
        commands = metadata_of(bound) is not None or method == "take_control"

        def run() -> Any:
            with contextlib.nullcontext() if guard is None else guard(keywords):
                if commands:
                    self._require_confirmed()
                if control:
                    self.require_not_lost(method)
                    self.take_control()
                    self.lane_for(method).check_wanted()  # a stop may have arrived while control was being taken
                return bound(**keywords)

        return Job(method, run, notify=notify), deadline_of(bound)

    # -------------------------------------------------------------------------------- stop
    @property
    def stop_method(self) -> Callable[[], Any] | None:
        """Return the method that stops this device, or None if it has none."""
        return stop_of(self.instance)

    def cancelled_by(self, action: str) -> str:
        """Return the name of the method that cancels an action. Raises InvalidData if there is none."""
        method = type(self.require()).CANCEL_MAPPING.get(action)
        if method is None:
            raise InvalidData("{name}.{action} cannot be cancelled", name=self.name, action=action)
        return method

    def _cancel_method(self, action: str) -> Callable[[], Any] | None:
        """Return the method that cancels a running action, or None if there is none or it is `stop`."""
        name = getattr(type(self.instance), "CANCEL_MAPPING", {}).get(action)
        found = getattr(self.instance, name, None) if name else None
        return found if callable(found) and found != self.stop_method else None

    def begin_stop(self, notify: Callable[[Job], None] | None = None) -> tuple[Job, Job | None] | None:
        """Cancel the queued calls, and call `stop` and the cancel method of the running action on the stop lane.

        Return the call and the call that it interrupts, or None if the device has neither method.
        """
        running = self.lane.current
        stop, cancel = self.stop_method, None if running is None else self._cancel_method(running.method)
        if stop is None and cancel is None:
            self.lane.cancel_waiting()
            return None
        interrupted = self.lane.interrupt()
        job = Job("stop", self._stop, (stop, cancel, interrupted, time.monotonic()), notify=notify)
        self.stop_lane.submit(job)
        return job, interrupted

    def _stop(
        self, stop: Callable[[], Any] | None, cancel: Callable[[], Any] | None, interrupted: Job | None, moment: float
    ) -> None:
        """Call `stop`, and `cancel` if the interrupted call still runs.

        The command of a call that started just before `moment` may reach the device after the stop. If such a call does
        not return, `stop` is called again.
        """
        try:
            if stop is not None:
                stop()
                job = self.lane.current
                if job is not None and job.since > moment - STOP_RACE_TIME and not job.wait(STOP_RACE_TIME / 2):
                    stop()
        finally:
            if cancel is not None and self.lane.current is interrupted:
                cancel()

    @property
    def moving(self) -> bool:
        """Return whether the device reports that it moves."""
        return isinstance(self.instance, Robot) and self.instance.move_in_progress


def describe(device: Device, error: BaseException) -> Arcor2Error:
    """Return an error whose message names the device, its type and address. Errors of our classes keep their class."""
    where = f"{device.name} ({device.recipe.cls.__name__})"
    address = device.recipe.address
    message = message_of(error)
    if isinstance(error, Arcor2NotImplemented):
        return DeviceError("{device}: not implemented: {method}", device=where, method=message)
    if not isinstance(error, Arcor2Error) and message.text != type(error).__name__:
        message = Message.of("{type}: {reason}", type=type(error).__name__, reason=message)
    named = message.text.startswith(device.name) or str(error).startswith(device.name)
    if address and not any(part.split(" ", 1)[-1] in message.text for part in address.split(", ")):
        message = Message.of(
            "{problem} [{address}]" if named else "{device}: {problem} [{address}]",
            device=where,
            problem=message,
            address=address,
        )
    elif not named:
        message = Message.of("{device}: {problem}", device=where, problem=message)
    elif isinstance(error, Arcor2Error):
        return error
    described = error.with_message(message) if isinstance(error, Arcor2Error) else DeviceError(message)
    described.__cause__ = error
    return described


def time_left(deadline: float) -> float:
    """Return the time left until a time of the monotonic clock, s; at least 0."""
    return max(0.0, deadline - time.monotonic())

"""All devices of a scene: connected, stopped and closed concurrently."""

import importlib
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from queue import Empty, SimpleQueue
from types import MappingProxyType
from typing import Final

from msgspec.structs import replace

from arcor2_hw.data.device import Connection
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.scene import Scene, SceneObjectOverride
from arcor2_hw.data.secret import ObjectSecrets
from arcor2_hw.exceptions import Arcor2Error, NotConnected, NotFound, ProgramStopped, Refused
from arcor2_hw.objects import Camera, Generic, Robot
from arcor2_hw.runtime.creation import Recipe, load_type, recipe
from arcor2_hw.runtime.device import CLOSE_DEADLINE, Device, describe, until
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.messages import OpenScene
from arcor2_hw.runtime.methods import overrides
from arcor2_hw.runtime.stopping import SentStop, send_stop
from arcor2_hw.runtime.surroundings import SceneSurroundings
from arcor2_hw.runtime.world_updates import WorldUpdates

CONTROL_DEADLINE: Final = 10.0
"""Seconds for taking control: a controller may have to load and start its control program."""
SETTLE: Final = 0.4
"""Seconds that running calls have to return before their device is closed."""


class SceneFault(Exception):
    """A scene could not be opened: the error, and the object that it belongs to."""

    def __init__(self, object_id: str, error: Arcor2Error) -> None:
        super().__init__(str(error))
        self.object_id = object_id
        self.error = error


def recipes(
    scene: Scene,
    classes: Mapping[str, type[Generic]],
    models: Mapping[str, ObjectModel],
    overridden: Iterable[SceneObjectOverride] = (),
    failed: Callable[[SceneFault], None] | None = None,
    secrets: Mapping[str, ObjectSecrets] = MappingProxyType({}),
) -> list[Recipe]:
    """Return how every object is made; `secrets` are those of the objects, by id.

    SceneFault names the first that cannot be made; with `failed`, that is called for each instead.
    """
    overridden = list(overridden)
    _import_numpy(classes.values())
    found = []
    for scene_object in scene.objects:
        try:
            cls = classes.get(scene_object.type)
            if cls is None:
                raise NotFound(
                    "{name}: object type {type} is not there", name=scene_object.name, type=scene_object.type
                )
            own = secrets.get(scene_object.id, ObjectSecrets())
            found.append(recipe(scene_object, cls, models.get(scene_object.type), overridden, own))
        except Arcor2Error as error:
            fault = SceneFault(scene_object.id, error)
            if failed is None:
                raise fault from error
            failed(fault)
    return found


def scene_recipes(
    message: OpenScene, failed: Callable[[SceneFault], None] | None = None, only: str = ""
) -> list[Recipe]:
    """Load the types of the objects of a scene, or of `only` that one, and return how each is made.

    SceneFault for the first object that cannot be made; with `failed`, that is called for each. Otherwise NotFound
    or InvalidData for a type.
    """
    objects = [one for one in message.scene.objects if only in ("", one.id)]
    codes = {code.name: code for code in message.types}
    classes: dict[str, type[Generic]] = {}
    broken: dict[str, Arcor2Error] = {}
    for name in dict.fromkeys(one.type for one in objects if one.type in codes):
        try:
            classes[name] = load_type(codes[name])
        except Arcor2Error as error:
            if failed is None and not only:
                raise
            broken[name] = error
    for one in objects:
        if (problem := broken.get(one.type)) is not None:
            fault = SceneFault(
                one.id, NotConnected("{name}: {problem}", problem.detail, name=one.name, problem=problem)
            )
            if failed is None:
                raise fault
            failed(fault)
    rest = replace(message.scene, objects=[one for one in objects if one.type not in broken])
    return recipes(rest, classes, message.models, message.overrides, failed, message.secrets)


def _import_numpy(classes: Iterable[type[Generic]]) -> None:
    """Import numpy before the devices connect, each on a thread of its own.

    A vendor's library that is loaded while another thread is importing numpy fails. The import takes 0.1 s, which
    scenes without robots and cameras do without.
    """
    if any(issubclass(each, Robot | Camera) for each in classes):
        importlib.import_module("numpy")


class Cell:
    """The devices by the id of their scene object."""

    def __init__(self) -> None:
        self._devices: dict[str, Device] = {}
        self._absent: dict[str, Arcor2Error] = {}
        self._ended: SimpleQueue[Job | None] = SimpleQueue()
        self._abandoned = False
        self.assets: Mapping[str, str] = {}
        """Files of meshes and of robots' models that were uploaded, by the asset's id."""
        self.updates = WorldUpdates()
        """Bodies and calibrations that the server has sent."""
        self.changed: Callable[[Device], None] = lambda _: None
        """Called when the connection of a device changes, on the thread that observes it."""

    def __iter__(self) -> Iterator[Device]:
        return iter(list(self._devices.values()))

    def __getitem__(self, object_id: str) -> Device:
        try:
            return self._devices[object_id]
        except KeyError:
            if (error := self._absent.get(object_id)) is not None:
                raise NotConnected(str(error), error.detail) from None
            raise NotFound("the scene has no object {object_id}", object_id=object_id) from None

    def find(self, name: str) -> Generic:
        """Return the instance of an object by its name or id, for another object; NotFound, NotConnected."""
        for device in self:
            if name in (device.name, device.id):
                return device.require()
        raise NotFound("the scene has no object {name}", name=name)

    def find_robot(self, name: str) -> Robot:
        """Return a robot by its name or id, for a gripper; for an empty name the only robot of the scene.

        Raises:
            NotFound: There is no such robot, or several when no name is given.
            NotConnected: The robot does not exist yet, or has failed.
        """
        if name:
            found = self.find(name)
            if not isinstance(found, Robot):
                raise NotFound("{name} is no robot", name=name)
            return found
        robots = [device for device in self if issubclass(device.recipe.cls, Robot)]
        if len(robots) != 1:
            raise NotFound(
                "the scene has {count} robots; name the one that carries the gripper in its settings", count=len(robots)
            )
        robot = robots[0].require()
        assert isinstance(robot, Robot)
        return robot

    # -------------------------------------------------------------------------------- up and down
    def open(self, how: Iterable[Recipe], failed: Callable[[SceneFault], None] | None = None) -> None:
        """Create and connect all objects concurrently; SceneFault for the first that fails, as soon as it fails.

        With `failed`, that is called for each that fails, and the others continue.
        Connected objects stay connected; `close` follows in any case. ProgramStopped if `abandon` is called meanwhile.
        """
        began = time.monotonic()
        pending: dict[Job, tuple[Device, float]] = {}
        for each in how:
            self._make(each)
        for device in self:
            opening, deadline = device.open(self._ended.put)
            pending[opening] = (device, began + deadline)
        while pending:
            if self._abandoned:
                raise ProgramStopped
            first = min(pending, key=lambda job: pending[job][1])
            device, moment = pending[first]
            try:
                ended = self._ended.get(timeout=until(moment))
            except Empty:
                device.lane.expire(first, moment - began)
                continue
            if ended is None:
                continue
            device, _ = pending.pop(ended)
            if ended.error is None:
                continue
            fault = SceneFault(device.id, describe(device, ended.error))
            if failed is None:
                raise fault from ended.error
            device.fail(fault.error)
            failed(fault)

    def _make(self, how: Recipe) -> Device:
        surroundings = SceneSurroundings(how.scene_object.id, self, self.assets, self.updates)
        device = Device(how, lambda device: self.changed(device), self.find, surroundings, self.find_robot)
        self._devices[device.id] = device
        return device

    def mark_absent(self, fault: SceneFault) -> None:
        """Record an object that could not be prepared, with the error that its callers get."""
        self._absent[fault.object_id] = fault.error

    def require_failed(self, object_id: str) -> None:
        """Raise Refused unless an object has failed; NotFound."""
        if object_id in self._absent:
            return
        device = self[object_id]
        connection = None if device.instance is None else device.instance.connection
        if device.failure is None and connection is not Connection.FAILED:
            raise Refused("{name} has not failed", name=device.name)

    def retry(self, how: Recipe) -> None:
        """Create and connect an object that has failed once more; SceneFault when it fails again."""
        object_id = how.scene_object.id
        former = self._devices.get(object_id)
        if former is not None and former.failure is None:
            former.fail(NotConnected("{name} is being connected anew", name=former.name))
        if former is not None and former.closed_by is not None:
            former.closed_by.wait(CLOSE_DEADLINE)  # both would be at the same port
        device = self._make(how)
        self._absent.pop(object_id, None)
        job, deadline = device.open(lambda _: None)
        if not job.wait(deadline):
            device.lane.expire(job, deadline)
        if job.error is not None:
            error = describe(device, job.error)
            device.fail(error)
            raise SceneFault(object_id, error) from job.error

    def abandon(self) -> None:
        """End an `open` that is in progress."""
        self._abandoned = True
        self._ended.put(None)

    def close(self) -> Arcor2Error | None:
        """Disconnect all devices concurrently, within about CLOSE_DEADLINE; return the first error."""
        settled = time.monotonic() + SETTLE
        while time.monotonic() < settled and any(d.lane.busy_with or d.stop_lane.busy_with for d in self):
            time.sleep(0.002)
        deadline = time.monotonic() + CLOSE_DEADLINE
        jobs: list[tuple[Device, Job]] = []
        problem: Arcor2Error | None = None
        for device in self:
            if device.failure is not None:
                continue
            try:
                job = device.begin_close()
            except Arcor2Error as error:  # both lanes hang
                problem = problem or error
                continue
            if job is not None:
                jobs.append((device, job))
        for device, job in jobs:
            if not job.wait(until(deadline)):
                (device.stop_lane if device.lane.busy_with != "disconnect" else device.lane).expire(job, CLOSE_DEADLINE)
            if job.error is not None:
                problem = problem or describe(device, job.error)
        for device in self:
            device.release_lanes()
        self._devices.clear()
        return problem

    # -------------------------------------------------------------------------------- stop and control
    def stop_all(self, because: BaseException | None = None) -> list[SentStop]:
        """Send a stop to every device without waiting; return the stops.

        With `because`, running and waiting calls end at once with that error for their callers.
        """
        stops = []
        for device in self:
            stops.append(send_stop(device))
            if because is not None and (running := device.lane.interrupt()) is not None:
                running.give_up(because)
        return stops

    def wait_still(self, within: float) -> bool:
        """Wait until no device reports that it moves; return False when one still does after `within` s."""
        deadline = time.monotonic() + within
        while any(device.moving for device in self):
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.005)
        return True

    def take_control(self) -> None:
        """Take control of every device that has the concept, concurrently; SceneFault names one that refuses."""
        jobs = []
        for device in self:
            if overrides(device.recipe.cls, "take_control"):
                job = Job("take_control", device.take_control)
                device.lane.submit(job)
                jobs.append((device, job))
        deadline = time.monotonic() + CONTROL_DEADLINE
        for device, job in jobs:
            if not job.wait(until(deadline)):
                device.lane.expire(job, CONTROL_DEADLINE)
            if job.error is not None:
                raise SceneFault(device.id, describe(device, job.error)) from job.error

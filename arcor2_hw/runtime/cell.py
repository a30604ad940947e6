"""All devices of a scene, which are connected, stopped and closed concurrently."""

import importlib
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from queue import Empty, SimpleQueue
from types import MappingProxyType
from typing import Final

from msgspec.structs import replace

from arcor2_hw.data.device import Connection, Identity
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.data.secret import ObjectSecrets
from arcor2_hw.exceptions import Arcor2Error, NotConnected, NotFound, ProgramStopped, Refused
from arcor2_hw.messages import Message
from arcor2_hw.objects import Camera, Generic, Robot
from arcor2_hw.runtime.creation import Recipe, load_type, recipe
from arcor2_hw.runtime.device import CLOSE_DEADLINE, Device, describe, time_left
from arcor2_hw.runtime.identification import Identification, ReadIdentity
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.messages import OpenScene, RunPackage
from arcor2_hw.runtime.methods import overrides
from arcor2_hw.runtime.remote_objects import RemoteObjects
from arcor2_hw.runtime.stopping import SentStop, send_stop
from arcor2_hw.runtime.surroundings import SceneSurroundings
from arcor2_hw.runtime.world_updates import WorldUpdates

CONTROL_DEADLINE: Final = 10.0
"""Time limit for taking control, s. A controller may have to load and start its control program."""
IDENTIFY_DEADLINE: Final = 5.0
"""Time limit for reading the identities before a program starts, s."""
CALL_END_WAIT: Final = 0.4
"""Time that running calls have to return before their device is closed, s."""


class SceneFault(Exception):
    """A scene could not be opened because of an error of one object."""

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
    remotes: RemoteObjects | None = None,
) -> list[Recipe]:
    """Return the recipes of all objects.

    Args:
        scene: The scene.
        classes: Object types by name.
        models: Collision models by object type.
        overridden: Parameters that override those of the scene.
        failed: Called for each object without a recipe; the others are returned.
        secrets: Values of secret settings by object id.
        remotes: The objects of other hosts; None without them.

    Raises:
        SceneFault: The first object without a recipe, unless `failed` is given.
    """
    overridden = list(overridden)
    _import_numpy(classes.values())
    found = []
    for scene_object in scene.objects:
        try:
            cls = classes.get(scene_object.type)
            if cls is None:
                raise NotFound(
                    "{name}: object type {type} is not available", name=scene_object.name, type=scene_object.type
                )
            model = models.get(scene_object.type)
            if remotes is not None and remotes.computer(scene_object.id) is not None:
                found.append(Recipe(scene_object, cls, (model,), {}, "", remotes))
                continue
            own = secrets.get(scene_object.id, ObjectSecrets())
            found.append(recipe(scene_object, cls, model, overridden, own))
        except Arcor2Error as error:
            fault = SceneFault(scene_object.id, error)
            if failed is None:
                raise fault from error
            failed(fault)
    return found


def scene_recipes(
    message: OpenScene,
    remotes: RemoteObjects,
    failed: Callable[[SceneFault], None] | None = None,
    only: str = "",
) -> list[Recipe]:
    """Load the object types of a scene and return the recipes of its objects.

    Args:
        message: The scene, its types and their models.
        remotes: The objects of other hosts.
        failed: Called for each object without a recipe; the others are returned.
        only: Id of the only object to prepare; empty for all.

    Raises:
        SceneFault: The first object without a recipe, unless `failed` is given.
        NotFound: A type does not exist, unless `failed` or `only` is given.
        InvalidData: A type cannot be imported, unless `failed` or `only` is given.
    """
    objects = [one for one in own_objects(message, message.scene) if only in ("", one.id)]
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
    return recipes(rest, classes, message.models, message.overrides, failed, message.secrets, remotes)


def own_objects(message: OpenScene | RunPackage, scene: Scene) -> list[SceneObject]:
    """Return the objects that a host creates. The main host creates all, with stubs for those of other hosts."""
    return [one for one in scene.objects if message.main or one.id not in message.remote]


def _import_numpy(classes: Iterable[type[Generic]]) -> None:
    """Import numpy before the devices connect on their threads.

    Vendor libraries fail to load while another thread imports numpy. The import takes 0.1 s, so scenes without robots
    and cameras skip it.
    """
    if any(issubclass(each, Robot | Camera) for each in classes):
        importlib.import_module("numpy")


class Cell:
    """The devices of a scene by object id."""

    def __init__(self) -> None:
        self._devices: dict[str, Device] = {}
        self._absent: dict[str, Arcor2Error] = {}
        self._ended: SimpleQueue[Job | None] = SimpleQueue()
        self._abandoned = False
        self.elsewhere: Mapping[str, Message] = {}
        """The computers of objects that only the main host can call, by their names and ids."""
        self.assets: Mapping[str, str] = {}
        """Files of uploaded meshes and robot models by asset id."""
        self.updates = WorldUpdates()
        """Added bodies and calibrations from the server."""
        self.changed: Callable[[Device], None] = lambda _: None
        """Called when the connection of a device changes, on the thread that observes it."""
        self.conditions_changed: Callable[[Device], None] = lambda _: None
        """Called when a device has reported a condition, on any thread."""
        self.identities: Mapping[str, Identity] = {}
        """The confirmed identities by object id."""
        self.identified: Callable[[Device, ReadIdentity], None] | None = None
        """Called with the identity of a device after it connected, on any thread; None: identities are not read."""
        self.state_taken: Callable[[Device, object], None] = lambda *_: None
        """Called when a driver has read a new state of its device, on the thread that observes it."""

    def __iter__(self) -> Iterator[Device]:
        return iter(list(self._devices.values()))

    def __getitem__(self, object_id: str) -> Device:
        try:
            return self._devices[object_id]
        except KeyError:
            if (error := self._absent.get(object_id)) is not None:
                raise NotConnected(error.message, error.detail) from None
            raise NotFound("the scene has no object {object_id}", object_id=object_id) from None

    def find(self, name: str) -> Generic:
        """Return the instance of an object by name or id. Raises NotFound, NotConnected."""
        for device in self:
            if name in (device.name, device.id):
                return device.require()
        if (computer := self.elsewhere.get(name)) is not None:
            raise Refused(
                "{name} runs on another computer ({computer}). Run both on the same one.", name=name, computer=computer
            )
        raise NotFound("the scene has no object {name}", name=name)

    def find_robot(self, name: str) -> Robot:
        """Return a robot by name or id; the only robot of the scene if the name is empty.

        Raises:
            NotFound: The robot does not exist, or the name is empty and the scene has none or several.
            NotConnected: The robot is not connected yet, or has failed.
        """
        if name:
            found = self.find(name)
            if not isinstance(found, Robot):
                raise NotFound("{name} is not a robot", name=name)
            return found
        robots = [device for device in self if issubclass(device.recipe.cls, Robot)]
        if len(robots) != 1:
            raise NotFound(
                "the scene has {count} robots. Name the robot that carries the gripper in the settings of the gripper.",
                count=len(robots),
            )
        robot = robots[0].require()
        assert isinstance(robot, Robot)
        return robot

    # -------------------------------------------------------------------------------- open and close
    def open(self, how: Iterable[Recipe], failed: Callable[[SceneFault], None] | None = None) -> None:
        """Create and connect all objects concurrently. Call `close` afterwards, also after an error.

        failed: called for each object that fails; the others continue.

        Raises:
            SceneFault: The first object that fails, as soon as it fails, unless `failed` is given.
            ProgramStopped: `abandon` was called.
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
                ended = self._ended.get(timeout=time_left(moment))
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
        device = Device(
            how,
            lambda device: self.changed(device),
            self.find,
            surroundings,
            self.find_robot,
            self._identification(how),
        )
        if how.remotes is not None:
            how.remotes.follow(device.id, lambda: self.changed(device))
        device.conditions_changed = lambda: self.conditions_changed(device)
        device.state_taken = lambda state: self.state_taken(device, state)
        self._devices[device.id] = device
        return device

    def _identification(self, how: Recipe) -> Identification | None:
        """Return the identification of a device, None if its type has no identity.

        Commands of a type that continues without its connection, such as a service with an outbox, are not delayed.
        """
        object_id = how.scene_object.id
        identified = self.identified
        if (
            identified is None
            or how.remotes is not None
            or not overrides(how.cls, "identify")
            or not how.cls.loss_ends_program
        ):
            return None
        return Identification(
            how.scene_object.name,
            self.identities.get(object_id),
            lambda reported: identified(self._devices[object_id], reported),
            lambda: self.conditions_changed(self._devices[object_id]),
        )

    def require_confirmed(self) -> None:
        """Wait until the identities are read. Raises SceneFault for the first device that is not the confirmed one."""
        jobs = [(device, job) for device in self if (job := device.begin_identify()) is not None]
        deadline = time.monotonic() + IDENTIFY_DEADLINE
        for device, job in jobs:
            if not job.wait(time_left(deadline)):
                device.lane.expire(job, IDENTIFY_DEADLINE)
            if isinstance(job.error, Refused):  # other errors occur again with the first command
                raise SceneFault(device.id, job.error) from job.error

    def mark_absent(self, fault: SceneFault) -> None:
        """Record that an object has no device. Access to it raises the error of the fault."""
        self._absent[fault.object_id] = fault.error

    def require_failure(self, object_id: str) -> None:
        """Raise Refused unless an object has failed. Raises NotFound."""
        if object_id in self._absent:
            return
        device = self[object_id]
        connection = None if device.instance is None else device.instance.connection
        if device.failure is None and connection is not Connection.FAILED:
            raise Refused("{name} has not failed", name=device.name)

    def retry(self, how: Recipe) -> None:
        """Create and connect a failed object again. Raises SceneFault if it fails again."""
        object_id = how.scene_object.id
        former = self._devices.get(object_id)
        if former is not None and former.failure is None:
            former.fail(NotConnected("{name} is being connected again", name=former.name))
        if former is not None and former.closed_by is not None:
            former.closed_by.wait(CLOSE_DEADLINE)  # a second instance would use the same port
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
        """Make `open` raise ProgramStopped."""
        self._abandoned = True
        self._ended.put(None)

    def close(self) -> Arcor2Error | None:
        """Disconnect all devices concurrently, within about CLOSE_DEADLINE, and return the first error."""
        settled = time.monotonic() + CALL_END_WAIT
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
            if not job.wait(time_left(deadline)):
                (device.stop_lane if device.lane.busy_with != "disconnect" else device.lane).expire(job, CLOSE_DEADLINE)
            if job.error is not None:
                problem = problem or describe(device, job.error)
        for device in self:
            device.release_lanes()
        self._devices.clear()
        return problem

    # -------------------------------------------------------------------------------- stop and control
    def stop_all(self, because: BaseException | None = None) -> list[SentStop]:
        """Send a stop to every device without waiting for the outcome, and return the stops.

        because: error that ends the running and queued calls at once for their callers; None to let them return.
        """
        stops = []
        for device in self:
            stops.append(send_stop(device))
            if because is not None and (running := device.lane.interrupt()) is not None:
                running.give_up(because)
        return stops

    def wait_standstill(self, within: float) -> bool:
        """Wait until no device moves. Return False if one still moves after `within` s."""
        deadline = time.monotonic() + within
        while any(device.moving for device in self):
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.005)
        return True

    def take_control(self) -> list[tuple[Device, BaseException]]:
        """Take control of every device that supports it, concurrently. Return the devices that refuse, with reasons."""
        jobs = []
        for device in self:
            if overrides(device.recipe.cls, "take_control"):
                job = Job("take_control", device.take_control)
                device.lane.submit(job)
                jobs.append((device, job))
        deadline = time.monotonic() + CONTROL_DEADLINE
        for device, job in jobs:
            if not job.wait(time_left(deadline)):
                device.lane.expire(job, CONTROL_DEADLINE)
        return [(device, job.error) for device, job in jobs if job.error is not None]

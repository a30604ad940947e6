"""All devices of a scene: brought up at once, stopped at once, closed at once."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from queue import Empty, SimpleQueue
from typing import Final

from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.scene import Scene, SceneObjectOverride
from arcor2_hw.exceptions import Arcor2Error, Cancelled, NotFound, ProgramStopped
from arcor2_hw.objects import Generic
from arcor2_hw.runtime.creation import Recipe, recipe
from arcor2_hw.runtime.device import CLOSE_DEADLINE, STOP_DEADLINE, Device, describe, overrides, until
from arcor2_hw.runtime.lane import Job

CONTROL_DEADLINE: Final = 10.0
"""Seconds for taking control: a controller may have to load and start its control program."""
SETTLE: Final = 0.4
"""Seconds that calls which are under way get to come back before a device is closed past them."""


class SceneFault(Exception):
    """A scene could not be brought up: what went wrong, and with which object."""

    def __init__(self, object_id: str, error: Arcor2Error) -> None:
        super().__init__(str(error))
        self.object_id = object_id
        self.error = error


def recipes(
    scene: Scene,
    classes: Mapping[str, type[Generic]],
    models: Mapping[str, ObjectModel],
    overridden: Iterable[SceneObjectOverride] = (),
) -> list[Recipe]:
    """Work out how every object is made; SceneFault names the first that cannot be."""
    overridden = list(overridden)
    found = []
    for scene_object in scene.objects:
        try:
            cls = classes.get(scene_object.type)
            if cls is None:
                raise NotFound(f"{scene_object.name}: object type {scene_object.type} is not there")
            found.append(recipe(scene_object, cls, models.get(scene_object.type), overridden))
        except Arcor2Error as error:
            raise SceneFault(scene_object.id, error) from error
    return found


class Cell:
    """The devices by the id of their scene object."""

    def __init__(self) -> None:
        self._devices: dict[str, Device] = {}
        self._ended: SimpleQueue[Job | None] = SimpleQueue()
        self._abandoned = False
        self.changed: Callable[[Device], None] = lambda _: None
        """Called when the connection of a device changes, on the thread that keeps it."""

    def __iter__(self) -> Iterator[Device]:
        return iter(list(self._devices.values()))

    def __getitem__(self, object_id: str) -> Device:
        try:
            return self._devices[object_id]
        except KeyError:
            raise NotFound(f"the scene has no object {object_id}") from None

    def find(self, name: str) -> Generic:
        """Give the instance of an object by its name or id, for another object; NotFound, NotConnected."""
        for device in self:
            if name in (device.name, device.id):
                return device.require()
        raise NotFound(f"the scene has no object {name}")

    # -------------------------------------------------------------------------------- up and down
    def open(self, how: Iterable[Recipe]) -> None:
        """Create and connect all objects at once; SceneFault with the first that fails, as soon as it fails.

        What came up stays up: `close` follows in any case. ProgramStopped when `abandon` is called meanwhile.
        """
        began = time.monotonic()
        pending: dict[Job, tuple[Device, float]] = {}
        for each in how:
            self._devices[each.scene_object.id] = Device(each, lambda device: self.changed(device), self.find)
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
            if ended.error is not None:
                raise SceneFault(device.id, describe(device, ended.error)) from ended.error

    def abandon(self) -> None:
        """Make an `open` that is under way end at once."""
        self._abandoned = True
        self._ended.put(None)

    def close(self) -> Arcor2Error | None:
        """Disconnect all at once, within about CLOSE_DEADLINE; gives the first thing that went wrong."""
        settled = time.monotonic() + SETTLE
        while time.monotonic() < settled and any(d.lane.busy_with or d.stop_lane.busy_with for d in self):
            time.sleep(0.002)
        deadline = time.monotonic() + CLOSE_DEADLINE
        jobs: list[tuple[Device, Job]] = []
        problem: Arcor2Error | None = None
        for device in self:
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
    def stop_all(self, because: BaseException | None = None) -> list[tuple[Device, Job]]:
        """Send `stop` to every device that has it, without waiting; gives the calls.

        With `because`, calls that run or wait end at once with that error for whoever waits for them.
        """
        jobs = []
        for device in self:
            try:
                begun = device.begin_stop()
            except Arcor2Error:  # its stop lane hangs: an earlier stop has not come back
                continue
            if begun is not None:
                jobs.append((device, begun[0]))
            if because is not None and (running := device.lane.interrupt()) is not None:
                running.give_up(because)
        return jobs

    def wait_stopped(self, stops: list[tuple[Device, Job]], within: float = STOP_DEADLINE) -> Arcor2Error | None:
        """Wait until devices obeyed their `stop`; gives the first that did not."""
        deadline = time.monotonic() + within
        problem: Arcor2Error | None = None
        for device, job in stops:
            if not job.wait(until(deadline)):
                device.stop_lane.expire(job, within)
            if job.error is not None and not isinstance(job.error, Cancelled):
                problem = problem or describe(device, job.error)
        return problem

    def wait_still(self, within: float) -> bool:
        """Wait until no device says that it moves; False when one still does after `within` s."""
        deadline = time.monotonic() + within
        while any(device.moving for device in self):
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.005)
        return True

    def take_control(self) -> None:
        """Take control of every device that knows control, all at once; SceneFault names one that refuses."""
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

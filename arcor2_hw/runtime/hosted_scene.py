"""The scene of a cell host: opens it, connects its devices, and later single ones again or new ones."""

import contextlib
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from msgspec.structs import replace

from arcor2_hw.data.device import Connection, Identity
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, ProgramStopped, Refused
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.calls import error_data
from arcor2_hw.runtime.cell import Cell, SceneFault, own_objects, scene_recipes
from arcor2_hw.runtime.creation import write_sources
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.identification import ReadIdentity
from arcor2_hw.runtime.link import Link
from arcor2_hw.runtime.methods import overrides
from arcor2_hw.runtime.package import PackageData, package_recipes
from arcor2_hw.runtime.remote_objects import RemoteObjects
from arcor2_hw.runtime.script import traceback_text
from arcor2_hw.runtime.watch import Watch


class HostedScene:
    """Opens a scene and connects its objects.

    Args:
        cell: The devices; none before the scene is opened.
        watch: Reports the connection of each device.
        link: The connection to the server.
        remotes: The objects of other hosts.
    """

    def __init__(self, cell: Cell, watch: Watch, link: Link, remotes: RemoteObjects) -> None:
        self._cell = cell
        self._remotes = remotes
        self._watch = watch
        self._link = link
        self._connecting = threading.Lock()
        self._opening: m.OpenScene | None = None

    def open(self, message: m.OpenScene) -> bool:
        """Open the scene. Return False if this has failed and the host has to exit.

        Raises:
            ProgramStopped: The scene was closed, or the server ended, while the objects were connecting.
        """
        self._opening = message
        failed = self._skip if message.keep_going else None

        def create() -> None:
            write_sources(message.types)
            self._cell.open(scene_recipes(message, self._remotes, failed), failed)

        return self._open(message, message.scene, create)

    def serve(self, message: m.RunPackage) -> bool:
        """Open the objects of a package that are in this host, for the program in the main host. Else like `open`."""
        directory = Path(message.directory)
        try:
            data = PackageData(directory, message.values)
        except Arcor2Error as error:
            self._link.post(m.SceneFailed(error_data(error)))
            return False

        def create() -> None:
            own = own_objects(message, data.scene)
            self._cell.open(package_recipes(directory, data, message.cell, message.secrets, own, None))
            self._cell.require_confirmed()

        return self._open(message, data.scene, create)

    def _open(self, message: m.OpenScene | m.RunPackage, scene: Scene, create: Callable[[], None]) -> bool:
        fault: SceneFault | None = None
        self._cell.assets = message.assets
        if not message.main:
            names = {one.id: one.name for one in scene.objects}
            places = message.remote.items()
            self._cell.elsewhere = {key: place for each, place in places for key in (each, names.get(each, each))}
        recognise(self._cell, message.identities, self._link)
        try:
            create()
        except SceneFault as caught:
            fault = caught
        except Arcor2Error as error:
            fault = SceneFault("", error)
        except ProgramStopped:
            raise
        except Exception as error:  # noqa: BLE001 - loading an object type may raise anything
            fault = SceneFault(
                "", Arcor2Error("{type}: {reason}", traceback_text(error), type=type(error).__name__, reason=error)
            )
        if fault is not None:
            self._cell.close()
            self._link.post(m.SceneFailed(error_data(fault.error, fault.object_id)))
            return False
        for device in self._cell:  # clients receive the state of each device before the scene is online
            self._watch.check_connection(device)
        return True

    # Objects are connected on threads of their own, because loading a type may take long.
    def retry(self, message: m.RetryObject) -> None:
        """Create and connect a failed object again, on a thread."""
        threading.Thread(target=self._retry, args=(message,), name="retry", daemon=True).start()

    def add(self, message: m.AddObject) -> None:
        """Create and connect a new object, on a thread."""
        threading.Thread(target=self._add, args=(message,), name="add", daemon=True).start()

    def _retry(self, message: m.RetryObject) -> None:
        with self._answering(message.id, message.object_id):
            self._cell.require_failure(message.object_id)
            if not self._connecting.acquire(blocking=False):
                raise Refused("another object is being connected again. Wait until that has ended.")
            try:
                self._connect(message.object_id)
            finally:
                self._connecting.release()

    def _add(self, message: m.AddObject) -> None:
        (added,) = message.opening.scene.objects
        with self._answering(message.id, added.id), self._connecting:
            self._remotes.expect(message.opening.remote)
            self._extend(message.opening)
            self._connect(added.id)

    @contextlib.contextmanager
    def _answering(self, number: int, object_id: str) -> Iterator[None]:
        """Answer the request with this number when the object is connected, or with an error."""
        try:
            yield
        except Exception as error:  # noqa: BLE001 - loading an object type may raise anything
            self._link.post(m.CallFailed(number, error_data(error, object_id)))
            return
        self._watch.check_connection(self._cell[object_id])
        self._link.post(m.CallDone(number))

    def _connect(self, object_id: str) -> None:
        assert self._opening is not None
        self._watch.report(object_id, Connection.CONNECTING)
        try:
            (recipe,) = scene_recipes(self._opening, self._remotes, only=object_id)
            self._cell.retry(recipe)
        except SceneFault as fault:
            self._skip(fault)
            raise fault.error from fault

    def _skip(self, fault: SceneFault) -> None:
        """Continue without an object that could not be created or connected."""
        self._cell.mark_absent(fault)
        self._watch.report(fault.object_id, Connection.FAILED, fault.error.message)

    def _extend(self, opening: m.OpenScene) -> None:
        """Add the object of another scene with its type, model, settings and secrets to the open scene."""
        assert self._opening is not None
        scene, objects = self._opening, opening.scene.objects
        known = {code.name for code in scene.types}
        types = [*scene.types, *(code for code in opening.types if code.name not in known)]
        if any(code.source for code in types[len(scene.types) :]):
            write_sources(types)
        added = {one.id for one in objects}
        self._opening = replace(
            scene,
            scene=replace(scene.scene, objects=[*scene.scene.objects, *objects]),
            types=types,
            models=scene.models | opening.models,
            overrides=[*scene.overrides, *(each for each in opening.overrides if each.id in added)],
            secrets=scene.secrets | opening.secrets,
            remote=scene.remote | opening.remote,
        )
        recognise(self._cell, {**self._cell.identities, **opening.identities}, self._link)


def recognise(cell: Cell, identities: Mapping[str, Identity], link: Link) -> None:
    """Compare the devices that will be connected with the confirmed identities, and report their identities."""

    def identified(device: Device, reported: ReadIdentity) -> None:
        cls = device.recipe.cls
        backup = overrides(cls, "parameters_dump"), overrides(cls, "parameters_restore")
        link.post(m.DeviceIdentified(device.id, device.name, cls.__name__, *reported, *backup))

    cell.identities, cell.identified = identities, identified

"""What cell hosts are told of the world besides a scene: what was put in over REST, and calibrations of arms."""

import asyncio
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import msgspec

from arcor2_hw.data.object_type import Mesh, ObjectModel
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import KinematicCalibration
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.exceptions import InvalidPackage
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.documents import read_document
from arcor2_server.workspace.collisions import Placed

if TYPE_CHECKING:
    from arcor2_server.services import Services

Opening = TypeVar("Opening", m.OpenScene, m.RunPackage)


def tell_hosts(services: "Services") -> None:
    """Tell the hosts that there are of each change from now on."""

    def say(message: m.ToHost) -> None:
        services.cell.say(message)
        services.execution.say(message)

    services.collisions.on_put.append(lambda placed: say(m.PutBody(_body(services, placed))))
    services.collisions.on_remove.append(lambda keys: say(m.RemoveBodies(keys)))
    services.arm_calibrations.on_change.append(
        lambda robot: services.cell.say(m.Calibrate(robot.id, services.arm_calibrations.in_force(robot)))
    )


def with_world(services: "Services", message: Opening, calibrations: dict[str, KinematicCalibration]) -> Opening:
    """Give what opens a scene, or runs a package, with the world as it is now: to be sent at once."""
    bodies = [_body(services, placed) for placed in services.collisions.put_in.values()]
    return msgspec.structs.replace(message, bodies=bodies, calibrations=calibrations)


def calibrations(
    services: "Services", objects: Iterable[SceneObject], overrides: Iterable[SceneObjectOverride] | None = None
) -> dict[str, KinematicCalibration]:
    """Give the calibrations that are in force for robots, by id. overrides: else those of the open project."""
    laid = None if overrides is None else list(overrides)
    found = {obj.id: services.arm_calibrations.in_force(obj, laid) for obj in objects}
    return {key: calibration for key, calibration in found.items() if calibration is not None}


async def calibrations_of_package(services: "Services", directory: Path) -> dict[str, KinematicCalibration]:
    """Give those for the robots of a package; none of one that is damaged, which its host will say."""
    if not services.arm_calibrations.any:
        return {}
    try:
        scene, project = await asyncio.to_thread(_documents, directory / "data")
    except InvalidPackage:
        return {}
    return calibrations(services, scene.objects, project.object_overrides)


def _documents(data: Path) -> tuple[Scene, Project]:
    return read_document(data / "scene.json", Scene), read_document(data / "project.json", Project)


def _body(services: "Services", placed: Placed) -> m.PutIn:
    model, holder = placed.model, placed.attachment
    file = ""
    if isinstance(model, Mesh) and services.assets.exists(model.asset_id):
        file = str(services.assets.file(model.asset_id))
    held = ("", "", []) if holder is None else (holder.robot, holder.link, list(holder.touching))
    return m.PutIn(model.id, ObjectModel.of(model), placed.pose, placed.scale, file, *held)

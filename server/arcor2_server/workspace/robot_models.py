"""Where the models of robots are: uploaded as assets, or in the folders of installed drivers."""

import re
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import unquote, urlsplit

import msgspec

from arcor2_hw.collision.description import RobotSource, StoredFile
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.scene import SceneObject, SceneObjectOverride
from arcor2_hw.exceptions import NotFound
from arcor2_server.errors import RequestRefused

if TYPE_CHECKING:
    from arcor2_server.services import Services

_ASSET: Final = re.compile(r"/assets/([^/]+)/data/?$")


def model_of_type(services: "Services", type_name: str) -> StoredFile | None:
    """Give the file of a robot type's model, None when it has none."""
    name = services.types.robot_meta(type_name).urdf_package_filename
    if isinstance(name, Unset):
        return None
    return StoredFile(str(services.assets.file(name)), name) if services.assets.exists(name) else None


def model_of(services: "Services", robot: SceneObject, why: str) -> RobotSource:
    """Give the model of a robot of the open scene, where it stands, with its settings.

    RequestRefused for a robot without a model; `why` says what it is needed for.
    """
    file = model_of_type(services, robot.type)
    if file is None:
        raise RequestRefused(f"{robot.name} has no model (URDF) {why}.")
    base = Pose() if isinstance(robot.pose, Unset) else robot.pose
    calibration = services.arm_calibrations.in_force(robot)
    return RobotSource(file, base, settings_of(services, robot), robot.name, calibration)


def settings_of(
    services: "Services", robot: SceneObject, overrides: list[SceneObjectOverride] | None = None
) -> dict[str, Any]:
    """Give the settings of an object by name, as its scene and the overrides, else those of the open project, say."""
    if overrides is None:
        project = services.session.project
        overrides = [] if project is None else list(project.object_overrides)
    parameters = list(robot.parameters)
    for override in overrides:
        if override.id == robot.id:
            parameters += override.parameters
    found: dict[str, Any] = {}
    for parameter in parameters:
        try:
            found[parameter.name] = msgspec.json.decode(parameter.value)
        except msgspec.DecodeError:
            continue  # the object type's own business
    return found


def model_of_uri(services: "Services", uri: str) -> RobotSource:
    """Give the model in the asset that a URI names, by its id or its address here.

    Nothing is fetched from elsewhere: NotFound.
    """
    path = urlsplit(uri).path
    found = _ASSET.search(path)
    for name in (uri, unquote(found[1]) if found else unquote(path.rsplit("/", 1)[-1])):
        if services.assets.exists(name):
            return RobotSource(StoredFile(str(services.assets.file(name)), name))
    raise NotFound(f"There is no asset {uri!r}, which the robot's model should be.")

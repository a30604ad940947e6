"""Arguments and answers about scenes and their objects."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.robot import RobotArg
from arcor2_hw.data.rpc.general import IdArgs


class AddObjectToSceneArgs(Data, frozen=True):
    """Arguments of AddObjectToScene."""

    name: str
    type: str
    pose: Pose | Unset = UNSET
    parameters: list[Parameter] = field(default_factory=list)


class AddVirtualCollisionObjectToSceneArgs(Data, frozen=True):
    """Arguments of AddVirtualCollisionObjectToScene."""

    name: str
    pose: Pose
    model: ObjectModel


class CalibrateCameraArgs(Data, frozen=True):
    """Arguments of CalibrateCamera."""

    id: str


class CameraColorImageArgs(Data, frozen=True):
    """Arguments of CameraColorImage."""

    id: str


class CameraColorParametersArgs(Data, frozen=True):
    """Arguments of CameraColorParameters."""

    id: str


class CloseSceneArgs(Data, frozen=True):
    """Arguments of CloseScene."""

    force: bool = False


class CopySceneArgs(Data, frozen=True):
    """Arguments of CopyScene."""

    source_id: str
    target_name: str


class ListScenesData(Data, frozen=True):
    """Answer to ListScenes."""

    id: str
    name: str
    created: Timestamp
    modified: Timestamp
    description: str | Unset = UNSET
    problems: list[str] | Unset = UNSET


class NewSceneArgs(Data, frozen=True):
    """Arguments of NewScene."""

    name: str
    description: str = ""


class RemoveFromSceneArgs(IdArgs, frozen=True):
    """Arguments of RemoveFromScene."""

    force: bool = False


class UpdateObjectParametersArgs(Data, frozen=True):
    """Arguments of UpdateObjectParameters."""

    id: str
    parameters: list[Parameter] = field(default_factory=list)


class UpdateObjectPoseArgs(Data, frozen=True):
    """Arguments of UpdateObjectPose."""

    object_id: str
    pose: Pose


class Pivot(enum.StrEnum):
    """Values of PivotEnum in UpdateObjectPoseUsingRobot."""

    TOP = "top"
    MIDDLE = "middle"
    BOTTOM = "bottom"


class UpdateObjectPoseUsingRobotArgs(IdArgs, frozen=True):
    """Arguments of UpdateObjectPoseUsingRobot."""

    robot: RobotArg
    pivot: Pivot = Pivot.MIDDLE


class UpdateSceneDescriptionArgs(Data, frozen=True):
    """Arguments of UpdateSceneDescription."""

    scene_id: str
    new_description: str

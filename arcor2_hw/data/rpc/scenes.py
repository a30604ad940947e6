"""Arguments and answers about scenes and their objects."""

import enum
from typing import Final

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.device import Alarm, Health, Identity
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.nodes import NodeName
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.robot import RobotArg
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.general import IdArgs, RenameArgs
from arcor2_hw.data.rpc.operation import RetryObjectArgs
from arcor2_hw.data.scene import Scene
from arcor2_hw.messages import Message


class AddObjectToSceneArgs(Data, frozen=True):
    """Arguments of AddObjectToScene.

    node (not in ARCOR2): name of the node on which the object runs; empty or omitted for the computer of the server.
    """

    name: str
    type: str
    pose: Pose | Unset = UNSET
    parameters: list[Parameter] = field(default_factory=list)
    node: NodeName | Unset = UNSET


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


class CheckConnectionArgs(Data, frozen=True):
    """Arguments of CheckConnection: type and settings of a device, and its id if it is an object of the scene.

    The id gives access to the stored secrets of the object, which is checked on its node. Other devices are checked on
    `node`; empty for the computer of the server.
    """

    type: str
    parameters: list[Parameter] = field(default_factory=list)
    id: str = ""
    node: NodeName | Unset = UNSET


class CheckConnectionData(Data, frozen=True):
    """Answer to CheckConnection: the data reported by the connected device, and the time to connect, s."""

    identity: Identity
    health: Health
    alarms: list[Alarm]
    seconds: float


class CloseSceneArgs(Data, frozen=True):
    """Arguments of CloseScene."""

    force: bool = False


class CopySceneArgs(Data, frozen=True):
    """Arguments of CopyScene."""

    source_id: str
    target_name: str


class FindDevicesArgs(Data, frozen=True):
    """Arguments of FindDevices: a type of devices, the setting whose values are searched, and the other settings.

    addresses: of a search in the network: addresses and networks, separated by commas or spaces.
    """

    type: str
    setting: str
    parameters: list[Parameter] = field(default_factory=list)
    addresses: str = ""


class FoundDevice(Data, frozen=True):
    """Answer to FindDevices: JSON of the setting's value that selects a device, and a description of the device."""

    value: str
    address: str
    description: str
    serial: str


class ListScenesData(Data, frozen=True):
    """Answer to ListScenes. `problem_messages`: the problems with keys and values for translation, if requested."""

    id: str
    name: str
    created: Timestamp
    modified: Timestamp
    description: str | Unset = UNSET
    problems: list[str] | Unset = UNSET
    problem_messages: list[Message] | Unset = UNSET


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


SCENE_RPCS: Final = (
    Rpc("AddObjectToScene", AddObjectToSceneArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("AddSceneObject", AddObjectToSceneArgs, None, Role.TECHNICIAN, dry_run=True, additional=True),
    Rpc("AddSceneShape", AddVirtualCollisionObjectToSceneArgs, None, Role.TECHNICIAN, dry_run=True, additional=True),
    Rpc("AddVirtualCollisionObjectToScene", AddVirtualCollisionObjectToSceneArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("CalibrateCamera", CalibrateCameraArgs, None, Role.TECHNICIAN),
    Rpc("CameraColorImage", CameraColorImageArgs, str, Role.OPERATOR),
    Rpc("CameraColorParameters", CameraColorParametersArgs, CameraParameters, Role.OPERATOR),
    Rpc("CheckConnection", CheckConnectionArgs, CheckConnectionData, Role.TECHNICIAN, additional=True),
    Rpc("CloseScene", CloseSceneArgs, None, Role.STANDARD_USER, args_optional=True, dry_run=True),
    Rpc("CopyScene", CopySceneArgs, str, Role.TECHNICIAN),
    Rpc("DeleteScene", IdArgs, set[str], Role.TECHNICIAN, dry_run=True),
    Rpc("FindDevices", FindDevicesArgs, list[FoundDevice], Role.TECHNICIAN, additional=True),
    Rpc("GetScene", IdArgs, Scene, Role.OPERATOR),
    Rpc("ListScenes", None, list[ListScenesData], Role.OPERATOR),
    Rpc("NewScene", NewSceneArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("OpenScene", IdArgs, None, Role.STANDARD_USER),
    Rpc("RemoveFromScene", RemoveFromSceneArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("RenameObject", RenameArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("RenameScene", RenameArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("RetryObject", RetryObjectArgs, None, Role.STANDARD_USER, additional=True),
    Rpc("SaveScene", None, None, Role.TECHNICIAN, dry_run=True),
    Rpc("SceneObjectUsage", IdArgs, set[str], Role.OPERATOR),
    Rpc("StartScene", None, None, Role.STANDARD_USER, dry_run=True),
    Rpc("StartSceneKeepGoing", None, None, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("StopScene", None, None, Role.STANDARD_USER, dry_run=True),
    Rpc("UpdateObjectParameters", UpdateObjectParametersArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("UpdateObjectPose", UpdateObjectPoseArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("UpdateObjectPoseUsingRobot", UpdateObjectPoseUsingRobotArgs, None, Role.TECHNICIAN),
    Rpc("UpdateSceneDescription", UpdateSceneDescriptionArgs, None, Role.TECHNICIAN),
    Rpc("UpdateSceneObjectSettings", UpdateObjectParametersArgs, None, Role.TECHNICIAN, dry_run=True, additional=True),
    Rpc("UpdateSceneObjectPose", UpdateObjectPoseArgs, None, Role.TECHNICIAN, dry_run=True, additional=True),
)
"""Requests about scenes."""

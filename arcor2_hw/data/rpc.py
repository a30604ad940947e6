"""Every request that clients may send: arguments, answer and the least role that may use it."""

import enum
from typing import Any, Final

from msgspec import Raw, Struct, field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.camera import CameraParameters, EstimatedPose, MarkerCorners
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import ObjectAction, ObjectModel, ObjectTypeMeta
from arcor2_hw.data.package import PackageSummary
from arcor2_hw.data.parameter import IdValue, Parameter
from arcor2_hw.data.project import ActionParameter, BareProject, Flow, Project, ProjectLogicIf
from arcor2_hw.data.robot import Joint, RobotArg, RobotMeta
from arcor2_hw.data.role import Role
from arcor2_hw.data.scene import Scene


class Rpc(Struct, frozen=True):
    """Declares one request: types of `args` and of the answer's `data` (None: there is none), and the least role.

    `args_optional`: the arguments may be left out. `dry_run`: the request may ask for its checks alone.
    """

    name: str
    args: Any
    data: Any
    role: Role
    args_optional: bool = False
    dry_run: bool = False


class Request(Data, frozen=True):
    """The envelope of a request; `args` is decoded when the request is known."""

    id: int
    request: str
    args: Raw | Unset = UNSET
    dry_run: bool = False


class Response(Data, frozen=True):
    """The envelope of an answer."""

    id: int
    response: str
    result: bool
    messages: list[str] | Unset = UNSET
    data: Any = UNSET


class ActionParamValuesArgs(Data, frozen=True):
    """Arguments of ActionParamValues."""

    id: str
    param_id: str
    parent_params: list[IdValue] = field(default_factory=list)


class AddActionArgs(Data, frozen=True):
    """Arguments of AddAction."""

    action_point_id: str
    name: str
    type: str
    parameters: list[ActionParameter] = field(default_factory=list)
    flows: list[Flow] = field(default_factory=list)


class AddActionPointArgs(Data, frozen=True):
    """Arguments of AddActionPoint."""

    name: str
    position: Position
    parent: str | Unset = UNSET


class AddActionPointJointsUsingRobotArgs(Data, frozen=True):
    """Arguments of AddActionPointJointsUsingRobot."""

    action_point_id: str
    robot_id: str
    name: str = "default"
    arm_id: str | Unset = UNSET
    end_effector_id: str | Unset = UNSET


class AddActionPointOrientationArgs(Data, frozen=True):
    """Arguments of AddActionPointOrientation."""

    action_point_id: str
    orientation: Orientation
    name: str = "default"


class AddActionPointOrientationUsingRobotArgs(Data, frozen=True):
    """Arguments of AddActionPointOrientationUsingRobot."""

    action_point_id: str
    robot: RobotArg
    name: str = "default"


class AddApUsingRobotArgs(Data, frozen=True):
    """Arguments of AddApUsingRobot."""

    robot_id: str
    end_effector_id: str
    name: str
    arm_id: str | Unset = UNSET


class AddLogicItemArgs(Data, frozen=True):
    """Arguments of AddLogicItem."""

    start: str
    end: str
    condition: ProjectLogicIf | Unset = UNSET


class AddObjectToSceneArgs(Data, frozen=True):
    """Arguments of AddObjectToScene."""

    name: str
    type: str
    pose: Pose | Unset = UNSET
    parameters: list[Parameter] = field(default_factory=list)


class AddOverrideArgs(Data, frozen=True):
    """Arguments of AddOverride."""

    id: str
    override: Parameter


class AddProjectParameterArgs(Data, frozen=True):
    """Arguments of AddProjectParameter."""

    name: str
    type: str
    value: str


class AddVirtualCollisionObjectToSceneArgs(Data, frozen=True):
    """Arguments of AddVirtualCollisionObjectToScene."""

    name: str
    pose: Pose
    model: ObjectModel


class BuildProjectArgs(Data, frozen=True):
    """Arguments of BuildProject."""

    project_id: str
    package_name: str


class BuildProjectData(Data, frozen=True):
    """What BuildProject answers."""

    package_id: str


class CalibrateCameraArgs(Data, frozen=True):
    """Arguments of CalibrateCamera."""

    id: str


class CalibrateRobotArgs(Data, frozen=True):
    """Arguments of CalibrateRobot."""

    robot_id: str
    camera_id: str | Unset = UNSET
    move_to_calibration_pose: bool = True


class CameraColorImageArgs(Data, frozen=True):
    """Arguments of CameraColorImage."""

    id: str


class CameraColorParametersArgs(Data, frozen=True):
    """Arguments of CameraColorParameters."""

    id: str


class CloseProjectArgs(Data, frozen=True):
    """Arguments of CloseProject."""

    force: bool = False


class CloseSceneArgs(Data, frozen=True):
    """Arguments of CloseScene."""

    force: bool = False


class CopyActionPointArgs(Data, frozen=True):
    """Arguments of CopyActionPoint."""

    id: str
    position: Position | Unset = UNSET


class CopyProjectArgs(Data, frozen=True):
    """Arguments of CopyProject."""

    source_id: str
    target_name: str


class CopySceneArgs(Data, frozen=True):
    """Arguments of CopyScene."""

    source_id: str
    target_name: str


class DeleteObjectTypesData(Data, frozen=True):
    """What DeleteObjectTypes answers."""

    id: str
    error: str


class DeleteOverrideArgs(Data, frozen=True):
    """Arguments of DeleteOverride."""

    id: str
    override: Parameter


class IdArgs(Data, frozen=True):
    """Arguments of every RPC that takes one id."""

    id: str


class ExecuteActionArgs(Data, frozen=True):
    """Arguments of ExecuteAction."""

    action_id: str


class ForwardKinematicsArgs(Data, frozen=True):
    """Arguments of ForwardKinematics."""

    robot_id: str
    end_effector_id: str
    joints: list[Joint]
    arm_id: str | Unset = UNSET


class TypeArgs(Data, frozen=True):
    """Arguments of GetActions."""

    type: str


class GetCameraPoseArgs(Data, frozen=True):
    """Arguments of GetCameraPose."""

    camera_parameters: CameraParameters
    image: str
    inverse: bool = False


class GetEndEffectorPoseArgs(Data, frozen=True):
    """Arguments of GetEndEffectorPose."""

    robot_id: str
    end_effector_id: str
    arm_id: str | Unset = UNSET


class GetEndEffectorsArgs(Data, frozen=True):
    """Arguments of GetEndEffectors."""

    robot_id: str
    arm_id: str | Unset = UNSET


class GetGrippersArgs(Data, frozen=True):
    """Arguments of GetGrippers."""

    robot_id: str
    arm_id: str | Unset = UNSET


class GetRobotArmsArgs(Data, frozen=True):
    """Arguments of GetRobotArms."""

    robot_id: str


class GetRobotJointsArgs(Data, frozen=True):
    """Arguments of GetRobotJoints."""

    robot_id: str
    arm_id: str | Unset = UNSET


class GetSuctionsArgs(Data, frozen=True):
    """Arguments of GetSuctions."""

    robot_id: str
    arm_id: str | Unset = UNSET


class HandTeachingModeArgs(Data, frozen=True):
    """Arguments of HandTeachingMode."""

    robot_id: str
    enable: bool
    arm_id: str | Unset = UNSET


class InverseKinematicsArgs(Data, frozen=True):
    """Arguments of InverseKinematics."""

    robot_id: str
    end_effector_id: str
    pose: Pose
    start_joints: list[Joint] | Unset = UNSET
    avoid_collisions: bool = True
    arm_id: str | Unset = UNSET


class ListProjectsData(BareProject, frozen=True):
    """What ListProjects answers."""

    problems: list[str] | Unset = UNSET


class ListScenesData(Data, frozen=True):
    """What ListScenes answers."""

    id: str
    name: str
    created: Timestamp
    modified: Timestamp
    description: str | Unset = UNSET
    problems: list[str] | Unset = UNSET


class MarkersCornersArgs(Data, frozen=True):
    """Arguments of MarkersCorners."""

    camera_parameters: CameraParameters
    image: str


class MoveToActionPointArgs(Data, frozen=True):
    """Arguments of MoveToActionPoint."""

    robot_id: str
    speed: float
    end_effector_id: str | Unset = UNSET
    orientation_id: str | Unset = UNSET
    joints_id: str | Unset = UNSET
    safe: bool = True
    linear: bool = False
    arm_id: str | Unset = UNSET


class MoveToJointsArgs(Data, frozen=True):
    """Arguments of MoveToJoints."""

    robot_id: str
    speed: float
    joints: list[Joint]
    safe: bool = True
    arm_id: str | Unset = UNSET


class MoveToPoseArgs(Data, frozen=True):
    """Arguments of MoveToPose."""

    robot_id: str
    end_effector_id: str
    speed: float
    position: Position | Unset = UNSET
    orientation: Orientation | Unset = UNSET
    safe: bool = True
    linear: bool = False
    arm_id: str | Unset = UNSET


class NewProjectArgs(Data, frozen=True):
    """Arguments of NewProject."""

    scene_id: str
    name: str
    description: str = ""
    has_logic: bool = True


class NewSceneArgs(Data, frozen=True):
    """Arguments of NewScene."""

    name: str
    description: str = ""


class ObjectAimingAddPointArgs(Data, frozen=True):
    """Arguments of ObjectAimingAddPoint."""

    point_idx: int


class ObjectAimingAddPointData(Data, frozen=True):
    """What ObjectAimingAddPoint answers."""

    finished_indexes: list[int]


class ObjectAimingStartArgs(Data, frozen=True):
    """Arguments of ObjectAimingStart."""

    object_id: str
    robot: RobotArg


class ReadLockArgs(Data, frozen=True):
    """Arguments of ReadLock."""

    object_id: str


class ReadUnlockArgs(Data, frozen=True):
    """Arguments of ReadUnlock."""

    object_id: str


class RobotEventKind(enum.StrEnum):
    """Values of RegisterEnum in RegisterForRobotEvent."""

    EEF_POSE = "eef_pose"
    JOINTS = "joints"


class RegisterForRobotEventArgs(Data, frozen=True):
    """Arguments of RegisterForRobotEvent."""

    robot_id: str
    what: RobotEventKind
    send: bool


class RegisterUserArgs(Data, frozen=True):
    """Arguments of RegisterUser."""

    user_name: str


class RemoveActionPointJointsArgs(Data, frozen=True):
    """Arguments of RemoveActionPointJoints."""

    joints_id: str


class RemoveActionPointOrientationArgs(Data, frozen=True):
    """Arguments of RemoveActionPointOrientation."""

    orientation_id: str


class RemoveFromSceneArgs(IdArgs, frozen=True):
    """Arguments of RemoveFromScene."""

    force: bool = False


class RemoveLogicItemArgs(Data, frozen=True):
    """Arguments of RemoveLogicItem."""

    logic_item_id: str


class RemoveProjectParameterArgs(Data, frozen=True):
    """Arguments of RemoveProjectParameter."""

    id: str


class RenameActionArgs(Data, frozen=True):
    """Arguments of RenameAction."""

    action_id: str
    new_name: str


class RenameActionPointArgs(Data, frozen=True):
    """Arguments of RenameActionPoint."""

    action_point_id: str
    new_name: str


class RenameActionPointJointsArgs(Data, frozen=True):
    """Arguments of RenameActionPointJoints."""

    joints_id: str
    new_name: str


class RenameActionPointOrientationArgs(Data, frozen=True):
    """Arguments of RenameActionPointOrientation."""

    orientation_id: str
    new_name: str


class RenameArgs(Data, frozen=True):
    """Arguments of RenameScene and RenameObject."""

    id: str
    new_name: str


class RenamePackageArgs(Data, frozen=True):
    """Arguments of RenamePackage."""

    package_id: str
    new_name: str


class RenameProjectArgs(Data, frozen=True):
    """Arguments of RenameProject."""

    project_id: str
    new_name: str


class RunPackageArgs(IdArgs, frozen=True):
    """Arguments of RunPackage."""

    start_paused: bool = False
    breakpoints: set[str] | Unset = UNSET


class SetEefPerpendicularToWorldArgs(Data, frozen=True):
    """Arguments of SetEefPerpendicularToWorld."""

    robot_id: str
    end_effector_id: str
    safe: bool = True
    speed: float = 0.25
    linear: bool = True
    arm_id: str | Unset = UNSET


class StepAxis(enum.StrEnum):
    """Values of Axis in StepRobotEef."""

    X = "x"
    Y = "y"
    Z = "z"


class StepWhat(enum.StrEnum):
    """Values of What in StepRobotEef."""

    POSITION = "position"
    ORIENTATION = "orientation"


class StepMode(enum.StrEnum):
    """Values of Mode in StepRobotEef."""

    WORLD = "world"
    ROBOT = "robot"
    USER = "user"
    RELATIVE = "relative"


class StepRobotEefArgs(Data, frozen=True):
    """Arguments of StepRobotEef."""

    robot_id: str
    end_effector_id: str
    axis: StepAxis
    what: StepWhat
    mode: StepMode
    step: float
    safe: bool = True
    pose: Pose | Unset = UNSET
    speed: float = 0.25
    linear: bool = True
    arm_id: str | Unset = UNSET


class StopRobotArgs(Data, frozen=True):
    """Arguments of StopRobot."""

    robot_id: str


class SystemInfoData(Data, frozen=True):
    """What SystemInfo answers."""

    version: str
    api_version: str
    supported_parameter_types: set[str] = field(default_factory=set)
    supported_rpc_requests: set[str] = field(default_factory=set)


class TemporaryPackageArgs(Data, frozen=True):
    """Arguments of TemporaryPackage."""

    start_paused: bool = False
    breakpoints: set[str] | Unset = UNSET


class UpdateActionArgs(Data, frozen=True):
    """Arguments of UpdateAction."""

    action_id: str
    parameters: list[ActionParameter] | Unset = UNSET
    flows: list[Flow] | Unset = UNSET


class UpdateActionPointJointsArgs(Data, frozen=True):
    """Arguments of UpdateActionPointJoints."""

    joints_id: str
    joints: list[Joint]


class UpdateActionPointJointsUsingRobotArgs(Data, frozen=True):
    """Arguments of UpdateActionPointJointsUsingRobot."""

    joints_id: str = "default"


class UpdateActionPointOrientationArgs(Data, frozen=True):
    """Arguments of UpdateActionPointOrientation."""

    orientation_id: str
    orientation: Orientation


class UpdateActionPointOrientationUsingRobotArgs(Data, frozen=True):
    """Arguments of UpdateActionPointOrientationUsingRobot."""

    orientation_id: str
    robot: RobotArg


class UpdateActionPointParentArgs(Data, frozen=True):
    """Arguments of UpdateActionPointParent."""

    action_point_id: str
    new_parent_id: str


class UpdateActionPointPositionArgs(Data, frozen=True):
    """Arguments of UpdateActionPointPosition."""

    action_point_id: str
    new_position: Position


class UpdateActionPointUsingRobotArgs(Data, frozen=True):
    """Arguments of UpdateActionPointUsingRobot."""

    action_point_id: str
    robot: RobotArg


class LockType(enum.StrEnum):
    """Kinds of write lock."""

    TREE = "TREE"
    OBJECT = "OBJECT"


class UpdateLockArgs(Data, frozen=True):
    """Arguments of UpdateLock."""

    object_id: str
    new_type: LockType


class UpdateLogicItemArgs(Data, frozen=True):
    """Arguments of UpdateLogicItem."""

    logic_item_id: str
    start: str
    end: str
    condition: ProjectLogicIf | Unset = UNSET


class UpdateObjectModelArgs(Data, frozen=True):
    """Arguments of UpdateObjectModel."""

    object_type_id: str
    object_model: ObjectModel


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


class UpdateOverrideArgs(Data, frozen=True):
    """Arguments of UpdateOverride."""

    id: str
    override: Parameter


class UpdateProjectDescriptionArgs(Data, frozen=True):
    """Arguments of UpdateProjectDescription."""

    project_id: str
    new_description: str


class UpdateProjectHasLogicArgs(Data, frozen=True):
    """Arguments of UpdateProjectHasLogic."""

    project_id: str
    new_has_logic: bool


class UpdateProjectParameterArgs(Data, frozen=True):
    """Arguments of UpdateProjectParameter."""

    id: str
    name: str | Unset = UNSET
    value: str | Unset = UNSET


class UpdateSceneDescriptionArgs(Data, frozen=True):
    """Arguments of UpdateSceneDescription."""

    scene_id: str
    new_description: str


class UploadPackageArgs(Data, frozen=True):
    """Arguments of UploadPackage."""

    id: str
    data: str


class WriteLockArgs(Data, frozen=True):
    """Arguments of WriteLock."""

    object_id: str
    lock_tree: bool = False


class WriteUnlockArgs(Data, frozen=True):
    """Arguments of WriteUnlock."""

    object_id: str


RPCS: Final = {
    rpc.name: rpc
    for rpc in (
        Rpc("ActionParamValues", ActionParamValuesArgs, set[str], Role.STANDARD_USER),
        Rpc("AddAction", AddActionArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("AddActionPoint", AddActionPointArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc(
            "AddActionPointJointsUsingRobot", AddActionPointJointsUsingRobotArgs, None, Role.STANDARD_USER, dry_run=True
        ),
        Rpc("AddActionPointOrientation", AddActionPointOrientationArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc(
            "AddActionPointOrientationUsingRobot",
            AddActionPointOrientationUsingRobotArgs,
            None,
            Role.STANDARD_USER,
            dry_run=True,
        ),
        Rpc("AddApUsingRobot", AddApUsingRobotArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("AddLogicItem", AddLogicItemArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("AddObjectToScene", AddObjectToSceneArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("AddOverride", AddOverrideArgs, None, Role.ADVANCED_USER, dry_run=True),
        Rpc("AddProjectParameter", AddProjectParameterArgs, None, Role.ADVANCED_USER, dry_run=True),
        Rpc(
            "AddVirtualCollisionObjectToScene",
            AddVirtualCollisionObjectToSceneArgs,
            None,
            Role.TECHNICIAN,
            dry_run=True,
        ),
        Rpc("BuildProject", BuildProjectArgs, BuildProjectData, Role.STANDARD_USER),
        Rpc("CalibrateCamera", CalibrateCameraArgs, None, Role.TECHNICIAN),
        Rpc("CalibrateRobot", CalibrateRobotArgs, None, Role.TECHNICIAN),
        Rpc("CameraColorImage", CameraColorImageArgs, str, Role.OPERATOR),
        Rpc("CameraColorParameters", CameraColorParametersArgs, CameraParameters, Role.OPERATOR),
        Rpc("CancelAction", None, None, Role.OPERATOR),
        Rpc("CloseProject", CloseProjectArgs, None, Role.STANDARD_USER, args_optional=True, dry_run=True),
        Rpc("CloseScene", CloseSceneArgs, None, Role.STANDARD_USER, args_optional=True, dry_run=True),
        Rpc("CopyActionPoint", CopyActionPointArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("CopyProject", CopyProjectArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("CopyScene", CopySceneArgs, str, Role.TECHNICIAN),
        Rpc(
            "DeleteObjectTypes",
            set[str],
            list[DeleteObjectTypesData],
            Role.PROGRAMMER,
            args_optional=True,
            dry_run=True,
        ),
        Rpc("DeleteOverride", DeleteOverrideArgs, None, Role.ADVANCED_USER, dry_run=True),
        Rpc("DeletePackage", IdArgs, None, Role.ADVANCED_USER),
        Rpc("DeleteProject", IdArgs, None, Role.STANDARD_USER),
        Rpc("DeleteScene", IdArgs, set[str], Role.TECHNICIAN, dry_run=True),
        Rpc("ExecuteAction", ExecuteActionArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("ForwardKinematics", ForwardKinematicsArgs, Pose, Role.STANDARD_USER),
        Rpc("GetActions", TypeArgs, list[ObjectAction], Role.OPERATOR),
        Rpc("GetCameraPose", GetCameraPoseArgs, EstimatedPose, Role.TECHNICIAN),
        Rpc("GetEndEffectorPose", GetEndEffectorPoseArgs, Pose, Role.OPERATOR),
        Rpc("GetEndEffectors", GetEndEffectorsArgs, set[str], Role.OPERATOR),
        Rpc("GetGrippers", GetGrippersArgs, set[str], Role.OPERATOR),
        Rpc("GetObjectTypes", None, list[ObjectTypeMeta], Role.OPERATOR),
        Rpc("GetProject", IdArgs, Project, Role.OPERATOR),
        Rpc("GetRobotArms", GetRobotArmsArgs, set[str], Role.OPERATOR),
        Rpc("GetRobotJoints", GetRobotJointsArgs, list[Joint], Role.OPERATOR),
        Rpc("GetRobotMeta", None, list[RobotMeta], Role.OPERATOR),
        Rpc("GetScene", IdArgs, Scene, Role.OPERATOR),
        Rpc("GetSuctions", GetSuctionsArgs, set[str], Role.OPERATOR),
        Rpc("HandTeachingMode", HandTeachingModeArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("InverseKinematics", InverseKinematicsArgs, list[Joint], Role.STANDARD_USER),
        Rpc("ListPackages", None, list[PackageSummary], Role.OPERATOR),
        Rpc("ListProjects", None, list[ListProjectsData], Role.OPERATOR),
        Rpc("ListScenes", None, list[ListScenesData], Role.OPERATOR),
        Rpc("MarkersCorners", MarkersCornersArgs, list[MarkerCorners], Role.TECHNICIAN),
        Rpc("MoveToActionPoint", MoveToActionPointArgs, None, Role.STANDARD_USER),
        Rpc("MoveToJoints", MoveToJointsArgs, None, Role.STANDARD_USER),
        Rpc("MoveToPose", MoveToPoseArgs, None, Role.STANDARD_USER),
        Rpc("NewObjectType", ObjectTypeMeta, None, Role.PROGRAMMER, dry_run=True),
        Rpc("NewProject", NewProjectArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("NewScene", NewSceneArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("ObjectAimingAddPoint", ObjectAimingAddPointArgs, ObjectAimingAddPointData, Role.TECHNICIAN, dry_run=True),
        Rpc("ObjectAimingCancel", None, None, Role.TECHNICIAN, dry_run=True),
        Rpc("ObjectAimingDone", None, ObjectAimingAddPointData, Role.TECHNICIAN, dry_run=True),
        Rpc("ObjectAimingStart", ObjectAimingStartArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("ObjectTypeUsage", IdArgs, set[str], Role.OPERATOR),
        Rpc("OpenProject", IdArgs, None, Role.STANDARD_USER),
        Rpc("OpenScene", IdArgs, None, Role.STANDARD_USER),
        Rpc("PausePackage", None, None, Role.OPERATOR),
        Rpc("ProjectsWithScene", IdArgs, set[str], Role.OPERATOR),
        Rpc("ReadLock", ReadLockArgs, None, Role.OPERATOR),
        Rpc("ReadUnlock", ReadUnlockArgs, None, Role.OPERATOR),
        Rpc("RegisterForRobotEvent", RegisterForRobotEventArgs, set[str], Role.OPERATOR),
        Rpc("RegisterUser", RegisterUserArgs, None, Role.OPERATOR),
        Rpc("RemoveAction", IdArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("RemoveActionPoint", IdArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("RemoveActionPointJoints", RemoveActionPointJointsArgs, None, Role.STANDARD_USER),
        Rpc("RemoveActionPointOrientation", RemoveActionPointOrientationArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("RemoveFromScene", RemoveFromSceneArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("RemoveLogicItem", RemoveLogicItemArgs, None, Role.STANDARD_USER),
        Rpc("RemoveProjectParameter", RemoveProjectParameterArgs, None, Role.ADVANCED_USER, dry_run=True),
        Rpc("RenameAction", RenameActionArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("RenameActionPoint", RenameActionPointArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("RenameActionPointJoints", RenameActionPointJointsArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("RenameActionPointOrientation", RenameActionPointOrientationArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("RenameObject", RenameArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("RenamePackage", RenamePackageArgs, None, Role.ADVANCED_USER),
        Rpc("RenameProject", RenameProjectArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("RenameScene", RenameArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("ResumePackage", None, None, Role.OPERATOR),
        Rpc("RunPackage", RunPackageArgs, None, Role.OPERATOR),
        Rpc("SaveProject", None, None, Role.STANDARD_USER, dry_run=True),
        Rpc("SaveScene", None, None, Role.TECHNICIAN, dry_run=True),
        Rpc("SceneObjectUsage", IdArgs, set[str], Role.OPERATOR),
        Rpc("SetEefPerpendicularToWorld", SetEefPerpendicularToWorldArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("StartScene", None, None, Role.STANDARD_USER, dry_run=True),
        Rpc("StepAction", None, None, Role.OPERATOR),
        Rpc("StepRobotEef", StepRobotEefArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("StopPackage", None, None, Role.OPERATOR),
        Rpc("StopRobot", StopRobotArgs, None, Role.OPERATOR),
        Rpc("StopScene", None, None, Role.STANDARD_USER, dry_run=True),
        Rpc("SystemInfo", None, SystemInfoData, Role.OPERATOR),
        Rpc("TemporaryPackage", TemporaryPackageArgs, None, Role.STANDARD_USER, args_optional=True),
        Rpc("UpdateAction", UpdateActionArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("UpdateActionPointJoints", UpdateActionPointJointsArgs, None, Role.STANDARD_USER),
        Rpc("UpdateActionPointJointsUsingRobot", UpdateActionPointJointsUsingRobotArgs, None, Role.STANDARD_USER),
        Rpc("UpdateActionPointOrientation", UpdateActionPointOrientationArgs, None, Role.STANDARD_USER),
        Rpc(
            "UpdateActionPointOrientationUsingRobot",
            UpdateActionPointOrientationUsingRobotArgs,
            None,
            Role.STANDARD_USER,
        ),
        Rpc("UpdateActionPointParent", UpdateActionPointParentArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("UpdateActionPointPosition", UpdateActionPointPositionArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("UpdateActionPointUsingRobot", UpdateActionPointUsingRobotArgs, None, Role.STANDARD_USER),
        Rpc("UpdateLock", UpdateLockArgs, None, Role.STANDARD_USER),
        Rpc("UpdateLogicItem", UpdateLogicItemArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("UpdateObjectModel", UpdateObjectModelArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("UpdateObjectParameters", UpdateObjectParametersArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("UpdateObjectPose", UpdateObjectPoseArgs, None, Role.TECHNICIAN, dry_run=True),
        Rpc("UpdateObjectPoseUsingRobot", UpdateObjectPoseUsingRobotArgs, None, Role.TECHNICIAN),
        Rpc("UpdateOverride", UpdateOverrideArgs, None, Role.ADVANCED_USER, dry_run=True),
        Rpc("UpdateProjectDescription", UpdateProjectDescriptionArgs, None, Role.STANDARD_USER),
        Rpc("UpdateProjectHasLogic", UpdateProjectHasLogicArgs, None, Role.ADVANCED_USER),
        Rpc("UpdateProjectParameter", UpdateProjectParameterArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("UpdateSceneDescription", UpdateSceneDescriptionArgs, None, Role.TECHNICIAN),
        Rpc("UploadPackage", UploadPackageArgs, None, Role.TECHNICIAN),
        Rpc("WriteLock", WriteLockArgs, None, Role.STANDARD_USER),
        Rpc("WriteUnlock", WriteUnlockArgs, None, Role.STANDARD_USER),
    )
}
"""Every request of the protocol by name."""

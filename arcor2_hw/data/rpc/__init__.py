"""Every request that clients may send: arguments, answer and the minimum role."""

from typing import Final

from arcor2_hw.data.calibration import CalibrationCheck
from arcor2_hw.data.camera import CameraParameters, EstimatedPose, MarkerCorners
from arcor2_hw.data.editor import MovePreview, Presence, ProjectBreakpoints, ReachabilityData, ViewState
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta
from arcor2_hw.data.package import PackageSummary
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import Joint, RobotMeta
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.action_points import AddActionPointArgs as AddActionPointArgs
from arcor2_hw.data.rpc.action_points import AddActionPointJointsUsingRobotArgs as AddActionPointJointsUsingRobotArgs
from arcor2_hw.data.rpc.action_points import AddActionPointOrientationArgs as AddActionPointOrientationArgs
from arcor2_hw.data.rpc.action_points import (
    AddActionPointOrientationUsingRobotArgs as AddActionPointOrientationUsingRobotArgs,
)
from arcor2_hw.data.rpc.action_points import AddApUsingRobotArgs as AddApUsingRobotArgs
from arcor2_hw.data.rpc.action_points import CopyActionPointArgs as CopyActionPointArgs
from arcor2_hw.data.rpc.action_points import RemoveActionPointJointsArgs as RemoveActionPointJointsArgs
from arcor2_hw.data.rpc.action_points import RemoveActionPointOrientationArgs as RemoveActionPointOrientationArgs
from arcor2_hw.data.rpc.action_points import RenameActionPointArgs as RenameActionPointArgs
from arcor2_hw.data.rpc.action_points import RenameActionPointJointsArgs as RenameActionPointJointsArgs
from arcor2_hw.data.rpc.action_points import RenameActionPointOrientationArgs as RenameActionPointOrientationArgs
from arcor2_hw.data.rpc.action_points import UpdateActionPointJointsArgs as UpdateActionPointJointsArgs
from arcor2_hw.data.rpc.action_points import (
    UpdateActionPointJointsUsingRobotArgs as UpdateActionPointJointsUsingRobotArgs,
)
from arcor2_hw.data.rpc.action_points import UpdateActionPointOrientationArgs as UpdateActionPointOrientationArgs
from arcor2_hw.data.rpc.action_points import (
    UpdateActionPointOrientationUsingRobotArgs as UpdateActionPointOrientationUsingRobotArgs,
)
from arcor2_hw.data.rpc.action_points import UpdateActionPointParentArgs as UpdateActionPointParentArgs
from arcor2_hw.data.rpc.action_points import UpdateActionPointPositionArgs as UpdateActionPointPositionArgs
from arcor2_hw.data.rpc.action_points import UpdateActionPointUsingRobotArgs as UpdateActionPointUsingRobotArgs
from arcor2_hw.data.rpc.calibrations import CheckCalibrationArgs as CheckCalibrationArgs
from arcor2_hw.data.rpc.calibrations import ListCalibrationsArgs as ListCalibrationsArgs
from arcor2_hw.data.rpc.calibrations import ListCalibrationsData as ListCalibrationsData
from arcor2_hw.data.rpc.editor import GetBreakpointsArgs as GetBreakpointsArgs
from arcor2_hw.data.rpc.editor import GetExecutionTraceArgs as GetExecutionTraceArgs
from arcor2_hw.data.rpc.editor import GetExecutionTraceData as GetExecutionTraceData
from arcor2_hw.data.rpc.editor import GetViewStateArgs as GetViewStateArgs
from arcor2_hw.data.rpc.editor import ListRunsArgs as ListRunsArgs
from arcor2_hw.data.rpc.editor import ListRunsData as ListRunsData
from arcor2_hw.data.rpc.editor import ReachabilityArgs as ReachabilityArgs
from arcor2_hw.data.rpc.editor import SetBreakpointsArgs as SetBreakpointsArgs
from arcor2_hw.data.rpc.editor import SetViewStateArgs as SetViewStateArgs
from arcor2_hw.data.rpc.editor import SetViewStateData as SetViewStateData
from arcor2_hw.data.rpc.envelope import Request as Request
from arcor2_hw.data.rpc.envelope import Response as Response
from arcor2_hw.data.rpc.envelope import Rpc as Rpc
from arcor2_hw.data.rpc.execution import BuildProjectArgs as BuildProjectArgs
from arcor2_hw.data.rpc.execution import BuildProjectData as BuildProjectData
from arcor2_hw.data.rpc.execution import ExecuteActionArgs as ExecuteActionArgs
from arcor2_hw.data.rpc.execution import RenamePackageArgs as RenamePackageArgs
from arcor2_hw.data.rpc.execution import RunPackageArgs as RunPackageArgs
from arcor2_hw.data.rpc.execution import TemporaryPackageArgs as TemporaryPackageArgs
from arcor2_hw.data.rpc.execution import UploadPackageArgs as UploadPackageArgs
from arcor2_hw.data.rpc.general import AuthenticateArgs as AuthenticateArgs
from arcor2_hw.data.rpc.general import AuthenticateData as AuthenticateData
from arcor2_hw.data.rpc.general import GetCameraPoseArgs as GetCameraPoseArgs
from arcor2_hw.data.rpc.general import IdArgs as IdArgs
from arcor2_hw.data.rpc.general import MarkersCornersArgs as MarkersCornersArgs
from arcor2_hw.data.rpc.general import RegisterUserArgs as RegisterUserArgs
from arcor2_hw.data.rpc.general import RenameArgs as RenameArgs
from arcor2_hw.data.rpc.general import SubscribeEventsArgs as SubscribeEventsArgs
from arcor2_hw.data.rpc.general import SystemInfoData as SystemInfoData
from arcor2_hw.data.rpc.general import TypeArgs as TypeArgs
from arcor2_hw.data.rpc.history import HistoryArgs as HistoryArgs
from arcor2_hw.data.rpc.history import HistoryData as HistoryData
from arcor2_hw.data.rpc.history import HistoryEdit as HistoryEdit
from arcor2_hw.data.rpc.history import HistoryItem as HistoryItem
from arcor2_hw.data.rpc.history import RedoArgs as RedoArgs
from arcor2_hw.data.rpc.history import RestoreRevisionArgs as RestoreRevisionArgs
from arcor2_hw.data.rpc.history import RestoreRevisionData as RestoreRevisionData
from arcor2_hw.data.rpc.history import UndoArgs as UndoArgs
from arcor2_hw.data.rpc.history import UndoData as UndoData
from arcor2_hw.data.rpc.locks import HeldLock as HeldLock
from arcor2_hw.data.rpc.locks import LockHolder as LockHolder
from arcor2_hw.data.rpc.locks import LockType as LockType
from arcor2_hw.data.rpc.locks import ReadLockArgs as ReadLockArgs
from arcor2_hw.data.rpc.locks import ReadUnlockArgs as ReadUnlockArgs
from arcor2_hw.data.rpc.locks import TakeOverLocksArgs as TakeOverLocksArgs
from arcor2_hw.data.rpc.locks import TakeOverLocksData as TakeOverLocksData
from arcor2_hw.data.rpc.locks import UpdateLockArgs as UpdateLockArgs
from arcor2_hw.data.rpc.locks import WriteLockArgs as WriteLockArgs
from arcor2_hw.data.rpc.locks import WriteUnlockArgs as WriteUnlockArgs
from arcor2_hw.data.rpc.object_types import ActionParamValuesArgs as ActionParamValuesArgs
from arcor2_hw.data.rpc.object_types import AddOverrideArgs as AddOverrideArgs
from arcor2_hw.data.rpc.object_types import DeleteObjectTypesData as DeleteObjectTypesData
from arcor2_hw.data.rpc.object_types import DeleteOverrideArgs as DeleteOverrideArgs
from arcor2_hw.data.rpc.object_types import ObjectAimingAddPointArgs as ObjectAimingAddPointArgs
from arcor2_hw.data.rpc.object_types import ObjectAimingAddPointData as ObjectAimingAddPointData
from arcor2_hw.data.rpc.object_types import ObjectAimingStartArgs as ObjectAimingStartArgs
from arcor2_hw.data.rpc.object_types import UpdateObjectModelArgs as UpdateObjectModelArgs
from arcor2_hw.data.rpc.object_types import UpdateOverrideArgs as UpdateOverrideArgs
from arcor2_hw.data.rpc.operation import AcknowledgeStopArgs as AcknowledgeStopArgs
from arcor2_hw.data.rpc.operation import HoldHandTeachingArgs as HoldHandTeachingArgs
from arcor2_hw.data.rpc.operation import JogFrame as JogFrame
from arcor2_hw.data.rpc.operation import JogRobotArgs as JogRobotArgs
from arcor2_hw.data.rpc.operation import JogRobotData as JogRobotData
from arcor2_hw.data.rpc.operation import RetryObjectArgs as RetryObjectArgs
from arcor2_hw.data.rpc.operation import StopAllData as StopAllData
from arcor2_hw.data.rpc.operation import StopKind as StopKind
from arcor2_hw.data.rpc.operation import StopOutcome as StopOutcome
from arcor2_hw.data.rpc.operation import StreamRobotArgs as StreamRobotArgs
from arcor2_hw.data.rpc.projects import AddActionArgs as AddActionArgs
from arcor2_hw.data.rpc.projects import AddLogicItemArgs as AddLogicItemArgs
from arcor2_hw.data.rpc.projects import AddProjectParameterArgs as AddProjectParameterArgs
from arcor2_hw.data.rpc.projects import CloseProjectArgs as CloseProjectArgs
from arcor2_hw.data.rpc.projects import CopyProjectArgs as CopyProjectArgs
from arcor2_hw.data.rpc.projects import ListProjectsData as ListProjectsData
from arcor2_hw.data.rpc.projects import NewProjectArgs as NewProjectArgs
from arcor2_hw.data.rpc.projects import RemoveActionArgs as RemoveActionArgs
from arcor2_hw.data.rpc.projects import RemoveLogicItemArgs as RemoveLogicItemArgs
from arcor2_hw.data.rpc.projects import RemoveProjectParameterArgs as RemoveProjectParameterArgs
from arcor2_hw.data.rpc.projects import RenameActionArgs as RenameActionArgs
from arcor2_hw.data.rpc.projects import RenameProjectArgs as RenameProjectArgs
from arcor2_hw.data.rpc.projects import UpdateActionArgs as UpdateActionArgs
from arcor2_hw.data.rpc.projects import UpdateLogicItemArgs as UpdateLogicItemArgs
from arcor2_hw.data.rpc.projects import UpdateProjectDescriptionArgs as UpdateProjectDescriptionArgs
from arcor2_hw.data.rpc.projects import UpdateProjectHasLogicArgs as UpdateProjectHasLogicArgs
from arcor2_hw.data.rpc.projects import UpdateProjectParameterArgs as UpdateProjectParameterArgs
from arcor2_hw.data.rpc.robots import CalibrateRobotArgs as CalibrateRobotArgs
from arcor2_hw.data.rpc.robots import ForwardKinematicsArgs as ForwardKinematicsArgs
from arcor2_hw.data.rpc.robots import GetEndEffectorPoseArgs as GetEndEffectorPoseArgs
from arcor2_hw.data.rpc.robots import GetEndEffectorsArgs as GetEndEffectorsArgs
from arcor2_hw.data.rpc.robots import GetGrippersArgs as GetGrippersArgs
from arcor2_hw.data.rpc.robots import GetRobotArmsArgs as GetRobotArmsArgs
from arcor2_hw.data.rpc.robots import GetRobotJointsArgs as GetRobotJointsArgs
from arcor2_hw.data.rpc.robots import GetSuctionsArgs as GetSuctionsArgs
from arcor2_hw.data.rpc.robots import HandTeachingModeArgs as HandTeachingModeArgs
from arcor2_hw.data.rpc.robots import InverseKinematicsArgs as InverseKinematicsArgs
from arcor2_hw.data.rpc.robots import MoveToActionPointArgs as MoveToActionPointArgs
from arcor2_hw.data.rpc.robots import MoveToJointsArgs as MoveToJointsArgs
from arcor2_hw.data.rpc.robots import MoveToPoseArgs as MoveToPoseArgs
from arcor2_hw.data.rpc.robots import RegisterForRobotEventArgs as RegisterForRobotEventArgs
from arcor2_hw.data.rpc.robots import RobotEventKind as RobotEventKind
from arcor2_hw.data.rpc.robots import SetEefPerpendicularToWorldArgs as SetEefPerpendicularToWorldArgs
from arcor2_hw.data.rpc.robots import StepAxis as StepAxis
from arcor2_hw.data.rpc.robots import StepMode as StepMode
from arcor2_hw.data.rpc.robots import StepRobotEefArgs as StepRobotEefArgs
from arcor2_hw.data.rpc.robots import StepWhat as StepWhat
from arcor2_hw.data.rpc.robots import StopRobotArgs as StopRobotArgs
from arcor2_hw.data.rpc.scenes import AddObjectToSceneArgs as AddObjectToSceneArgs
from arcor2_hw.data.rpc.scenes import AddVirtualCollisionObjectToSceneArgs as AddVirtualCollisionObjectToSceneArgs
from arcor2_hw.data.rpc.scenes import CalibrateCameraArgs as CalibrateCameraArgs
from arcor2_hw.data.rpc.scenes import CameraColorImageArgs as CameraColorImageArgs
from arcor2_hw.data.rpc.scenes import CameraColorParametersArgs as CameraColorParametersArgs
from arcor2_hw.data.rpc.scenes import CloseSceneArgs as CloseSceneArgs
from arcor2_hw.data.rpc.scenes import CopySceneArgs as CopySceneArgs
from arcor2_hw.data.rpc.scenes import ListScenesData as ListScenesData
from arcor2_hw.data.rpc.scenes import NewSceneArgs as NewSceneArgs
from arcor2_hw.data.rpc.scenes import Pivot as Pivot
from arcor2_hw.data.rpc.scenes import RemoveFromSceneArgs as RemoveFromSceneArgs
from arcor2_hw.data.rpc.scenes import UpdateObjectParametersArgs as UpdateObjectParametersArgs
from arcor2_hw.data.rpc.scenes import UpdateObjectPoseArgs as UpdateObjectPoseArgs
from arcor2_hw.data.rpc.scenes import UpdateObjectPoseUsingRobotArgs as UpdateObjectPoseUsingRobotArgs
from arcor2_hw.data.rpc.scenes import UpdateSceneDescriptionArgs as UpdateSceneDescriptionArgs
from arcor2_hw.data.scene import Scene

RPCS: Final = {
    rpc.name: rpc
    for rpc in (
        Rpc("AcknowledgeStop", AcknowledgeStopArgs, None, Role.OPERATOR, additional=True),
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
        Rpc("Authenticate", AuthenticateArgs, AuthenticateData, Role.OPERATOR, additional=True),
        Rpc("BuildProject", BuildProjectArgs, BuildProjectData, Role.STANDARD_USER),
        Rpc("CalibrateCamera", CalibrateCameraArgs, None, Role.TECHNICIAN),
        Rpc("CalibrateRobot", CalibrateRobotArgs, None, Role.TECHNICIAN),
        Rpc("CameraColorImage", CameraColorImageArgs, str, Role.OPERATOR),
        Rpc("CameraColorParameters", CameraColorParametersArgs, CameraParameters, Role.OPERATOR),
        Rpc("CancelAction", None, None, Role.OPERATOR),
        Rpc("CheckCalibration", CheckCalibrationArgs, CalibrationCheck, Role.OPERATOR, additional=True),
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
        Rpc(
            "GetBreakpoints", GetBreakpointsArgs, ProjectBreakpoints, Role.OPERATOR, args_optional=True, additional=True
        ),
        Rpc("GetCameraPose", GetCameraPoseArgs, EstimatedPose, Role.TECHNICIAN),
        Rpc("GetEndEffectorPose", GetEndEffectorPoseArgs, Pose, Role.OPERATOR),
        Rpc("GetEndEffectors", GetEndEffectorsArgs, set[str], Role.OPERATOR),
        Rpc(
            "GetExecutionTrace",
            GetExecutionTraceArgs,
            GetExecutionTraceData,
            Role.OPERATOR,
            args_optional=True,
            additional=True,
        ),
        Rpc("GetGrippers", GetGrippersArgs, set[str], Role.OPERATOR),
        Rpc("GetObjectTypes", None, list[ObjectTypeMeta], Role.OPERATOR),
        Rpc("GetProject", IdArgs, Project, Role.OPERATOR),
        Rpc("GetRobotArms", GetRobotArmsArgs, set[str], Role.OPERATOR),
        Rpc("GetRobotJoints", GetRobotJointsArgs, list[Joint], Role.OPERATOR),
        Rpc("GetRobotMeta", None, list[RobotMeta], Role.OPERATOR),
        Rpc("GetScene", IdArgs, Scene, Role.OPERATOR),
        Rpc("GetSuctions", GetSuctionsArgs, set[str], Role.OPERATOR),
        Rpc("GetViewState", GetViewStateArgs, ViewState, Role.OPERATOR, additional=True),
        Rpc("HandTeachingMode", HandTeachingModeArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("History", HistoryArgs, HistoryData, Role.OPERATOR, args_optional=True, additional=True),
        Rpc("HoldHandTeaching", HoldHandTeachingArgs, None, Role.STANDARD_USER, additional=True),
        Rpc("InverseKinematics", InverseKinematicsArgs, list[Joint], Role.STANDARD_USER),
        Rpc("JogRobot", JogRobotArgs, JogRobotData, Role.STANDARD_USER, additional=True),
        Rpc(
            "ListCalibrations",
            ListCalibrationsArgs,
            ListCalibrationsData,
            Role.OPERATOR,
            args_optional=True,
            additional=True,
        ),
        Rpc("ListLocks", None, list[LockHolder], Role.OPERATOR, additional=True),
        Rpc("ListPackages", None, list[PackageSummary], Role.OPERATOR),
        Rpc("ListProjects", None, list[ListProjectsData], Role.OPERATOR),
        Rpc("ListRuns", ListRunsArgs, ListRunsData, Role.OPERATOR, args_optional=True, additional=True),
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
        Rpc("PreviewMove", MovePreview, None, Role.STANDARD_USER, additional=True),
        Rpc("ProjectsWithScene", IdArgs, set[str], Role.OPERATOR),
        Rpc(
            "Reachability", ReachabilityArgs, list[ReachabilityData], Role.OPERATOR, args_optional=True, additional=True
        ),
        Rpc("ReadLock", ReadLockArgs, None, Role.OPERATOR),
        Rpc("ReadUnlock", ReadUnlockArgs, None, Role.OPERATOR),
        Rpc("Redo", RedoArgs, UndoData, Role.STANDARD_USER, args_optional=True, dry_run=True, additional=True),
        Rpc("RegisterForRobotEvent", RegisterForRobotEventArgs, set[str], Role.OPERATOR),
        Rpc("RegisterUser", RegisterUserArgs, None, Role.OPERATOR),
        Rpc("RemoveAction", RemoveActionArgs, None, Role.STANDARD_USER, dry_run=True),
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
        Rpc(
            "RestoreRevision",
            RestoreRevisionArgs,
            RestoreRevisionData,
            Role.STANDARD_USER,
            dry_run=True,
            additional=True,
        ),
        Rpc("ResumePackage", None, None, Role.OPERATOR),
        Rpc("RetryObject", RetryObjectArgs, None, Role.STANDARD_USER, additional=True),
        Rpc("RunPackage", RunPackageArgs, None, Role.OPERATOR),
        Rpc("SaveProject", None, None, Role.STANDARD_USER, dry_run=True),
        Rpc("SaveScene", None, None, Role.TECHNICIAN, dry_run=True),
        Rpc("SceneObjectUsage", IdArgs, set[str], Role.OPERATOR),
        Rpc("SetBreakpoints", SetBreakpointsArgs, ProjectBreakpoints, Role.STANDARD_USER, additional=True),
        Rpc("SetEefPerpendicularToWorld", SetEefPerpendicularToWorldArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("SetViewState", SetViewStateArgs, SetViewStateData, Role.OPERATOR, additional=True),
        Rpc("StartScene", None, None, Role.STANDARD_USER, dry_run=True),
        Rpc("StartSceneKeepGoing", None, None, Role.STANDARD_USER, dry_run=True, additional=True),
        Rpc("StepAction", None, None, Role.OPERATOR),
        Rpc("StepRobotEef", StepRobotEefArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("StopAll", None, StopAllData, Role.OPERATOR, additional=True),
        Rpc("StopPackage", None, None, Role.OPERATOR),
        Rpc("StopRobot", StopRobotArgs, None, Role.OPERATOR),
        Rpc("StopScene", None, None, Role.STANDARD_USER, dry_run=True),
        Rpc("StreamRobot", StreamRobotArgs, None, Role.OPERATOR, additional=True),
        Rpc("SubscribeEvents", SubscribeEventsArgs, None, Role.OPERATOR, additional=True),
        Rpc("SystemInfo", None, SystemInfoData, Role.OPERATOR),
        Rpc("TakeOverLocks", TakeOverLocksArgs, TakeOverLocksData, Role.STANDARD_USER, dry_run=True, additional=True),
        Rpc("TemporaryPackage", TemporaryPackageArgs, None, Role.STANDARD_USER, args_optional=True),
        Rpc("Undo", UndoArgs, UndoData, Role.STANDARD_USER, args_optional=True, dry_run=True, additional=True),
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
        Rpc("UpdatePresence", Presence, None, Role.OPERATOR, additional=True),
        Rpc("UpdateProjectDescription", UpdateProjectDescriptionArgs, None, Role.STANDARD_USER),
        Rpc("UpdateProjectHasLogic", UpdateProjectHasLogicArgs, None, Role.ADVANCED_USER),
        Rpc("UpdateProjectParameter", UpdateProjectParameterArgs, None, Role.STANDARD_USER, dry_run=True),
        Rpc("UpdateSceneDescription", UpdateSceneDescriptionArgs, None, Role.TECHNICIAN),
        Rpc("UploadPackage", UploadPackageArgs, None, Role.PROGRAMMER),
        Rpc("WriteLock", WriteLockArgs, None, Role.STANDARD_USER),
        Rpc("WriteUnlock", WriteUnlockArgs, None, Role.STANDARD_USER),
    )
}
"""Every request by name."""

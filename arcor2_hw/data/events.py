"""Every event that the server sends: its data, and the minimum role that receives it."""

import enum
from typing import Any, Final

from msgspec import Struct, field

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.base import UNSET, Data, TranslatableData, Unset
from arcor2_hw.data.cell_state import CellStatus
from arcor2_hw.data.device import Connection, Observation
from arcor2_hw.data.dry_run import DryRunHead
from arcor2_hw.data.editor import (
    HistoryChangedData,
    MovePreviewData,
    ProjectBreakpoints,
    ReachabilityData,
    Run,
    RunStatisticsData,
    TaskStateData,
    TraceEntry,
    UserPresenceData,
    ViewState,
)
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.held import HeldData, HoldDecidedData
from arcor2_hw.data.interlocks import Interlock, InterlockStates
from arcor2_hw.data.maintenance import DeviceCard
from arcor2_hw.data.nodes import NodesData
from arcor2_hw.data.object_type import ObjectTypeMeta
from arcor2_hw.data.operation import ObjectHealthData, ObjectValuesData, RobotHoldData
from arcor2_hw.data.package import CollisionModels, PackageStateEnum, PackageSummary
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.parts import PartInventory
from arcor2_hw.data.persons import LogOnChangedData, Person
from arcor2_hw.data.points import ForcesChangedData, ObjectPointsData
from arcor2_hw.data.position import ProgramPosition
from arcor2_hw.data.project import (
    BareAction,
    BareActionPoint,
    BareProject,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectFunction,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.recipes import Changeover, Recipe
from arcor2_hw.data.recordings import RecordingChangedData
from arcor2_hw.data.robot import EefPose, Joint
from arcor2_hw.data.role import Role
from arcor2_hw.data.scene import BareScene, Scene, SceneObject
from arcor2_hw.data.units import Unit


class EventType(Struct, frozen=True):
    """Declaration of an event: the type of its data (None: no data) and the minimum role that receives it.

    `additional`: it is not part of the ARCOR2 protocol, and is sent only to clients that subscribed to it.
    """

    name: str
    data: Any
    role: Role
    additional: bool = False


class Event(Data, frozen=True):
    """The envelope of an event."""

    event: str
    change_type: "ChangeType | Unset" = UNSET
    parent_id: str | Unset = UNSET
    data: Any = UNSET


class ActionExecutionData(Data, frozen=True):
    """Data of the event ActionExecution."""

    action_id: str = ""


class ActionResultData(TranslatableData, frozen=True):
    """Data of the event ActionResult."""

    action_id: str
    results: list[str] | Unset = UNSET
    error: str | Unset = UNSET


class ProcessStateEnum(enum.StrEnum):
    """Values of StateEnum in ProcessState."""

    STARTED = "started"
    FINISHED = "finished"
    FAILED = "failed"


class ProcessStateData(TranslatableData, frozen=True):
    """Data of the event ProcessState."""

    id: str
    state: ProcessStateEnum
    message: str | Unset = UNSET


class MainScreen(enum.StrEnum):
    """Values of WhatEnum in ShowMainScreen."""

    SCENES_LIST = "ScenesList"
    PROJECTS_LIST = "ProjectsList"
    PACKAGES_LIST = "PackagesList"


class ShowMainScreenData(Data, frozen=True):
    """Data of the event ShowMainScreen."""

    what: MainScreen
    highlight: str | Unset = UNSET


class LockData(Data, frozen=True):
    """Data of the events ObjectsLocked and ObjectsUnlocked."""

    object_ids: list[str]
    owner: str


class OpenProjectData(Data, frozen=True):
    """Data of the event OpenProject."""

    scene: Scene
    project: Project


class HandTeachingModeData(Data, frozen=True):
    """Data of the event HandTeachingMode."""

    robot_id: str
    enabled: bool
    arm_id: str | Unset = UNSET


class MoveEventType(enum.StrEnum):
    """Phases of a motion."""

    START = "start"
    END = "end"
    FAILED = "failed"


class RobotMoveToActionPointJointsData(TranslatableData, frozen=True):
    """Data of the event RobotMoveToActionPointJoints."""

    move_event_type: MoveEventType
    robot_id: str
    joints_id: str
    safe: bool
    message: str | Unset = UNSET
    arm_id: str | Unset = UNSET


class RobotMoveToActionPointOrientationData(TranslatableData, frozen=True):
    """Data of the event RobotMoveToActionPointOrientation."""

    move_event_type: MoveEventType
    robot_id: str
    end_effector_id: str
    orientation_id: str
    safe: bool
    linear: bool
    message: str | Unset = UNSET
    arm_id: str | Unset = UNSET


class RobotMoveToJointsData(TranslatableData, frozen=True):
    """Data of the event RobotMoveToJoints."""

    move_event_type: MoveEventType
    robot_id: str
    target_joints: list[Joint]
    safe: bool
    message: str | Unset = UNSET
    arm_id: str | Unset = UNSET


class RobotMoveToPoseData(TranslatableData, frozen=True):
    """Data of the event RobotMoveToPose."""

    move_event_type: MoveEventType
    robot_id: str
    end_effector_id: str
    target_pose: Pose
    safe: bool
    linear: bool
    message: str | Unset = UNSET
    arm_id: str | Unset = UNSET


class OpenSceneData(Data, frozen=True):
    """Data of the event OpenScene."""

    scene: Scene


class SceneStateEnum(enum.StrEnum):
    """Values of StateEnum in SceneState."""

    STOPPED = "stopped"
    STARTING = "starting"
    STARTED = "started"
    STOPPING = "stopping"


class SceneStateData(TranslatableData, frozen=True):
    """Data of the event SceneState."""

    state: SceneStateEnum
    message: str | Unset = UNSET


class RobotEefData(Data, frozen=True):
    """Data of the event RobotEef; `time_ms` (steady clock of the cell) is set if StreamRobot requested it."""

    robot_id: str
    end_effectors: list[EefPose] = field(default_factory=list)
    time_ms: float | Unset = UNSET


class RobotJointsData(Data, frozen=True):
    """Data of the event RobotJoints; `time_ms` as in RobotEef."""

    robot_id: str
    joints: list[Joint]
    time_ms: float | Unset = UNSET


class ActionStateAfterData(Data, frozen=True):
    """Data of the event ActionStateAfter."""

    action_id: str
    results: list[str] | Unset = UNSET


class ActionStateBeforeData(Data, frozen=True):
    """Data of the event ActionStateBefore."""

    action_id: str | Unset = UNSET
    parameters: list[str] | Unset = UNSET
    action_point_ids: set[str] | Unset = UNSET
    thread_id: int | Unset = UNSET


class NotificationLevel(enum.StrEnum):
    """Values of Level in Notification."""

    INFO = "Info"
    WARN = "Warn"
    ERROR = "Error"


class NotificationData(TranslatableData, frozen=True):
    """Data of the event Notification."""

    message: str
    level: NotificationLevel


class PackageInfoData(Data, frozen=True):
    """Data of the event PackageInfo."""

    package_id: str
    package_name: str
    scene: Scene
    project: Project
    collision_models: CollisionModels = field(default_factory=CollisionModels)


class PackageStateData(Data, frozen=True):
    """Data of the event PackageState."""

    state: PackageStateEnum = PackageStateEnum.UNDEFINED
    package_id: str | Unset = UNSET


class ProjectExceptionData(TranslatableData, frozen=True):
    """Data of the event ProjectException; action_id (not in ARCOR2): the action that failed."""

    message: str
    type: str
    handled: bool = False
    action_id: str | Unset = UNSET


class ObjectStateData(TranslatableData, frozen=True):
    """Data of the event ObjectState: the connection of an object of the online scene or the running program.

    reason: why the connection is lost or failed, or why all connections ended. overlaid: settings from the server's
        cell file.
    answering: false while the process that controls the devices does not answer; `state` is then the last known one.
    """

    object_id: str
    state: Connection
    reason: str | Unset = UNSET
    overlaid: list[str] | Unset = UNSET
    answering: bool | Unset = UNSET


class ObjectObservationsData(TranslatableData, frozen=True):
    """Data of the event ObjectObservations: present values of a device.

    time_ms: time of reading on the steady clock of the cell. reason: why no value is known.
    """

    object_id: str
    time_ms: float
    observations: list[Observation] = field(default_factory=list)
    reason: str | Unset = UNSET


class ChangeType(enum.StrEnum):
    """Kind of change of the item in an event."""

    ADD = "add"
    UPDATE = "update"
    REMOVE = "remove"
    UPDATE_BASE = "update_base"


EVENTS: Final = {
    event.name: event
    for event in (
        EventType("ActionCancelled", None, Role.OPERATOR),
        EventType("ActionExecution", ActionExecutionData, Role.OPERATOR),
        EventType("ActionResult", ActionResultData, Role.OPERATOR),
        EventType("ProcessState", ProcessStateData, Role.OPERATOR),
        EventType("ShowMainScreen", ShowMainScreenData, Role.OPERATOR),
        EventType("ObjectsLocked", LockData, Role.OPERATOR),
        EventType("ObjectsUnlocked", LockData, Role.OPERATOR),
        EventType("ChangedObjectTypes", list[ObjectTypeMeta], Role.OPERATOR),
        EventType("OverrideUpdated", Parameter, Role.OPERATOR),
        EventType("ActionChanged", BareAction, Role.OPERATOR),
        EventType("ActionPointChanged", BareActionPoint, Role.OPERATOR),
        EventType("JointsChanged", ProjectRobotJoints, Role.OPERATOR),
        EventType("LogicItemChanged", LogicItem, Role.OPERATOR),
        EventType("OpenProject", OpenProjectData, Role.OPERATOR),
        EventType("OrientationChanged", NamedOrientation, Role.OPERATOR),
        EventType("ProjectChanged", BareProject, Role.OPERATOR),
        EventType("ProjectClosed", None, Role.OPERATOR),
        EventType("ProjectParameterChanged", ProjectParameter, Role.OPERATOR),
        EventType("ProjectSaved", None, Role.OPERATOR),
        EventType("HandTeachingMode", HandTeachingModeData, Role.OPERATOR),
        EventType("RobotMoveToActionPointJoints", RobotMoveToActionPointJointsData, Role.OPERATOR),
        EventType("RobotMoveToActionPointOrientation", RobotMoveToActionPointOrientationData, Role.OPERATOR),
        EventType("RobotMoveToJoints", RobotMoveToJointsData, Role.OPERATOR),
        EventType("RobotMoveToPose", RobotMoveToPoseData, Role.OPERATOR),
        EventType("OpenScene", OpenSceneData, Role.OPERATOR),
        EventType("SceneChanged", BareScene, Role.OPERATOR),
        EventType("SceneClosed", None, Role.OPERATOR),
        EventType("SceneObjectChanged", SceneObject, Role.OPERATOR),
        EventType("SceneSaved", None, Role.OPERATOR),
        EventType("SceneState", SceneStateData, Role.OPERATOR),
        EventType("PackageChanged", PackageSummary, Role.OPERATOR),
        EventType("RobotEef", RobotEefData, Role.OPERATOR),
        EventType("RobotJoints", RobotJointsData, Role.OPERATOR),
        EventType("ActionStateAfter", ActionStateAfterData, Role.OPERATOR),
        EventType("ActionStateBefore", ActionStateBeforeData, Role.OPERATOR),
        EventType("Notification", NotificationData, Role.OPERATOR),
        EventType("PackageInfo", PackageInfoData, Role.OPERATOR),
        EventType("PackageState", PackageStateData, Role.OPERATOR),
        EventType("ProjectException", ProjectExceptionData, Role.OPERATOR),
        EventType("ObjectState", ObjectStateData, Role.OPERATOR, additional=True),
        EventType("ObjectHealth", ObjectHealthData, Role.OPERATOR, additional=True),
        EventType("ObjectObservations", ObjectObservationsData, Role.OPERATOR, additional=True),
        EventType("ObjectPoints", ObjectPointsData, Role.OPERATOR, additional=True),
        EventType("ObjectValues", ObjectValuesData, Role.OPERATOR, additional=True),
        EventType("RobotHold", RobotHoldData, Role.OPERATOR, additional=True),
        EventType("AlarmChanged", AlarmRecord, Role.OPERATOR, additional=True),
        EventType("RecordingChanged", RecordingChangedData, Role.OPERATOR, additional=True),
        EventType("BreakpointsChanged", ProjectBreakpoints, Role.OPERATOR, additional=True),
        EventType("CellChanged", CellStatus, Role.OPERATOR, additional=True),
        EventType("DryRunChanged", DryRunHead, Role.OPERATOR, additional=True),
        EventType("ExecutionTrace", TraceEntry, Role.OPERATOR, additional=True),
        EventType("ForcesChanged", ForcesChangedData, Role.OPERATOR, additional=True),
        EventType("FunctionChanged", ProjectFunction, Role.OPERATOR, additional=True),
        EventType("DeviceCardChanged", DeviceCard, Role.OPERATOR, additional=True),
        EventType("Held", HeldData, Role.OPERATOR, additional=True),
        EventType("HistoryChanged", HistoryChangedData, Role.OPERATOR, additional=True),
        EventType("HoldDecided", HoldDecidedData, Role.OPERATOR, additional=True),
        EventType("InterlockChanged", Interlock, Role.OPERATOR, additional=True),
        EventType("InterlockStates", InterlockStates, Role.OPERATOR, additional=True),
        EventType("LogOnChanged", LogOnChangedData, Role.OPERATOR, additional=True),
        EventType("MovePreview", MovePreviewData, Role.OPERATOR, additional=True),
        EventType("NodesChanged", NodesData, Role.OPERATOR, additional=True),
        EventType("PartsChanged", PartInventory, Role.OPERATOR, additional=True),
        EventType("PersonChanged", Person, Role.OPERATOR, additional=True),
        EventType("ProgramPosition", ProgramPosition, Role.OPERATOR, additional=True),
        EventType("ChangeoverChanged", Changeover, Role.OPERATOR, additional=True),
        EventType("RecipeChanged", Recipe, Role.OPERATOR, additional=True),
        EventType("UnitChanged", Unit, Role.OPERATOR, additional=True),
        EventType("ReachabilityChanged", ReachabilityData, Role.OPERATOR, additional=True),
        EventType("RunChanged", Run, Role.OPERATOR, additional=True),
        EventType("RunStatistics", RunStatisticsData, Role.OPERATOR, additional=True),
        EventType("TaskState", TaskStateData, Role.OPERATOR, additional=True),
        EventType("UserPresence", UserPresenceData, Role.OPERATOR, additional=True),
        EventType("ViewStateChanged", ViewState, Role.OPERATOR, additional=True),
    )
}
"""Every event by name, those of the protocol and additional ones."""

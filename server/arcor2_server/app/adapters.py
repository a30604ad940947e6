"""Builds the handlers of websocket requests and REST operations from the parts of the server."""

from arcor2_server.app.parts import Server
from arcor2_server.rest.alarms import AlarmOperations
from arcor2_server.rest.api_page import ApiPageOperations
from arcor2_server.rest.assets import AssetOperations
from arcor2_server.rest.audit_trail import AuditOperations
from arcor2_server.rest.build import BuildOperations
from arcor2_server.rest.calibration_methods import CalibrationMethodOperations
from arcor2_server.rest.calibration_records import CalibrationRecordOperations
from arcor2_server.rest.calibration_service import CalibrationServiceOperations
from arcor2_server.rest.cameras import CameraOperations
from arcor2_server.rest.diagnosis import DiagnosisOperations
from arcor2_server.rest.diagnosis_bundle import Diagnosis
from arcor2_server.rest.display_models import DisplayModelOperations
from arcor2_server.rest.documents import ApiDocumentOperations
from arcor2_server.rest.execution import ExecutionOperations
from arcor2_server.rest.general import GeneralOperations
from arcor2_server.rest.history import HistoryOperations
from arcor2_server.rest.kinematics import KinematicsOperations
from arcor2_server.rest.models import ModelOperations
from arcor2_server.rest.object_types import ObjectTypeOperations
from arcor2_server.rest.production import ProductionOperations
from arcor2_server.rest.projects import ProjectOperations
from arcor2_server.rest.recordings import RecordingOperations
from arcor2_server.rest.runs import RunOperations
from arcor2_server.rest.scene_service import SceneServiceOperations
from arcor2_server.rest.scenes import SceneOperations
from arcor2_server.rpc.action_points import ActionPointRequests
from arcor2_server.rpc.actions import ActionRequests
from arcor2_server.rpc.alarms import AlarmRequests
from arcor2_server.rpc.answer_cache import AnswerCache
from arcor2_server.rpc.build import BuildRequests
from arcor2_server.rpc.calibration import CalibrationRequests
from arcor2_server.rpc.calibration_records import CalibrationRecordRequests
from arcor2_server.rpc.cameras import CameraRequests
from arcor2_server.rpc.cell import CellRequests
from arcor2_server.rpc.copying import CopyRequests
from arcor2_server.rpc.dry_runs import DryRunRequests
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.editor import SharedStateRequests
from arcor2_server.rpc.execution import ExecutionRequests
from arcor2_server.rpc.forces import ForceRequests
from arcor2_server.rpc.functions import FunctionRequests
from arcor2_server.rpc.general import GeneralRequests
from arcor2_server.rpc.history import HistoryRequests
from arcor2_server.rpc.interlocks import InterlockRequests
from arcor2_server.rpc.joints import JointsRequests
from arcor2_server.rpc.lists import ListRequests
from arcor2_server.rpc.locking import LockRequests
from arcor2_server.rpc.logic import LogicRequests
from arcor2_server.rpc.maintenance import MaintenanceRequests
from arcor2_server.rpc.nodes import NodeRequests
from arcor2_server.rpc.object_aiming import ObjectAimingRequests
from arcor2_server.rpc.object_types import ObjectTypeRequests
from arcor2_server.rpc.operation import OperationRequests
from arcor2_server.rpc.orientations import OrientationRequests
from arcor2_server.rpc.parameters import ParameterRequests
from arcor2_server.rpc.persons import PersonRequests
from arcor2_server.rpc.project import ProjectRequests
from arcor2_server.rpc.reachability import ReachabilityRequests
from arcor2_server.rpc.recipes import RecipeRequests
from arcor2_server.rpc.registry import Handlers
from arcor2_server.rpc.robot import RobotRequests
from arcor2_server.rpc.robot_motion import RobotMotionRequests
from arcor2_server.rpc.runs import RunRequests
from arcor2_server.rpc.scene import SceneRequests
from arcor2_server.rpc.scene_objects import SceneObjectRequests
from arcor2_server.rpc.scripts import ScriptRequests
from arcor2_server.rpc.units import UnitRequests


def request_handlers(s: Server) -> Handlers:
    """Return the handlers of the websocket requests."""
    answers = AnswerCache()
    editing = Editing(s.locks, s.storage, s.session, s.execution, s.secrets)
    scenes = SceneRequests(s.locks, s.storage, s.session, s.online, s.type_notifications, s.dependents, editing)
    objects = SceneObjectRequests(
        s.locks, s.storage, s.assets, s.types, s.session, s.online, s.dependents, editing, s.connection_check
    )
    return Handlers(
        ActionPointRequests(s.locks, s.session, s.online, editing),
        ActionRequests(s.locks, s.types, s.session, editing),
        AlarmRequests(s.alarms),
        BuildRequests(s.locks, s.execution, s.build, s.tasks),
        CalibrationRequests(s.session, s.online, s.calibration, s.scene_calibration),
        CalibrationRecordRequests(s.session, s.calibration_records),
        CameraRequests(s.session, s.online, editing, s.cameras),
        CellRequests(s.cell),
        CopyRequests(s.locks, s.session, editing),
        SharedStateRequests(s.locks, s.session, s.previews, s.view_states, s.breakpoints, s.presence),
        DryRunRequests(s.dry_runs),
        ExecutionRequests(
            s.locks, s.types, s.session, s.online, s.execution, s.tasks, s.package_runs, s.temporary_runs
        ),
        ForceRequests(s.online, s.execution),
        FunctionRequests(s.types, s.session, s.undo, editing),
        GeneralRequests(
            s.access,
            s.persons,
            s.log_ons,
            s.hub,
            s.users,
            s.locks,
            s.session,
            s.online,
            s.execution,
            s.object_aiming,
            s.tasks,
            s.presence,
            s.edit_notifications,
            s.reachability,
            s.settings,
            s.nodes,
        ),
        HistoryRequests(s.session, s.undo, editing),
        InterlockRequests(s.locks, s.types, s.session, s.online, s.execution, editing),
        JointsRequests(s.locks, s.session, s.online, editing),
        ListRequests(s.storage, s.types, s.type_notifications, answers, s.saved_problems),
        LockRequests(s.users, s.locks, s.lock_takeover),
        LogicRequests(s.locks, s.types, s.session, editing),
        MaintenanceRequests(s.devices, s.parameters),
        NodeRequests(s.locks, s.session, s.online, s.nodes, editing),
        ObjectAimingRequests(s.types, s.session, s.online, s.object_aiming, editing, objects),
        ObjectTypeRequests(s.locks, s.storage, s.assets, s.types, s.session, s.online, answers),
        OperationRequests(s.types, s.session, s.online, s.execution, s.motion, s.stop_all),
        OrientationRequests(s.locks, s.session, s.online, editing),
        ParameterRequests(s.locks, s.types, s.session, editing),
        PersonRequests(s.access, s.persons, s.log_ons),
        ProjectRequests(s.hub, s.locks, s.storage, s.types, s.session, s.online, s.type_notifications, editing, scenes),
        ReachabilityRequests(s.reachability),
        RecipeRequests(s.recipes, s.execution),
        RobotRequests(s.locks, s.types, s.session, s.online, s.robots, s.kinematics, s.motion),
        RobotMotionRequests(s.locks, s.types, s.session, s.online, s.robots, s.motion),
        RunRequests(s.runs),
        ScriptRequests(s.session, s.undo, s.script_editing, editing),
        UnitRequests(s.units, s.cell_time),
        scenes,
        objects,
    )


def rest_groups(s: Server) -> list[object]:
    """Return the objects whose methods handle the REST operations."""
    diagnosis = Diagnosis(s.settings, s.hub, s.types, s.session, s.online, s.execution, s.runs)
    return [
        ApiPageOperations(),
        AlarmOperations(s.alarms),
        AssetOperations(s.assets, s.type_notifications),
        AuditOperations(s.audit),
        BuildOperations(s.storage, s.build, s.package_import),
        CameraOperations(s.session, s.online, s.cameras),
        CalibrationServiceOperations(s.calibration, s.robots),
        CalibrationRecordOperations(s.calibration_records),
        CalibrationMethodOperations(s.calibration_records, s.compute, s.markers, s.robots),
        DiagnosisOperations(s.secrets, diagnosis),
        DisplayModelOperations(s.display_models),
        ApiDocumentOperations(s.settings),
        ExecutionOperations(s.hub, s.storage, s.execution, s.package_runs),
        GeneralOperations(s.settings, s.online, s.execution),
        HistoryOperations(s.history),
        RecordingOperations(s.recordings),
        KinematicsOperations(s.online, s.robot_calibrations, s.robots),
        ModelOperations(s.storage, s.type_notifications),
        ObjectTypeOperations(s.storage, s.types, s.type_notifications),
        ProductionOperations(s.recipes, s.units, s.cell_time),
        ProjectOperations(s.storage),
        RunOperations(s.runs),
        SceneServiceOperations(s.assets, s.online, s.compute, s.collisions, s.scene_collisions),
        SceneOperations(s.storage, s.types),
    ]

"""Every request and event of the protocol, and the tests that show its effect, its events and its refusals.

Recorded sessions and the state matrix cover most of them. For the others the table names a test, which must exist and
mention the request or event. Every request and event of protocol.json must be covered.
"""

import ast
from functools import cache
from pathlib import Path

import pytest

from tests.protocol import PROTOCOL, STATES, session
from tests.server.protocol.test_protocol_traces import DIFFERENT, SESSIONS

TESTS = Path(__file__).resolve().parents[2]

EDITING = "server/protocol/test_protocol_editing.py"
VALUES = "server/protocol/test_protocol_values.py"
CAMERAS = "server/protocol/test_protocol_cameras.py"
AIMING = "server/protocol/test_protocol_aiming.py"
ONLINE = "server/cell/test_online_scene.py"
RUNNING = "server/cell/test_execution.py"
REQUESTS = "server/session/test_session_requests.py"
ON_THE_WIRE = "server/core/test_users_and_locks_on_the_wire.py"

GRANTED = {
    "ActionParamValues": f"{VALUES}::test_a_live_object_offers_values",
    "AddActionPointJointsUsingRobot": f"{EDITING}::test_orientations_and_joints_are_taught_by_a_robot",
    "AddOverride": f"{VALUES}::test_overrides_apply_online_and_in_the_package",
    "CalibrateCamera": f"{CAMERAS}::test_a_camera_pose_is_set_from_its_picture",
    "CalibrateRobot": f"{CAMERAS}::test_a_robot_pose_is_set_from_a_camera",
    "CameraColorImage": f"{CAMERAS}::test_a_camera_returns_its_picture_and_parameters",
    "CameraColorParameters": f"{CAMERAS}::test_a_camera_returns_its_picture_and_parameters",
    "CancelAction": f"{ONLINE}::test_a_single_action_can_be_cancelled",
    "DeleteOverride": f"{VALUES}::test_overrides_apply_online_and_in_the_package",
    "GetCameraPose": f"{CAMERAS}::test_pictures_of_a_client_are_evaluated_by_the_service",
    "GetProject": f"{EDITING}::test_logic_items_are_changed",
    "GetRobotArms": f"{EDITING}::test_robots_list_their_arms_and_switch_hand_teaching",
    "GetScene": f"{EDITING}::test_object_settings_and_collision_models_are_changed",
    "HandTeachingMode": f"{EDITING}::test_robots_list_their_arms_and_switch_hand_teaching",
    "MarkersCorners": f"{CAMERAS}::test_pictures_of_a_client_are_evaluated_by_the_service",
    "ObjectAimingAddPoint": f"{AIMING}::test_an_object_is_aimed_by_its_focus_points",
    "ObjectAimingCancel": f"{AIMING}::test_an_object_is_aimed_by_its_focus_points",
    "ObjectAimingDone": f"{AIMING}::test_an_object_is_aimed_by_its_focus_points",
    "ObjectAimingStart": f"{AIMING}::test_an_object_is_aimed_by_its_focus_points",
    "MoveToJoints": f"{ONLINE}::test_a_motion_reports_start_and_end",
    "OpenProject": f"{EDITING}::test_logic_items_are_changed",
    "PausePackage": f"{RUNNING}::test_each_run_state_allows_its_requests",
    "ReadLock": f"{ON_THE_WIRE}::test_a_lock_is_announced_to_all_after_the_answer",
    "ReadUnlock": f"{ON_THE_WIRE}::test_a_lock_is_announced_to_all_after_the_answer",
    "RemoveActionPointJoints": f"{EDITING}::test_orientations_and_joints_are_taught_by_a_robot",
    "RemoveActionPointOrientation": f"{EDITING}::test_orientations_and_joints_are_taught_by_a_robot",
    "RemoveFromScene": f"{REQUESTS}::test_an_object_used_by_projects_is_not_removed",
    "RemoveLogicItem": f"{REQUESTS}::test_logic_items_always_announce_unlocking",
    "ResumePackage": f"{RUNNING}::test_each_run_state_allows_its_requests",
    "SceneObjectUsage": f"{REQUESTS}::test_an_object_used_by_projects_is_not_removed",
    "SetEefPerpendicularToWorld": (
        "server/protocol/test_protocol_perpendicular.py::test_a_tool_is_turned_down_with_the_smallest_change"
    ),
    "StepAction": f"{RUNNING}::test_each_run_state_allows_its_requests",
    "StopRobot": f"{ONLINE}::test_stop_robot_stops_the_motion",
    "UpdateActionPointOrientationUsingRobot": f"{EDITING}::test_orientations_and_joints_are_taught_by_a_robot",
    "UpdateLogicItem": f"{EDITING}::test_logic_items_are_changed",
    "UpdateObjectModel": f"{EDITING}::test_object_settings_and_collision_models_are_changed",
    "UpdateObjectParameters": f"{EDITING}::test_object_settings_and_collision_models_are_changed",
    "UpdateOverride": f"{VALUES}::test_overrides_apply_online_and_in_the_package",
    "UploadPackage": f"{RUNNING}::test_packages_are_uploaded_renamed_and_deleted",
}
"""Tests of the effect and events of requests that no recorded session grants."""

REFUSED = {
    "GetCameraPose": f"{CAMERAS}::test_pictures_of_a_client_are_evaluated_by_the_service",
    "MarkersCorners": f"{CAMERAS}::test_pictures_of_a_client_are_evaluated_by_the_service",
    "PausePackage": f"{RUNNING}::test_each_run_state_allows_its_requests",
    "RegisterUser": f"{ON_THE_WIRE}::test_a_user_name_is_unique",
    "RenamePackage": f"{RUNNING}::test_packages_are_uploaded_renamed_and_deleted",
    "ResumePackage": f"{RUNNING}::test_each_run_state_allows_its_requests",
    "StepAction": f"{RUNNING}::test_each_run_state_allows_its_requests",
    "StopPackage": f"{RUNNING}::test_each_run_state_allows_its_requests",
    "TemporaryPackage": "server/protocol/test_protocol_temporary.py::test_a_project_runs_and_is_reopened",
}
"""Tests of refusals that neither a recorded session nor the matrix contains."""

NEVER_REFUSED = {"GetObjectTypes", "GetRobotMeta", "ListPackages", "ListProjects", "ListScenes", "ObjectTypeUsage",
                 "SystemInfo"}  # fmt: skip
"""Requests without arguments and without preconditions."""

SENT = {
    "ActionCancelled": f"{ONLINE}::test_a_single_action_can_be_cancelled",
    "HandTeachingMode": f"{EDITING}::test_robots_list_their_arms_and_switch_hand_teaching",
    "OverrideUpdated": f"{VALUES}::test_overrides_apply_online_and_in_the_package",
    "ProcessState": f"{CAMERAS}::test_a_camera_pose_is_set_from_its_picture",
    "ProjectException": f"{RUNNING}::test_a_script_error_is_reported",
    "RobotMoveToJoints": f"{ONLINE}::test_a_motion_reports_start_and_end",
}
"""Tests of events that no recorded session contains."""

NEVER_SENT = {"Notification"}
"""Declared and never sent, not even by the original (protocol, 8)."""


@cache
def functions(file: str) -> dict[str, set[str]]:
    """Return the tests of a file with the texts and names that occur in each."""
    return {
        node.name: {
            text
            for part in ast.walk(node)
            for text in (getattr(part, "value", None), getattr(part, "id", None), getattr(part, "attr", None))
            if isinstance(text, str)
        }
        for node in ast.walk(ast.parse((TESTS / file).read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }


@cache
def recorded() -> tuple[set[str], set[str], set[str]]:
    """Return the requests granted, the requests refused and the events in the compared sessions."""
    granted, refused, events = set(), set(), set()
    for name in SESSIONS:
        dry = {line["msg"]["id"]: line["msg"].get("dry_run") for line in session(name) if line["who"].endswith(">")}
        for message in (line["msg"] for line in session(name)):
            if "event" in message:
                events.add(message["event"])
            elif "response" in message and message["id"] not in DIFFERENT:
                if not message["result"]:
                    refused.add(message["response"])
                elif not dry[message["id"]]:
                    granted.add(message["response"])
    return granted, refused, events


@pytest.mark.parametrize(
    ("name", "test"), [*GRANTED.items(), *REFUSED.items(), *SENT.items()], ids=lambda text: text.rpartition(":")[2]
)
def test_the_named_test_exists_and_mentions_the_request(name: str, test: str) -> None:
    file, _, function = test.partition("::")
    texts = functions(file)[function]
    assert name in texts, f"{test} does not mention {name}"


@pytest.mark.parametrize(("name", "test"), REFUSED.items(), ids=REFUSED)
def test_the_named_test_expects_a_refusal(name: str, test: str) -> None:
    file, _, function = test.partition("::")
    assert functions(file)[function] & {"refused", "raises"}, f"{test} expects no refusal of {name}"


def test_every_request_has_a_test_of_its_effect() -> None:
    granted = recorded()[0] | GRANTED.keys() | CHECKED_SEPARATELY
    assert set(PROTOCOL["requests"]) - granted == set()
    assert GRANTED.keys() & recorded()[0] == set(), "the recorded sessions show these already"


CHECKED_SEPARATELY = {"GetActions", "GetObjectTypes", "GetRobotMeta", "SystemInfo"}
"""Requests whose recorded answers differ on purpose. The comparison of the sessions checks what must be the same."""


def test_every_request_has_a_test_of_its_refusal() -> None:
    in_matrix = {name for rows in STATES.values() for name, outcome in rows.items() if outcome.startswith("refused")}
    shown = recorded()[1] | in_matrix | REFUSED.keys()
    assert set(PROTOCOL["requests"]) - shown == NEVER_REFUSED


def test_every_event_has_a_test() -> None:
    assert set(PROTOCOL["events"]) - recorded()[2] - SENT.keys() == NEVER_SENT

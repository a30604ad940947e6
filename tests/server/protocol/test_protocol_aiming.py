"""The pose of an object is found by touching its focus points with a robot."""

import math
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings, strategies as st

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import InvalidData
from arcor2_server.workspace.point_registration import fit
from tests.server.protocol.in_process_server import FOCUS_POINTS, Actor, Stage, open_stage, refused, until_event

TRUE_POSE = Pose(Position(0.5, -0.3, 0.2), Orientation.from_rotation_vector(0.3, -0.2, 1.1))


def near(one: Pose, other: Pose) -> bool:
    return one.position.distance_to(other.position) < 1e-9 and one.orientation.angle_to(other.orientation) < 1e-6


# ------------------------------------------------------------------------------------------------ the fit
coordinates = st.floats(-2, 2)
poses = st.builds(
    lambda p, r: Pose(Position(*p), Orientation.from_rotation_vector(*r)),
    st.tuples(coordinates, coordinates, coordinates),
    st.tuples(coordinates, coordinates, coordinates),
)


@settings(deadline=None)
@given(poses, st.permutations(range(4)))
def test_fit_finds_any_pose_from_any_order_of_points(pose: Pose, order: list[int]) -> None:
    points = [FOCUS_POINTS[index].position for index in order]
    found = fit(points, [(pose * Pose(point)).position for point in points])
    assert near(found.pose, pose)
    assert found.worst < 1e-9


def test_fit_of_three_points_in_a_plane_is_not_a_reflection() -> None:
    points = [Position(0, 0, 0), Position(1, 0, 0), Position(0, 2, 0)]
    pose = Pose(Position(1, 1, 1), Orientation.from_rotation_vector(math.pi, 0, 0))
    assert near(fit(points, [(pose * Pose(point)).position for point in points]).pose, pose)


def test_fit_distributes_touching_errors() -> None:
    points = [point.position for point in FOCUS_POINTS]
    touched = [(TRUE_POSE * Pose(point)).position for point in points]
    touched[0] = touched[0] + Position(0.003, 0, 0)
    found = fit(points, touched)
    assert 0.0005 < found.worst < 0.003
    assert found.pose.position.distance_to(TRUE_POSE.position) < 0.003


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        ([(0, 0, 0), (1, 0, 0)], "at least 3"),
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0.001)], "one line"),
        ([(1, 1, 1)] * 4, "one line or in one place"),
        ([(0, 0, 0), (1, 0, 0), (0, math.inf, 0)], "not a finite number"),
    ],
)
def test_fit_refuses_degenerate_points(points: list[tuple[float, float, float]], reason: str) -> None:
    positions = [Position(*point) for point in points]
    with pytest.raises(InvalidData, match=reason):
        fit(positions, positions)


def test_fit_refuses_lists_of_different_length() -> None:
    points = [point.position for point in FOCUS_POINTS]
    with pytest.raises(InvalidData, match="3 were touched"):
        fit(points, points[:3])


# ------------------------------------------------------------------------------------------------ the requests
async def put_tip(stage: Stage, actor: Actor, position: Position) -> None:
    """Move the arm there. The move needs a different lock from the one that the user holds."""
    pose = msgspec.to_builtins(Pose(position, Orientation(1, 0, 0, 0)))
    raw: dict[str, Any] = {"end_effector_id": "tip", "target_pose": pose, "speed": 1.0}
    await stage.services.online.call(stage.ids["arm"], "move_to_pose", raw)
    actor.take()


async def test_an_object_is_aimed_by_its_focus_points(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm", "Part", "Plain", "Thin", "Chooser") as stage:
        alice, bob, stranger = await stage.person("alice"), await stage.person("bob"), await stage.person()
        start: dict[str, Any] = {"object_id": "x", "robot": {"robot_id": "y", "end_effector": "tip"}}
        assert "No scene is open" in await refused(alice, "ObjectAimingStart", **start)
        assert "No scene is open" in await refused(alice, "ObjectAimingAddPoint", point_idx=0)
        assert "No scene is open" in await refused(alice, "ObjectAimingDone")
        assert "not aiming" in await refused(alice, "ObjectAimingCancel")
        assert "not logged in" in await refused(stranger, "ObjectAimingCancel")

        await stage.place(alice, arm="Arm", part="Part", plain="Plain", thin="Thin", chooser="Chooser")
        arm, part = stage.ids["arm"], stage.ids["part"]
        start = {"object_id": part, "robot": {"robot_id": arm, "end_effector": "tip"}}
        assert "offline" in await refused(alice, "ObjectAimingStart", **start)
        await stage.start(alice)
        assert "not logged in" in await refused(stranger, "ObjectAimingStart", **start)
        assert "has no mesh" in await refused(alice, "ObjectAimingStart", **start | {"object_id": stage.ids["plain"]})
        assert "has no pose" in await refused(alice, "ObjectAimingStart", **start | {"object_id": stage.ids["chooser"]})
        assert "one line" in await refused(alice, "ObjectAimingStart", **start | {"object_id": stage.ids["thin"]})
        assert "lock" in await refused(alice, "ObjectAimingStart", **start)
        await alice.lock(part)
        assert "lock" in await refused(alice, "ObjectAimingStart", **start)
        await alice.lock(arm)
        unknown = {"robot_id": arm, "end_effector": "claw"}
        assert "no end effector" in await refused(alice, "ObjectAimingStart", **start | {"robot": unknown})
        arms = {"robot_id": arm, "end_effector": "tip", "arm_id": "left"}
        assert "one arm" in await refused(alice, "ObjectAimingStart", **start | {"robot": arms})
        not_robot = {"robot_id": part, "end_effector": "tip"}
        assert "not a robot" in await refused(alice, "ObjectAimingStart", **start | {"robot": not_robot})

        await alice.ask("ObjectAimingStart", dry_run=True, **start)
        assert "not aiming" in await refused(alice, "ObjectAimingAddPoint", point_idx=0)
        bob.take()
        await alice.ask("ObjectAimingStart", **start)
        assert "already aiming" in await refused(alice, "ObjectAimingStart", **start)
        assert "not aiming" in await refused(bob, "ObjectAimingAddPoint", point_idx=0)
        for wrong in (-1, 4):
            assert "does not exist" in await refused(alice, "ObjectAimingAddPoint", point_idx=wrong)
        assert "missing: 0, 1, 2, 3" in await refused(alice, "ObjectAimingDone")

        done: list[int] = []
        for index in (2, 0, 3, 1):
            await put_tip(stage, alice, (TRUE_POSE * FOCUS_POINTS[index]).position)
            tried = await alice.ask("ObjectAimingAddPoint", dry_run=True, point_idx=index)
            assert tried["finished_indexes"] == sorted({*done, index})
            assert (await alice.ask("ObjectAimingAddPoint", point_idx=index))["finished_indexes"] == sorted(
                {*done, index}
            )
            done.append(index)
        before = stage.services.session.document.scene_object(part).pose
        await alice.ask("ObjectAimingDone", dry_run=True)
        assert stage.services.session.document.scene_object(part).pose == before
        assert bob.names() == []
        await alice.ask("ObjectAimingDone")
        assert [message.get("event") or message["response"] for message in alice.take()][-2:] == [
            "ObjectAimingDone",
            "SceneObjectChanged",
        ]
        changed = await until_event(bob, "SceneObjectChanged")
        assert changed["id"] == part
        assert near(msgspec.convert(changed["pose"], Pose), TRUE_POSE)
        live = await stage.services.online.ask(Pose, part, "pose")
        assert near(live, TRUE_POSE)
        assert "not aiming" in await refused(alice, "ObjectAimingDone")
        # The locks stay with the user.
        assert "lock" in await refused(bob, "WriteLock", object_id=part)

        # A point taken at the wrong place is reported and can be taken again.
        await alice.ask("ObjectAimingStart", **start)
        for index in range(4):
            wrong_point = FOCUS_POINTS[(index + 1) % 4]
            await put_tip(stage, alice, (TRUE_POSE * wrong_point).position)
            await alice.ask("ObjectAimingAddPoint", point_idx=index)
        assert "do not fit" in await refused(alice, "ObjectAimingDone")
        await alice.ask("ObjectAimingCancel", dry_run=True)
        await alice.ask("ObjectAimingCancel")
        assert "not aiming" in await refused(alice, "ObjectAimingCancel")

        # A user who releases the lock cannot continue. Registering again discards the earlier aiming.
        await alice.ask("ObjectAimingStart", **start)
        await alice.ask("WriteUnlock", object_id=part)
        assert "lock" in await refused(alice, "ObjectAimingAddPoint", point_idx=0)
        await alice.ask("RegisterUser", user_name="alice")
        assert "not aiming" in await refused(alice, "ObjectAimingCancel")

        # Aiming ends when the scene closes.
        await alice.lock(part)
        await alice.ask("ObjectAimingStart", **start)
        await alice.ask("WriteUnlock", object_id=part)
        await alice.ask("WriteUnlock", object_id=arm)
        await stage.stop(alice)
        assert "offline" in await refused(alice, "ObjectAimingStart", **start)
        await alice.ask("CloseScene", force=True)
        assert "not aiming" in await refused(alice, "ObjectAimingCancel")

"""A UrdfRobot that implements only joint motion: its features and refusals."""

import importlib
import itertools
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arcor2_hw.analysis.library import Library
from arcor2_hw.analysis.source import SourceFile
from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Cancelled, InvalidData, NotFound, OutOfRange, Refused
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Box
from arcor2_hw.objects import safe_moves
from arcor2_hw.objects.surroundings import Obstacle
from arcor2_hw.planning import planner

from .conftest import ACROSS, BASE, READY, SOURCE, URDF, WALL, FixedSurroundings, joints, moved, new_arm, values


def assert_free(arm: Any, surroundings: FixedSurroundings, path: list[list[Joint]]) -> None:
    """Check a path in a separate collision world with a finer resolution."""
    model = RobotModel.load(URDF)
    world = CollisionWorld()
    world.add_robot("arm", model, BASE)
    for thing in surroundings.things:
        box = thing.model
        assert isinstance(box, object_type.Box)
        world.put(thing.name, Box(box.size_x, box.size_y, box.size_z), thing.pose)
    for a, b in itertools.pairwise(values(waypoint) for waypoint in path):
        for share in np.linspace(0.0, 1.0, 2 + int(np.abs(b - a).max() / 0.005)):
            assert world.is_free("arm", a + share * (b - a)), world.contacts("arm", a + share * (b - a))


# ------------------------------------------------------------------------------------------------ features of a type
def test_analysis_finds_features_of_the_urdf(folder: Path) -> None:
    path = folder / "plain_arm.py"
    library = Library([SourceFile("PlainArm", "plain_driver.plain_arm", path.read_text(), str(path))])
    found = library.analyse("PlainArm")
    assert found.problem is None
    assert found.robot is not None
    features = found.robot.features
    assert features.forward_kinematics
    assert features.inverse_kinematics
    assert features.move_to_pose
    assert features.move_to_joints
    assert features.stop
    assert not features.hand_teaching
    assert found.robot.urdf_package_filename == "plain_arm.zip"
    assert {"move_to_pose", "joint_limits", "inverse_kinematics", "stop"} <= found.implemented
    assert not {"jog", "move_path", "wrench", "connect", "state"} & found.implemented
    assert not found.meta.abstract


def test_a_type_without_stop_cannot_be_added_to_a_scene(folder: Path) -> None:
    text = SOURCE[: SOURCE.index("    def stop")]
    found = Library([SourceFile("PlainArm", "plain_driver.plain_arm", text, str(folder / "plain_arm.py"))])
    assert found.analyse("PlainArm").meta.abstract


def test_kinematics_use_world_coordinates(arm: Any) -> None:
    assert arm.get_end_effectors_ids() == {"tcp"}
    there = arm.get_end_effector_pose("tcp")
    model = RobotModel.load(URDF).arm("tcp")
    assert np.allclose(there.matrix(), (BASE * model.pose(np.array(READY))).matrix())
    goal = moved(there, 0.0, 0.1, 0.05)
    found = arm.inverse_kinematics("tcp", goal)
    assert np.allclose(arm.forward_kinematics("tcp", found).matrix(), goal.matrix(), atol=1e-6)
    assert np.abs(values(found) - np.array(READY)).max() < 0.5
    assert arm.joint_limits()["elbow_joint"][1] == pytest.approx(np.pi, abs=3.2)
    with pytest.raises(NotFound, match=r"no end effector 'pen'\. Available: tcp"):
        arm.forward_kinematics("pen", found)
    with pytest.raises(arm.KinematicsException, match="plain cannot reach"):
        arm.inverse_kinematics("tcp", moved(there, 3.0, 0.0, 0.0))
    with pytest.raises(InvalidData, match="elbow_joint"):
        arm.forward_kinematics("tcp", joints(READY)[:2])


def test_inverse_kinematics_avoids_obstacles_on_request(arm: Any, surroundings: FixedSurroundings) -> None:
    goal = moved(arm.get_end_effector_pose("tcp"), 0.0, 0.1, 0.0)
    first = arm.inverse_kinematics("tcp", goal)
    model = RobotModel.load(URDF)
    elbow = model.link_poses(values(first))["forearm_link"][:3, 3]
    surroundings.box("post", Position(*map(float, elbow)), 0.05, 0.05, 0.05)
    other = arm.inverse_kinematics("tcp", goal)
    assert np.abs(values(other) - values(first)).max() > 0.5
    assert arm.safe_moves.contacts(other) == []
    assert any("post" in pair for pair in arm.safe_moves.contacts(first))
    assert np.allclose(values(arm.inverse_kinematics("tcp", goal, None, False)), values(first))


# ------------------------------------------------------------------------------------------------ moves
def test_only_a_safe_move_avoids_obstacles(arm: Any, surroundings: FixedSurroundings) -> None:
    surroundings.box("wall", *WALL)
    arm.move_to_joints(joints(ACROSS), 0.5)
    (path,) = arm.paths
    assert len(path.waypoints) > 2
    assert_free(arm, surroundings, path.waypoints)
    assert np.allclose(values(arm.now), ACROSS)
    arm.now = joints(READY)
    arm.move_to_joints(joints(ACROSS), 0.5, safe=False)
    assert len(arm.paths[-1].waypoints) == 2
    with pytest.raises(AssertionError):
        assert_free(arm, surroundings, arm.paths[-1].waypoints)


def test_a_safe_move_to_a_pose_avoids_obstacles(arm: Any, surroundings: FixedSurroundings) -> None:
    surroundings.box("wall", *WALL)
    goal = arm.forward_kinematics("tcp", joints(ACROSS))
    arm.move_to_pose("tcp", goal, 0.5, safe=True, linear=False)
    assert_free(arm, surroundings, arm.paths[-1].waypoints)
    assert np.allclose(arm.get_end_effector_pose("tcp").matrix(), goal.matrix(), atol=1e-5)


def test_a_linear_move_is_straight_or_refused(arm: Any, surroundings: FixedSurroundings) -> None:
    here = arm.get_end_effector_pose("tcp")
    goal = moved(here, 0.0, 0.3, 0.0)
    arm.move_to_pose("tcp", goal, 0.5)
    path = arm.paths[-1]
    assert path.line
    for waypoint in path.waypoints:
        at = arm.forward_kinematics("tcp", waypoint).position
        share = here.position.distance_to(at) / 0.3
        on = moved(here, 0.0, 0.3 * share, 0.0).position
        assert on.distance_to(at) < 1e-4
    arm.now = joints(READY)
    post = BASE.inverted() * moved(here, 0.0, 0.2, 0.0)
    surroundings.box("post", post.position, 0.02, 0.02, 0.3)
    with pytest.raises(arm.KinematicsException, match=r"plain cannot go straight: 0\.1\d\d m .* plain/.* and post"):
        arm.move_to_pose("tcp", goal, 0.5)
    assert len(arm.paths) == 1
    arm.move_to_pose("tcp", goal, 0.5, safe=False)
    assert len(arm.paths) == 2


def test_a_move_may_end_close_to_an_obstacle(arm: Any, surroundings: FixedSurroundings) -> None:
    """A pick ends nearer to the table than the margin, without touching it."""
    here = BASE.inverted() * arm.get_end_effector_pose("tcp")
    surroundings.box("table", here.position + Position(0.0, 0.0, -0.152), 0.4, 0.4, 0.1)
    arm.move_to_pose("tcp", moved(arm.get_end_effector_pose("tcp"), 0.0, 0.0, -0.1), 0.2)
    arm.move_to_pose("tcp", BASE * here, 0.2)
    with pytest.raises(arm.KinematicsException, match="table"):
        arm.move_to_pose("tcp", moved(BASE * here, 0.0, 0.0, -0.105), 0.2)


def test_a_refused_move_names_the_reason(arm: Any, surroundings: FixedSurroundings) -> None:
    tip = BASE.inverted() * arm.forward_kinematics("tcp", joints(ACROSS))
    surroundings.box("crate", tip.position, 0.1, 0.1, 0.1)
    with pytest.raises(arm.KinematicsException, match="in collision at the goal: plain/wrist_3_link and crate"):
        arm.move_to_joints(joints(ACROSS), 0.5)
    surroundings.unknown = "second"
    with pytest.raises(Refused, match="The position of second is unknown"):
        arm.move_to_joints(joints(ACROSS), 0.5)
    arm.move_to_joints(joints(ACROSS), 0.5, safe=False)
    for speed in (0.0, 1.5, float("nan")):
        with pytest.raises(OutOfRange, match="speed"):
            arm.move_to_joints(joints(READY), speed)
    with pytest.raises(OutOfRange, match="elbow_joint"):
        arm.move_to_joints(joints((0.0, 0.0, 9.0, 0.0, 0.0, 0.0)), 0.5)
    with pytest.raises(InvalidData):
        arm.move_to_joints(joints(READY)[1:], 0.5)
    assert len(arm.paths) == 1


def test_a_held_part_moves_with_the_robot_and_avoids_obstacles(
    folder: Path, arm: Any, surroundings: FixedSurroundings
) -> None:
    middle = BASE.inverted() * arm.forward_kinematics("tcp", joints((1.2, *READY[1:])))
    surroundings.box("bin", middle.position + Position(0.0, 0.0, -0.3), 0.06, 0.06, 0.1)
    goal = joints((2.4, *READY[1:]))
    arm.move_to_joints(goal, 0.5)
    assert len(arm.paths[-1].waypoints) == 2
    arm.now = joints(READY)
    tip = BASE.inverted() * arm.get_end_effector_pose("tcp")
    surroundings.box("rod", tip.position + Position(0.0, 0.0, -0.15), 0.03, 0.03, 0.28)
    arm.safe_moves.hold("rod", "tcp", arm.now)
    arm.move_to_joints(goal, 0.5)
    path = arm.paths[-1].waypoints
    assert len(path) > 2
    # The rod, in a separate collision world of the test.
    world = CollisionWorld()
    world.add_robot("arm", RobotModel.load(URDF), BASE, np.array(READY))
    for name in ("rod", "bin"):
        thing = next(each for each in surroundings.things if each.name == name)
        assert isinstance(thing.model, object_type.Box)
        world.put(name, Box(thing.model.size_x, thing.model.size_y, thing.model.size_z), thing.pose)
    world.attach("rod", "arm", "tcp")
    for a, b in itertools.pairwise(values(waypoint) for waypoint in path):
        for share in np.linspace(0.0, 1.0, 2 + int(np.abs(b - a).max() / 0.005)):
            assert world.is_free("arm", a + share * (b - a))
    # A part held by another robot is an obstacle at the other robot's gripper.
    second = new_arm(folder, surroundings, "second", BASE * Pose(Position(0.0, 1.9, 0.0)))
    surroundings.others = [(arm, arm.now)]
    rod = arm.safe_moves.forward("tcp", arm.now) * Pose(Position(0.0, 0.0, 0.15))
    second.surround(surroundings)
    world.set_joints("arm", values(arm.now))
    assert world.pose("rod").position.distance_to(rod.position) < 0.01
    seen = second.safe_moves._snapshot().obstacles["rod"]
    assert seen.attachment is not None
    assert seen.attachment.robot == "plain"
    # After its release, it stays where it was released.
    at = arm.safe_moves.release("rod", arm.now)
    assert at.position.distance_to(rod.position) < 0.01
    with pytest.raises(NotFound, match="does not hold rod"):
        arm.safe_moves.release("rod", arm.now)
    with pytest.raises(NotFound, match="no collision object"):
        arm.safe_moves.hold("nothing", "tcp", arm.now)
    with pytest.raises(NotFound, match="no link 'claw'"):
        arm.safe_moves.hold("bin", "claw", arm.now)


def test_another_robot_is_an_obstacle(folder: Path, arm: Any, surroundings: FixedSurroundings) -> None:
    beside = BASE * Pose(Position(0.75, 0.0, 0.0), Orientation.from_rotation_vector(0.0, 0.0, np.pi))
    second = new_arm(folder, FixedSurroundings(), "second", beside)
    surroundings.others = [(second, joints((0.0, -1.57, 0.0, -1.57, 0.0, 0.0)))]
    here = arm.get_end_effector_pose("tcp")
    arm.move_to_pose("tcp", moved(here, 0.0, 0.0, 0.02), 0.5)
    surroundings.others = [(second, joints(READY))]
    with pytest.raises(arm.KinematicsException, match=r"plain/.* and second/"):
        arm.move_to_pose("tcp", here, 0.5)


def test_a_missing_mesh_refuses_moves_and_a_present_one_is_considered(
    arm: Any, surroundings: FixedSurroundings, tmp_path: Path
) -> None:
    import trimesh

    surroundings.things.append(Obstacle("shield", object_type.Mesh("shield", "shield.stl"), BASE * Pose(WALL[0])))
    with pytest.raises(Refused, match="mesh of shield is not available"):
        arm.move_to_joints(joints(ACROSS), 0.5)
    surroundings.files["shield.stl"] = tmp_path / "0f3a"
    surroundings.files["shield.stl"].write_bytes(trimesh.creation.box(WALL[1:]).export(file_type="stl"))
    arm.move_to_joints(joints(ACROSS), 0.5)
    surroundings.things = []
    surroundings.box("wall", *WALL)
    assert_free(arm, surroundings, arm.paths[-1].waypoints)


def test_an_uploaded_model_takes_precedence(arm: Any, surroundings: FixedSurroundings, tmp_path: Path) -> None:
    longer = tmp_path / "88c1"
    text = URDF.read_text().replace('xyz="0 0 0.0996"', 'xyz="0 0 0.1996"')
    assert text != URDF.read_text()
    longer.write_text(text)
    surroundings.files["plain_arm.zip"] = longer
    tip = (BASE.inverted() * arm.get_end_effector_pose("tcp")).position
    nominal = RobotModel.load(URDF).arm("tcp").pose(np.array(READY)).position
    assert nominal.distance_to(tip) == pytest.approx(0.1, abs=1e-6)


def test_a_missing_model_is_reported(folder: Path, surroundings: FixedSurroundings) -> None:
    cls = importlib.import_module("plain_driver.plain_arm").PlainArm
    other = type("Nameless", (cls,), {"urdf_package_name": "missing.zip", "__module__": cls.__module__})
    device = other("id", "nameless", BASE)
    with pytest.raises(Refused, match="nameless has no URDF model"):
        device.get_end_effectors_ids()


# ------------------------------------------------------------------------------------------------ time limits and stops
def test_a_path_can_be_sampled_over_time(arm: Any, surroundings: FixedSurroundings) -> None:
    surroundings.box("wall", *WALL)
    arm.move_to_joints(joints(ACROSS), 0.5)
    path = arm.paths[-1]
    timed = path.timed()
    limits = RobotModel.load(URDF).velocity
    rates = np.array([velocity for _, _, velocity in timed.sampled(0.01)])
    assert (np.abs(rates).max(axis=0) <= 0.5 * limits * 1.001).all()
    assert np.allclose(timed.at(timed.duration)[0], ACROSS)
    assert_free(arm, surroundings, [joints(tuple(q)) for _, q, _ in timed.sampled(0.02)])
    arm.now = joints(READY)
    arm.move_to_pose("tcp", moved(arm.get_end_effector_pose("tcp"), 0.0, 0.25, 0.0), 1.0, safe=False)
    assert arm.paths[-1].timed(0.05).duration == pytest.approx(0.25 / 0.05 + 0.25, rel=0.1)


def fences(surroundings: FixedSurroundings) -> None:
    """Put plates on both sides of the base, higher than the arm, so that its shoulder cannot turn past them."""
    for side in (-1.0, 1.0):
        surroundings.box(f"fence {side:+.0f}", Position(0.0, side * 0.68, 0.5), 0.02, 1.06, 3.0)


BEFORE, BEHIND = (0.8, *READY[1:]), (0.8 + np.pi, *READY[1:])


def test_a_move_without_a_path_is_refused(
    arm: Any, surroundings: FixedSurroundings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(safe_moves, "PLANNING_TIMEOUT", 0.3)
    fences(surroundings)
    arm.now = joints(BEFORE)
    with pytest.raises(arm.KinematicsException, match=r"plain found no .* within 0\.3 s; .* and fence"):
        arm.move_to_joints(joints(BEHIND), 0.5)
    assert arm.paths == []


def test_a_repeat_after_no_path_has_more_time_and_another_seed(
    arm: Any, surroundings: FixedSurroundings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(safe_moves, "PLANNING_TIMEOUT", 0.05)
    seeds: list[int] = []
    plan = planner.Planner.to_any

    def recorded(*args: Any, seed: int, **options: Any) -> Any:
        seeds.append(seed)
        return plan(*args, seed=seed, **options)

    monkeypatch.setattr(planner.Planner, "to_any", recorded)
    fences(surroundings)
    arm.now = joints(BEFORE)
    for within in (r"0\.05", r"0\.1", r"0\.2", r"0\.2"):
        with pytest.raises(arm.KinematicsException, match=f"within {within} s"):
            arm.move_to_joints(joints(BEHIND), 0.5)
    assert seeds == [0, 1, 2, 3]
    arm.move_to_joints(joints((0.9, *READY[1:])), 0.5)
    assert seeds[-1] == 0
    with pytest.raises(arm.KinematicsException, match=r"within 0\.05 s"):
        arm.move_to_joints(joints((0.9 + np.pi, *READY[1:])), 0.5)
    surroundings.things.clear()
    arm.move_to_joints(joints(BEHIND), 0.5)
    assert seeds[-1] == 4
    assert len(arm.paths) == 2


class StepClock:
    """A clock that advances by a second whenever it is read, so that time limits are numbers of steps of the search."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        self.now += 1.0
        return self.now


def test_a_repeat_finds_a_path_that_was_not_found_in_time(
    arm: Any, surroundings: FixedSurroundings, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seed 0 needs 152 steps and seed 1 needs 50: the repeat needs another seed as well as more time."""
    monkeypatch.setattr(planner, "time", StepClock())
    monkeypatch.setattr(safe_moves, "PLANNING_TIMEOUT", 42.0)
    surroundings.box("wall", *WALL)
    start, goal = joints((2.3, -1.2, *READY[2:])), joints(READY)
    plan = planner.Planner.to_any
    for forced in ({"seed": 0, "within": 84.0}, {"seed": 1, "within": 42.0}):
        other = new_arm(folder, surroundings, "other")
        other.now = start
        with monkeypatch.context() as only:
            only.setattr(planner.Planner, "to_any", lambda *a, forced=forced, **options: plan(*a, **options | forced))
            with pytest.raises(other.KinematicsException, match="found no collision-free path"):
                other.move_to_joints(goal, 0.5)
    arm.now = start
    with pytest.raises(arm.KinematicsException, match="within 42 s"):
        arm.move_to_joints(goal, 0.5)
    assert arm.paths == []
    arm.move_to_joints(goal, 0.5)
    assert np.allclose(values(arm.now), READY)
    assert_free(arm, surroundings, arm.paths[-1].waypoints)


def test_a_stop_ends_planning(arm: Any, surroundings: FixedSurroundings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(safe_moves, "PLANNING_TIMEOUT", 60.0)
    fences(surroundings)
    arm.now = joints(BEFORE)
    ended: list[BaseException] = []

    def move() -> None:
        try:
            arm.move_to_joints(joints(BEHIND), 0.5)
        except BaseException as error:
            ended.append(error)

    thread = threading.Thread(target=move)
    thread.start()
    try:
        while not arm.move_in_progress:
            time.sleep(0.001)
        time.sleep(0.3)
        assert arm.move_in_progress
    finally:
        arm.stop()
        thread.join(30.0)
    assert [type(error) for error in ended] == [Cancelled]
    assert arm.paths == []


def test_a_second_move_is_refused_during_a_move(arm: Any) -> None:
    def follow(_: Any) -> None:
        with pytest.raises(Refused, match="moving already"):
            arm.move_to_joints(joints(READY), 0.5)

    arm.follow = follow
    arm.move_to_joints(joints(ACROSS), 0.5)
    assert not arm.move_in_progress

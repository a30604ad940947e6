"""Monitoring of safe moves: the robot stops before an obstacle that enters its path, and names it."""

import itertools
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import Cancelled, PathBlocked
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Box
from arcor2_hw.objects.path_monitor import rest_of
from arcor2_hw.objects.surroundings import HeldPart, Obstacle

from .conftest import ACROSS, BASE, READY, URDF, FixedSurroundings, joints, moved, new_arm, values

STEP = 0.005
SPEED = 1.0
"""Speed of the fastest joint, rad/s."""


class Motion:
    """Move a simple arm with a constant speed, and brake after a stop."""

    def __init__(self, arm: Any, braking: float = 0.05) -> None:
        self.arm, self.braking = arm, braking
        self.at: tuple[float, Callable[[], None]] | None = None
        """Value of the first joint at which an action is executed once."""
        self.stops = 0
        self._stopped = threading.Event()
        self._stop = arm.stop
        arm.follow, arm.stop = self.follow, self.stop

    def stop(self) -> None:
        self.stops += 1
        self._stop()
        self._stopped.set()

    def follow(self, path: Any) -> None:
        left = self.braking
        self._stopped.clear()
        for a, b in itertools.pairwise(values(waypoint) for waypoint in path.waypoints):
            count = max(1, int(np.ceil(np.abs(b - a).max() / (SPEED * STEP))))
            for number in range(1, count + 1):
                self.arm.now = joints(tuple(a + number / count * (b - a)))
                if self.at is not None and self.arm.now[0].value >= self.at[0]:
                    done, self.at = self.at[1], None
                    done()
                if self._stopped.is_set():
                    left -= SPEED * STEP
                    if left <= 0.0:
                        raise Cancelled("stopped")
                time.sleep(STEP)


@pytest.fixture
def motion(arm: Any) -> Motion:
    return Motion(arm)


def tip_at(arm: Any, pan: float) -> Position:
    """Return the position of the tool in the robot's base for a value of the first joint."""
    position: Position = (BASE.inverted() * arm.forward_kinematics("tcp", joints((pan, *READY[1:])))).position
    return position


def touches(surroundings: FixedSurroundings, now: Any) -> set[str]:
    """Return the contacts of the arm in a separate collision world."""
    world = CollisionWorld()
    world.add_robot("arm", RobotModel.load(URDF), BASE, values(now))
    for thing in surroundings.things:
        box = thing.model
        assert isinstance(box, object_type.Box)
        world.put(thing.name, Box(box.size_x, box.size_y, box.size_z), thing.pose)
    return {contact.second for contact in world.contacts("arm", values(now))}


def test_the_robot_stops_before_a_box_that_enters_its_path(
    arm: Any, surroundings: FixedSurroundings, motion: Motion
) -> None:
    surroundings.box("shelf", Position(0.0, 0.0, 1.6), 0.2, 0.2, 0.1)
    at = tip_at(arm, 1.8)
    motion.at = 0.3, lambda: surroundings.box("crate", at, 0.1, 0.1, 0.1)
    with pytest.raises(
        PathBlocked, match=r"plain stopped: crate came into its path; plain/\w+ and crate would collide"
    ):
        arm.move_to_joints(joints(ACROSS), 0.5)
    assert motion.stops == 1
    assert 0.3 < arm.now[0].value < 1.5
    assert touches(surroundings, arm.now) == set()
    # The next move leads around it.
    arm.follow = lambda path: setattr(arm, "now", path.waypoints[-1])
    arm.move_to_joints(joints(ACROSS), 0.5)
    assert np.allclose(values(arm.now), ACROSS)


def test_a_linear_move_stops_before_an_obstacle_that_enters_it(
    arm: Any, surroundings: FixedSurroundings, motion: Motion
) -> None:
    here = arm.get_end_effector_pose("tcp")
    post = (BASE.inverted() * moved(here, 0.0, 0.3, 0.0)).position
    surroundings.box("post", post + Position(0.0, 0.0, 3.0), 0.03, 0.03, 0.3)

    def lower() -> None:
        surroundings.things[0].pose.position.z -= 3.0  # in place, as a program may

    motion.at = 0.02, lower
    with pytest.raises(PathBlocked, match="post came into its path"):
        arm.move_to_pose("tcp", moved(here, 0.0, 0.4, 0.0), 0.5)
    assert touches(surroundings, arm.now) == set()


def test_an_obstacle_within_the_braking_distance_is_reported(arm: Any, surroundings: FixedSurroundings) -> None:
    motion = Motion(arm, braking=0.4)
    motion.at = 0.8, lambda: surroundings.box("crate", tip_at(arm, 1.25), 0.1, 0.1, 0.1)
    with pytest.raises(PathBlocked, match=r"crate appeared within its braking distance: plain/\w+ and crate are in"):
        arm.move_to_joints(joints(ACROSS), 0.5)
    assert motion.stops == 1
    assert touches(surroundings, arm.now) == {"crate"}


def test_an_obstacle_outside_the_rest_of_the_path_is_ignored(
    arm: Any, surroundings: FixedSurroundings, motion: Motion
) -> None:
    def change() -> None:
        surroundings.box("behind", tip_at(arm, 0.3), 0.1, 0.1, 0.1)
        surroundings.box("above", tip_at(arm, 1.2) + Position(0.0, 0.0, 0.8), 0.1, 0.1, 0.1)
        surroundings.things = surroundings.things[1:]  # an obstacle that existed before is removed

    surroundings.box("gone", tip_at(arm, -1.5), 0.1, 0.1, 0.1)
    motion.at = 1.0, change
    arm.move_to_joints(joints((1.3, *READY[1:])), 0.5)
    assert motion.stops == 0
    assert arm.now[0].value == pytest.approx(1.3)


def test_the_robot_stops_before_another_arm_that_enters_its_path(
    folder: Path, arm: Any, surroundings: FixedSurroundings, motion: Motion
) -> None:
    second = new_arm(folder, FixedSurroundings(), "second", BASE * Pose(Position(0.0, 0.95, 0.0)))
    away, over = joints((1.57, *READY[1:])), joints((-1.57, *READY[1:]))
    surroundings.others = [(second, away)]

    def swing() -> None:
        surroundings.others = [(second, over)]

    motion.at = 0.2, swing
    with pytest.raises(PathBlocked, match=r"second/\w+ came into its path"):
        arm.move_to_joints(joints((1.57, *READY[1:])), 0.5)
    # An obstacle whose pose becomes unknown stays at its last pose.
    arm.now = joints(READY)
    surroundings.others = [(second, away)]

    def lose_signal() -> None:
        surroundings.unknown = "second"

    motion = Motion(arm)
    motion.at = 0.2, lose_signal
    arm.move_to_joints(joints((0.6, *READY[1:])), 0.5)
    assert motion.stops == 0


def test_a_part_gripped_during_the_move_is_considered(
    arm: Any, surroundings: FixedSurroundings, motion: Motion
) -> None:
    surroundings.box("bin", tip_at(arm, 1.8) + Position(0.0, 0.0, -0.3), 0.06, 0.06, 0.1)
    rod = HeldPart("rod", "tcp", Pose(Position(0.0, 0.0, 0.15)), object_type.Box("rod", 0.03, 0.03, 0.28))
    motion.at = 0.3, lambda: arm.hold_part(rod)
    with pytest.raises(PathBlocked, match="bin came into its path; rod and bin would collide"):
        arm.move_to_joints(joints(ACROSS), 0.5)


def test_the_robot_stops_if_its_path_cannot_be_checked(
    arm: Any, surroundings: FixedSurroundings, motion: Motion
) -> None:
    shield = Obstacle("shield", object_type.Mesh("shield", "shield.stl"), BASE)
    motion.at = 0.3, lambda: surroundings.things.append(shield)
    with pytest.raises(PathBlocked, match=r"plain stopped: its surroundings changed.*mesh of shield"):
        arm.move_to_joints(joints(ACROSS), 0.5)
    assert arm.now[0].value < 1.5


def test_a_user_stop_remains_cancelled_and_unsafe_moves_are_not_monitored(
    arm: Any, surroundings: FixedSurroundings, motion: Motion
) -> None:
    motion.at = 0.3, arm.stop
    with pytest.raises(Cancelled):
        arm.move_to_joints(joints(ACROSS), 0.5)
    arm.now = joints(READY)
    motion = Motion(arm)
    motion.at = 0.1, lambda: surroundings.box("crate", tip_at(arm, 0.5), 0.1, 0.1, 0.1)
    arm.move_to_joints(joints((0.6, *READY[1:])), 0.5, safe=False)
    assert motion.stops == 0
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("path of")]


def test_the_rest_of_a_path_starts_at_the_current_joints() -> None:
    points = [np.array(each) for each in ([0.0, 0.0], [1.0, 0.0], [1.0, 1.0])]
    levers = np.ones(2)
    for q, left in (([0.0, 0.0], 3), ([0.5, 0.01], 3), ([1.0, 0.4], 2), ([1.0, 1.1], 2)):
        rest = rest_of(points, np.array(q), levers)
        assert len(rest) == left
        assert (rest[0] == q).all()
        assert (rest[-1] == points[-1]).all()

"""A gripped part is attached to the robot: safe moves keep it clear of obstacles until it is released or lost."""

from typing import Any

import numpy as np
import pytest

from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import NotFound
from arcor2_hw.objects import CollisionObject, Generic, Gripper, PartSize, Robot
from arcor2_hw.objects.small import GripperState

from .conftest import BASE, READY, FixedSurroundings, joints, moved


class Claw(Gripper):
    """A gripper that always grips."""

    _ABSTRACT = False

    def activate(self) -> None: ...

    def grip(self, width: float, force: float, speed: float) -> tuple[bool, float]:
        self.attach_part()
        return True, width

    def release(self) -> None:
        self.detach_part()

    def state(self) -> GripperState:
        return GripperState.HOLDING


class Board(CollisionObject):
    """A part to grip."""

    _ABSTRACT = False


@pytest.fixture
def board(arm: Any) -> Board:
    below = Pose(Position(0.0, 0.0, 0.15))
    model = object_type.Box("Board", 0.03, 0.03, 0.28)
    return Board("board_id", "board", arm.get_end_effector_pose("tcp") * below, model)


@pytest.fixture
def claw(arm: Any, board: Board) -> Claw:
    objects: dict[str, Generic] = {"plain": arm, "board": board}

    def find(name: str) -> Generic:
        if name not in objects:
            raise NotFound(f"the scene has no object {name}")
        return objects[name]

    def robot(name: str) -> Robot:
        assert name == ""
        assert isinstance(arm, Robot)
        return arm

    claw = Claw("claw_id", "claw")
    claw.mount(find, robot)
    return claw


def below_tip(surroundings: FixedSurroundings, arm: Any) -> Any:
    """Put a bin below a sideways line, so that only a long part touches it. Return the target."""
    here = arm.get_end_effector_pose("tcp")
    target = moved(here, 0.0, 0.25, 0.0)
    at = (BASE.inverted() * target).position
    surroundings.box("bin", at + Position(0.0, 0.0, -0.2), 0.06, 0.06, 0.1)
    return target


def line(arm: Any, target: Pose) -> None:
    arm.now = joints(READY)
    arm.move_to_pose("tcp", target, 0.5)


def test_a_gripped_part_is_considered_until_released(arm: Any, surroundings: FixedSurroundings, claw: Claw) -> None:
    target = below_tip(surroundings, arm)
    claw.grip(0.0, 1.0, 1.0)
    line(arm, target)  # of an unknown size
    claw.set_part(0.03, 0.03, 0.28, 0.14)
    claw.grip(0.0, 1.0, 1.0)
    with pytest.raises(arm.KinematicsException, match="part of claw and bin"):
        line(arm, target)
    assert [pair for pair in arm.safe_moves.contacts(values_of(arm, target)) if "part of claw" in pair]
    claw.release()
    line(arm, target)
    claw.release()  # no effect without a part
    assert arm.parts == {}


def values_of(arm: Any, target: Pose) -> Any:
    return arm.inverse_kinematics("tcp", target, joints(READY), avoid_collisions=False)


def test_an_object_of_the_scene_moves_with_the_tool(
    arm: Any, surroundings: FixedSurroundings, claw: Claw, board: Board
) -> None:
    target = below_tip(surroundings, arm)
    surroundings.box("board", (BASE.inverted() * board.pose).position, 0.03, 0.03, 0.28)
    surroundings.things[-1].pose.orientation = board.pose.orientation
    with pytest.raises(NotFound, match="no object lid"):
        claw.set_part_object("lid")
    with pytest.raises(NotFound, match="plain: the scene has no collision object"):
        claw.set_part_object("plain")
    claw.set_part_object("board")
    claw.grip(0.0, 1.0, 1.0)
    with pytest.raises(arm.KinematicsException, match="board and bin"):
        line(arm, target)
    arm.now = joints((0.5, *READY[1:]))
    expected = arm.get_end_effector_pose("tcp") * Pose(Position(0.0, 0.0, 0.15))
    claw.release()
    assert np.allclose(board.pose.matrix(), expected.matrix(), atol=1e-9)
    line(arm, moved(target, 0.0, -0.1, 0.0))
    claw.grip(0.0, 1.0, 1.0)
    assert arm.parts == {}, "only the next grip takes the object"


def test_a_gripped_part_may_touch_the_surface_below(arm: Any, surroundings: FixedSurroundings, claw: Claw) -> None:
    here = arm.get_end_effector_pose("tcp")
    at = (BASE.inverted() * here).position
    surroundings.box("table", at + Position(0.0, 0.0, -0.07), 0.3, 0.3, 0.1)  # its top 20 mm below the tip
    claw.set_part(0.03, 0.03, 0.04)
    claw.grip(0.0, 1.0, 1.0)
    arm.move_to_pose("tcp", moved(here, 0.0, 0.0, 0.1), 0.5)
    arm.move_to_pose("tcp", here, 0.5)
    claw.set_part(0.03, 0.03, 0.06)
    claw.grip(0.0, 1.0, 1.0)
    with pytest.raises(arm.KinematicsException, match="part of claw and table"):
        arm.move_to_pose("tcp", moved(here, 0.0, 0.0, 0.1), 0.5)


def test_a_part_hangs_below_a_suction_cup(arm: Any, claw: Claw) -> None:
    claw.set_part(0.1, 0.08, 0.02)
    for hanging, middle in ((False, 0.0), (True, 0.01)):
        claw.attach_part(hanging=hanging)
        (part,) = arm.parts.values()
        assert part.in_link.position == Position(0.0, 0.0, middle)
    box = part.model
    assert isinstance(box, object_type.Box)
    assert (box.size_x, box.size_y, box.size_z) == pytest.approx((0.096, 0.076, 0.016))
    claw.set_part(0.0, 0.0, 0.0)
    claw.attach_part(PartSize(0.04, 0.04, 0.02, -0.01))
    (part,) = arm.parts.values()
    assert part.in_link.position.z == -0.01


def test_gripping_succeeds_without_a_known_robot(claw: Claw) -> None:
    def none(name: str) -> Robot:
        raise NotFound("the scene has 2 robots")

    claw.set_part(0.1, 0.1, 0.1)
    claw.mount(lambda name: claw, none)
    assert claw.grip(0.0, 1.0, 1.0)[0]
    claw.release()

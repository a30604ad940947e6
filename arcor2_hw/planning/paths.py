"""Geometric paths: straight lines of an end effector.

A path is a list of waypoints, joint values of the arm. Between two of them all joints move in proportion.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from arcor2_hw.collision.sweep import Sweep
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.kinematics.arm import NEAR_SINGULAR, Arm
from arcor2_hw.kinematics.errors import MotionInCollision, NoStraightLine
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.shapes import Array
from arcor2_hw.messages import Message

OFF_LINE: Final = 0.0005
"""Maximum distance of the end effector from its line between two waypoints, m."""
OFF_TURN: Final = 0.005
"""Maximum deviation of the orientation from its interpolation between two waypoints, rad."""
PIECE: Final = 0.05
"""Length of a line between two waypoints before it is subdivided where needed, m."""
TURN: Final = 0.2
"""Rotation between two waypoints before it is subdivided where needed, rad."""
_HALVINGS: Final = 10


def interpolate(a: Pose, b: Pose, share: float) -> Pose:
    """Return the pose at a share (0 to 1) of the line from `a` to `b`, with a rotation about one axis."""
    turn = (a.orientation.inverted() * b.orientation).rotation_vector()
    rotated = a.orientation * Orientation.from_rotation_vector(*(share * part for part in turn))
    start, way = a.position, b.position - a.position
    return Pose(Position(start.x + share * way.x, start.y + share * way.y, start.z + share * way.z), rotated)


def straight_line(arm: Arm, start: Array, target: Array, name: str = "") -> list[Array]:
    """Compute waypoints that move the end effector in a straight line.

    Between waypoints the end effector stays within OFF_LINE and OFF_TURN of the line.

    Args:
        arm: The arm.
        start: Joint values at the start.
        target: Pose at the end, (4, 4), in the frame of the model's root link.
        name: Name of the robot in messages.

    Raises:
        OutOfReach: The target is out of reach.
        NoStraightLine: The line is interrupted; the message says where, and whether by reach, a limit or a singularity.
    """
    return _Line(arm, start, Pose.from_matrix(target), name or arm.model.name).waypoints(start)


class _Line:
    def __init__(self, arm: Arm, start: Array, target: Pose, name: str) -> None:
        self._arm, self._inverse, self._name = arm, InverseKinematics(arm), name
        self._from, self._to = arm.pose(start), target
        self._length = self._from.position.distance_to(target.position)
        self._turns = int(np.count_nonzero(arm.rows >= 3)) == 3
        if not self._turns:  # a rotation is not commanded: it follows from the position
            self._from = Pose(self._from.position, target.orientation)

    def waypoints(self, start: Array) -> list[Array]:
        angle = self._from.orientation.angle_to(self._to.orientation) if self._turns else 0.0
        count = max(1, int(np.ceil(self._length / PIECE)), int(np.ceil(angle / TURN)))
        way, before = [start], 0.0
        if next(self._inverse.candidates(self._to.matrix(), start), None) is None:
            self._inverse.solve(self._to.matrix(), start)  # raises
        for number in range(1, count + 1):
            share = number / count
            way += self._piece(way[-1], before, share, _HALVINGS)
            before = share
        return way

    def _piece(self, q: Array, here: float, there: float, halvings: int) -> list[Array]:
        """Return the waypoints after `q`, which is at the share `here`, up to the share `there`."""
        pose = interpolate(self._from, self._to, there)
        after = next(self._inverse.candidates(pose.matrix(), q), None)
        if after is not None and self._keeps((q + after) / 2.0, (here + there) / 2.0):
            return [after]
        if halvings == 0:
            raise NoStraightLine(self._why(q, there, after), f"at {there:.3f} of the path")
        middle = (here + there) / 2.0
        first = self._piece(q, here, middle, halvings - 1)
        return first + self._piece(first[-1], middle, there, halvings - 1)

    def _keeps(self, q: Array, share: float) -> bool:
        at, wanted = self._arm.pose(q), interpolate(self._from, self._to, share)
        if at.position.distance_to(wanted.position) > OFF_LINE:
            return False
        return not self._turns or at.orientation.angle_to(wanted.orientation) <= OFF_TURN

    def _why(self, q: Array, share: float, after: Array | None) -> Message:
        if near := self._arm.near_limits(q):
            return Message.of(
                "{name} cannot go straight: {distance:.3f} m along its line {joints} would leave its limit."
                if len(near) == 1
                else "{name} cannot go straight: {distance:.3f} m along its line {joints} would leave their limits.",
                name=self._name,
                distance=share * self._length,
                joints=", ".join(near),
            )
        if self._arm.smallest(q) < NEAR_SINGULAR:
            text = (
                "{name} cannot go straight: {distance:.3f} m along its line it reaches a singularity, where joints "
                "would have to flip."
            )
        elif after is None:
            text = "{name} cannot go straight: {distance:.3f} m along its line the line is out of reach."
        else:
            text = "{name} cannot go straight: {distance:.3f} m along its line joints would have to flip."
        return Message.of(text, name=self._name, distance=share * self._length)


def free_line(sweep: Sweep, start: Array, target: Array, name: str = "") -> list[Array]:
    """Compute waypoints of a straight line that is free of collision.

    Args:
        sweep: Collision checks of the arm.
        start: Joint values at the start.
        target: Pose at the end, (4, 4), in the frame of the model's root link.
        name: Name of the robot in messages.

    Raises:
        OutOfReach: The target is out of reach.
        NoStraightLine: The line is interrupted.
        MotionInCollision: The line meets an obstacle; the message names both parts and the place.
    """
    name = name or sweep.arm.model.name
    way = straight_line(sweep.arm, start, target, name)
    require_free(sweep, way, name)
    return way


def require_free(sweep: Sweep, way: Sequence[Array], name: str) -> None:
    """Require that a path is free of collision.

    Raises:
        MotionInCollision: It meets an obstacle; the message names both parts and the place.
    """
    if (hit := sweep.first_hit(way)) is not None:
        length = float(np.linalg.norm(sweep.arm.forward(way[-1])[:3, 3] - sweep.arm.forward(way[0])[:3, 3]))
        raise MotionInCollision(
            "{name} cannot go straight: {distance:.3f} m along its line it is in collision: {what}.",
            name=name,
            distance=hit.share * length,
            what=hit.what,
        )

"""Geometric paths: straight lines of an end effector.

A path is a list of waypoints, joint values of the arm. Between two of them all joints move in proportion.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import pinocchio as pin

from arcor2_hw.collision.sweep import Sweep
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.kinematics.arm import NEAR_SINGULAR, Arm
from arcor2_hw.kinematics.errors import MotionInCollision, NoStraightLine
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.shapes import Array

LINE_TOLERANCE: Final = 0.0005
"""Maximum distance of the end effector from its line between two waypoints, m."""
ORIENTATION_TOLERANCE: Final = 0.005
"""Maximum deviation of the orientation from its interpolation between two waypoints, rad."""
MAX_SEGMENT_LENGTH: Final = 0.05
"""Length of a line between two waypoints before it is subdivided where needed, m."""
MAX_SEGMENT_ROTATION: Final = 0.2
"""Rotation between two waypoints before it is subdivided where needed, rad."""
_HALVINGS: Final = 10


def interpolate(a: Pose, b: Pose, share: float) -> Pose:
    """Return the pose at a share (0 to 1) of the line from `a` to `b`, with a rotation about one axis."""
    turn = (a.orientation.inverted() * b.orientation).rotation_vector()
    rotated = a.orientation * Orientation.from_rotation_vector(*(share * part for part in turn))
    start, way = a.position, b.position - a.position
    return Pose(Position(start.x + share * way.x, start.y + share * way.y, start.z + share * way.z), rotated)


def straight_line(
    arm: Arm,
    start: Array,
    target: Array,
    name: str = "",
    *,
    coarse: float = 1.0,
    inverse: InverseKinematics | None = None,
) -> list[Array]:
    """Compute waypoints that move the end effector in a straight line.

    Between waypoints the end effector stays within LINE_TOLERANCE and ORIENTATION_TOLERANCE of the line.

    Args:
        arm: The arm.
        start: Joint values at the start.
        target: Pose at the end, (4, 4), in the frame of the model's root link.
        name: Name of the robot in messages.
        coarse: Factor on LINE_TOLERANCE and ORIENTATION_TOLERANCE, for fewer waypoints where
            the robot does not follow them.
        inverse: Inverse kinematics of the arm, for callers that compute many lines.

    Raises:
        OutOfReach: The target is out of reach.
        NoStraightLine: The line is interrupted; the message says where, and whether by reach, a limit or a singularity.
    """
    inverse = inverse or InverseKinematics(arm)
    return _Line(inverse, start, target, name or arm.model.name, coarse).waypoints(start)


class _Line:
    """Poses are matrices, because a line has many, and `Pose` is ten times slower."""

    def __init__(self, inverse: InverseKinematics, start: Array, target: Array, name: str, coarse: float) -> None:
        arm = inverse.arm
        self._arm, self._inverse, self._name = arm, inverse, name
        self._off_line, self._trace = coarse * LINE_TOLERANCE, 1.0 + 2.0 * math.cos(coarse * ORIENTATION_TOLERANCE)
        self._longer = math.sqrt(coarse)  # the deviation grows with the square of the distance between waypoints
        self._to = target
        self._from = arm.forward(start).copy()
        self._way = target[:3, 3] - self._from[:3, 3]
        self._length = float(np.linalg.norm(self._way))
        self._turns = int(np.count_nonzero(arm.rows >= 3)) == 3
        if not self._turns:  # a rotation is not commanded: it follows from the position
            self._from[:3, :3] = target[:3, :3]
        self._turn = pin.log3(self._from[:3, :3].T @ target[:3, :3])

    def _pose(self, share: float) -> Array:
        """Return the pose at a share (0 to 1) of the line, with a rotation about one axis."""
        pose = self._from.copy()
        pose[:3, :3] = pose[:3, :3] @ pin.exp3(share * self._turn)
        pose[:3, 3] += share * self._way
        return pose

    def waypoints(self, start: Array) -> list[Array]:
        angle = float(np.linalg.norm(self._turn)) if self._turns else 0.0
        count = max(
            1,
            math.ceil(self._length / (self._longer * MAX_SEGMENT_LENGTH)),
            math.ceil(angle / (self._longer * MAX_SEGMENT_ROTATION)),
        )
        way, before = [start], 0.0
        if next(self._inverse.candidates(self._to, start), None) is None:
            self._inverse.solve(self._to, start)  # raises
        for number in range(1, count + 1):
            share = number / count
            way += self._piece(way[-1], before, share, _HALVINGS)
            before = share
        return way

    def _piece(self, q: Array, here: float, there: float, halvings: int) -> list[Array]:
        """Return the waypoints after `q`, which is at the share `here`, up to the share `there`."""
        after = next(self._inverse.candidates(self._pose(there), q), None)
        if after is not None and self._keeps((q + after) / 2.0, (here + there) / 2.0):
            return [after]
        if halvings == 0:
            raise self._interrupted(q, there, after)
        middle = (here + there) / 2.0
        first = self._piece(q, here, middle, halvings - 1)
        return first + self._piece(first[-1], middle, there, halvings - 1)

    def _keeps(self, q: Array, share: float) -> bool:
        at, wanted = self._arm.forward(q), self._pose(share)
        if math.dist(at[:3, 3].tolist(), wanted[:3, 3].tolist()) > self._off_line:
            return False
        return not self._turns or float(np.vdot(at[:3, :3], wanted[:3, :3])) >= self._trace

    def _interrupted(self, q: Array, share: float, after: Array | None) -> NoStraightLine:
        near = self._arm.near_limits(q)
        if near:
            text = "{name} cannot go straight: after {distance:.3f} m of its line, {joints} would leave the limits."
        elif self._arm.smallest(q) < NEAR_SINGULAR:
            text = (
                "{name} cannot go straight: after {distance:.3f} m, its line passes a singularity, where joints would "
                "have to flip."
            )
        elif after is None:
            text = "{name} cannot go straight: after {distance:.3f} m, its line is out of reach."
        else:
            text = "{name} cannot go straight: after {distance:.3f} m of its line, joints would have to flip."
        detail = f"at {share:.3f} of the path"
        return NoStraightLine(text, detail, name=self._name, distance=share * self._length, joints=", ".join(near))


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


def require_free(sweep: Sweep, path: Sequence[Array], name: str) -> None:
    """Require that a path is free of collision.

    Raises:
        MotionInCollision: It meets an obstacle; the message names both parts and the place.
    """
    if (hit := sweep.first_hit(path)) is not None:
        length = float(np.linalg.norm(sweep.arm.forward(path[-1])[:3, 3] - sweep.arm.forward(path[0])[:3, 3]))
        raise MotionInCollision(
            "{name} cannot go straight: {distance:.3f} m along its line it is in collision: {what}.",
            name=name,
            distance=hit.share * length,
            what=hit.what,
        )

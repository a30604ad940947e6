"""Errors of robot models and meshes, and reasons why a pose cannot be reached."""

from typing import ClassVar

from arcor2_hw.exceptions import InvalidData, KinematicsError


class ModelError(InvalidData):
    """A robot model cannot be used; the message names the link, joint or file."""

    code: ClassVar[str] = "robot_model"


class UnsafeDescription(ModelError):
    """A package or URDF is rejected for safety: a path outside of it, an XML entity, or its size."""

    code = "unsafe_description"


class MissingMesh(ModelError):
    """A URDF refers to a mesh that is not in its package."""

    code = "missing_mesh"


class BadMesh(ModelError):
    """A mesh cannot be used: unknown format, too large, not finite, empty or flat."""

    code = "bad_mesh"


class JointLoop(ModelError):
    """The joints of a URDF form a loop."""

    code = "joint_loop"


class ZeroLength(ModelError):
    """A shape has a size of zero, or two joints rotate about the same axis."""

    code = "zero_length"


class OutOfReach(KinematicsError):
    """No joint values within the limits reach the pose."""

    code = "out_of_reach"


class OnlyInCollision(KinematicsError):
    """All joint values found for the pose are in collision; the message names a contact."""

    code = "in_collision"


class StartInCollision(KinematicsError):
    """The robot is in collision at its present joint values; the message names a contact."""

    code = "start_in_collision"


class GoalInCollision(KinematicsError):
    """The robot would be in collision at the target; the message names a contact."""

    code = "goal_in_collision"


class MotionInCollision(KinematicsError):
    """A prescribed motion would lead to a collision; the message names a contact."""

    code = "motion_in_collision"


class NoPath(KinematicsError):
    """No collision-free path was found in time. There may be one."""

    code = "no_path"


class NoStraightLine(KinematicsError):
    """The end effector cannot move straight to a pose: part of the line is out of reach, or passes a singularity."""

    code = "no_straight_line"

"""What can be wrong with a robot's description or a mesh, and why there are no joints for a pose."""

from typing import ClassVar

from arcor2_hw.exceptions import InvalidData, KinematicsError


class ModelError(InvalidData):
    """A robot's description cannot be used; the message names the link, joint or file."""

    code: ClassVar[str] = "robot_model"


class UnsafeDescription(ModelError):
    """A package or description is refused before it is read: a path that leaves it, an entity, too large."""

    code = "unsafe_description"


class MissingMesh(ModelError):
    """A description names a mesh that is not in its package."""

    code = "missing_mesh"


class BadMesh(ModelError):
    """A mesh cannot be used: no mesh, too large, numbers that are not finite, nothing in it, flat."""

    code = "bad_mesh"


class JointLoop(ModelError):
    """The joints of a description close a loop, so that there is no way from the base to the links in it."""

    code = "joint_loop"


class ZeroLength(ModelError):
    """A link has a shape without extent, or none of the length that its joints need."""

    code = "zero_length"


class OutOfReach(KinematicsError):
    """No joints within the limits bring the end effector to the pose."""

    code = "out_of_reach"


class OnlyInCollision(KinematicsError):
    """All joints found that reach the pose are in collision; the message names a pair."""

    code = "in_collision"


class StartInCollision(KinematicsError):
    """A robot is in collision, by what is known, where it stands; the message names a pair."""

    code = "start_in_collision"


class GoalInCollision(KinematicsError):
    """A robot would be in collision with the joints that are asked for; the message names a pair."""

    code = "goal_in_collision"


class MotionInCollision(KinematicsError):
    """A motion that must go as it was asked for would lead into something; the message names a pair."""

    code = "motion_in_collision"


class NoPath(KinematicsError):
    """No way free of collision was found in the time given; there may be one."""

    code = "no_path"


class NoStraightLine(KinematicsError):
    """An end effector cannot be led straight to a pose: out of reach on the way, or joints would have to turn over."""

    code = "no_straight_line"

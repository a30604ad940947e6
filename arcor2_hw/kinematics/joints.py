"""The joints of a robot that take values, and arrays of their values."""

from collections.abc import Iterable, Sequence

import numpy as np

from arcor2_hw.data import robot
from arcor2_hw.kinematics.description import Joint
from arcor2_hw.kinematics.errors import ModelError
from arcor2_hw.kinematics.shapes import Array


class JointSet:
    """Joints that take values: neither fixed nor mimicking. Values are arrays in their order, rad or m.

    Attributes:
        name: Name of the robot.
        joints: The joints, from the root outwards.
        joint_names: Their names.
        lower: Lower limits, rad or m; infinite for continuous joints.
        upper: Upper limits, rad or m; infinite for continuous joints.
        velocity: Maximum velocities, rad/s or m/s.
    """

    def __init__(self, name: str, joints: Sequence[Joint]) -> None:
        self.name = name
        self.joints = tuple(joints)
        if not self.joints:
            raise ModelError("{name} has no joint that moves.", name=self.name)
        self.joint_names = tuple(joint.name for joint in self.joints)
        self.lower = np.array([joint.lower for joint in self.joints])
        self.upper = np.array([joint.upper for joint in self.joints])
        self.velocity = np.array([joint.velocity for joint in self.joints])
        self._column = {name: number for number, name in enumerate(self.joint_names)}

    def values(self, joints: Iterable[robot.Joint], others: Array | None = None) -> Array:
        """Return the values of named joints in the model's order.

        Unknown joints, such as those of a gripper, are ignored.

        Args:
            joints: Named joint values.
            others: Values of joints that are not named; None: all are required.

        Raises:
            ModelError: A joint is missing, repeated, or not finite.
        """
        found: dict[str, float] = {}
        for joint in joints:
            if joint.name in found:
                raise ModelError("The joint {name} of {owner} is given twice.", name=joint.name, owner=self.name)
            if joint.name in self._column and not np.isfinite(joint.value):
                raise ModelError(
                    "The joint {name} of {owner} must be a finite number, not {value!r}.",
                    name=joint.name,
                    owner=self.name,
                    value=joint.value,
                )
            found[joint.name] = joint.value
        missing = [name for name in self.joint_names if name not in found]
        if missing and others is None:
            raise ModelError("Joints of {name} are missing: {missing}.", name=self.name, missing=", ".join(missing))
        out = np.zeros(len(self.joints)) if others is None else np.array(others, dtype=np.float64)
        for name, number in self._column.items():
            out[number] = found.get(name, out[number])
        return out

    def named(self, q: Array) -> list[robot.Joint]:
        """Return joint values with their names."""
        return [robot.Joint(name, float(value)) for name, value in zip(self.joint_names, q, strict=True)]

    def neutral(self) -> Array:
        """Return zero for each joint, or the limit nearest to it."""
        return np.clip(np.zeros(len(self.joints)), self.lower, self.upper)

"""A URDF description as Pinocchio's tree of joints."""

from typing import Any

import numpy as np
import pinocchio as pin

from arcor2_hw.kinematics.description import Description, Joint
from arcor2_hw.kinematics.shapes import Array


class Tree:
    """Joints that move, including mimicking ones; fixed joints are merged. `base` (4, 4) is the pose of the root.

    Joint values are those of joints that do not mimic.

    Attributes:
        model: Pinocchio's model.
        data: Pinocchio's data.
        bodies: By link, the number of its body in Pinocchio's model (0: the root, which does not move) and the frame of
            the link in it.
    """

    def __init__(self, description: Description, base: Array) -> None:
        self.model: Any = pin.Model()
        self.bodies: dict[str, tuple[int, Array]] = {description.root: (0, np.array(base, dtype=np.float64))}
        moving: list[Joint] = []
        for joint in description.joints:
            body, placement = self.bodies[joint.parent]
            at = placement @ joint.origin
            if joint.kind == "fixed":
                self.bodies[joint.child] = body, at
                continue
            kind = joint_model(np.array(joint.axis), joint.kind == "prismatic")
            self.bodies[joint.child] = self.model.addJoint(body, kind, pin.SE3(at), joint.name), np.eye(4)
            moving.append(joint)
        self.data: Any = self.model.createData()
        leaders = [joint.name for joint in moving if joint.mimic is None]
        self._factors = np.zeros((len(moving), len(leaders)))
        self._offsets = np.zeros(len(moving))
        for row, joint in enumerate(moving):
            mimic = joint.mimic
            self._factors[row, leaders.index(mimic.joint if mimic else joint.name)] = mimic.multiplier if mimic else 1.0
            self._offsets[row] = mimic.offset if mimic else 0.0
        self.has_mimics = len(moving) != len(leaders)

    def expand(self, q: Array) -> Array:
        """Return the values of all joints of Pinocchio's model."""
        return np.asarray(self._factors @ q + self._offsets) if self.has_mimics else q

    @property
    def coupling(self) -> Array:
        """Return the factors (m, n) by which n joints that do not mimic move the m joints of Pinocchio's model."""
        return self._factors

    def frames(self, q: Array) -> dict[str, Array]:
        """Return the frame of each link, (4, 4)."""
        pin.forwardKinematics(self.model, self.data, self.expand(q))
        bodies = [np.array(placement.homogeneous) for placement in self.data.oMi]
        return {link: bodies[body] @ placement for link, (body, placement) in self.bodies.items()}


def joint_model(axis: Array, prismatic: bool) -> Any:
    """Return Pinocchio's model of a joint about, or along, an axis."""
    for number, letter in enumerate("XYZ"):
        if axis[number] == 1.0:
            return getattr(pin, f"JointModel{'P' if prismatic else 'R'}{letter}")()
    return pin.JointModelPrismaticUnaligned(axis) if prismatic else pin.JointModelRevoluteUnaligned(axis)

"""A description as Pinocchio's tree of joints, and on which of its bodies each link sits."""

from typing import Any

import numpy as np
import pinocchio as pin

from arcor2_hw.kinematics.description import Description, Joint
from arcor2_hw.kinematics.shapes import Array


class Tree:
    """Joints that move, mimicking ones too, with fixed joints drawn in; `base` (4, 4) is where the root stands.

    model, data: Pinocchio's. bodies: by link, number of the body in Pinocchio's model (0: the root's, which does not
    move) and the link's frame in it. Joint values are those of the joints that do not mimic.
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
        """Give the values of all joints of Pinocchio's model."""
        return np.asarray(self._factors @ q + self._offsets) if self.has_mimics else q

    @property
    def coupling(self) -> Array:
        """Give by how much (m, n) the n joints that do not mimic move the m joints of Pinocchio's model."""
        return self._factors

    def frames(self, q: Array) -> dict[str, Array]:
        """Give the frame of each link, (4, 4)."""
        pin.forwardKinematics(self.model, self.data, self.expand(q))
        bodies = [np.array(placement.homogeneous) for placement in self.data.oMi]
        return {link: bodies[body] @ placement for link, (body, placement) in self.bodies.items()}


def joint_model(axis: Array, prismatic: bool) -> Any:
    """Give Pinocchio's joint about, or along, an axis."""
    for number, letter in enumerate("XYZ"):
        if axis[number] == 1.0:
            return getattr(pin, f"JointModel{'P' if prismatic else 'R'}{letter}")()
    return pin.JointModelPrismaticUnaligned(axis) if prismatic else pin.JointModelRevoluteUnaligned(axis)

"""The chain of joints from a robot's root link to one end effector: poses, Jacobians, dexterity.

Joint values are arrays in the order of `joint_names`, rad or (prismatic) m. Matrices are homogeneous, (4, 4), in the
frame of the model's root link. Not safe for use by two threads at once.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import pinocchio as pin

from arcor2_hw.data import robot
from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose
from arcor2_hw.kinematics.description import EndEffector
from arcor2_hw.kinematics.errors import ModelError
from arcor2_hw.kinematics.joints import JointSet
from arcor2_hw.kinematics.shapes import Array
from arcor2_hw.kinematics.tree import joint_model

NEAR_SINGULAR: Final = 0.02
"""Smallest singular value (see `Dexterity`) below which a configuration is near a singularity.

For a UR5e this is a wrist within 2° of straight, where 0.1 rad/s of the tool need 250 °/s of a joint, or an elbow
within 9°, where 10 mm/s need 20 °/s.
"""
NEAR_LIMIT: Final = 0.05
"""Distance to a limit below which a joint is near it, rad or m; a twentieth of the range where that is shorter."""


class Step(NamedTuple):
    """One joint of a chain. Its value is factor * q[column] + offset, where q are the joint values of the model.

    Attributes:
        name: Name of the joint.
        origin: Origin in the frame of the previous joint, (4, 4).
        axis: Axis, None for a fixed joint.
        prismatic: Whether it is prismatic.
        column: Index of the model's joint that moves it, -1 for a fixed joint.
        factor: Factor of a mimicking joint.
        offset: Offset of a mimicking joint, rad or m.
    """

    name: str
    origin: Array
    axis: Array | None
    prismatic: bool
    column: int
    factor: float
    offset: float


class Dexterity(Data, frozen=True):
    """Dexterity of an arm in a configuration.

    Attributes:
        manipulability: Yoshikawa's measure, the square root of det(J Jᵀ), of the commanded directions.
        smallest: Smallest singular value of the Jacobian with lengths divided by the arm's length (dimensionless).
        near_singularity: Whether `smallest` is below NEAR_SINGULAR.
    """

    manipulability: float
    smallest: float
    near_singularity: bool


class Arm:
    """The chain to one end effector. Created by `RobotModel.arm`.

    Attributes:
        end_effector: The link, its free directions and tolerances.
        joint_names: Names of the joints of this chain.
        lower: Lower limits, rad or m.
        upper: Upper limits, rad or m.
        velocity: Maximum velocities, rad/s or m/s.
        indices: Indices of these joints in the model.
        length: Length of the chain from its first joint to the tip, m.
        centre: Position of the first joint, (3).
        reach: Maximum distance of the tip from `centre`, m.
    """

    def __init__(self, model: JointSet, end_effector: EndEffector, steps: Sequence[Step], tool: Array) -> None:
        self.model = model
        self.end_effector = end_effector
        self.steps = tuple(steps)
        columns = sorted({step.column for step in steps if step.axis is not None})
        if not columns:
            raise ModelError("{name}: no joint moves {link}.", name=model.name, link=end_effector.link)
        self.indices = np.array(columns)
        self.joint_names = tuple(model.joint_names[column] for column in columns)
        self.lower, self.upper = model.lower[self.indices], model.upper[self.indices]
        self.velocity = model.velocity[self.indices]
        self.dof = len(columns)
        self._build(columns)
        self.set_tool(tool)

    def set_tool(self, tool: Array) -> None:
        """Attach a tool: the pose of its tip in the frame of the end effector, (4, 4)."""
        self.tool = np.array(tool, dtype=np.float64)
        self._pin: Any = pin.Model()
        body = 0
        for origin, axis, prismatic in self._moving:
            body = self._pin.addJoint(body, joint_model(axis, prismatic), pin.SE3(origin), f"{body}")
        tip = pin.SE3(self._behind @ self.tool)
        self._tip = self._pin.addFrame(pin.Frame("tip", body, 0, tip, pin.FrameType.OP_FRAME))
        self._data: Any = self._pin.createData()
        self.tip_in_last = self._behind @ self.tool
        lengths = [float(np.linalg.norm(origin[:3, 3])) for origin, _, _ in self._moving[1:]]
        self.length = max(sum(lengths) + float(np.linalg.norm(self.tip_in_last[:3, 3])), 1e-3)
        self._scale = np.where(self._rows < 3, self.length, 1.0)[:, None]
        self.centre = self._moving[0][0][:3, 3]
        self.reach = self.length + self._slides

    # -------------------------------------------------------------------------------- poses
    def forward(self, q: Array) -> Array:
        """Return the pose of the tip, (4, 4)."""
        if self._factors is not None:
            q = self._factors @ q + self._offsets
        pin.forwardKinematics(self._pin, self._data, q)
        out: Array = pin.updateFramePlacement(self._pin, self._data, self._tip).homogeneous
        return out

    def pose(self, q: Array) -> Pose:
        """Return the pose of the tip."""
        return Pose.from_matrix(self.forward(q))

    def placement(self, q: Array) -> Any:
        """Return the pose of the tip as Pinocchio's SE3, a view that the next call overwrites."""
        if self._factors is not None:
            q = self._factors @ q + self._offsets
        pin.forwardKinematics(self._pin, self._data, q)
        return pin.updateFramePlacement(self._pin, self._data, self._tip)

    # -------------------------------------------------------------------------------- how
    def jacobian(self, q: Array) -> Array:
        """Return the Jacobian (6, n) in the axes of the root link: linear rows (m/s) above angular rows (rad/s)."""
        return self._jacobian(q, pin.LOCAL_WORLD_ALIGNED)

    def jacobian_in_tip(self, q: Array) -> Array:
        """Return the Jacobian (6, n) in the axes of the tip."""
        return self._jacobian(q, pin.LOCAL)

    def _jacobian(self, q: Array, axes: Any) -> Array:
        if self._factors is None:
            out: Array = pin.computeFrameJacobian(self._pin, self._data, q, self._tip, axes)
            return out
        whole = self._factors @ q + self._offsets
        return np.asarray(pin.computeFrameJacobian(self._pin, self._data, whole, self._tip, axes) @ self._factors)

    def dexterity(self, q: Array) -> Dexterity:
        """Return how well the arm moves in a configuration."""
        values = np.linalg.svd(self.jacobian_in_tip(q)[self.rows], compute_uv=False)
        smallest = self.smallest(q)
        return Dexterity(float(np.prod(values)), smallest, smallest < NEAR_SINGULAR)

    def smallest(self, q: Array) -> float:
        """Return the smallest singular value of the Jacobian with lengths divided by the arm's, see `Dexterity`."""
        return float(np.linalg.svd(self.jacobian_in_tip(q)[self.rows] / self._scale, compute_uv=False)[-1])

    @property
    def rows(self) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
        """Return the indices of the commanded directions among x, y, z, rx, ry, rz of the tip."""
        return self._rows

    # -------------------------------------------------------------------------------- joint values
    def of(self, q: Array) -> Array:
        """Select the values of this chain from those of the whole model."""
        return np.asarray(q[self.indices])

    def whole(self, q: Array, others: Array | None = None) -> Array:
        """Return values of all joints of the model: those of this chain, and `others` (default: neutral) elsewhere."""
        out = self.model.neutral() if others is None else np.array(others, dtype=np.float64)
        out[self.indices] = q
        return out

    def values(self, joints: Iterable[robot.Joint]) -> Array:
        """Return the values of this chain from named joints.

        Raises:
            ModelError: A joint is missing or not finite.
        """
        given = {joint.name: joint.value for joint in joints}
        if missing := [name for name in self.joint_names if name not in given]:
            raise ModelError(
                "Joints of {name} are missing: {missing}.", name=self.model.name, missing=", ".join(missing)
            )
        values = np.array([given[name] for name in self.joint_names], dtype=np.float64)
        if not np.isfinite(values).all():
            raise ModelError("The joints of {name} must be finite numbers.", name=self.model.name)
        return values

    def named(self, q: Array) -> list[robot.Joint]:
        """Return joint values with their names."""
        return [robot.Joint(name, float(value)) for name, value in zip(self.joint_names, q, strict=True)]

    def middle(self) -> Array:
        """Return the middle of the range of each joint, zero where the range is infinite."""
        whole = np.isfinite(self.lower) & np.isfinite(self.upper)
        return np.where(whole, (np.where(whole, self.lower, 0.0) + np.where(whole, self.upper, 0.0)) / 2.0, 0.0)

    def within(self, q: Array, slack: float = 1e-9) -> bool:
        """Return whether joint values are within the limits."""
        return bool(((q >= self.lower - slack) & (q <= self.upper + slack)).all())

    def near_limits(self, q: Array) -> list[str]:
        """Return the names of joints that are near a limit or beyond it."""
        margin = np.minimum(NEAR_LIMIT, (self.upper - self.lower) / 20.0)
        near = (q < self.lower + margin) | (q > self.upper - margin)
        return [name for name, is_near in zip(self.joint_names, near, strict=True) if is_near]

    # -------------------------------------------------------------------------------- inside
    def _build(self, columns: list[int]) -> None:
        """Merge fixed joints into the moving ones, and compute how the joints of the chain move these."""
        at = np.eye(4)
        self._moving: list[tuple[Array, Array, bool]] = []
        rows: list[tuple[int, float, float]] = []
        for step in self.steps:
            at = at @ step.origin
            if step.axis is not None:
                self._moving.append((at, step.axis, step.prismatic))
                rows.append((columns.index(step.column), step.factor, step.offset))
                at = np.eye(4)
        self._behind = at
        self.prismatic = [self.model.joints[column].kind == "prismatic" for column in columns]
        reaches = np.maximum(np.abs(self.lower), np.abs(self.upper))
        self._slides = float(
            sum(abs(f) * reaches[c] + abs(o) for (c, f, o), m in zip(rows, self._moving, strict=True) if m[2])
        )
        plain = [(number, 1.0, 0.0) for number in range(len(columns))]
        self._factors: Array | None = None
        self._offsets = np.array([offset for _, _, offset in rows])
        if rows != plain:
            self._factors = np.zeros((len(rows), len(columns)))
            for row, (column, factor, _) in enumerate(rows):
                self._factors[row, column] = factor
        free = self.end_effector.free
        self._rows = np.array([row for row, name in enumerate(("x", "y", "z", "rx", "ry", "rz")) if name not in free])

    @property
    def moving(self) -> list[tuple[Array, Array, bool]]:
        """Return origin in the previous joint, axis, and whether it is prismatic, of each moving joint."""
        return self._moving

    @property
    def coupling(self) -> tuple[Array, Array]:
        """Return factors (m, n) and offsets (m) from the n joints of the chain to its m moving joints."""
        if self._factors is None:
            return np.eye(self.dof), self._offsets
        return self._factors, self._offsets

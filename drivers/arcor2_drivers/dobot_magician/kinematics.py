"""Kinematics of the Magician from its published links: m and rad, in the controller's base frame.

That frame has its origin where the axes of joints 1 and 2 meet, x to the front, z up. Joint 2 is counted from the
vertical, joint 3 from the horizontal, positive downwards. The linkage keeps the wrist level: the tool points down, and
only its turn about the vertical, joints 1 and 4 together, can be chosen. Nominal: a real arm is off by some tenths of
a millimetre.
"""

import math
from typing import Final, NamedTuple

from arcor2_hw.data.geometry import Orientation, Pose, Position

REAR_ARM: Final = 0.135
FOREARM: Final = 0.147
JOINTS: Final = ("joint_1", "joint_2", "joint_3", "joint_4")
LIMITS: Final = (
    (math.radians(-90.0), math.radians(90.0)),
    (math.radians(0.0), math.radians(85.0)),
    (math.radians(-10.0), math.radians(90.0)),
    (math.radians(-90.0), math.radians(90.0)),
)
"""As published, rad."""
LEVEL: Final = math.radians(1.0)
"""rad a pose's tool axis may differ from the vertical: nobody teaches better by hand."""
SLACK: Final = 1e-4
"""rad a joint may be beyond its limit: what arithmetic in single precision adds to one that stands at it."""

Joints = tuple[float, float, float, float]
_DOWN: Final = Orientation(1.0, 0.0, 0.0, 0.0)


class Tool(NamedTuple):
    """Where the tool is: m, and its turn about the vertical in rad."""

    x: float
    y: float
    z: float
    r: float

    @property
    def pose(self) -> Pose:
        """Give the pose in the base; z of the tool points down."""
        turn = Orientation(0.0, 0.0, math.sin(self.r / 2.0), math.cos(self.r / 2.0))
        return Pose(Position(self.x, self.y, self.z), turn * _DOWN)


class Unreachable(ValueError):
    """There are no joints for a pose; the message says why."""


def tool_of(pose: Pose) -> Tool:
    """Give the tool's place for a pose in the base. Raises Unreachable when the pose does not point down."""
    numbers = (*pose.position, *pose.orientation)
    if not all(map(math.isfinite, numbers)):
        raise Unreachable("its numbers are not finite")
    turn = pose.orientation * _DOWN.inverted()
    tilt = 2.0 * math.asin(min(1.0, math.hypot(turn.x, turn.y)))
    if tilt > LEVEL:
        raise Unreachable(f"the tool can only point down; it is tilted by {math.degrees(tilt):.1f}°")
    r = math.remainder(2.0 * math.atan2(turn.z, turn.w), 2.0 * math.pi)
    return Tool(pose.position.x, pose.position.y, pose.position.z, r)


def forward(q: Joints, tool_x: float, tool_z: float) -> Tool:
    """Give the tool for joint values; `tool_x` is how far it is before the wrist, `tool_z` how far above it."""
    out = REAR_ARM * math.sin(q[1]) + FOREARM * math.cos(q[2]) + tool_x
    up = REAR_ARM * math.cos(q[1]) - FOREARM * math.sin(q[2]) + tool_z
    return Tool(out * math.cos(q[0]), out * math.sin(q[0]), up, q[0] + q[3])


def inverse(tool: Tool, tool_x: float, tool_z: float) -> Joints:
    """Give the joint values for a tool; there is one solution at most. Raises Unreachable, naming the joint."""
    base = math.atan2(tool.y, tool.x)
    out, up = math.hypot(tool.x, tool.y) - tool_x, tool.z - tool_z
    span = math.hypot(out, up)
    cosine = (REAR_ARM**2 + span**2 - FOREARM**2) / (2.0 * REAR_ARM * span) if span > 0.0 else 2.0
    if not -1.0 <= cosine <= 1.0:
        raise Unreachable(f"it is {span * 1000.0:.0f} mm from the shoulder")
    rear = math.atan2(up, out) + math.acos(cosine)  # above the horizontal; the elbow is above the line to the wrist
    fore = math.atan2(REAR_ARM * math.sin(rear) - up, out - REAR_ARM * math.cos(rear))
    q = (base, math.pi / 2.0 - rear, fore, math.remainder(tool.r - base, 2.0 * math.pi))
    for name, value, (low, high) in zip(JOINTS, q, LIMITS, strict=True):
        if not low - SLACK <= value <= high + SLACK:
            limits = f"{math.degrees(low):.0f}° to {math.degrees(high):.0f}°"
            raise Unreachable(f"{name} would be at {math.degrees(value):.1f}°, beyond {limits}")
    return q

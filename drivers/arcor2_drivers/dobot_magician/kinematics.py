"""Nominal kinematics of the Magician from its published links: m and rad, in the controller's base frame.

The origin of that frame is at the intersection of the axes of joints 1 and 2; x points forward, z up. Joint 2 is
measured from the vertical, joint 3 from the horizontal, positive downwards. The linkage keeps the wrist level: the tool
points down, and only its rotation about the vertical (joints 1 and 4 together) can be chosen. A real arm differs by
some tenths of a millimetre.
"""

import math
from typing import Final, NamedTuple

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects.arm import joint_values

REAR_ARM: Final = 0.135
FOREARM: Final = 0.147
LIMITS: Final = {
    "joint_1": (math.radians(-90.0), math.radians(90.0)),
    "joint_2": (math.radians(0.0), math.radians(85.0)),
    "joint_3": (math.radians(-10.0), math.radians(90.0)),
    "joint_4": (math.radians(-90.0), math.radians(90.0)),
}
"""Published limits, rad."""
JOINTS: Final = tuple(LIMITS)
LEVEL: Final = math.radians(1.0)
"""Maximum angle between the tool axis of a pose and the vertical, rad: the precision of hand teaching."""
SLACK: Final = 1e-4
"""Tolerance beyond a joint limit, rad: the rounding error of single precision."""

Joints = tuple[float, float, float, float]
_DOWN: Final = Orientation(1.0, 0.0, 0.0, 0.0)


class Tool(NamedTuple):
    """Position of the tool, m, and its rotation about the vertical, rad."""

    x: float
    y: float
    z: float
    r: float

    @property
    def pose(self) -> Pose:
        """Return the pose in the base; z of the tool points down."""
        turn = Orientation(0.0, 0.0, math.sin(self.r / 2.0), math.cos(self.r / 2.0))
        return Pose(Position(self.x, self.y, self.z), turn * _DOWN)


class Unreachable(ValueError):
    """No joints reach a pose; the message has the reason."""


def tool_of(pose: Pose) -> Tool:
    """Return the tool of a pose in the base. Raise Unreachable if the pose does not point down."""
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
    """Return the tool for joint values; `tool_x` is its distance in front of the wrist, `tool_z` above it, m."""
    out = REAR_ARM * math.sin(q[1]) + FOREARM * math.cos(q[2]) + tool_x
    up = REAR_ARM * math.cos(q[1]) - FOREARM * math.sin(q[2]) + tool_z
    return Tool(out * math.cos(q[0]), out * math.sin(q[0]), up, q[0] + q[3])


def inverse(tool: Tool, tool_x: float, tool_z: float) -> Joints:
    """Return the joint values for a tool; there is at most one solution. Raise Unreachable."""
    base = math.atan2(tool.y, tool.x)
    out, up = math.hypot(tool.x, tool.y) - tool_x, tool.z - tool_z
    span = math.hypot(out, up)
    cosine = (REAR_ARM**2 + span**2 - FOREARM**2) / (2.0 * REAR_ARM * span) if span > 0.0 else 2.0
    if not -1.0 <= cosine <= 1.0:
        raise Unreachable(f"it is {span * 1000.0:.0f} mm from the shoulder")
    rear = math.atan2(up, out) + math.acos(cosine)  # above the horizontal; the elbow is above the line to the wrist
    fore = math.atan2(REAR_ARM * math.sin(rear) - up, out - REAR_ARM * math.cos(rear))
    q = (base, math.pi / 2.0 - rear, fore, math.remainder(tool.r - base, 2.0 * math.pi))
    for value, (name, (low, high)) in zip(q, LIMITS.items(), strict=True):
        if not low - SLACK <= value <= high + SLACK:
            limits = f"{math.degrees(low):.0f}° to {math.degrees(high):.0f}°"
            raise Unreachable(f"{name} would be at {math.degrees(value):.1f}°, beyond {limits}")
    return q


def values(arm: str, joints: list[Joint]) -> Joints:
    """Return joint values in order. Raise InvalidData for wrong names, OutOfRange beyond limits."""
    one, two, three, four = joint_values(arm, joints, LIMITS, SLACK)
    return one, two, three, four

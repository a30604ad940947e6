"""Forward and inverse kinematics, in millimetres and degrees, as on the wire.

Links as published: rear arm 135 mm, forearm 147 mm. Angle 2 is from the vertical, angle 3 from the horizontal and
positive downwards; the wrist stays level, so that angle 4 only rotates the tool.
"""

from __future__ import annotations

import math

REAR, FORE = 135.0, 147.0
LOWEST = (-90.0, 0.0, -10.0, -90.0)
HIGHEST = (90.0, 85.0, 90.0, 90.0)

Four = tuple[float, float, float, float]


def tool_at(joints: Four, bias: tuple[float, float, float]) -> Four:
    """Return x, y, z, r of the tool."""
    one, two, three = (math.radians(angle) for angle in joints[:3])
    out = REAR * math.sin(two) + FORE * math.cos(three) + bias[0]
    across = bias[1]
    return (
        out * math.cos(one) - across * math.sin(one),
        out * math.sin(one) + across * math.cos(one),
        REAR * math.cos(two) - FORE * math.sin(three) + bias[2],
        joints[0] + joints[3],
    )


def joints_for(tool: Four, bias: tuple[float, float, float]) -> Four | None:
    """Return the joint angles for x, y, z, r; None if it is out of reach."""
    x, y, z, r = tool
    square = x * x + y * y - bias[1] * bias[1]
    if square <= 0.0:
        return None
    out = math.sqrt(square)
    one = math.atan2(y, x) - math.atan2(bias[1], out)
    out, up = out - bias[0], z - bias[2]
    span = math.hypot(out, up)
    if not abs(REAR - FORE) < span < REAR + FORE:
        return None
    # Elbow up: the triangle of the two links over the line from shoulder to wrist.
    corner = math.acos((REAR * REAR + span * span - FORE * FORE) / (2.0 * REAR * span))
    rise = math.atan2(up, out) + corner
    two = math.pi / 2.0 - rise
    three = math.atan2(REAR * math.sin(rise) - up, out - REAR * math.cos(rise))
    base = math.degrees(one)
    return base, math.degrees(two), math.degrees(three), r - base


def limit_alarm(joints: Four) -> int | None:
    """Return the alarm of the first joint beyond a limit: from 40h on, positive and negative limits alternate."""
    for number, (angle, low, high) in enumerate(zip(joints, LOWEST, HIGHEST, strict=True)):
        if angle > high + 1e-3:
            return 0x40 + 2 * number
        if angle < low - 1e-3:
            return 0x41 + 2 * number
    return None

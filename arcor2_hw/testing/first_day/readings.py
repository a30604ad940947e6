"""The readings of a connected device, which the person compares with the display of the device."""

import math
from typing import Any

from arcor2_hw.objects import Generic, IOBlock, MultiArmRobot, Robot


def readings_of(device: Generic, method: str) -> list[tuple[str, str, Any]]:
    """Return the readings of a connected device: name, text with unit, value."""
    if isinstance(device, MultiArmRobot):
        joints = [
            (f"{arm} {each.name}", each.value)
            for arm in sorted(device.get_arm_ids())
            for each in device.robot_joints(arm_id=arm)
        ]
    elif isinstance(device, Robot):
        joints = [(each.name, each.value) for each in device.robot_joints()]
    if isinstance(device, Robot):
        return [(name, f"{math.degrees(value):.2f}° ({value:.4f} rad or m)", value) for name, value in joints]
    if isinstance(device, IOBlock):
        values = [(point, device.read(point.name).value) for point in device.points()]
        return [(point.name, f"{value} {point.unit}".strip(), value) for point, value in values]
    value = getattr(device, method)()
    value = getattr(value, "value", value)
    return [(method, str(value), value)]

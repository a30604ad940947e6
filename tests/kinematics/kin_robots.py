"""Models for the tests: the models of the drivers, and small models defined here."""

import functools
from pathlib import Path

import arcor2_drivers
from arcor2_hw.kinematics.model import RobotModel

DRIVERS = Path(next(iter(arcor2_drivers.__path__)))
UR = DRIVERS / "universal_robots" / "urdf"
DOBOT = DRIVERS / "dobot_magician" / "urdf" / "dobot_magician"
TWO_AXIS = DRIVERS / "two_axis_robot" / "urdf" / "two_axis_robot"


@functools.cache
def ur(name: str = "ur5e") -> RobotModel:
    return RobotModel.load(UR / name)


def urdf(body: str, name: str = "arm") -> bytes:
    return f'<robot name="{name}">{body}</robot>'.encode()


def links(*names: str) -> str:
    return "".join(f'<link name="{name}"/>' for name in names)


def joint(
    name: str,
    parent: str,
    child: str,
    *,
    kind: str = "revolute",
    xyz: str = "0 0 0",
    rpy: str = "0 0 0",
    axis: str = "0 0 1",
    limit: str = '<limit lower="-3" upper="3" velocity="1" effort="1"/>',
    more: str = "",
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{more}</joint>'
    )


def six_axes(wrist: float = 0.0, elbow: str = "0 1 0") -> RobotModel:
    """Return an industrial arm on an inclined foot. `wrist`: offset of its last axis from the previous two axes, m."""
    text = links("base", "l1", "l2", "l3", "l4", "l5", "l6", "tool")
    text += joint("j1", "base", "l1", xyz="0 0 0.2", rpy="0.2 0 0")
    text += joint("j2", "l1", "l2", xyz="0.1 0 0.2", axis="0 1 0", limit='<limit lower="-2" upper="2.2" velocity="1"/>')
    text += joint("j3", "l2", "l3", xyz="0 0 0.4", axis=elbow, limit='<limit lower="-3.4" upper="3.4" velocity="1"/>')
    text += joint("j4", "l3", "l4", xyz="0.2 0 0.05", axis="1 0 0", limit='<limit lower="-4.6" upper="4.6"/>')
    text += joint("j5", "l4", "l5", xyz="0.2 0 0", axis="0 1 0", limit='<limit lower="-2" upper="2"/>')
    text += joint("j6", "l5", "l6", xyz=f"0.08 0 {wrist}", axis="1 0 0", kind="continuous", limit="")
    text += joint("tool_joint", "l6", "tool", kind="fixed", xyz="0.1 0 0.02", rpy="0 0.3 0", limit="")
    return RobotModel.load(urdf(text, "six"))

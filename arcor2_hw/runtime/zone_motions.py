"""Motions of robots for interlocks: positions of end effectors, lines to targets, and the zones on these lines."""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.collision.lines import first_hit
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.objects import CollisionObject, MultiArmRobot, Robot
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.device import Device

POSITION_TIMEOUT: Final = 0.5
"""Time in which a robot has to return its position, s."""


class ZoneBodies:
    """The collision objects of zones, at their present poses.

    Args:
        cell: returns the devices.
        zones: returns the ids of the zones.
    """

    def __init__(self, cell: Callable[[], Cell], zones: Callable[[], Iterable[str]]) -> None:
        self._cell, self._zones = cell, zones

    def present(self) -> Iterator[tuple[str, Obstacle]]:
        """Return the ids and bodies of the zones."""
        cell = self._cell()
        for zone in self._zones():
            with contextlib.suppress(Arcor2Error):
                instance = cell[zone].require()
                if isinstance(instance, CollisionObject) and instance.collision_model is not None:
                    yield zone, Obstacle.of(instance.collision_model, instance.pose)

    def touched(self, lines: Iterable[tuple[Position, Position]]) -> set[str]:
        """Return the zones that straight lines enter."""
        found: set[str] = set()
        bodies = list(self.present())
        for start, end in lines:
            found |= {key for key, body in bodies if first_hit(start, end, [(key, body)], 0.0) is not None}
        return found


def tips_of(device: Device) -> list[Position]:
    """Return the positions of the end effectors of a robot in the world. Raises Arcor2Error."""
    robot = device.require()

    def read_tips() -> list[Position]:
        if isinstance(robot, MultiArmRobot):
            pairs = [(each, arm) for arm in robot.get_arm_ids() for each in robot.get_end_effectors_ids(arm)]
            return [robot.get_end_effector_pose(each, arm).position for each, arm in pairs]
        assert isinstance(robot, Robot)
        return [robot.get_end_effector_pose(each).position for each in robot.get_end_effectors_ids()]

    found: list[Position] = device.watch_lane.call("get_end_effector_pose", read_tips, deadline=POSITION_TIMEOUT)
    return found


def extrapolated(before: Position, now: Position, share: float) -> Position:
    """Return the position after a fraction of the time between two positions."""
    return now + Position(*(share * each for each in now - before))


def lines_over(tips: Iterable[Position], targets: Sequence[Position]) -> Iterator[tuple[Position, Position]]:
    """Return the straight lines from each end effector over all targets."""
    for tip in tips:
        last = tip
        for target in targets:
            yield last, target
            last = target


def targets_of(device: Device, arguments: Iterable[Any]) -> Iterator[Position]:
    """Return the positions to which an action moves a robot, as far as its arguments state them."""
    for argument in arguments:
        match argument:
            case Pose():
                yield argument.position
            case ProjectRobotJoints():
                yield from _reached(device, argument.joints)
            case list() if argument and all(isinstance(each, Joint) for each in argument):
                yield from _reached(device, argument)
            case list() | tuple():
                yield from targets_of(device, argument)
            case Mapping():
                yield from targets_of(device, argument.values())
            case _:
                pass


def _reached(device: Device, joints: list[Joint]) -> Iterator[Position]:
    """Return the positions of the end effectors for joint values; none if the driver cannot compute them."""
    robot = device.require()
    if not isinstance(robot, Robot) or isinstance(robot, MultiArmRobot):
        return
    for each in robot.get_end_effectors_ids():
        with contextlib.suppress(Arcor2Error):
            yield robot.forward_kinematics(each, joints).position

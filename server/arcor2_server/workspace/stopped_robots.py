"""Joints of the robots of the online scene at their last standstill, for collision checks between robots."""

import asyncio
from collections.abc import Iterable
from typing import Final

from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObject
from arcor2_server.hosts.session import HostSession
from arcor2_server.workspace.robots import SceneRobots

PERIOD: Final = 0.5
"""Period of reading the joints, s."""
ANSWER_TIMEOUT: Final = 1.0
"""Time limit for reading the joints of a robot, s."""
STANDSTILL: Final = 0.01
"""Joint change above which a robot counts as moved, rad or m."""


class StoppedRobots:
    """Joints of robots at standstill, by robot. They are kept while a robot moves or is disconnected."""

    def __init__(self, host: HostSession, robots: SceneRobots) -> None:
        self._host = host
        self._robots = robots
        self._last_joints: dict[str, list[Joint]] = {}
        self.joints: dict[str, list[Joint]] = {}

    def forget(self) -> None:
        """Drop all joints, since the scene is offline."""
        self._last_joints.clear()
        self.joints.clear()

    async def update(self, robots: Iterable[SceneObject]) -> bool:
        """Read the joints of robots; return whether the standstill position of one changed."""
        if not self._host.online:
            known = bool(self.joints)
            self.forget()
            return known
        chosen = list(robots)
        answers = await asyncio.gather(*(self._joints_of(robot) for robot in chosen))
        before = dict(self.joints)
        for robot, joints in zip(chosen, answers, strict=True):
            last = self._last_joints.get(robot.id)
            if not joints:
                continue
            self._last_joints[robot.id] = joints
            known_joints = self.joints.get(robot.id)
            stopped = last is not None and not _differ(last, joints)
            if known_joints is None or (stopped and _differ(known_joints, joints)):
                self.joints[robot.id] = joints
        ids = {robot.id for robot in chosen}
        self.joints = {key: joints for key, joints in self.joints.items() if key in ids}
        return self.joints != before

    async def _joints_of(self, robot: SceneObject) -> list[Joint]:
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT):
                return await self._robots.present_joints(robot)
        except TimeoutError:
            return []


def _differ(first: list[Joint], second: list[Joint]) -> bool:
    values = {joint.name: joint.value for joint in first}
    return len(first) != len(second) or any(abs(values.get(j.name, 1e9) - j.value) > STANDSTILL for j in second)

"""Where the robots of the scene that is online stand, as they last stood still: so they are in each other's way."""

import asyncio
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObject
from arcor2_server.workspace.scene_collisions import present_joints

if TYPE_CHECKING:
    from arcor2_server.services import Services

PERIOD: Final = 0.5
"""Seconds between two looks."""
ANSWER_WITHIN: Final = 1.0
"""Seconds that a robot gets to tell its joints."""
STANDS: Final = 0.01
"""rad, or m, by which a joint has to have moved for its robot to stand elsewhere."""


class StandingArms:
    """`joints` by robot; what moves counts where it stood last until it stands again, one that is lost likewise."""

    def __init__(self, services: "Services") -> None:
        self._services = services
        self._seen: dict[str, list[Joint]] = {}
        self.joints: dict[str, list[Joint]] = {}

    def forget(self) -> None:
        """Know nothing of any: they are not in operation."""
        self._seen.clear()
        self.joints.clear()

    async def look(self, robots: Iterable[SceneObject]) -> bool:
        """Ask robots for their joints; tells whether one stands elsewhere than before."""
        if not self._services.cell.online:
            known = bool(self.joints)
            self.forget()
            return known
        chosen = list(robots)
        told = await asyncio.gather(*(self._asked(robot) for robot in chosen))
        before = dict(self.joints)
        for robot, joints in zip(chosen, told, strict=True):
            last = self._seen.get(robot.id)
            if not joints:
                continue
            self._seen[robot.id] = joints
            known_joints = self.joints.get(robot.id)
            stands = last is not None and not _differ(last, joints)
            if known_joints is None or (stands and _differ(known_joints, joints)):
                self.joints[robot.id] = joints
        ids = {robot.id for robot in chosen}
        self.joints = {key: joints for key, joints in self.joints.items() if key in ids}
        return self.joints != before

    async def _asked(self, robot: SceneObject) -> list[Joint]:
        try:
            async with asyncio.timeout(ANSWER_WITHIN):
                return await present_joints(self._services, robot)
        except TimeoutError:
            return []


def _differ(one: list[Joint], other: list[Joint]) -> bool:
    values = {joint.name: joint.value for joint in one}
    return len(one) != len(other) or any(abs(values.get(j.name, 1e9) - j.value) > STANDS for j in other)

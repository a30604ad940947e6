"""What a robot is told of the things around it: the scene's collision objects and other robots, as they are now."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2Error, Refused
from arcor2_hw.objects import CollisionObject, MultiArmRobot, Robot
from arcor2_hw.objects.surroundings import Obstacle
from arcor2_hw.runtime.device import Device

JOINTS_WITHIN: Final = 0.5
"""Seconds in which another robot has to tell its joints: what moves does not stay there longer anyway."""


class SceneSurroundings:
    """The things around one robot of a scene.

    Collision objects that count now, each with the model of its type, where it stands now; robots with one arm, as they
    stand now. Not known are objects that never came up, and robots with several arms.
    """

    def __init__(self, robot: str, devices: Iterable[Device], assets: Mapping[str, str]) -> None:
        self._robot, self._devices, self._assets = robot, devices, assets

    def obstacles(self) -> list[Obstacle]:
        """Give what robots must not run into."""
        found = []
        for device in self._devices:
            instance = device.instance
            if not isinstance(instance, CollisionObject) or not instance.enabled:
                continue
            if instance.collision_model is not None:
                found.append(Obstacle(instance.name, instance.collision_model, instance.pose))
        return found

    def robots(self) -> list[tuple[Robot, list[Joint]]]:
        """Give the other robots with their joints. Raises Refused naming one whose joints nobody knows."""
        found: list[tuple[Robot, list[Joint]]] = []
        for device in self._devices:
            if device.id == self._robot or not issubclass(device.recipe.cls, Robot):
                continue
            if issubclass(device.recipe.cls, MultiArmRobot) or device.recipe.cls.urdf_package_name is None:
                continue
            try:
                instance = device.require()
                assert isinstance(instance, Robot)
                joints = device.watch_lane.call("robot_joints", instance.robot_joints, deadline=JOINTS_WITHIN)
            except Arcor2Error as error:
                raise Refused(f"where {device.name} stands is not known, which may be in the way: {error}") from error
            found.append((instance, joints))
        return found

    def asset(self, asset_id: str) -> Path | None:
        """Give the file of an uploaded asset, None when it is not known here."""
        path = self._assets.get(asset_id)
        return None if path is None else Path(path)

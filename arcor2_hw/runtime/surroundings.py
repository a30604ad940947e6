"""Surroundings of a robot: the current obstacles and the other robots of the scene."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.exceptions import Arcor2Error, Refused
from arcor2_hw.objects import CollisionObject, Robot
from arcor2_hw.objects.surroundings import Attachment, Obstacle
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.messages import AddedBody
from arcor2_hw.runtime.own_process.pickling import ByReference
from arcor2_hw.runtime.world_updates import WorldUpdates

JOINTS_TIMEOUT: Final = 0.5
"""Running time in which another robot has to return its joints, s: longer than BUSY_FOR, which its driver may wait."""


class SceneSurroundings(ByReference):
    """Return the obstacles and robots around one robot of a scene, at their current poses.

    Obstacles are the enabled collision objects, except zones, and the added bodies. A body replaces the collision
    object of the same id. Objects that failed to connect, and parts held by a robot that is not in the scene, are
    missing.
    """

    def __init__(self, robot: str, devices: Iterable[Device], assets: Mapping[str, str], updates: WorldUpdates) -> None:
        self._robot, self._devices, self._assets, self._updates = robot, devices, assets, updates

    def obstacles(self) -> list[Obstacle]:
        """Return the obstacles."""
        found, bodies, names = [], self._updates.bodies(), {}
        for device in self._devices:
            names[device.id] = device.name
            instance = device.instance
            if not isinstance(instance, CollisionObject) or not instance.enabled or device.id in bodies:
                continue
            if device.id in self._updates.zones:
                continue
            if instance.collision_model is not None:
                found.append(Obstacle(instance.name, instance.collision_model, instance.pose))
        taken = set(names.values())
        for body in bodies.values():
            if body.robot and body.robot not in names:
                continue
            name = body.id
            while name in taken:
                name += " (added)"
            taken.add(name)
            found.append(_obstacle(body, name, names.get(body.robot)))
        return found

    def robots(self) -> list[tuple[Robot, list[Joint]]]:
        """Return the other robots that have a model, with their joints. Raises Refused if joints are unknown."""
        found: list[tuple[Robot, list[Joint]]] = []
        for device in self._devices:
            if device.id == self._robot or not issubclass(device.recipe.cls, Robot):
                continue
            if device.recipe.cls.urdf_package_name is None:
                continue
            try:
                instance = device.require()
                assert isinstance(instance, Robot)
                joints = device.watch_lane.read("robot_joints", instance.robot_joints, JOINTS_TIMEOUT)
            except Arcor2Error as error:
                raise Refused("The position of {name} is unknown: {reason}", name=device.name, reason=error) from error
            found.append((instance, joints))
        return found

    def asset(self, asset_id: str) -> Path | None:
        """Return the file of an uploaded asset, or None if it is unknown."""
        path = self._assets.get(asset_id)
        return None if path is None else Path(path)

    def calibration(self, robot_id: str) -> KinematicCalibration | None:
        """Return the kinematic calibration of a robot, or None for nominal kinematics."""
        return self._updates.calibration(robot_id)


def _obstacle(body: AddedBody, name: str, robot: str | None) -> Obstacle:
    holder = None if robot is None else Attachment(robot, body.link, tuple(body.touching))
    return Obstacle(name, body.model.model(), body.pose, holder, body.scale, Path(body.file) if body.file else None)

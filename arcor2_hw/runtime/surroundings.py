"""Obstacles around a robot: the current collision objects of the scene and the other robots."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.exceptions import Arcor2Error, Refused
from arcor2_hw.objects import CollisionObject, Robot
from arcor2_hw.objects.surroundings import Attachment, Obstacle
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.messages import PutIn
from arcor2_hw.runtime.own_process.pickling import ByReference
from arcor2_hw.runtime.world_updates import WorldUpdates

JOINTS_WITHIN: Final = 0.5
"""Seconds in which another robot has to return its joints; older values would be of no use while it moves."""


class SceneSurroundings(ByReference):
    """The things around one robot of a scene.

    Collision objects that count now, each with the model of its type, where it stands now; what was put in besides, in
    place of the object of the same id; other robots that have a model, as they stand now. Not known are objects that
    never came up, and what is held by a robot that is not in the scene.
    """

    def __init__(self, robot: str, devices: Iterable[Device], assets: Mapping[str, str], updates: WorldUpdates) -> None:
        self._robot, self._devices, self._assets, self._updates = robot, devices, assets, updates

    def obstacles(self) -> list[Obstacle]:
        """Return the obstacles for robots."""
        found, bodies, names = [], self._updates.bodies(), {}
        for device in self._devices:
            names[device.id] = device.name
            instance = device.instance
            if not isinstance(instance, CollisionObject) or not instance.enabled or device.id in bodies:
                continue
            if instance.collision_model is not None:
                found.append(Obstacle(instance.name, instance.collision_model, instance.pose))
        taken = set(names.values())
        for body in bodies.values():
            if body.robot and body.robot not in names:
                continue
            name = body.id
            while name in taken:
                name += " (put in)"
            taken.add(name)
            found.append(_put_in(body, name, names.get(body.robot)))
        return found

    def robots(self) -> list[tuple[Robot, list[Joint]]]:
        """Return the other robots with their joints. Raises Refused naming one whose joints are unknown."""
        found: list[tuple[Robot, list[Joint]]] = []
        for device in self._devices:
            if device.id == self._robot or not issubclass(device.recipe.cls, Robot):
                continue
            if device.recipe.cls.urdf_package_name is None:
                continue
            try:
                instance = device.require()
                assert isinstance(instance, Robot)
                joints = device.watch_lane.call("robot_joints", instance.robot_joints, deadline=JOINTS_WITHIN)
            except Arcor2Error as error:
                raise Refused("The position of {name} is unknown: {reason}", name=device.name, reason=error) from error
            found.append((instance, joints))
        return found

    def asset(self, asset_id: str) -> Path | None:
        """Return the file of an uploaded asset; None when it is unknown."""
        path = self._assets.get(asset_id)
        return None if path is None else Path(path)

    def calibration(self, robot_id: str) -> KinematicCalibration | None:
        """Return the kinematic calibration of a robot; None when its kinematics are nominal."""
        return self._updates.calibration(robot_id)


def _put_in(body: PutIn, name: str, robot: str | None) -> Obstacle:
    holder = None if robot is None else Attachment(robot, body.link, tuple(body.touching))
    return Obstacle(name, body.model.model(), body.pose, holder, body.scale, Path(body.file) if body.file else None)

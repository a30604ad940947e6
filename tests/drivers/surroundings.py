"""Surroundings of a robot: boxes parallel to the axes of the world."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint, KinematicCalibration
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Box
from arcor2_hw.objects import Robot
from arcor2_hw.objects.surroundings import Obstacle


class Carrier(Robot):
    """A robot that only carries a gripper."""

    def __init__(self) -> None:
        super().__init__("carrier_id", "carrier", Pose())

    def get_end_effectors_ids(self) -> set[str]:
        return {"tcp"}

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        return Pose()

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        return []

    def grippers(self) -> set[str]:
        return set()

    def suctions(self) -> set[str]:
        return set()


class BoxSurroundings:
    def __init__(self) -> None:
        self.boxes: dict[str, tuple[Position, tuple[float, float, float]]] = {}

    def obstacles(self) -> list[Obstacle]:
        return [Obstacle(name, object_type.Box(name, *sizes), Pose(at)) for name, (at, sizes) in self.boxes.items()]

    def robots(self) -> list[tuple[Robot, list[Joint]]]:
        return []

    def asset(self, asset_id: str) -> Path | None:
        return None

    def calibration(self, robot_id: str) -> KinematicCalibration | None:
        return None

    def touches(self, model: RobotModel, base: Pose, seen: Iterable[Iterable[float]]) -> set[str]:
        """Return the names of what the robot touches at joint values, computed with a separate collision world."""
        world = CollisionWorld()
        world.add_robot("arm", model, base)
        for name, (at, sizes) in self.boxes.items():
            world.put(name, Box(*sizes), Pose(at))
        contacts = (world.contacts("arm", np.array([*q])) for q in seen)
        return {contact.second for found in contacts for contact in found}

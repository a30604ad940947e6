"""In the host a robot knows what stands in the scene: it goes around that, as it is now."""

from pathlib import Path
from typing import Any

import pytest

import arcor2_drivers
from arcor2_hw.data import object_type
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.runtime import messages as m

from .conftest import HostProcess, open_scene, type_code

URDF = Path(next(iter(arcor2_drivers.__path__))) / "universal_robots" / "urdf" / "ur5e" / "ur5e.urdf"
NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
READY = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
ACROSS = (2.74, -1.57, 1.57, -1.57, -1.57, 0.0)
ARM = """
from arcor2_hw.objects.safe_moves import Way
from arcor2_hw.objects.urdf_robot import UrdfRobot

class Arm(UrdfRobot):
    _ABSTRACT = False
    urdf_package_name = "arm.urdf"

    def __init__(self, obj_id: str, name: str, pose: Pose) -> None:
        super().__init__(obj_id, name, pose)
        self.now = [Joint(f"{n}_joint", v) for n, v in START]
        self.count = 0
        self.silent = False

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        if self.silent:
            raise Stale(f"{self.name} has told nothing")
        return self.now

    def follow(self, way: Way) -> None:
        self.count, self.now = len(way.waypoints), way.waypoints[-1]

    def stop(self) -> None:
        super().stop()

    def waypoints(self) -> int:
        return self.count

    def fall_silent(self) -> None:
        self.silent = True
""".replace("START", repr(list(zip(NAMES, READY, strict=True))))
WALL = """
class Wall(CollisionObject):
    _ABSTRACT = False
"""
MODELS = {"Wall": object_type.ObjectModel.of(object_type.Box("Wall", 0.04, 0.5, 1.0))}


def placed(name: str, kind: str, pose: Pose) -> SceneObject:
    return SceneObject(name, kind, pose, [], f"obj_{name}")


@pytest.fixture
def scene(host: HostProcess) -> HostProcess:
    types = [type_code("Arm", ARM), type_code("Wall", WALL)]
    objects = [
        placed("arm", "Arm", Pose()),
        placed("wall", "Wall", Pose(Position(0.0, 0.55, 0.5))),
        placed("other", "Arm", Pose(Position(5.0, 0.0, 0.0))),
    ]
    host.send(open_scene(types, *objects, models=MODELS, assets={"arm.urdf": str(URDF)}))
    host.expect(m.SceneOpened)
    return host


def joints(values: tuple[float, ...]) -> list[Joint]:
    return [Joint(f"{name}_joint", value) for name, value in zip(NAMES, values, strict=True)]


def go(host: HostProcess, values: tuple[float, ...], safe: bool = True) -> Any:
    return host.call("obj_arm", "move_to_joints", target_joints=joints(values), speed=0.5, safe=safe)


def test_it_goes_around_what_stands_there_now(scene: HostProcess) -> None:
    assert go(scene, ACROSS) is None
    assert scene.call("obj_arm", "waypoints") > 2
    # A wall that does not count, and one that was moved away, are no obstacle.
    assert scene.call("obj_wall", "set_enabled", state=False) is None
    assert go(scene, READY) is None
    assert scene.call("obj_arm", "waypoints") == 2
    assert scene.call("obj_wall", "set_enabled", state=True) is None
    assert scene.call("obj_wall", "update_pose", new_pose=Pose(Position(0.0, 9.0, 0.0))) is None
    assert go(scene, ACROSS) is None
    assert scene.call("obj_arm", "waypoints") == 2
    tip = scene.call("obj_arm", "get_end_effector_pose", end_effector="tcp")
    at = Position(*(tip["position"][axis] for axis in "xyz"))
    assert go(scene, READY) is None
    assert scene.call("obj_wall", "update_pose", new_pose=Pose(at)) is None
    error = go(scene, ACROSS)
    assert isinstance(error, m.ErrorData)
    assert error.code == "kinematics"
    assert "arm/" in error.message
    assert "wall" in error.message


def test_another_robot_is_known_by_its_joints_or_the_move_is_refused(scene: HostProcess) -> None:
    assert go(scene, ACROSS) is None
    scene.call("obj_other", "fall_silent")
    error = go(scene, READY)
    assert isinstance(error, m.ErrorData)
    assert error.code == "refused"
    assert "where other stands is not known" in error.message
    assert go(scene, READY, safe=False) is None

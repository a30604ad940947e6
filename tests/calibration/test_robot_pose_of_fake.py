"""Robot pose from the fake camera's picture of the fake cell, with the model from the driver."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

import arcor2_drivers.universal_robots
from arcor2_fakes.cell import arm
from arcor2_fakes.cell.layout import Pose as Place
from arcor2_fakes.oak_d.optics import Lens
from arcor2_fakes.oak_d.scene import Pose as Look, Thing
from arcor2_hw.calibration.robot_pose import find_robot_pose
from arcor2_hw.calibration.surface import surface_of
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.kinematics.errors import ModelError
from arcor2_hw.kinematics.model import RobotModel
from tests.calibration.depth_sensor import looking

Q = (0.3, -1.3, 1.4, -1.2, -1.5, 0.2)
BASE = Place((0.05, -0.1, 0.0), (0.0, 0.0, math.sin(0.25), math.cos(0.25)))
TIP = Place((0.0, 0.0, 0.15))
EYE = looking(np.array([0.2, -0.1, 0.35]), np.array([1.0, -0.9, 0.9]))


def model_of(name: str) -> RobotModel:
    return RobotModel.load(Path(arcor2_drivers.universal_robots.__file__).parent / "urdf" / name)


def joints(model: RobotModel) -> list[Joint]:
    return [Joint(name, value) for name, value in zip(model.joint_names, Q, strict=True)]


def test_the_arm_is_found_where_the_layout_places_it() -> None:
    from arcor2_fakes.oak_d.render import Renderer  # loads Open3D, which takes a second
    from arcor2_fakes.oak_d.sensor import Sensor

    name = "ur5e"
    lens = Lens(640, 360)
    seen = arm.things(name, BASE.matrix(), Q, TIP.matrix()).values()
    things = tuple(msgspec.convert(msgspec.to_builtins(thing), Thing) for thing in seen)
    view = Renderer(lens).view(msgspec.convert(arm.pose_of(EYE), Look), 0.0, things)
    sensor = Sensor(640, 360, 1.0, 1)
    depth = np.stack([sensor.depth(view, number, covered=False) for number in range(6)])
    true = Pose(Position(*BASE.position), Orientation(*BASE.orientation))
    assumed = Pose(Position(0.08, -0.13, 0.02), true.orientation * Orientation.from_rotation_vector(0.04, -0.04, 0.06))
    model = model_of(name)
    found = find_robot_pose(
        surface_of(model, joints(model)),
        depth,
        CameraParameters(lens.fx, lens.fy, lens.cx, lens.cy, list(lens.distortion)),
        Pose.from_matrix(EYE),
        assumed,
    )
    assert found.pose.position.distance_to(true.position) < 0.002
    assert found.pose.orientation.angle_to(true.orientation) < math.radians(0.3)
    assert found.fitness > 0.8


def test_missing_joints_are_named() -> None:
    model = model_of("ur5e")
    with pytest.raises(ModelError, match="elbow_joint"):
        surface_of(model, [joint for joint in joints(model) if joint.name != "elbow_joint"])

"""Arms in front of a synthetic depth camera: joint states, places and assumed poses from a seed."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from arcor2_hw.calibration.surface import RobotSurface
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from tests.calibration.depth_sensor import Floats, Sensor, arm, looking, moved, shift, tool, triangles, turn

LARGE = {"width": 1280, "height": 720, "fx": 912.5, "fy": 912.1, "cx": 642.3, "cy": 357.8}
INTRINSICS_OFF = 0.0005
"""Relative error of the fx and fy that the solver receives. Its cx and cy are a quarter of a pixel off."""


@dataclass(frozen=True)
class View:
    """Inputs of a solver, and the true result."""

    surface: RobotSurface
    depth: npt.NDArray[np.uint16]
    parameters: CameraParameters
    camera: Pose
    assumed: Pose
    true: Pose

    def error(self, found: Pose) -> tuple[float, float]:
        """m and rad."""
        return found.position.distance_to(self.true.position), found.orientation.angle_to(self.true.orientation)


def joints_above_the_table(rng: np.random.Generator) -> list[float]:
    while True:
        lift, bend = rng.uniform(-2.2, -0.8), rng.uniform(0.5, 2.2) * rng.choice([-1, 1])
        joints = [rng.uniform(-3, 3), lift, bend, rng.uniform(-2.5, 0), rng.uniform(-2.5, 2.5), rng.uniform(-3, 3)]
        if min(min(link.begin[2], link.end[2]) - link.radius for link in arm(joints)[1:]) > 0.02:
            return joints


def surface_of_arm(joints: list[float]) -> RobotSurface:
    return RobotSurface.of_links([(*triangles(link), np.eye(4)) for link in arm(joints)], "the arm")


def off_by(true: Floats, distance: float, angle: float, rng: np.random.Generator) -> Floats:
    way = rng.normal(size=3)
    return shift(*(distance * way / np.linalg.norm(way))) @ true @ turn(rng.normal(size=3), angle)


def drawn(seed: int, distance: float = 0.05, angle: float = math.radians(5.0), large: bool = False) -> View:
    """Create an arm with a gripper and a cable somewhere on a table, seen from 1.0 to 1.8 m, 15 to 60° above."""
    rng = np.random.default_rng(seed)
    joints = joints_above_the_table(rng)
    true = shift(*rng.uniform(-0.1, 0.1, 2), 0.0) @ turn(np.array([0.0, 0.0, 1.0]), rng.uniform(-3, 3))
    middle = np.mean([(true @ [*link.begin, 1.0])[:3] for link in arm(joints)], axis=0)
    away, up, around = rng.uniform(1.0, 1.8), math.radians(rng.uniform(15, 60)), rng.uniform(-math.pi, math.pi)
    direction = np.array([math.cos(up) * math.cos(around), math.cos(up) * math.sin(around), math.sin(up)])
    sensor = Sensor(shapes=[moved(shape, true) for shape in [*arm(joints), *tool(joints)]], wall=-2.0)
    if large:
        for name, value in LARGE.items():
            setattr(sensor, name, value)
    camera = looking(middle, middle + away * direction)
    return View(
        surface_of_arm(joints),
        sensor.take(camera, rng),
        configured_parameters(sensor),
        Pose.from_matrix(camera),
        Pose.from_matrix(off_by(true, distance, angle, rng)),
        Pose.from_matrix(true),
    )


def configured_parameters(sensor: Sensor) -> CameraParameters:
    """Return the intrinsic parameters that the solver receives. They deviate from those of the sensor."""
    factor = 1.0 + INTRINSICS_OFF
    return CameraParameters(
        sensor.fx * factor, sensor.fy * factor, sensor.cx + 0.25, sensor.cy - 0.25, list(sensor.distortion)
    )


@dataclass(frozen=True)
class States:
    """Depth images of one arm in several joint states, and the truth."""

    joints: list[list[float]]
    depths: list[npt.NDArray[np.uint16]]
    parameters: CameraParameters
    camera: Pose
    assumed: Pose
    true: Pose

    def off(self, joint: int, angle: float) -> list[RobotSurface]:
        """Return the surfaces with a joint that is off by an angle, rad."""
        return [surface_of_arm([q + angle * (i == joint) for i, q in enumerate(each)]) for each in self.joints]


def states(seed: int, count: int = 3) -> States:
    """Return an arm in several joint states in front of one camera, 1.3 to 1.8 m away, 20 to 50° above."""
    rng = np.random.default_rng(seed)
    true = shift(*rng.uniform(-0.1, 0.1, 2), 0.0) @ turn(np.array([0.0, 0.0, 1.0]), rng.uniform(-3, 3))
    joints = [joints_above_the_table(rng) for _ in range(count)]
    middle = np.mean([(true @ [*link.begin, 1.0])[:3] for each in joints for link in arm(each)], axis=0)
    up, around = math.radians(rng.uniform(20, 50)), rng.uniform(-math.pi, math.pi)
    direction = np.array([math.cos(up) * math.cos(around), math.cos(up) * math.sin(around), math.sin(up)])
    camera = looking(middle, middle + rng.uniform(1.3, 1.8) * direction)
    depths = []
    for each in joints:
        sensor = Sensor(shapes=[moved(shape, true) for shape in [*arm(each), *tool(each)]], wall=-2.0)
        depths.append(sensor.take(camera, rng))
    assumed = off_by(true, 0.05, math.radians(5.0), rng)
    poses = (Pose.from_matrix(camera), Pose.from_matrix(assumed), Pose.from_matrix(true))
    return States(joints, depths, configured_parameters(sensor), *poses)

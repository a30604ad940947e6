"""Settings of a YuMi."""

import dataclasses
import math
from typing import Annotated

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import Settings
from arcor2_hw.objects.settings import Range, check_host, within

LEFT = "left"
RIGHT = "right"
ARMS = (LEFT, RIGHT)
MAX_PAYLOAD = 0.5
"""Maximum mass at the flange of an arm, hand included, kg."""

FULL_TURN = 2.0 * math.pi
MAX_WATCHDOG_PERIOD = 0.5
"""Longest watchdog, s, with which an arm stops within the time that the type declares (`loss_reaction`)."""


@dataclasses.dataclass
class YumiSettings(Settings):
    """Settings in SI units. The pose of a TCP is in the flange of its arm (tool0); orientations are rotation vectors.

    :param host: address of the controller
    :param rws_port: port of Robot Web Services
    :param user: user of the controller (UAS) with the grants to change modes, run RAPID and hold mastership
    :param password: password of the user
    :param left_port: port of the left arm's motion server; its watch port is the next one
    :param right_port: port of the right arm's motion server; its watch port is the next one
    :param left_mass: mass at the left flange with the hand, kg; negative: not set. Required before the robot can move
    :param left_cog_x: center of gravity of the left load, m
    :param left_cog_y: center of gravity of the left load, m
    :param left_cog_z: center of gravity of the left load, m
    :param left_tcp_x: left tool center point, m
    :param left_tcp_y: left tool center point, m
    :param left_tcp_z: left tool center point, m
    :param left_tcp_rx: orientation at the left tool center point, rad
    :param left_tcp_ry: orientation at the left tool center point, rad
    :param left_tcp_rz: orientation at the left tool center point, rad
    :param right_mass: mass at the right flange with the hand, kg; negative: not set. Required before the robot can move
    :param right_cog_x: center of gravity of the right load, m
    :param right_cog_y: center of gravity of the right load, m
    :param right_cog_z: center of gravity of the right load, m
    :param right_tcp_x: right tool center point, m
    :param right_tcp_y: right tool center point, m
    :param right_tcp_z: right tool center point, m
    :param right_tcp_rx: orientation at the right tool center point, rad
    :param right_tcp_ry: orientation at the right tool center point, rad
    :param right_tcp_rz: orientation at the right tool center point, rad
    :param left_gripper: the left hand has fingers
    :param right_gripper: the right hand has fingers
    :param left_suction: the left hand has a suction cup
    :param right_suction: the right hand has a suction cup
    :param max_tcp_speed: TCP speed of a linear move at speed 1, m/s
    :param max_joint_speed: joint speed of a joint move at speed 1, rad/s
    :param clearance: smallest distance between the arms, m, by capsules around nominal links
    :param watchdog: time without a keep-alive after which an arm stops, s
    :param poll_period: time between two readings of the state, s
    """

    host: str
    rws_port: Annotated[int, Range(1, 65535)] = 80
    user: str = "Default User"
    password: str = dataclasses.field(
        default="robotics", repr=False, metadata={"secret": True}
    )  # the names of the modules that ABB ships
    left_port: Annotated[int, Range(1, 65534)] = 6101
    right_port: Annotated[int, Range(1, 65534)] = 6111
    left_mass: float = dataclasses.field(default=-1.0, metadata={"for_control": True})
    left_cog_x: Annotated[float, Range(-0.5, 0.5)] = 0.0
    left_cog_y: Annotated[float, Range(-0.5, 0.5)] = 0.0
    left_cog_z: Annotated[float, Range(-0.5, 0.5)] = 0.05
    left_tcp_x: Annotated[float, Range(-0.5, 0.5)] = 0.0
    left_tcp_y: Annotated[float, Range(-0.5, 0.5)] = 0.0
    left_tcp_z: Annotated[float, Range(-0.5, 0.5)] = 0.0
    left_tcp_rx: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    left_tcp_ry: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    left_tcp_rz: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    right_mass: float = dataclasses.field(default=-1.0, metadata={"for_control": True})
    right_cog_x: Annotated[float, Range(-0.5, 0.5)] = 0.0
    right_cog_y: Annotated[float, Range(-0.5, 0.5)] = 0.0
    right_cog_z: Annotated[float, Range(-0.5, 0.5)] = 0.05
    right_tcp_x: Annotated[float, Range(-0.5, 0.5)] = 0.0
    right_tcp_y: Annotated[float, Range(-0.5, 0.5)] = 0.0
    right_tcp_z: Annotated[float, Range(-0.5, 0.5)] = 0.0
    right_tcp_rx: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    right_tcp_ry: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    right_tcp_rz: Annotated[float, Range(-FULL_TURN, FULL_TURN)] = 0.0
    left_gripper: bool = True
    right_gripper: bool = True
    left_suction: bool = False
    right_suction: bool = False
    max_tcp_speed: Annotated[float, Range(0.01, 1.5)] = 0.5
    max_joint_speed: Annotated[float, Range(0.01, math.pi)] = 1.0
    clearance: Annotated[float, Range(0.0, 0.08)] = 0.02  # the shoulders are 0.1 m apart
    watchdog: Annotated[float, Range(0.2, MAX_WATCHDOG_PERIOD)] = 0.4
    poll_period: Annotated[float, Range(0.02, 0.5)] = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        check_host(self.host)
        if not self.user.strip():
            raise OutOfRange("user must be a user of the controller, not empty")
        for name in ("left_mass", "right_mass"):
            if not getattr(self, name) < 0.0:
                within(name, getattr(self, name), 0.001, MAX_PAYLOAD)
        if abs(self.left_port - self.right_port) < 2:
            raise OutOfRange(
                "right_port must differ from left_port {left_port} by at least 2: an arm uses two",
                left_port=self.left_port,
            )

    def port(self, arm: str) -> int:
        """Return the port of an arm's motion server."""
        return self.left_port if arm == LEFT else self.right_port

    def tcp(self, arm: str) -> Pose:
        """Return an arm's TCP in its flange."""
        x, y, z, rx, ry, rz = (getattr(self, f"{arm}_tcp_{part}") for part in ("x", "y", "z", "rx", "ry", "rz"))
        return Pose(Position(x, y, z), Orientation.from_rotation_vector(rx, ry, rz))

    def load(self, arm: str) -> tuple[float, tuple[float, float, float]] | None:
        """Return mass (kg) and center of gravity (m) at an arm's flange; None if they are not set."""
        mass: float = getattr(self, f"{arm}_mass")
        x, y, z = (getattr(self, f"{arm}_cog_{axis}") for axis in "xyz")
        return (mass, (x, y, z)) if mass >= 0.0 else None

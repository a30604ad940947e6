"""The workplace of the recorded sessions: a robot with the recorded poses and joints, which moves at once."""

from typing import Any

from arcor2_hw.data.object_type import Box, ObjectModel, ObjectTypeSource
from tests.protocol import session

ROBOT = "DobotMagician"
"""Like the other recorded types it replaces an installed one, which has other parameters."""


def _answer(name: str, number: int) -> Any:
    return next(m["msg"]["data"] for m in session(name) if m["msg"].get("id") == number and "data" in m["msg"])


def source() -> str:
    """Return the source of the robot's module, with the recorded joints and poses."""
    scene_session = "03_scene_online_robot"
    joints, pose, solved = _answer(scene_session, 47), _answer(scene_session, 53), _answer(scene_session, 55)
    return f'''
from dataclasses import dataclass

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint, RobotType
from arcor2_hw.objects import Robot, Settings

JOINTS = {[(joint["name"], joint["value"]) for joint in joints]}
SOLVED = {[(joint["name"], joint["value"]) for joint in solved]}
POSITION = {list(pose["position"].values())}
ORIENTATION = {list(pose["orientation"].values())}


class MoveType(StrEnum):
    LINEAR = "LINEAR"
    JOINTS = "JOINTS"
    JUMP = "JUMP"


@dataclass
class RecordedSettings(Settings):
    url: str = "http://127.0.0.1:5018"


class {ROBOT}(Robot):
    """A robot as it was recorded."""

    _ABSTRACT = False
    robot_type = RobotType.SCARA

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: RecordedSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._tip = Pose(Position(*POSITION), Orientation(*ORIENTATION))

    @action
    def move(
        self,
        pose: Pose,
        move_type: MoveType = MoveType.JOINTS,
        velocity: float = 50.0,
        acceleration: float = 50.0,
        safe: bool = True,
        *,
        an: str | None = None,
    ) -> None:
        """Move.

        :param pose: where to
        :param move_type: how
        :param velocity: how fast
        :param acceleration: how soon
        :param safe: past obstacles
        """
        assert 0.0 <= velocity <= 100.0
        assert 0.0 <= acceleration <= 100.0
        self._tip = pose

    def get_end_effectors_ids(self) -> set[str]:
        return {{"default"}}

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        return self._tip

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        return [Joint(name, value) for name, value in JOINTS]

    def grippers(self) -> set[str]:
        return set()

    def suctions(self) -> set[str]:
        return {{"default"}}

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: list[Joint] | None = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        return [Joint(name, value) for name, value in SOLVED]

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        return Pose(Position(*POSITION), Orientation(*ORIENTATION))

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        self._tip = target_pose

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        self._tip = self.forward_kinematics("default", target_joints)
'''


SCALE = '''
from arcor2_hw.objects import CollisionObject


class WeighingMachine(CollisionObject):
    """A scale as it was recorded: nothing but a box."""

    _ABSTRACT = False
'''


TIME = """
import time

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class TimeActions(Generic):
    _ABSTRACT = False

    @action
    def sleep(self, seconds: float, *, an: str | None = None) -> None:
        time.sleep(seconds)
"""

RANDOM = """
import random

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class RandomActions(Generic):
    _ABSTRACT = False

    @action
    def random_bool(self, probability: float, *, an: str | None = None) -> bool:
        return random.random() < probability
"""


def uploads() -> list[ObjectTypeSource]:
    """Return the object types that a client uploaded before the recorded sessions."""
    metas = _answer("01_connect_register", 4)
    box = next(meta["object_model"]["box"] for meta in metas if meta["type"] == "WeighingMachine")
    model = ObjectModel.of(Box(**box))
    return [
        ObjectTypeSource(ROBOT, source().lstrip()),
        ObjectTypeSource("TimeActions", TIME.lstrip()),
        ObjectTypeSource("RandomActions", RANDOM.lstrip()),
        ObjectTypeSource("WeighingMachine", SCALE.lstrip(), model=model),
    ]

"""Object types as written for ARCOR2, without references to ARCOR2-HW."""

FIT_MIXIN = '''
from arcor2.data.common import Joint, Pose
from arcor2.data.robot import InverseKinematicsRequest
from arcor2_web import rest


class KinematicsMixin:
    """Methods that two robots share."""

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: None | list[Joint] = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        request = InverseKinematicsRequest(pose, start_joints, avoid_collisions)
        return rest.call(rest.Method.PUT, f"{self.settings.url}/ik", body=request, list_return_type=Joint)
'''

ABSTRACT_ARM = '''
from dataclasses import dataclass
from typing import Optional, cast

from arcor2 import transformations as tr
from arcor2.data.common import ActionMetadata, Joint, Orientation, Pose, Position, StrEnum
from arcor2.data.robot import RobotType
from arcor2.exceptions import Arcor2Exception
from arcor2.logging import get_logger
from arcor2_object_types.abstract import Robot, RobotException, Settings
from arcor2_web import rest

logger = get_logger(__name__)


class MoveType(StrEnum):
    JUMP: str = "JUMP"
    LINEAR: str = "LINEAR"


class ArmException(RobotException):
    pass


@dataclass
class ArmSettings(Settings):
    url: str
    slow: bool = False


class AbstractArm(Robot):
    """Arm behind a REST service."""

    robot_type = RobotType.SCARA

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: ArmSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        if rest.call(rest.Method.GET, f"{self.settings.url}/state/started", return_type=bool):
            raise ArmException("Somebody uses the arm.")
        rest.call(rest.Method.PUT, f"{self.settings.url}/state/start", body=self.pose)
        logger.info(f"{self.name} started")

    @property
    def settings(self) -> ArmSettings:
        return cast(ArmSettings, super().settings)

    def cleanup(self) -> None:
        super().cleanup()
        rest.call(rest.Method.PUT, f"{self.settings.url}/state/stop")

    def get_end_effectors_ids(self) -> set[str]:
        return {"default"}

    def grippers(self) -> set[str]:
        return set()

    def suctions(self) -> set[str]:
        return {"default"}

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        local = rest.call(rest.Method.GET, f"{self.settings.url}/eef/pose", return_type=Pose)
        return tr.make_pose_abs(self.pose, local)

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        return rest.call(rest.Method.GET, f"{self.settings.url}/joints", list_return_type=Joint)

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        self.move(target_pose, MoveType.LINEAR if linear else MoveType.JUMP, speed * 100)

    def home(self, *, an: Optional[str] = None) -> None:
        """Go home."""
        with self._move_lock:
            rest.call(rest.Method.PUT, f"{self.settings.url}/home", timeout=rest.Timeout(read=60))

    def move(self, pose: Pose, move_type: MoveType, velocity: float = 50.0, *, an: Optional[str] = None) -> None:
        """Moves the end effector.

        :param pose: Where to.
        :param move_type: Way of moving.
        :param velocity: Percent.
        :return:
        """
        assert 0.0 <= velocity <= 100.0
        self.check_if_ready_to_move()
        with self._move_lock:
            rest.call(
                rest.Method.PUT,
                f"{self.settings.url}/eef/pose",
                body=tr.make_pose_rel(self.pose, pose),
                params={"move_type": move_type, "velocity": velocity, "safe": True, "nothing": None},
            )

    home.__action__ = ActionMetadata()
    move.__action__ = ActionMetadata()
'''

ARM_M1 = """
from arcor2.data.common import Pose
from .abstract_arm import AbstractArm, ArmSettings
from .kinematics_mixin import KinematicsMixin


class ArmM1(KinematicsMixin, AbstractArm):
    _ABSTRACT = False
    urdf_package_name = "arm-m1.zip"

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: ArmSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
"""

SHOP_CAMERA = '''
from typing import Optional

from PIL import Image

from arcor2.data.camera import CameraParameters
from arcor2.data.common import ActionMetadata, Pose
from arcor2.data.object_type import Models
from arcor2_object_types.abstract import Camera, Settings


class ShopCamera(Camera):
    """A camera."""

    _ABSTRACT = False
    mesh_filename = "camera.dae"

    def __init__(
        self,
        obj_id: str,
        name: str,
        pose: Pose,
        collision_model: Optional[Models] = None,
        settings: Optional[Settings] = None,
    ) -> None:
        super().__init__(obj_id, name, pose, collision_model, settings)
        self.color_camera_params = CameraParameters(900.0, 900.0, 320.0, 240.0, [0.1, 0.0, 0.0, 0.0])

    def color_image(self, *, an: Optional[str] = None) -> Image.Image:
        return Image.new("RGB", (4, 3), (255, 0, 0))

    def brightness(self, image: Image.Image, *, an: Optional[str] = None) -> int:
        return image.convert("L").getpixel((0, 0))

    color_image.__action__ = ActionMetadata()
    brightness.__action__ = ActionMetadata()
'''

TEST_BENCH = '''
import socket
import threading
from dataclasses import dataclass
from enum import unique
from typing import Optional

import arcor2.data.common as common
from arcor2 import DynamicParamTuple, json
from arcor2.data.common import ActionMetadata, IntEnum, Position, StrEnum
from arcor2.exceptions import Arcor2Exception
from arcor2_object_types.abstract import Generic, Settings


@unique
class Level(IntEnum):
    LOW = 1
    HIGH = 2


@dataclass
class BenchSettings(Settings):
    port: int
    host: str = "127.0.0.1"
    timeout: float = 3.5
    level: Level = Level.LOW


class BenchException(Arcor2Exception):
    """The bench says no."""


class TestBench(Generic):
    """Tests one piece at a time.

    It opens its line at once.
    """

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: BenchSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._cancelled = threading.Event()
        self._line = socket.create_connection((settings.host, settings.port), settings.timeout)
        self._file = self._line.makefile("rw", newline="\\n")

    def _ask(self, **question: object) -> dict:
        self._file.write(json.dumps(question) + "\\n")
        self._file.flush()
        answer = json.loads(self._file.readline())
        if "error" in answer:
            raise BenchException(answer["error"])
        return answer

    def cleanup(self) -> None:
        self._file.write("bye\\n")
        self._file.flush()
        self._file.close()
        self._line.close()

    def programs(self, group: str) -> set[str]:
        return set(self._ask(programs=group)["programs"])

    def groups(self) -> set[str]:
        return {"a", "b"}

    def test(self, group: str, program: str, level: Level, *, an: Optional[str] = None) -> tuple[bool, float]:
        """Tests the piece.

        :param program: What to test.
        """
        self._cancelled.clear()
        answer = self._ask(test=program, level=level)
        return answer["good"], answer["volts"]

    def wait(self, seconds: float, *, an: Optional[str] = None) -> bool:
        return self._cancelled.wait(seconds)

    def cancel_wait(self) -> None:
        self._cancelled.set()

    def both(self, *, an: Optional[str] = None) -> str:
        good, _ = self.test("a", "fast", Level.HIGH)
        self.test("a", "slow", Level.LOW)
        return str(good)

    def middle(self, a: common.Position, b: Position, *, an: Optional[str] = None) -> float:
        return sum((p + q) / 2 for p, q in zip(a, b))

    CANCEL_MAPPING = {wait.__name__: cancel_wait.__name__}
    DYNAMIC_PARAMS = {
        "program": DynamicParamTuple(programs.__name__, {"group"}),
        "group": DynamicParamTuple(groups.__name__, set()),
    }

    test.__action__ = ActionMetadata()
    wait.__action__ = ActionMetadata()
    both.__action__ = ActionMetadata(composite=True)
    middle.__action__ = ActionMetadata(hidden=True)
'''

CRATE = '''
from arcor2.data.common import Pose
from arcor2.data.object_type import Box, Models
from arcor2_object_types.abstract import CollisionObject, Settings


class Crate(CollisionObject):
    """A crate."""

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, pose: Pose, collision_model: Models, settings: None | Settings = None):
        super().__init__(obj_id, name, pose, collision_model, settings)
        assert isinstance(collision_model, Box)

    def volume(self, *, an: None | str = None) -> float:
        model = self.collision_model
        return model.size_x * model.size_y * model.size_z

    from arcor2.data.common import ActionMetadata
    volume.__action__ = ActionMetadata()
'''

SOURCES = {
    "KinematicsMixin": FIT_MIXIN,
    "AbstractArm": ABSTRACT_ARM,
    "ArmM1": ARM_M1,
    "ShopCamera": SHOP_CAMERA,
    "TestBench": TEST_BENCH,
    "Crate": CRATE,
}

SCRIPT = """
from action_points import ActionPoints
from arcor2_runtime.exceptions import print_exception
from arcor2_runtime.resources import Resources
from object_types.arm_m1 import ArmM1
from object_types.abstract_arm import MoveType
from object_types.shop_camera import ShopCamera
from object_types.test_bench import Level, TestBench


def main(res: Resources) -> None:
    aps = ActionPoints(res)
    arm: ArmM1 = res.objects["obj_arm"]
    bench: TestBench = res.objects["obj_bench"]
    camera: ShopCamera = res.objects["obj_camera"]
    for _ in range(2):
        arm.move(aps.top.poses.o, MoveType.JUMP, 25.0, an="a1")
        good, volts = bench.test("a", "fast", Level.HIGH, an="a2")
        picture = camera.color_image(an="a3")
        level = camera.brightness(picture, an="a4")
        assert (good, volts, level) == (True, 4.5, 76), (good, volts, level)
        aps.top.position.x = 99
    bench.both(an="a5")
    bench.test("a", "none", Level.LOW, an="a6")


if __name__ == "__main__":
    try:
        with Resources() as res:
            main(res)
    except Exception as e:
        print_exception(e)
"""

ACTION_POINTS = """
import copy

from arcor2.data.common import ActionPoint, Pose, Position, ProjectRobotJoints
from arcor2_runtime.resources import Resources


class ApTopPoses:
    def __init__(self, res: Resources):
        self._o = res.pose("ori_top")

    @property
    def o(self) -> Pose:
        return copy.deepcopy(self._o)


class ApTop:
    def __init__(self, res: Resources):
        self._ap: ActionPoint = res.bare_action_point("acp_top")
        self.poses = ApTopPoses(res)

    @property
    def position(self) -> Position:
        return copy.deepcopy(self._ap.position)


class ActionPoints:
    def __init__(self, res: Resources):
        self.top = ApTop(res)
"""

"""Object types without a device, which the tests upload. Their methods return at once."""

ARM = '''
import math
import time
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects import Robot, Settings


class Arm(Robot):
    """Six joints that are the pose itself: position and rotation vector. It reaches every pose above the floor."""

    _ABSTRACT = False
    urdf_package_name = "arm.zip"

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: Settings | None = None) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._tip = Pose(Position(0.4, 0.1, 0.3), Orientation(1, 0, 0, 0))
        self._stopped = False
        self._teaching = False

    def get_end_effectors_ids(self) -> set[str]:
        return {"tip"}

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        return self._tip

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        return self._of(self._tip)

    def _of(self, pose):
        numbers = [*pose.position, *pose.orientation.rotation_vector()]
        return [Joint(f"j{index}", value) for index, value in enumerate(numbers, 1)]

    def grippers(self) -> set[str]:
        return {"jaw"}

    def suctions(self) -> set[str]:
        return set()

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: list[Joint] | None = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        if pose.position.z < 0:
            raise Robot.KinematicsException("that is below the floor")
        joints = self._of(pose)
        if start_joints is None:
            return joints
        # A rotation has two vectors: the short way round, and the long way.
        angle = math.hypot(*(joint.value for joint in joints[3:]))
        scale = 1 - 2 * math.pi / angle if angle else 1.0
        other = [*joints[:3], *(Joint(joint.name, joint.value * scale) for joint in joints[3:])]
        return min(joints, other, key=lambda found: sum(abs(a.value - b.value) for a, b in zip(found, start_joints)))

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        values = [joint.value for joint in joints]
        return Pose(Position(*values[:3]), Orientation.from_rotation_vector(*values[3:]))

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        self._stopped = False
        until = time.monotonic() + (0.0 if speed > 0.5 else 10.0)
        while time.monotonic() < until and not self._stopped:
            time.sleep(0.01)
        if self._stopped:
            raise RuntimeError("stopped on the way")
        self._tip = target_pose

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        self._tip = self.forward_kinematics("tip", target_joints)

    def stop(self) -> None:
        self._stopped = True

    def get_hand_teaching_mode(self) -> bool:
        return self._teaching

    def set_hand_teaching_mode(self, enabled: bool) -> None:
        self._teaching = enabled

    def move_to_calibration_pose(self) -> None:
        self._tip = Pose(Position(0, 0, 1), Orientation())
'''

DUMB_ARM = '''
from .arm import Arm
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2NotImplemented


class DumbArm(Arm):
    """An arm that computes nothing and has no model."""

    _ABSTRACT = False
    urdf_package_name = None

    def inverse_kinematics(
        self, end_effector_id: str, pose: Pose, start_joints: list[Joint] | None = None, avoid_collisions: bool = True
    ) -> list[Joint]:
        raise Arcor2NotImplemented("inverse_kinematics")
'''

TWO_ARMS = '''
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects import MultiArmRobot


class TwoArms(MultiArmRobot):
    """Two arms that do not move."""

    _ABSTRACT = False

    def get_arm_ids(self) -> set[str]:
        return {"left", "right"}

    def get_end_effectors_ids(self, arm_id: str | None = None) -> set[str]:
        return {"tip"}

    def get_end_effector_pose(self, end_effector: str, arm_id: str | None = None) -> Pose:
        return Pose(Position(0, 0.5 if arm_id == "left" else -0.5, 0.3), Orientation())

    def robot_joints(self, include_gripper: bool = False, arm_id: str | None = None) -> list[Joint]:
        return [Joint(f"{arm_id}_1", 0.25)]

    def grippers(self, arm_id: str | None = None) -> set[str]:
        return set()

    def suctions(self, arm_id: str | None = None) -> set[str]:
        return {f"{arm_id}_cup"}
'''

EYE = '''
from PIL import Image
from arcor2_hw.actions import action
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.objects import Camera, Settings


class Eye(Camera):
    """A camera that sees a red wall, 1.5 m away."""

    _ABSTRACT = False

    def __init__(
        self,
        obj_id: str,
        name: str,
        pose: Pose,
        collision_model: Models | None = None,
        settings: Settings | None = None,
    ) -> None:
        super().__init__(obj_id, name, pose, collision_model, settings)
        self.color_camera_params = CameraParameters(600, 610, 320, 240, [0, 0, 0, 0])

    @action
    def color_image(self, *, an: str | None = None) -> Image.Image:
        return Image.new("RGB", (64, 48), (255, 0, 0))

    @action
    def depth_image(self, averaged_frames: int = 1, *, an: str | None = None) -> Image.Image:
        return Image.new("I;16", (64, 48), 1500)
'''

BLIND_EYE = '''
from .eye import Eye
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Models
from arcor2_hw.objects import Settings


class BlindEye(Eye):
    """A camera that does not know its parameters."""

    _ABSTRACT = False

    def __init__(
        self,
        obj_id: str,
        name: str,
        pose: Pose,
        collision_model: Models | None = None,
        settings: Settings | None = None,
    ) -> None:
        super().__init__(obj_id, name, pose, collision_model, settings)
        self.color_camera_params = None
'''

PART = '''
from arcor2_hw.objects import CollisionObject


class Part(CollisionObject):
    """A part with four focus points."""

    _ABSTRACT = False
'''

CHOOSER = '''
import time
from dataclasses import dataclass
from arcor2_hw.actions import action
from arcor2_hw.objects import Generic, Settings


@dataclass
class ChooserSettings(Settings):
    greeting: str = "hello"
    level: int = 1


class Chooser(Generic):
    """A device whose actions offer values that depend on each other."""

    _ABSTRACT = False
    DYNAMIC_PARAMS = {"item": ("items", {"shelf", "count"}), "shelf": ("shelves", set())}
    CANCEL_MAPPING = {"wait": "leave"}

    def __init__(self, obj_id: str, name: str, settings: ChooserSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._left = False

    def shelves(self) -> set[str]:
        return {"upper", "lower"}

    def items(self, shelf: str, count: int) -> set[str]:
        if shelf not in self.shelves():
            raise ValueError(f"there is no shelf {shelf}")
        return {f"{shelf} {number}" for number in range(count)}

    @action
    def take(self, shelf: str, count: int, item: str, *, an: str | None = None) -> str:
        return f"{shelf}/{item}/{count}"

    @action
    def greet(self, *, an: str | None = None) -> str:
        return f"{self.settings.greeting} {self.settings.level}"

    @action
    def wait(self, seconds: float, *, an: str | None = None) -> None:
        self._left = False
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            if self._left:
                raise RuntimeError("left")
            time.sleep(0.01)

    def leave(self) -> None:
        self._left = True
'''

OLDER_ARM = '''
from typing import Literal

from arcor2 import DynamicParamTuple as DPT
from arcor2.data.common import ActionMetadata, Joint, Orientation, Pose, Position
from arcor2_object_types.abstract import Robot


class OlderArm(Robot):
    """Three joints that are the position. Its methods have other parameter names than the base class."""

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, pose: Pose) -> None:
        super().__init__(obj_id, name, pose)
        self._tip = Pose(Position(0.4, 0.1, 0.3), Orientation())

    def get_end_effectors_ids(self) -> set[str]:
        return {"tip"}

    def get_end_effector_pose(self, end_effector_id):
        assert end_effector_id == "tip", end_effector_id
        return self._tip

    def robot_joints(self, with_gripper: bool = False) -> list[Joint]:
        return [Joint(name, value) for name, value in zip("xyz", self._tip.position)]

    def grippers(self) -> set[str]:
        return set()

    def suctions(self) -> set[str]:
        return set()

    def forward_kinematics(self, end_effector_id: str, joints: list[Joint]) -> Pose:
        return Pose(Position(*(joint.value for joint in joints)), Orientation())

    def move_to_pose(
        self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True, linear: bool = True
    ) -> None:
        self._tip = target_pose

    def jog(
        self,
        twist: tuple[float, float, float, float, float, float] | None = None,
        joint_velocities: list[float] | None = None,
        frame: Literal["world", "base", "tool", "user"] = "world",
        valid_for: float = 0.2,
        end_effector_id: str | None = None,
    ) -> None:
        x, y, z = (place + rate * valid_for for place, rate in zip(self._tip.position, twist))
        self._tip = Pose(Position(x, y, z), Orientation())

    def stop(self) -> None:
        pass

    def programs(self, chosen_group: str) -> set[str]:
        return {chosen_group + "1", chosen_group + "2"}

    def run(self, group: str, program: str, *, an: None | str = None) -> None:
        pass

    run.__action__ = ActionMetadata()
    DYNAMIC_PARAMS = {"program": DPT(programs.__name__, {"group"})}
'''

OLDER_ARMS = '''
from arcor2.data.common import Joint, Orientation, Pose, Position, StrEnum
from arcor2_object_types.abstract import MultiArmRobot


class Arms(StrEnum):
    LEFT: str = "left"
    RIGHT: str = "right"


class OlderArms(MultiArmRobot):
    """Two arms, which are selected by the parameter `arm`."""

    _ABSTRACT = False

    def get_arm_ids(self) -> set[str]:
        return Arms.set()

    def get_end_effectors_ids(self, arm: None | str = None) -> set[str]:
        return {"tip"} if arm in Arms.set() else set()

    def get_end_effector_pose(self, end_effector_id: str, arm: None | str = None) -> Pose:
        return Pose(Position(0, 0.5 if Arms(arm) is Arms.LEFT else -0.5, 0.3), Orientation())

    def robot_joints(self, with_gripper: bool = False, arm: None | str = None) -> list[Joint]:
        return [Joint(f"{name}_1", 0.25) for name in sorted(Arms.set()) if arm in (None, name)]

    def grippers(self, arm: None | str = None) -> set[str]:
        return {f"{arm}_jaw"}

    def suctions(self, arm: None | str = None) -> set[str]:
        return {f"{arm}_cup"}
'''

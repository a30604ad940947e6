"""The YuMi on its fake controller, on its own address."""

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from arcor2_drivers.abb_yumi.settings import YumiSettings
from arcor2_drivers.abb_yumi.yumi import ArmId, YuMi
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint, Safety
from arcor2_hw.exceptions import Stale
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from tests.drivers.abb_yumi.conftest import RWS_PORT, FakeYumi, settings
from tests.drivers.fake_bench import ControllerBench
from tests.waiting import wait_for

ORPHAN = """
import sys
from arcor2_drivers.abb_yumi.settings import YumiSettings
from arcor2_drivers.abb_yumi.yumi import YuMi
from arcor2_hw.data.geometry import Pose
robot = YuMi("id", "orphan", Pose(), YumiSettings(sys.argv[1], int(sys.argv[2]), left_mass=0.2, right_mass=0.2))
robot.connect()
robot.take_control()
joints = robot.robot_joints(arm_id="left")
joints[5].value += 3.0
robot.move_to_joints(joints, 0.5, arm_id="left")
"""
ABSENT = "127.99.77.2"


class YuMiBench(ControllerBench):
    object_type = YuMi
    connect_timeout = 5.0  # about twenty requests, each of which a busy machine delays
    call_within = 3.0
    stale_after = 2.2
    fake: FakeYumi

    def start(self) -> None:
        self.fake = FakeYumi()

    def make(self) -> YuMi:
        robot = YuMi("robot_id", "both arms", Pose(), settings(self.fake.host, watchdog=0.5))
        robot._observer.fresh_for = 2.0  # about ten requests, each of which a busy machine delays
        return robot

    def absent(self) -> tuple[Generic, str]:
        return YuMi("robot_id", "both arms", Pose(), YumiSettings(ABSENT)), ABSENT

    def writes(self) -> Any:
        truth = self.fake.truth()
        kept = ("joints", "moves_begun", "load", "tool_position", "width", "vacuum", "lead_through")
        arms = {name: [arm[key] for key in kept] for name, arm in truth["arms"].items()}
        return truth["writes"], truth["mastership"], arms

    def turn(self, device: Generic, by: float) -> object:
        assert isinstance(device, YuMi)
        joints = device.robot_joints(arm_id="left")
        joints[5].value += by if joints[5].value < 0.5 else -by
        device.move_to_joints(joints, 0.5, arm_id="left")
        return device.last_moves

    def running(self) -> bool:
        return self.fake.moving()

    def readings(self, device: Generic) -> Iterable[Check]:
        assert isinstance(device, YuMi)
        for arm in ("left", "right"):
            truth = self.fake.arm(arm)
            for joint, degrees in zip(device.robot_joints(arm_id=arm), truth["joints"], strict=True):
                yield Check(joint.name, joint.value, math.radians(degrees), 1e-5)
            pose = device.get_end_effector_pose("tcp", arm)
            flange = (pose * Pose(Position(0.0, 0.0, -0.136))).position
            for axis, by_driver, by_device in zip("xyz", flange, truth["position"], strict=True):
                yield Check(f"{axis} of the {arm} flange", by_driver, by_device, 1e-5)

    def results(self, device: Generic) -> Iterable[Check]:
        assert isinstance(device, YuMi)
        device.calibrate_gripper(ArmId.LEFT)
        for width in (0.01, 0.015):
            yield Check("open_gripper", device.open_gripper(ArmId.LEFT, width + 0.005), self._width(), 1e-4)
            self.fake.do("part", arm="left", width=width)
            yield Check("grip", device.grip(ArmId.LEFT), width, 1e-4)
            yield Check("gripper_width", device.gripper_width(ArmId.LEFT), self._width(), 1e-4)

    def _width(self) -> float:
        return float(self.fake.arm("left")["width"])

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, YuMi)
        joints = device.robot_joints(arm_id="left")
        beyond = [Joint(joints[0].name, 3.0), *joints[1:]]
        far, tool = Pose(Position(1.5, 0.0, 0.3)), (0.0, 0.0, 0.05)
        across = device.get_end_effector_pose("tcp", "left")
        across.position.y -= 0.35
        return {
            "a joint beyond its range": lambda: device.move_to_joints(beyond, 0.5, arm_id="left"),
            "a speed above 1": lambda: device.move_to_joints(joints, 1.5, arm_id="left"),
            "a pose out of reach": lambda: device.move_to_pose("tcp", far, 0.5, arm_id="left"),
            "a path into the other arm": lambda: device.move_to_pose("tcp", across, 0.5, linear=False, arm_id="left"),
            "a path of nothing": lambda: device.move_path([], arm_id="left"),
            "a blend of a metre": lambda: device.move_path([across], 1.0, arm_id="left"),
            "a synchronous motion of a single arm": lambda: device.move_synchronously({"left": joints}),
            "a load of 2 kg": lambda: device.set_tool(Pose(), 2.0, tool, arm_id="left"),
        }

    def works(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, YuMi)

        def near(arm: str, up: float) -> Pose:
            pose = device.get_end_effector_pose("tcp", arm)
            pose.position.z += up
            return pose

        def turned(arm: str) -> list[Joint]:
            joints = device.robot_joints(arm_id=arm)
            joints[5].value += 0.1
            return joints

        def taught() -> None:
            device.set_hand_teaching_mode(True, "left")
            assert self.fake.arm("left")["lead_through"]
            device.set_hand_teaching_mode(False, "left")
            assert not self.fake.arm("left")["lead_through"]

        def tooled() -> None:
            device.set_tool(Pose(Position(0.0, 0.0, 0.15)), 0.3, (0.0, 0.0, 0.06), arm_id="left")
            assert self.fake.arm("left")["load"] == [0.3, 0.0, 0.0, 60.0]

        def collided() -> None:
            self.fake.do("collide", arm="left")
            wait_for(protected)
            device.acknowledge_protective_stop("the suite")
            device.take_control()

        def protected() -> bool:
            try:
                return device.state().safety is Safety.PROTECTIVE_STOP
            except Stale:  # a busy machine polls seldom
                return False

        def switched() -> None:
            self.fake.do("control_state", state="motoroff")
            device.power_on()
            assert self.fake.truth()["control_state"] == "motoron"

        return {
            "move_to_pose": lambda: device.move_to_pose("tcp", near("left", 0.03), 0.5, arm_id="left"),
            "move_to_joints": lambda: device.move_to_joints(turned("right"), 0.5, arm_id="right"),
            "move_path": lambda: device.move_path([near("left", 0.02), near("left", 0.04)], arm_id="left"),
            "move_synchronously": lambda: device.move_synchronously({"left": turned("left"), "right": turned("right")}),
            "stop": device.stop,
            "inverse_kinematics": lambda: device.inverse_kinematics("tcp", near("right", 0.02), arm_id="right"),
            "forward_kinematics": lambda: device.forward_kinematics("tcp", turned("left"), "left"),
            "get_hand_teaching_mode": lambda: device.get_hand_teaching_mode("left"),
            "set_hand_teaching_mode": taught,
            "set_tool": tooled,
            "acknowledge_protective_stop": collided,
            "power_on": switched,
        }

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address, str(RWS_PORT)]

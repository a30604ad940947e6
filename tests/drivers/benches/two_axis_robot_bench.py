"""The two-axis robot on its fake servos, on a pty; the servos stop by their bus watchdog."""

import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from arcor2_drivers.two_axis_robot.settings import TwoAxisRobotSettings
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench, Check
from arcor2_hw.testing.life import wait_until
from tests.fakes.conftest import FakeProcess

ORPHAN = """
import sys
from arcor2_drivers.two_axis_robot.settings import TwoAxisRobotSettings
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.geometry import Pose
robot = TwoAxisRobot("id", "orphan", Pose(), TwoAxisRobotSettings(sys.argv[1], watchdog=0.4))
robot.connect()
robot.take_control()
joints = robot.robot_joints()
joints[0].value += 1.5
robot.move_to_joints(joints, 0.1)
"""
AT_REST = 0.03  # rad/s: what a servo tells as 0


class TwoAxisRobotBench(Bench):
    object_type = TwoAxisRobot
    fake: FakeProcess

    def start(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.fake = FakeProcess("two_axis_robot", "--link", str(Path(self.folder.name) / "ttyDXL"))
        self.do = self.fake.control.do

    def end(self) -> None:
        self.fake.end()
        self.folder.cleanup()

    def reset(self) -> None:
        self.do("heal")
        self.do("power_cycle")
        self.fake.control.wait_until(lambda truth: all(servo["answers"] for servo in truth["servos"].values()))

    @property
    def address(self) -> str:
        return str(self.fake.ready["port"])

    def _build(self, port: str) -> TwoAxisRobot:
        # The longest watchdog: the machine that runs the suite may be busy.
        return TwoAxisRobot("arm_id", "arm", Pose(), TwoAxisRobotSettings(port, watchdog=0.4))

    def make(self) -> TwoAxisRobot:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build("/dev/does-not-exist"), "/dev/does-not-exist"

    def writes(self) -> Any:
        return {number: servo["writes"] for number, servo in self.fake.truth()["servos"].items()}

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        self.do("heal")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, TwoAxisRobot)
        return device.robot_joints()

    def _turn(self, device: Generic, by: float, speed: float) -> None:
        assert isinstance(device, TwoAxisRobot)
        joints = device.robot_joints()
        joints[0].value += math.copysign(by, -joints[0].value)
        device.move_to_joints(joints, speed)

    def ask(self, device: Generic) -> object:
        return self._turn(device, 0.1, 0.5)

    def command(self, device: Generic) -> object:
        return self._turn(device, 0.1, 0.5)

    def run_long(self, device: Generic) -> object:
        return self._turn(device, 1.5, 0.1)

    def running(self) -> bool:
        return any(abs(servo["speed"]) > AT_REST for servo in self.fake.truth()["servos"].values())

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address]

    def reset_link(self) -> None:
        self.do("reset")

    def half_frame(self) -> None:
        self.do("half_frame")

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, TwoAxisRobot)
        self.do("place", servo=1, ticks=2500)
        self.do("place", servo=2, ticks=1800)
        time.sleep(0.3)  # until the driver has looked again
        servos = self.fake.truth()["servos"]
        joints = device.robot_joints()
        return [
            Check(f"{joint.name}, rad", joint.value, servos[number]["angle"], 0.01)
            for joint, number in zip(joints, ("1", "2"), strict=True)
        ]

    @staticmethod
    def _tool(device: TwoAxisRobot) -> str:
        return next(iter(device.get_end_effectors_ids()))

    def _turned(self, device: TwoAxisRobot, by: float) -> list[Joint]:
        joints = device.robot_joints()
        joints[1].value += by
        return joints

    def _teach(self, device: TwoAxisRobot) -> None:
        device.set_hand_teaching_mode(True)
        device.set_hand_teaching_mode(False)

    def _jog(self, device: TwoAxisRobot) -> None:
        before = device.robot_joints()[1].value
        device.jog(joint_velocities=[0.0, 0.5], valid_for=0.2)
        wait_until(lambda: not self.running() and abs(device.robot_joints()[1].value - before) > 0.05, 3.0, "a jog")

    def _restart(self, device: TwoAxisRobot) -> None:
        self.do("hardware_error", servo=1)
        wait_until(lambda: bool(device.alarms()), 3.0, "seeing a hardware error")
        device.restart_safety("the bench")

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, TwoAxisRobot)
        tool = self._tool(device)
        return {
            "forward_kinematics": lambda: device.forward_kinematics(tool, self._turned(device, 0.3)),
            "move_to_joints": lambda: device.move_to_joints(self._turned(device, 0.5), 0.5),
            "inverse_kinematics": lambda: device.inverse_kinematics(tool, device.get_end_effector_pose(tool)),
            "move_to_pose": lambda: device.move_to_pose(
                tool, device.forward_kinematics(tool, self._turned(device, 0.3)), 0.5, linear=False
            ),
            "jog": lambda: self._jog(device),
            "stop": device.stop,
            "set_hand_teaching_mode": lambda: self._teach(device),
            "restart_safety": lambda: self._restart(device),
        }

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, TwoAxisRobot)
        return {
            "a joint beyond its limit": lambda: device.move_to_joints(self._turned(device, 9.0), 0.5),
            "a pose out of reach": lambda: device.move_to_pose(
                self._tool(device), Pose(Position(5.0, 0.0, 0.0)), 0.5, linear=False
            ),
            "a speed above the highest": lambda: device.move_to_joints(self._turned(device, 0.1), 2.0),
        }

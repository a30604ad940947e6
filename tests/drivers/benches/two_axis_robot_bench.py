"""The two-axis robot on its fake servos, on a pty; the servos stop by their bus watchdog."""

import math
import sys
from collections.abc import Callable, Iterator
from typing import Any

from arcor2_drivers.two_axis_robot.settings import TwoAxisRobotSettings
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.life import wait_until
from tests.drivers.fake_bench import FakeBench

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
STANDSTILL = 0.03  # rad/s: the resolution of a servo's velocity


class TwoAxisRobotBench(FakeBench):
    object_type = TwoAxisRobot
    module = "two_axis_robot"
    link = "ttyDXL"
    nowhere = "/dev/does-not-exist"

    def reset(self) -> None:
        self.do("heal")
        for servo in (1, 2):
            self.do("absent", servo=servo, on=False)
            self.do("temperature", servo=servo, celsius=35)
        self.do("power_cycle")
        self.fake.control.wait_until(lambda truth: all(servo["answers"] for servo in truth["servos"].values()))

    def build(self, address: str) -> TwoAxisRobot:
        # Use the longest watchdog, because the machine that runs the suite may be busy.
        return TwoAxisRobot("arm_id", "arm", Pose(), TwoAxisRobotSettings(address, watchdog=0.4))

    def writes(self) -> Any:
        """Return all writes except those to the LEDs, which keep the bus watchdog from tripping."""
        servos = self.fake.truth()["servos"]
        return {number: [each for each in servo["writes"] if each[0] != "led"] for number, servo in servos.items()}

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
        return any(abs(servo["speed"]) > STANDSTILL for servo in self.fake.truth()["servos"].values())

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address]

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, TwoAxisRobot)
        self.do("place", servo=1, ticks=2500)
        self.do("place", servo=2, ticks=1800)
        servos = self.fake.truth()["servos"]
        real = [servos[number]["angle"] for number in ("1", "2")]
        return [self.polled("joints, rad", lambda: [joint.value for joint in device.robot_joints()], real, 0.01)]

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, TwoAxisRobot)
        for by in (0.3, -0.2):
            device.move_to_joints(self._turned(device, by), 0.5)
            servos = self.fake.truth()["servos"]
            real = [servos[number]["angle"] for number in ("1", "2")]
            yield self.polled("robot_joints", lambda: [joint.value for joint in device.robot_joints()], real, 0.01)

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
            "a speed above the maximum": lambda: device.move_to_joints(self._turned(device, 0.1), 2.0),
        }

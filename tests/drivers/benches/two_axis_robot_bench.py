"""The two-axis robot on its fake servos, on a pty; the servos stop by their bus watchdog."""

import math
import sys
import tempfile
from pathlib import Path
from typing import Any

from arcor2_drivers.two_axis_robot.settings import TwoAxisRobotSettings
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_hw.data.geometry import Pose
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
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

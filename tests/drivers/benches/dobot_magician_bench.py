"""The Dobot Magician on its fake. It has no watchdog: a started motion continues after a connection loss."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.life import wait_until
from tests.drivers.fake_bench import FakeBench

ORPHAN = """
import sys
from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.geometry import Pose
arm = DobotMagician("id", "orphan", Pose(), DobotMagicianSettings(sys.argv[1]))
arm.connect()
arm.take_control()
joints = arm.robot_joints()
joints[0].value = float(sys.argv[2])
arm.move_to_joints(joints, 0.05)
"""
TURN = 1.5  # rad, of the base
SENT = 1
"""Bit of a frame's control byte that marks a write."""


class DobotMagicianBench(FakeBench):
    object_type = DobotMagician
    module = "dobot_magician"
    link = "ttyDOBOT"
    nowhere = "/dev/does-not-exist"

    def reset(self) -> None:
        self.do("heal")
        self.do("renew")
        self.do("pace", factor=1.0)

    def build(self, address: str) -> DobotMagician:
        return DobotMagician("arm_id", "arm", Pose(), DobotMagicianSettings(address, answer_timeout=0.8))

    def writes(self) -> Any:
        truth = self.fake.truth()
        written = [each for each in truth["received"] if each[1] & SENT]
        return written, truth["suction"], truth["gripper"], truth["steppers"]

    def heal(self) -> None:
        # A started motion is completed, as declared. After that, no motion may start.
        wait_until(lambda: not self.running(), 15.0, "the end of a started motion")
        super().heal()

    def observe(self, device: Generic) -> object:
        assert isinstance(device, DobotMagician)
        return device.robot_joints()

    def ask(self, device: Generic) -> object:
        return self.command(device)

    def command(self, device: Generic) -> object:
        assert isinstance(device, DobotMagician)
        return device.suck(True)

    def run_long(self, device: Generic) -> object:
        """Turn the base from one side to the other, which takes about 4 s."""
        assert isinstance(device, DobotMagician)
        joints = device.robot_joints()
        joints[0].value = math.copysign(1.5, -joints[0].value)
        return device.move_to_joints(joints, 0.2)

    def running(self) -> bool:
        return bool(self.fake.truth()["moving"])

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.do("drive", turn=90.0)
        try:
            yield
        finally:
            self.do("renew")

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address, str(TURN)]

    def progress(self) -> float:
        return math.radians(self.fake.truth()["joints"][0]) / TURN

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, DobotMagician)
        self.do("drive", turn=30.0, percent=100.0)
        wait_until(lambda: self.fake.truth()["motions"] == 1 and not self.running(), 10.0, "a turn of 30 degrees")
        truth = self.fake.truth()
        joints = [math.radians(own) for own in truth["joints"]]
        tool = [each / 1000.0 for each in truth["tool"][:2]]

        def position() -> list[float]:
            found = device.get_end_effector_pose(self._tool(device)).position
            return [found.x, found.y]

        return [
            self.polled("joints, rad", lambda: [joint.value for joint in device.robot_joints()], joints, 1e-3),
            self.polled("x and y of the tool, m", position, tool, 1e-3),
        ]

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, DobotMagician)
        for by in (0.2, -0.3):
            device.move_to_joints(self._turned(device, by), 0.5)
            real = [math.radians(own) for own in self.fake.truth()["joints"]]
            yield self.polled("robot_joints", lambda: [joint.value for joint in device.robot_joints()], real, 1e-3)

    @staticmethod
    def _tool(device: DobotMagician) -> str:
        return next(iter(device.get_end_effectors_ids()))

    def _turned(self, device: DobotMagician, by: float) -> list[Joint]:
        joints = device.robot_joints()
        joints[0].value += by
        return joints

    def _home(self, device: DobotMagician) -> None:
        self.do("pace", factor=20.0)
        device.home()
        self.do("pace", factor=1.0)

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, DobotMagician)
        tool = self._tool(device)
        return {
            "forward_kinematics": lambda: device.forward_kinematics(tool, self._turned(device, 0.1)),
            "inverse_kinematics": lambda: device.inverse_kinematics(tool, device.get_end_effector_pose(tool)),
            "move_to_joints": lambda: device.move_to_joints(self._turned(device, 0.1), 0.5),
            "move_to_pose": lambda: device.move_to_pose(
                tool, device.forward_kinematics(tool, self._turned(device, -0.1)), 0.5
            ),
            "stop": device.stop,
            "home": lambda: self._home(device),
        }

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, DobotMagician)
        return {
            "a joint beyond its limit": lambda: device.move_to_joints(self._turned(device, 3.0), 0.5),
            "a pose out of reach": lambda: device.move_to_pose(self._tool(device), Pose(Position(2.0, 0.0, 0.0)), 0.5),
            "a speed above the maximum": lambda: device.move_to_joints(self._turned(device, 0.1), 2.0),
        }

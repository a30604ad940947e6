"""The Dobot Magician on its fake. It has no watchdog: a started motion continues after a connection loss."""

import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench, Check
from arcor2_hw.testing.life import wait_until
from tests.fakes.conftest import FakeProcess

ORPHAN = """
import sys
from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.geometry import Pose
arm = DobotMagician("id", "orphan", Pose(), DobotMagicianSettings(sys.argv[1]))
arm.connect()
arm.take_control()
joints = arm.robot_joints()
joints[0].value = 1.5
arm.move_to_joints(joints, 0.05)
"""
SENT = 1
"""Bit of a frame's control byte that says that something is written."""


class DobotMagicianBench(Bench):
    object_type = DobotMagician
    fake: FakeProcess

    def start(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.fake = FakeProcess("dobot_magician", "--link", str(Path(self.folder.name) / "ttyDOBOT"))
        self.do = self.fake.control.do

    def end(self) -> None:
        self.fake.end()
        self.folder.cleanup()

    def reset(self) -> None:
        self.do("heal")
        self.do("renew")
        self.do("pace", factor=1.0)

    @property
    def address(self) -> str:
        return str(self.fake.ready["port"])

    def _build(self, port: str) -> DobotMagician:
        return DobotMagician("arm_id", "arm", Pose(), DobotMagicianSettings(port))

    def make(self) -> DobotMagician:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build("/dev/does-not-exist"), "/dev/does-not-exist"

    def writes(self) -> Any:
        truth = self.fake.truth()
        written = [each for each in truth["received"] if each[1] & SENT]
        return written, truth["suction"], truth["gripper"], truth["steppers"]

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        # A motion that was begun is done, as declared; only then may nothing begin any more.
        wait_until(lambda: not self.running(), 15.0, "the end of a motion that was begun")
        self.do("heal")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, DobotMagician)
        return device.robot_joints()

    def ask(self, device: Generic) -> object:
        return self.command(device)

    def command(self, device: Generic) -> object:
        assert isinstance(device, DobotMagician)
        return device.suck(True)

    def run_long(self, device: Generic) -> object:
        """Turn the base from one side to the other, which takes some 4 s."""
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
        return [sys.executable, "-c", ORPHAN, self.address]

    def reset_link(self) -> None:
        self.do("reset")

    def half_frame(self) -> None:
        self.do("half_frame")

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, DobotMagician)
        self.do("drive", turn=30.0, percent=100.0)
        wait_until(lambda: self.fake.truth()["motions"] == 1 and not self.running(), 10.0, "a turn of 30 degrees")
        time.sleep(0.3)  # until the driver has looked again
        truth = self.fake.truth()
        joints = zip(device.robot_joints(), truth["joints"], strict=True)
        position = device.get_end_effector_pose(self._tool(device)).position
        return [
            *(Check(f"{joint.name}, rad", joint.value, math.radians(own), 1e-3) for joint, own in joints),
            Check("the tool's x, m", position.x, truth["tool"][0] / 1000.0, 1e-3),
            Check("the tool's y, m", position.y, truth["tool"][1] / 1000.0, 1e-3),
        ]

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
            "a speed above the highest": lambda: device.move_to_joints(self._turned(device, 0.1), 2.0),
        }

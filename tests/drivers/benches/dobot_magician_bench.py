"""The Dobot Magician on its fake, on a pty. It has no watchdog: what was begun goes on when we are gone."""

import math
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_hw.data.geometry import Pose
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
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

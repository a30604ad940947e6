"""The YuMi on its fake controller, on an address of its own."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from arcor2_drivers.abb_yumi.settings import YumiSettings
from arcor2_drivers.abb_yumi.yumi import YuMi
from arcor2_hw.data.geometry import Pose
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from tests.drivers.abb_yumi.conftest import RWS_PORT, FakeYumi, settings

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


class YuMiBench(Bench):
    object_type = YuMi
    call_within = 3.0
    fake: FakeYumi

    def start(self) -> None:
        self.fake = FakeYumi()

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        self.fake.reset()

    @property
    def address(self) -> str:
        return self.fake.host

    def make(self) -> YuMi:
        return YuMi("robot_id", "both arms", Pose(), settings(self.fake.host))

    def absent(self) -> tuple[Generic, str]:
        return YuMi("robot_id", "both arms", Pose(), YumiSettings(ABSENT)), ABSENT

    def writes(self) -> Any:
        truth = self.fake.truth()
        kept = ("joints", "moves_begun", "load", "tool_position", "width", "vacuum", "lead_through")
        arms = {name: [arm[key] for key in kept] for name, arm in truth["arms"].items()}
        return truth["writes"], truth["mastership"], arms

    def cut(self) -> None:
        self.fake.do("silence")

    def heal(self) -> None:
        self.fake.do("heal")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, YuMi)
        return device.robot_joints()

    def _turn(self, device: Generic, by: float) -> None:
        assert isinstance(device, YuMi)
        joints = device.robot_joints(arm_id="left")
        joints[5].value += by if joints[5].value < 0.5 else -by
        device.move_to_joints(joints, 0.5, arm_id="left")

    def ask(self, device: Generic) -> object:
        return self._turn(device, 0.1)

    def command(self, device: Generic) -> object:
        return self._turn(device, 0.1)

    def run_long(self, device: Generic) -> object:
        return self._turn(device, 3.0)

    def running(self) -> bool:
        return self.fake.moving()

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.fake.do("foreign_program", on=True)
        try:
            yield
        finally:
            self.fake.do("foreign_program", on=False)

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address, str(RWS_PORT)]

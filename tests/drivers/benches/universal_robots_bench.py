"""The UR5e on its fake controller, on an address of its own."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.geometry import Pose
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from tests.drivers.universal_robots.conftest import FakeUr

ORPHAN = """
import sys
from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.geometry import Pose
robot = UR5e("id", "orphan", Pose(), UrSettings(sys.argv[1], payload_mass=1.0, tcp_z=0.1))
robot.connect()
robot.take_control()
joints = robot.robot_joints()
joints[0].value += 3.0
robot.move_to_joints(joints, 0.5)
"""
ABSENT = "127.99.77.1"
AT_REST = 1e-3  # rad/s: the noise of the encoders of a real arm that stands


class UR5eBench(Bench):
    object_type = UR5e
    call_within = 4.0
    fake: FakeUr

    def start(self) -> None:
        self.fake = FakeUr("--time-scale", "0.1")

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        self.fake.reset()

    @property
    def address(self) -> str:
        return self.fake.host

    def _build(self, host: str) -> UR5e:
        return UR5e("robot_id", "arm", Pose(), UrSettings(host, payload_mass=1.0, tcp_z=0.1, watchdog_frequency=5.0))

    def make(self) -> UR5e:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build(ABSENT), ABSENT

    def writes(self) -> Any:
        truth = self.fake.truth()
        kept = ("scripts_taken", "programs_killed", "digital_outputs", "payload", "tcp_offset")
        return {key: truth[key] for key in kept}, self.fake.do("commands_taken")

    def cut(self) -> None:
        self.fake.do("silence")

    def heal(self) -> None:
        self.fake.do("heal")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, UR5e)
        return device.robot_joints()

    def _turn(self, device: Generic, by: float) -> None:
        assert isinstance(device, UR5e)
        joints = device.robot_joints()
        joints[0].value += by if joints[0].value < 1.0 else -by
        device.move_to_joints(joints, 0.5)

    def ask(self, device: Generic) -> object:
        return self._turn(device, 0.1)

    def command(self, device: Generic) -> object:
        return self._turn(device, 0.1)

    def run_long(self, device: Generic) -> object:
        return self._turn(device, 3.0)

    def running(self) -> bool:
        return bool(max(map(abs, self.fake.truth()["qd"])) > AT_REST)

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.fake.do("foreign_program", on=True)
        try:
            yield
        finally:
            self.fake.do("foreign_program", on=False)

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address]

"""The 2F gripper on its fake. After a connection loss it finishes its motion and holds."""

import sys
from collections.abc import Callable
from typing import Any

from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.robotiq_2f.settings import Robotiq2FSettings
from arcor2_fakes.control import BlockingControlClient
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench, Check
from arcor2_hw.testing.life import wait_until
from tests.fakes.conftest import FakeProcess

PACE = 6.0
"""How much faster than real the gripper is, so that its activation is quick; gripping is done at its slowest."""
READY = 100.0
MOVING = 0
"""gOBJ of fingers under way."""
ORPHAN = """
import sys
from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.robotiq_2f.settings import Robotiq2FSettings
gripper = Robotiq2F("id", "orphan", Robotiq2FSettings(host=sys.argv[1], port=int(sys.argv[2])))
gripper.connect()
gripper.take_control()
gripper.activate()
gripper.grip(0.0, speed=0.02)
"""


class Robotiq2FBench(Bench):
    object_type = Robotiq2F
    fake: FakeProcess

    def start(self) -> None:
        self.fake = FakeProcess("robotiq_2f", "--time-scale", str(PACE))
        self.do = self.fake.control.do
        self.beside = BlockingControlClient(self.fake.ready["control"])  # for calls on another thread

    def end(self) -> None:
        self.beside.close()
        self.fake.end()

    def reset(self) -> None:
        self.do("heal")
        self.do("remove_part")
        self.do("block", on=False)
        self.do("power_cycle")
        self.do("pace", factor=PACE)

    @property
    def address(self) -> str:
        return str(self.fake.ready["ascii"])

    def _build(self, address: str) -> Robotiq2F:
        host, _, port = address.rpartition(":")
        return Robotiq2F("gripper_id", "gripper", Robotiq2FSettings(host=host, port=int(port), request_timeout=0.3))

    def make(self) -> Robotiq2F:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build("127.0.0.1:1"), "127.0.0.1:1"

    def writes(self) -> Any:
        return self.fake.truth()["count"], self.fake.truth()["sets"]

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        # A motion that was begun is finished, as declared; only then may nothing begin any more.
        wait_until(lambda: not self.running(), 10.0, "the end of a motion that was begun")
        self.do("heal")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, Robotiq2F)
        return device.width()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, Robotiq2F)
        return device.part_held()

    def command(self, device: Generic) -> object:
        assert isinstance(device, Robotiq2F)
        return device.activate()

    def run_long(self, device: Generic) -> object:
        """Close and open at the slowest, which takes 4.3 s of the gripper's each."""
        assert isinstance(device, Robotiq2F)
        if device.state() == "inactive":
            self.beside.do("pace", factor=READY)
            device.activate()
            device.grip(0.085)
            self.beside.do("pace", factor=1.0)
        return device.grip(0.0 if device.width() > 0.04 else 0.085, speed=0.02)

    def running(self) -> bool:
        registers = self.fake.truth()["registers"]
        return bool(registers["GTO"] and registers["OBJ"] == MOVING)

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, *self.address.rsplit(":", 1)]

    def reset_link(self) -> None:
        self.do("reset")

    def half_frame(self) -> None:
        self.do("half_frame")

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        return {}  # no optional method but those that read

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, Robotiq2F)
        return [Check("the width, m", device.width(), self.fake.truth()["width"], 0.001)]

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, Robotiq2F)
        return {
            "a width beyond the stroke": lambda: device.grip(0.2),
            "a negative width": lambda: device.grip(-0.01),
            "a force beyond the model's": lambda: device.grip(force=500.0),
            "a speed beyond the model's": lambda: device.grip(speed=1.0),
        }

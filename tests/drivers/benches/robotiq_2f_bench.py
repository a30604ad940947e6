"""The 2F gripper on its fake. After a connection loss it completes its motion and holds."""

import sys
from collections.abc import Callable, Iterator
from typing import Any

from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.robotiq_2f.settings import Robotiq2FSettings
from arcor2_fakes.control import BlockingControlClient
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.life import wait_until
from tests.drivers.fake_bench import FakeBench

PACE = 6.0
"""Speed factor of the fake, so that activation is fast; gripping uses the lowest speed."""
READY = 100.0
MOVING, GRIPPED = 0, 2
"""Values of gOBJ for moving fingers, and for fingers stopped by a part while closing."""
ORPHAN = """
import sys
import time
from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.robotiq_2f.settings import Robotiq2FSettings
gripper = Robotiq2F("id", "orphan", Robotiq2FSettings(host=sys.argv[1], port=int(sys.argv[2])))
gripper.connect()
gripper.take_control()
gripper.grip(0.0, 30.0)
time.sleep(60.0)
"""
PART = 0.04  # m


class Robotiq2FBench(FakeBench):
    object_type = Robotiq2F
    module = "robotiq_2f"
    options = ("--time-scale", str(PACE))
    port = "ascii"

    def start(self) -> None:
        super().start()
        self.second_control = BlockingControlClient(self.fake.ready["control"])  # for calls in another thread

    def end(self) -> None:
        self.second_control.close()
        super().end()

    def reset(self) -> None:
        self.do("heal")
        self.do("remove_part")
        self.do("block", on=False)
        self.do("power_cycle")
        self.do("pace", factor=PACE)

    def build(self, address: str) -> Robotiq2F:
        host, _, port = address.rpartition(":")
        return Robotiq2F("gripper_id", "gripper", Robotiq2FSettings(host=host, port=int(port), request_timeout=0.5))

    def writes(self) -> Any:
        return self.fake.truth()["count"], self.fake.truth()["sets"]

    def heal(self) -> None:
        # A started motion is completed, as declared. After that, no motion may start.
        wait_until(lambda: not self.running(), 10.0, "the end of a started motion")
        super().heal()

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
        """Close and open at the lowest speed, which takes 4.3 s of the gripper's time each."""
        assert isinstance(device, Robotiq2F)
        if device.state() == "inactive":
            self.second_control.do("pace", factor=READY)
            device.activate()
            device.grip(0.085)
            self.second_control.do("pace", factor=1.0)
        return device.grip(0.0 if device.width() > 0.04 else 0.085, speed=0.02)

    def running(self) -> bool:
        registers = self.fake.truth()["registers"]
        return bool(registers["GTO"] and registers["OBJ"] == MOVING)

    def orphan(self) -> list[str]:
        first = self.controlled()
        assert isinstance(first, Robotiq2F)
        first.activate()
        first.disconnect()
        self.do("put_part", width=PART)
        return [sys.executable, "-c", ORPHAN, *self.address.rsplit(":", 1)]

    def holding(self) -> object:
        registers = self.fake.truth()["registers"]
        kept = {name: registers[name] for name in ("GTO", "POS", "FOR", "OBJ")}
        return kept if registers["OBJ"] == GRIPPED else None

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        return {}  # its optional methods only read

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, Robotiq2F)
        return [Check("the width, m", device.width(), self.fake.truth()["width"], 0.001)]

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, Robotiq2F)
        device.activate()
        for part in (PART, None):
            device.grip(0.085)
            self.do("remove_part") if part is None else self.do("put_part", width=part)
            held, width = device.grip()
            yield Check("grip", [held, width], [part is not None, self.fake.truth()["width"]], 0.001)
            yield self.polled("part_held", device.part_held, part is not None)

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, Robotiq2F)
        return {
            "a width beyond the stroke": lambda: device.grip(0.2),
            "a negative width": lambda: device.grip(-0.01),
            "a force beyond the model's": lambda: device.grip(force=500.0),
            "a speed beyond the model's": lambda: device.grip(speed=1.0),
        }

"""The conveyor on its fake: a drive behind a CAN adapter that is a TCP server."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from tests.fakes.conftest import FakeProcess

ORPHAN = """
import sys
from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
belt = Conveyor("id", "orphan", ConveyorSettings(sys.argv[1]))
belt.connect()
belt.take_control()
belt.move_by(20.0, 0.3)
"""


def build(address: str, **settings: Any) -> Conveyor:
    return Conveyor("belt_id", "belt", ConveyorSettings(f"socket://{address}", **settings))


class ConveyorBench(Bench):
    object_type = Conveyor
    fake: FakeProcess

    def start(self) -> None:
        self.fake = FakeProcess("conveyor")
        self.do = self.fake.control.do

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        self.do("heal")
        self.do("mute", on=False)
        self.do("power_cycle", belt=0)
        self.fake.control.wait_until(lambda truth: truth["booted"])

    @property
    def address(self) -> str:
        return str(self.fake.ready["can"])

    def make(self) -> Conveyor:
        return build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return build("127.0.0.1:1"), "127.0.0.1:1"

    def writes(self) -> Any:
        truth = self.fake.truth()
        return truth["writes"], truth["nmt"], round(truth["belt"])

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        self.do("heal")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, Conveyor)
        return device.position()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, Conveyor)
        return device.belt_position()

    def command(self, device: Generic) -> object:
        assert isinstance(device, Conveyor)
        return device.move_by(0.01, 0.3)

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, Conveyor)
        return device.move_by(20.0, 0.3)

    def running(self) -> bool:
        return bool(self.do("motion")["velocity"])

    @contextmanager
    def foreign(self) -> Iterator[None]:
        other = build(self.address, master_id=126)
        other.connect()
        other.take_control()
        try:
            yield
        finally:
            other.disconnect()

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, f"socket://{self.address}"]

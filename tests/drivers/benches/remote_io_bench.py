"""The remote I/O block and the tower light on one fake each."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings, TowerLightSettings
from arcor2_drivers.remote_io.tower_light import TowerLight
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from tests.fakes.conftest import FakeProcess

QUICK: dict[str, Any] = {"watchdog_ms": 400, "request_timeout": 0.1}
LONG = 20.0  # s, of a pulse

ORPHAN_IO = """
import sys
from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
host, port = sys.argv[1].rsplit(":", 1)
settings = RemoteIOSettings(host, int(port), watchdog_ms=400, request_timeout=0.1, points="valve=DO4")
block = RemoteIO("id", "orphan", settings)
block.connect()
block.take_control()
block.pulse("valve", 20.0)
"""
ORPHAN_LIGHT = """
import sys
from arcor2_drivers.remote_io.settings import TowerLightSettings
from arcor2_drivers.remote_io.tower_light import TowerLight
host, port = sys.argv[1].rsplit(":", 1)
settings = TowerLightSettings(host, int(port), watchdog_ms=400, request_timeout=0.1, green="DO0", buzzer="DO4")
light = TowerLight("id", "orphan", settings)
light.connect()
light.take_control()
light.buzz(20.0)
"""


def block(address: str, **settings: Any) -> RemoteIO:
    host, _, port = address.rpartition(":")
    points = "part=DI0; lamp=DO0; valve=DO4"
    return RemoteIO("block_id", "block", RemoteIOSettings(host, int(port), points=points, **{**QUICK, **settings}))


def light(address: str) -> TowerLight:
    host, _, port = address.rpartition(":")
    return TowerLight("light_id", "light", TowerLightSettings(host, int(port), green="DO0", buzzer="DO4", **QUICK))


class RemoteIOBench(Bench):
    object_type: ClassVar[type[Generic]] = RemoteIO
    fake: FakeProcess

    def start(self) -> None:
        self.fake = FakeProcess("remote_io")
        self.do = self.fake.control.do

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        self.do("renew")

    @property
    def address(self) -> str:
        return str(self.fake.ready["modbus"])

    def writes(self) -> Any:
        truth = self.fake.truth()
        return truth["writes"], truth["outputs"]

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        self.do("heal")

    def running(self) -> bool:
        return bool(self.do("outputs")["outputs"][4])

    @contextmanager
    def foreign(self) -> Iterator[None]:
        other = block(self.address)
        other.connect()
        other.take_control()
        try:
            yield
        finally:
            other.disconnect()

    def make(self) -> Generic:
        return block(self.address)

    def absent(self) -> tuple[Generic, str]:
        return block("127.0.0.1:1"), "127.0.0.1:1"

    def observe(self, device: Generic) -> object:
        assert isinstance(device, RemoteIO)
        return device.read("part")

    def ask(self, device: Generic) -> object:
        assert isinstance(device, RemoteIO)
        return device.read_digital("part")

    def command(self, device: Generic) -> object:
        assert isinstance(device, RemoteIO)
        return device.write_digital("lamp", True)

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, RemoteIO)
        return device.pulse("valve", LONG)

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN_IO, self.address]


class TowerLightBench(RemoteIOBench):
    object_type = TowerLight

    def make(self) -> Generic:
        return light(self.address)

    def absent(self) -> tuple[Generic, str]:
        return light("127.0.0.1:1"), "127.0.0.1:1"

    def observe(self, device: Generic) -> object:
        assert isinstance(device, TowerLight)
        return device.lit()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, TowerLight)
        return device.alarms()

    def command(self, device: Generic) -> object:
        assert isinstance(device, TowerLight)
        return device.off()

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, TowerLight)
        return device.buzz(LONG)

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN_LIGHT, self.address]

"""The remote I/O block and the tower light on one fake each. The wire in between is cut and recorded."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import pytest

from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings, TowerLightSettings
from arcor2_drivers.remote_io.tower_light import LampColor, TowerLight
from arcor2_hw.exceptions import Refused
from arcor2_hw.objects import Generic
from arcor2_hw.objects.machine import MachineStateName
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.frames import ModbusTcp
from tests.drivers.fake_bench import WiredBench

QUICK: dict[str, Any] = {"watchdog_ms": 2000, "request_timeout": 0.5}
LONG = 20.0  # duration of a pulse, s

ORPHAN_IO = """
import sys
from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
host, port = sys.argv[1].rsplit(":", 1)
settings = RemoteIOSettings(host, int(port), watchdog_ms=2000, request_timeout=0.5, points="valve=DO4")
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
settings = TowerLightSettings(host, int(port), watchdog_ms=2000, request_timeout=0.5, green="DO0", buzzer="DO4")
light = TowerLight("id", "orphan", settings)
light.connect()
light.take_control()
light.buzz(20.0)
"""


def block(address: str, **settings: Any) -> RemoteIO:
    host, _, port = address.rpartition(":")
    points = "part=DI0; level=AI0 scale=0.001 unit=m; lamp=DO0; valve=DO4; pressure=AO1 scale=10 unit=Pa"
    return RemoteIO("block_id", "block", RemoteIOSettings(host, int(port), points=points, **{**QUICK, **settings}))


class RemoteIOBench(WiredBench):
    object_type: ClassVar[type[Generic]] = RemoteIO
    module = "remote_io"
    port = "modbus"
    frames = ModbusTcp()

    def reset(self) -> None:
        self.heal()
        self.do("renew")

    def writes(self) -> Any:
        truth = self.fake.truth()
        return truth["writes"], truth["outputs"]

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

    def build(self, address: str) -> Generic:
        return block(address)

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

    def readings(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, RemoteIO)
        self.do("set_analog", number=0, raw=-1234)
        self.do("set_input", number=0, on=True)
        yield Check("level, m", device.read_analog("level"), -1.234, 1e-9)
        yield Check("part", device.read_digital("part"), True, 0.0)
        device.take_control()
        device.write_analog("pressure", -2500.0)
        yield Check("pressure, Pa", device.read_analog("pressure"), self.fake.truth()["analog_outputs"][1] * 10.0, 1e-9)

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, RemoteIO)
        for part, level in ((True, -1234), (False, 567)):
            self.do("set_input", number=0, on=part)
            self.do("set_analog", number=0, raw=level)
            yield Check("read_digital", device.read_digital("part"), part)
            yield Check("read_analog", device.read_analog("level"), level / 1000.0, 1e-9)

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, RemoteIO)
        return {
            "an analogue value beyond the register": lambda: device.write_analog("pressure", 400_000.0),
            "an analogue value that is not a number": lambda: device.write_analog("pressure", float("nan")),
            "a point that does not exist": lambda: device.write_digital("light", True),
            "writing an input": lambda: device.write("part", True),
            "a digital value for an analogue output": lambda: device.write_digital("pressure", True),
            "a pulse of an input": lambda: device.pulse("part", 1.0),
            "waiting for an analogue point": lambda: device.wait_for("level", True, 1.0),
        }

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, RemoteIO)

        def pulsed() -> None:
            device.pulse("valve", 0.2)
            switched = [(each["output"], each["on"]) for each in self.fake.truth()["history"]]
            assert switched == [(4, True), (4, False)]

        def waited() -> None:
            self.do("set_input", number=0, on=True)
            device.wait_for("part", True, 30.0)

        def forced() -> None:
            device.force_point("lamp", True)
            assert self.fake.truth()["outputs"][0] is True
            with pytest.raises(Refused, match="lamp is forced"):
                device.write_digital("lamp", False)

        def released() -> None:
            device.release_point("lamp", False)
            assert self.fake.truth()["outputs"][0] is False
            device.write_digital("lamp", False)

        return {"pulse": pulsed, "wait_for": waited, "force_point": forced, "release_point": released}


class TowerLightBench(RemoteIOBench):
    object_type = TowerLight

    def build(self, address: str) -> Generic:
        host, _, port = address.rpartition(":")
        return TowerLight("light_id", "light", TowerLightSettings(host, int(port), green="DO0", buzzer="DO4", **QUICK))

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

    def readings(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, TowerLight)
        device.take_control()
        device.show(LampColor.GREEN)
        yield Check("green, lit", device.lit()["green"], self.fake.truth()["outputs"][0], 0.0)
        device.off()
        yield Check("green, out", device.lit()["green"], self.fake.truth()["outputs"][0], 0.0)

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, TowerLight)
        for switch in (lambda: device.show(LampColor.GREEN), device.off):
            switch()
            yield Check("lit", device.lit()["green"], self.fake.truth()["outputs"][0])

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, TowerLight)
        return {
            "a colour without a lamp": lambda: device.show(LampColor.BLUE),
            "a state without a pattern": lambda: device.show_state(MachineStateName.ABORTED),
        }

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, TowerLight)

        def forced() -> None:
            device.force_point("green", True)
            device.off()
            assert self.fake.truth()["outputs"][0] is True

        def released() -> None:
            device.release_point("green", True)  # the lamps have been off since
            assert self.fake.truth()["outputs"][0] is False

        return {"force_point": forced, "release_point": released}

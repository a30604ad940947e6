"""The PLC on its fake: job 3 takes 20 s and is stopped by its request, or when the life sign ends."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_drivers.opcua_plc.settings import OpcUaPlcSettings
from arcor2_hw.exceptions import Refused
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from tests.drivers.fake_bench import FakeBench

POINTS = (
    "part=DI ns=2;s=Cell.PartPresent | lamp=DO ns=2;s=Cell.Lamp on_loss=off | "
    "level=AI ns=2;s=Cell.Level scale=0.001 unit=m | speed=AO ns=2;s=Cell.Speed scale=0.01 unit=m/s"
)
HANDSHAKE = (
    "owner=ns=2;s=Handshake.Owner | host_life=ns=2;s=Handshake.HostLife | plc_life=ns=2;s=Handshake.PlcLife | "
    "number=ns=2;s=Handshake.Number | request=ns=2;s=Handshake.Request | busy=ns=2;s=Handshake.Busy | "
    "done=ns=2;s=Handshake.Done | error=ns=2;s=Handshake.Error | code=ns=2;s=Handshake.Code"
)
ORPHAN = """
import sys
from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_drivers.opcua_plc.settings import OpcUaPlcSettings
plc = OpcUaPlc("id", "orphan", OpcUaPlcSettings(*sys.argv[1:]))
plc.connect()
plc.take_control()
plc.run_job(3)
"""


class OpcUaPlcBench(FakeBench):
    object_type = OpcUaPlc
    module = "opcua_plc"
    port = "url"
    nowhere = "opc.tcp://127.0.0.1:1"

    def reset(self) -> None:
        self.do("heal")
        self.do("restart")

    def build(self, address: str) -> OpcUaPlc:
        return OpcUaPlc("plc_id", "plc", OpcUaPlcSettings(address, POINTS, HANDSHAKE))

    def writes(self) -> Any:
        return self.fake.truth()["writes"]

    def observe(self, device: Generic) -> object:
        assert isinstance(device, OpcUaPlc)
        return device.read("level")

    def ask(self, device: Generic) -> object:
        return self.observe(device)

    def command(self, device: Generic) -> object:
        assert isinstance(device, OpcUaPlc)
        return device.write_digital("lamp", True)

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, OpcUaPlc)
        return device.run_job(3)

    def running(self) -> bool:
        return bool(self.fake.truth()["moving"])

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.do("stranger", number=77)
        try:
            yield
        finally:
            self.do("stranger", number=0)

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address, POINTS, HANDSHAKE]

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, OpcUaPlc)
        self.do("set", name="Level", value=-250)
        by_device = self.fake.truth()["points"]["Level"] / 1000.0  # the fake's level counts millimetres
        return [Check("the level, m", float(device.read("level").value), by_device, 1e-9)]

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, OpcUaPlc)
        for part, level in ((True, -250), (False, 1234)):
            self.do("set", name="PartPresent", value=part)
            self.do("set", name="Level", value=level)
            points = self.fake.truth()["points"]
            yield Check("read_digital", device.read_digital("part"), points["PartPresent"])
            yield Check("read_analog", device.read_analog("level"), points["Level"] / 1000.0, 1e-9)

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, OpcUaPlc)

        def forced() -> None:
            device.force_point("lamp", True)
            with pytest.raises(Refused, match="lamp is forced"):
                device.write_digital("lamp", False)
            assert device.read("lamp").value is True

        def released() -> None:
            device.release_point("lamp", False)
            assert device.read("lamp").value is False

        return {
            "wait_for": lambda: device.wait_for("part", False, 1.0),
            "force_point": forced,
            "release_point": released,
        }

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, OpcUaPlc)
        return {
            "a speed beyond the range of its type": lambda: device.write_analog("speed", 1000.0),
            "a negative speed of an unsigned type": lambda: device.write_analog("speed", -0.1),
            "writing an input": lambda: device.write_digital("part", True),
            "a job number beyond the range of its type": lambda: device.run_job(100_000),
        }

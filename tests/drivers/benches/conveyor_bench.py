"""The conveyor on its fake: a drive behind a CAN adapter that is a TCP server. The wire in between is recorded."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
from arcor2_hw.objects import Generic, MachineState
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.frames import CanopenSlcan
from arcor2_hw.testing.life import wait_until
from tests.drivers.fake_bench import WiredBench

ORPHAN = """
import sys
from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import ConveyorSettings
belt = Conveyor("id", "orphan", ConveyorSettings(sys.argv[1]))
belt.connect()
belt.take_control()
belt.move_by(20.0, 0.3)
"""

COUNTS = 10000.0
"""Counts of the drive per metre of belt."""
OPERATIONAL = 5
"""NMT state (CiA 301) of a controlled drive."""
BUSY = 1000
"""Time without a heartbeat that the drive tolerates, ms: the driver's maximum, as the machine may be busy."""


def build(address: str, **settings: Any) -> Conveyor:
    return Conveyor(
        "belt_id",
        "belt",
        ConveyorSettings(
            f"socket://{address}", counts_per_metre=COUNTS, heartbeat_ms=BUSY, **{"sdo_timeout": 0.5, **settings}
        ),
    )


class ConveyorBench(WiredBench):
    object_type = Conveyor
    module = "conveyor"
    port = "can"
    frames = CanopenSlcan()

    def reset(self) -> None:
        self.heal()
        self.do("mute", on=False)
        self.do("power_cycle", belt=0)
        self.fake.control.wait_until(lambda truth: truth["booted"])

    def build(self, address: str) -> Conveyor:
        return build(address)

    def writes(self) -> Any:
        truth = self.fake.truth()
        return truth["writes"], truth["nmt"], round(truth["belt"])

    def half_frame(self) -> None:
        """Wait until a PDO was cut: if two are sent at once, the first may be complete and count as an answer."""
        wire = self.wire
        assert wire is not None

        def received() -> int:
            return sum(piece.by == "device" for piece in wire.record())

        before = received()
        super().half_frame()
        wait_until(lambda: received() > before + 1, 2.0, "a message that the drive sends by itself")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, Conveyor)
        return device.position()

    def ask(self, device: Generic) -> object:
        """Read by SDO, because a PDO sent before the cut might still arrive."""
        assert isinstance(device, Conveyor)
        return device.identify()

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

    def readings(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, Conveyor)
        device.take_control()
        device.move_by(-0.05, 0.3)
        yield Check("position, m", device.belt_position(), self.fake.truth()["belt"] / COUNTS, 1e-4)
        device.run(-0.2)
        yield Check("velocity, m/s", device.velocity().value, self.do("motion")["velocity"] / COUNTS, 0.01)
        device.halt()

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, Conveyor)
        for distance in (0.05, -0.03):
            device.move_by(distance, 0.3)
            yield Check("belt_position", device.belt_position(), self.fake.truth()["belt"] / COUNTS, 1e-4)

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, Conveyor)
        # NMT commands are not confirmed: the start of the node may not be complete yet.
        self.fake.control.wait_until(lambda truth: truth["nmt"] == OPERATIONAL)
        return {
            "a position beyond the belt": lambda: device.move_by(200.0, 0.3),
            "a speed above the maximum": lambda: device.move_by(0.1, 0.6),
            "a speed of nothing": lambda: device.move_relative(0.1, 0.0),
            "a run faster than allowed": lambda: device.run(-0.6),
            "a position before homing": lambda: device.move_to(0.1, 0.3),
            "starting a belt that was not reset": device.start,
        }

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, Conveyor)

        def waited() -> None:
            device.reset()
            device.start()
            device.wait_for(MachineState.EXECUTE, 30.0)
            assert self.do("motion")["velocity"] > 0.0
            device.halt()

        return {"wait_for": waited}

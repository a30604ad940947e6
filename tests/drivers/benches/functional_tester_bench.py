"""The functional tester on its fake, with tests of 4 s. The connection between both is cut and recorded."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_hw.data.geometry import Pose
from arcor2_hw.objects import Generic, MachineState
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.frames import ModbusTcp
from tests.drivers.fake_bench import WiredBench

ORPHAN = """
import sys
from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_hw.data.geometry import Pose
host, port = sys.argv[1].rsplit(":", 1)
settings = FunctionalTesterSettings(host, int(port), watchdog_ms=2000, request_timeout=0.5)
tester = FunctionalTester("id", "orphan", Pose(), None, settings=settings)
tester.connect()
tester.take_control()
tester.test()
"""


class FunctionalTesterBench(WiredBench):
    object_type = FunctionalTester
    module = "functional_tester"
    options = ("--seed", "1", "--test-time", "20", "--time-scale", "5")
    port = "modbus"
    frames = ModbusTcp()

    def reset(self) -> None:
        do = self.do
        self.heal()
        do("emergency_stop", pressed=False)
        do("mode", mode="produce")
        state = self.fake.truth()["state"]
        if state in ("Execute", "Starting"):
            do("command", name="stop")
        self.fake.control.wait_until(lambda t: t["state"] in ("Stopped", "Aborted", "Idle", "Complete"))
        if self.fake.truth()["state"] == "Aborted":
            do("command", name="clear")
            self.fake.control.wait_until(lambda t: t["state"] == "Stopped")
        do("push_door", opening=True)
        self.fake.control.wait_until(lambda t: t["door"] == "open")
        if self.fake.truth()["board"] is None:
            do("put_board", code="B-1")
        do("push_door", opening=False)
        self.fake.control.wait_until(lambda t: t["door"] == "closed")

    def build(self, address: str) -> FunctionalTester:
        host, _, port = address.rpartition(":")
        settings = FunctionalTesterSettings(host, int(port), watchdog_ms=2000, request_timeout=0.5)
        return FunctionalTester("tester_id", "tester", Pose(), None, settings=settings)

    def writes(self) -> Any:
        truth = self.fake.truth()
        return {key: truth[key] for key in ("state", "door", "watchdog_ms", "last_command")}

    def observe(self, device: Generic) -> object:
        assert isinstance(device, FunctionalTester)
        return device.machine_state()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, FunctionalTester)
        return device.board_present()

    def command(self, device: Generic) -> object:
        assert isinstance(device, FunctionalTester)
        return device.open_door()

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, FunctionalTester)
        return device.test()

    def running(self) -> bool:
        return bool(self.fake.truth()["state"] == "Execute")

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.do("mode", mode="maintenance")
        try:
            yield
        finally:
            self.do("mode", mode="produce")

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address]

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, FunctionalTester)
        state, truth = MachineState[self.fake.truth()["state"].upper()], self.fake.truth()
        return [
            Check("state", device.machine_state(), state, 0.0),
            Check("boards tested", device.counters()["tested"], truth["tested"], 0.0),
            Check("board present", device.board_present(), truth["board"] is not None, 0.0),
        ]

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, FunctionalTester)
        for defect in (None, "leakage"):
            device.open_door()
            self.do("take_board")
            yield Check("board_present", device.board_present(), False)
            self.do("put_board", code="B-2", defect=defect)
            yield Check("board_present", device.board_present(), True)
            device.close_door()
            passed = device.test()
            real = self.fake.truth()["results"][-1]
            yield Check("test", passed, defect is None)
            for name in ("supply_voltage", "supply_current", "contact_resistance"):
                yield Check(name, getattr(device, name)(), real["measured"][name], 1e-4)

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, FunctionalTester)
        return {"wait_for": lambda: device.wait_for(device.machine_state(), 1.0)}

"""The functional tester on its fake: 4 s a test, all else quick."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_hw.data.geometry import Pose
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from tests.fakes.conftest import FakeProcess

ORPHAN = """
import sys
from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_hw.data.geometry import Pose
host, port = sys.argv[1].rsplit(":", 1)
settings = FunctionalTesterSettings(host, int(port), watchdog_ms=600, request_timeout=0.2)
tester = FunctionalTester("id", "orphan", Pose(), None, settings=settings)
tester.connect()
tester.take_control()
tester.test()
"""


def build(address: str) -> FunctionalTester:
    host, _, port = address.rpartition(":")
    settings = FunctionalTesterSettings(host, int(port), watchdog_ms=600, request_timeout=0.2)
    return FunctionalTester("tester_id", "tester", Pose(), None, settings=settings)


class FunctionalTesterBench(Bench):
    object_type = FunctionalTester
    fake: FakeProcess

    def start(self) -> None:
        self.fake = FakeProcess("functional_tester", "--seed", "1", "--test-time", "20", "--time-scale", "5")
        self.do = self.fake.control.do

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        do = self.do
        do("heal")
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

    @property
    def address(self) -> str:
        return str(self.fake.ready["modbus"])

    def make(self) -> FunctionalTester:
        return build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return build("127.0.0.1:1"), "127.0.0.1:1"

    def writes(self) -> Any:
        truth = self.fake.truth()
        return {key: truth[key] for key in ("state", "door", "watchdog_ms", "last_command")}

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        self.do("heal")

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

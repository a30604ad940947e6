"""The tests of the screwdriver's driver with its independent fake: the conformance suite at level silver.

Copy it to tests/test_screwdriver.py, and screwdriver_fake.py to screwdriver/screwdriver_fake.py.
"""

import sys
from collections.abc import Callable, Iterator
from typing import Any

from screwdriver.screwdriver import Screwdriver, ScrewdriverSettings

from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.conformance import Conformance
from arcor2_hw.testing.fake_bench import FakeBench, modbus_address

ORPHAN = """
import sys
from arcor2_hw.testing.fake_bench import modbus_address
from screwdriver.screwdriver import Screwdriver, ScrewdriverSettings
device = Screwdriver("id", "screwdriver", ScrewdriverSettings(**modbus_address(sys.argv[1])))
device.connect()
device.take_control()
device.tighten("soft", 10.0)
"""
STATES = ("idle", "tightening", "ok", "not_ok")


def build(address: str) -> Screwdriver:
    """Return an object for the device at an address."""
    return Screwdriver("id", "screwdriver", ScrewdriverSettings(**modbus_address(address)))


class ScrewdriverBench(FakeBench):
    """The driver on its fake. The program "soft" tightens by 1 N m per second."""

    object_type = Screwdriver
    fake = "screwdriver.screwdriver_fake"

    def make(self) -> Screwdriver:
        """Return an object for the fake."""
        return build(self.address)

    def absent(self) -> tuple[Screwdriver, str]:
        """Return an object for a missing device."""
        return build("127.0.0.1:1"), "127.0.0.1:1"

    def observe(self, device: Any) -> object:
        """Take a reading that can become stale."""
        return device.current()

    def ask(self, device: Any) -> object:
        """Communicate with the device."""
        return device.get_torque()

    def command(self, device: Any) -> object:
        """Act on the device."""
        return device.set_light(True)

    def run_long(self, device: Any) -> object:
        """Tighten for ten seconds."""
        return device.tighten("soft", 10.0)

    def running(self) -> bool:
        """Return whether the fake tightens."""
        return bool(self.do("truth")["busy"])

    def orphan(self) -> list[str]:
        """Return the command line of a process that tightens until it is killed."""
        return [sys.executable, "-c", ORPHAN, self.address]

    def readings(self, device: Any) -> Iterator[Check]:
        """Compare readings with the registers of the fake."""
        self.do("set", torque=4.5, angle=-1234)
        yield Check("torque, N m", device.read("torque").value, 4.5)
        yield Check("angle, °", device.read("angle").value, -123.4)

    def results(self, device: Any) -> Iterator[Check]:
        """Call each action that returns a value while the registers of the fake change."""
        for number, on in ((1, False), (2, True)):
            self.do(
                "set", state=number + 1, fault=number, torque=1.25 * number, angle=-100 * number, screw=on, light=on
            )
            truth = self.do("truth")["registers"]
            yield Check("get_state", device.get_state(), STATES[truth["state"]])
            yield Check("get_fault", device.get_fault(), truth["fault"])
            yield Check("get_torque", device.get_torque(), truth["torque"])
            yield Check("get_angle", device.get_angle(), truth["angle"] / 10.0)
            device.wait_for_screw(on, 1.0)
            yield Check("get_screw", device.get_screw(), truth["screw"])
            yield Check("get_light", device.get_light(), truth["light"])
        self.do("set", fault=0)
        for limit in (1.5, 2.5):
            torque, angle = device.tighten("hard", limit)
            truth = self.do("truth")["registers"]
            yield Check("tighten", (torque, angle), (truth["torque"], truth["angle"] / 10.0), 0.06)

    def beyond_limits(self, device: Any) -> dict[str, Callable[[], object]]:
        """Return calls that must be refused."""
        return {
            "a torque above the range": lambda: device.put("setting the torque", {"limit": 12.5}),
            "an unknown program": lambda: device.tighten("medium", 5.0),
        }


class TestConformance(Conformance):
    """The conformance suite."""

    benches = (ScrewdriverBench,)

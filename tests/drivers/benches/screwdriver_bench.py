"""The screwdriver on its fake: the long action waits for two tightenings, but the trigger is pulled only once.

A tightening takes 0.5 s and is over when the driver reconnects after a cut: the controller completes it.
"""

import sys
from collections.abc import Callable, Iterator
from typing import Any

from arcor2_drivers.screwdriver.screwdriver import OpenProtocolScrewdriver
from arcor2_drivers.screwdriver.settings import OpenProtocolScrewdriverSettings
from arcor2_fakes.control import BlockingControlClient
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.life import wait_until
from tests.drivers.fake_bench import WiredBench

ORPHAN = """
import sys
from arcor2_drivers.screwdriver.screwdriver import OpenProtocolScrewdriver
from arcor2_drivers.screwdriver.settings import OpenProtocolScrewdriverSettings
host, port = sys.argv[1].rsplit(":", 1)
screwdriver = OpenProtocolScrewdriver("id", "orphan", OpenProtocolScrewdriverSettings(host, int(port)))
screwdriver.connect()
screwdriver.take_control()
screwdriver.tighten(2)
"""
ACTING = {
    "0018": "select a program",
    "0038": "select a job",
    "0042": "disable the tool",
    "0043": "enable the tool",
    "0078": "acknowledge an alarm",
}


class OpenProtocol:
    """Telegrams from the driver, by the lengths in their headers."""

    def split(self, stream: bytes) -> list[bytes]:
        frames = []
        while len(stream) >= 4 and stream[:4].isdigit() and len(stream) > (length := int(stream[:4])) >= 20:
            frames.append(stream[: length + 1])
            stream = stream[length + 1 :]
        return [*frames, stream] if stream else frames

    def acting(self, frame: bytes) -> str:
        mid = frame[4:8].decode("ascii", "replace")
        if len(frame) < 21 or not mid.isdigit():
            return f"invalid telegram {frame!r}"
        return f"MID {mid} ({ACTING[mid]})" if mid in ACTING else ""


class OpenProtocolScrewdriverBench(WiredBench):
    object_type = OpenProtocolScrewdriver
    stale_after = 1.5  # the answer to a keep alive message is missed after 1.1 s
    module = "screwdriver"
    options = ("--duration", "0.5", "--seed", "1")
    port = "open_protocol"
    frames = OpenProtocol()

    def start(self) -> None:
        super().start()
        self.operator = BlockingControlClient(self.fake.ready["control"])  # for the thread of the action

    def end(self) -> None:
        self.operator.close()
        super().end()

    def reset(self) -> None:
        self.heal()
        self.do("renew")

    def build(self, address: str) -> OpenProtocolScrewdriver:
        host, _, port = address.rpartition(":")
        settings = OpenProtocolScrewdriverSettings(host, int(port), answer_timeout=0.4, keep_alive=0.3)
        return OpenProtocolScrewdriver("screwdriver_id", "screwdriver", settings)

    def writes(self) -> Any:
        truth = self.fake.truth()
        return {key: truth[key] for key in ("enabled", "program", "job", "alarm", "made")}

    def observe(self, device: Generic) -> object:
        assert isinstance(device, OpenProtocolScrewdriver)
        return device.ready()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, OpenProtocolScrewdriver)
        return device.select_program(2)

    def command(self, device: Generic) -> object:
        assert isinstance(device, OpenProtocolScrewdriver)
        return device.enable_tool()

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, OpenProtocolScrewdriver)
        self.operator.do("pull")
        return device.tighten(2)

    def running(self) -> bool:
        return bool(self.fake.truth()["running"])

    def orphan(self) -> list[str]:
        self.do("pull")
        return [sys.executable, "-c", ORPHAN, self.address]

    def holding(self) -> object:
        truth = self.fake.truth()
        return {key: truth[key] for key in ("enabled", "program", "job", "made")} if truth["made"] else None

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, OpenProtocolScrewdriver)
        self.do("plan", torque=11.37, angle=64)
        self.do("tighten")
        wait_until(lambda: self.fake.truth()["made"] and not self.fake.truth()["unacknowledged"], 10.0, "a result")
        ok, torque, angle = device.last_result()
        last = self.fake.truth()["last"]
        return [
            Check("OK", ok, last["ok"], 0.0),
            Check("torque", torque, last["torque"], 0.001),
            Check("angle", angle, last["angle"], 0.0),
        ]

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, OpenProtocolScrewdriver)
        for torque, angle in ((1.25, 90), (2.5, 180)):
            self.do("plan", torque=torque, angle=angle)
            self.do("pull")
            result = device.tighten()
            last = self.fake.truth()["last"]
            real = [last["ok"], last["torque"], last["angle"]]
            yield Check("tighten", list(result), real, 0.001)
            yield Check("last_result", list(device.last_result()), real, 0.001)
        yield Check("ready", device.ready(), True)
        self.do("alarm")
        yield self.polled("ready", device.ready, False)

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, OpenProtocolScrewdriver)
        return {
            "a program that does not exist": lambda: device.select_program(999),
            "a job that does not exist": lambda: device.select_job(99),
        }

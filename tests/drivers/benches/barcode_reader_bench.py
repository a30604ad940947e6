"""The barcode reader on its fake, on a pty behind a wire. Its long action reads while no code is visible."""

import sys
from collections.abc import Callable, Iterator
from typing import Any

from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.frames import Lines
from tests.drivers.fake_bench import WiredBench

ORPHAN = """
import sys
from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
reader = BarcodeReader("id", "orphan", settings=BarcodeReaderSettings(sys.argv[1]))
reader.connect()
reader.scan(60.0)
"""
ACTING = ("LON", "RST")


class BarcodeReaderBench(WiredBench):
    object_type = BarcodeReader
    module = "barcode_reader"
    options = ("--timeout", "0.5")
    link = "ttyREADER"
    nowhere = "/dev/does-not-exist"
    frames = Lines(ACTING)

    def reset(self) -> None:
        self.heal()
        self.do("health", value="OK")
        self.do("late", seconds=0.0)
        self.do("present", code=None)
        self.fake.control.wait_until(lambda t: not t["reading"])

    def build(self, address: str) -> BarcodeReader:
        return BarcodeReader("reader_id", "reader", settings=BarcodeReaderSettings(address, answer_timeout=0.8))

    def writes(self) -> Any:
        return [line for line in self.fake.truth()["received"] if line in ACTING]

    def ask(self, device: Generic) -> object:
        assert isinstance(device, BarcodeReader)
        return device.scan(0.5)

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, BarcodeReader)
        return device.scan(3.0)  # until this time is over, silence cannot be distinguished from a missing code

    def observe(self, device: Generic) -> object:
        return device.identify()

    def running(self) -> bool:
        return bool(self.fake.truth()["reading"])

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address]

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, BarcodeReader)
        for code in ("A-1", "B-2"):
            self.do("present", code=code)
            yield Check("scan", device.scan(2.0), code)
            yield Check("code_present", device.code_present(2.0), True)
            yield Check("last_code", device.last_code(), code)
            self.do("present", code=None)
            yield Check("code_present", device.code_present(0.5), False)

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, BarcodeReader)
        return {"a reading of an hour": lambda: device.trigger(3600.0), "one of 0 s": lambda: device.trigger(0.0)}

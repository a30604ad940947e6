"""The barcode reader on its fake, on a pty behind a wire; a reading of a code that is not there is its long act."""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.frames import Lines
from arcor2_hw.testing.serial_wire import SerialWire
from tests.fakes.conftest import FakeProcess

ORPHAN = """
import sys
from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
reader = BarcodeReader("id", "orphan", settings=BarcodeReaderSettings(sys.argv[1]))
reader.connect()
reader.scan(60.0)
"""
ACTING = ("LON", "RST")


class BarcodeReaderBench(Bench):
    object_type = BarcodeReader
    fake: FakeProcess

    def start(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.fake = FakeProcess(
            "barcode_reader", "--link", str(Path(self.folder.name) / "ttyREADER"), "--timeout", "0.5"
        )
        self.do = self.fake.control.do
        self.wire = SerialWire(self.fake.ready["port"])
        self.wire.start()
        self.frames = Lines(ACTING)

    def end(self) -> None:
        if self.wire is not None:
            self.wire.close()
        self.fake.end()
        self.folder.cleanup()

    def reset(self) -> None:
        self.heal()
        self.do("present", code=None)
        self.fake.control.wait_until(lambda t: not t["reading"])

    @property
    def address(self) -> str:
        assert self.wire is not None
        return self.wire.address

    def _build(self, port: str) -> BarcodeReader:
        return BarcodeReader("reader_id", "reader", settings=BarcodeReaderSettings(port, answer_timeout=0.5))

    def make(self) -> BarcodeReader:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build("/dev/does-not-exist"), "/dev/does-not-exist"

    def writes(self) -> Any:
        return [line for line in self.fake.truth()["received"] if line in ACTING]

    def ask(self, device: Generic) -> object:
        assert isinstance(device, BarcodeReader)
        return device.scan(0.5)

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, BarcodeReader)
        return device.scan(3.0)  # silence looks like no code to see, until this time is over

    def observe(self, device: Generic) -> object:
        return device.identify()

    def running(self) -> bool:
        return bool(self.fake.truth()["reading"])

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address]

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, BarcodeReader)
        return {"a reading of an hour": lambda: device.trigger(3600.0), "one of no time": lambda: device.trigger(0.0)}

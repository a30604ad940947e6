"""The label printer on its fake, on TCP; a label takes 1.5 s, and is completed without the driver."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any

from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
from arcor2_hw.exceptions import DeviceTimeout
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.life import wait_until
from tests.drivers.fake_bench import FakeBench

ORPHAN = """
import sys
from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
printer = ZplPrinter("id", "orphan", ZplPrinterSettings(sys.argv[1]))
printer.connect()
printer.print_label("title", "text", "code")
"""
ASKING = ("~HS", "~HI", "getvar ")


class ZplPrinterBench(FakeBench):
    object_type = ZplPrinter
    progress_within = 4.0  # a label, counted when it is printed
    module = "label_printer"
    options = ("--tcp", "127.0.0.1:0", "--duration", "1.5")

    def reset(self) -> None:
        self.do("heal")
        self.do("renew")  # clears the list of received commands, too, which drops the oldest when it is long

    def build(self, address: str) -> ZplPrinter:
        return ZplPrinter("printer_id", "printer", settings=ZplPrinterSettings(address, answer_timeout=0.8))

    def absent(self) -> tuple[Generic, str]:
        return self.build("socket://127.0.0.1:1"), "127.0.0.1:1"

    def writes(self) -> Any:
        truth = self.fake.truth()
        return [each for each in truth["received"] if not each.startswith(ASKING)], truth["counter"], truth["paused"]

    def observe(self, device: Generic) -> object:
        assert isinstance(device, ZplPrinter)
        return device.status()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, ZplPrinter)
        return device.labels_printed()

    def running(self) -> bool:
        return bool(self.fake.truth()["waiting"])

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address]

    def progress(self) -> float:
        return float(self.fake.truth()["counter"])

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, ZplPrinter)
        for _ in range(2):
            yield Check("print_label", device.print_label("title", "text", "1"), f"printer-{self._count()}")
            yield Check("labels_printed", device.labels_printed(), self._count())
        yield Check("ready", device.ready(), True)
        self.do("pause")
        yield Check("ready", device.ready(), False)
        self.do("pause", on=False)
        device.disconnect()
        impatient = ZplPrinter("id", "printer", settings=ZplPrinterSettings(self.address, print_timeout=1.0))
        self.keep(impatient).connect()
        for lost in (True, False):
            self.do("forgetful", on=lost)
            before = self._count()
            with contextlib.suppress(DeviceTimeout):
                impatient.print_label("title", "text", "2")
            wait_until(lambda: not self.running(), 5.0, "the end of the label")
            yield Check("last_came_out", impatient.last_came_out(), self._count() > before)

    def _count(self) -> int:
        return int(self.fake.truth()["counter"])

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        return {}  # its optional methods only read

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, ZplPrinter)
        return {
            "a text that is not a label": lambda: device.print("hello"),
            "two labels in one": lambda: device.print("^XA^FDa^FS^PQ2^XZ"),
            "a field that is too long": lambda: device.print_label("x" * 201, "", "1"),
            "a character that Code 128 does not have": lambda: device.print_label("", "", "\u20ac"),
        }

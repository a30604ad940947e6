"""The label printer on its fake, on TCP; a label takes 1.5 s, and is finished without us."""

import sys
from collections.abc import Callable
from typing import Any

from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from tests.fakes.conftest import FakeProcess

ORPHAN = """
import sys
from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
printer = ZplPrinter("id", "orphan", ZplPrinterSettings(sys.argv[1]))
printer.connect()
printer.print_label("title", "text", "code")
"""
ASKING = ("~HS", "~HI", "getvar ")


class ZplPrinterBench(Bench):
    object_type = ZplPrinter
    fake: FakeProcess

    def start(self) -> None:
        self.fake = FakeProcess("label_printer", "--tcp", "127.0.0.1:0", "--duration", "1.5")
        self.do = self.fake.control.do

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        self.do("heal")
        self.do("power_cycle")

    @property
    def address(self) -> str:
        return str(self.fake.ready["port"])

    def _build(self, port: str) -> ZplPrinter:
        return ZplPrinter("printer_id", "printer", settings=ZplPrinterSettings(port, answer_timeout=0.4))

    def make(self) -> ZplPrinter:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build("socket://127.0.0.1:1"), "127.0.0.1:1"

    def writes(self) -> Any:
        truth = self.fake.truth()
        return [each for each in truth["received"] if not each.startswith(ASKING)], truth["counter"], truth["paused"]

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        self.do("heal")

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

    def reset_link(self) -> None:
        self.do("reset")

    def half_frame(self) -> None:
        self.do("half_frame")

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        return {}  # no optional method but those that read

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, ZplPrinter)
        return {
            "what is no label": lambda: device.print("hello"),
            "two labels in one": lambda: device.print("^XA^FDa^FS^PQ2^XZ"),
            "a field that is too long": lambda: device.print_label("x" * 201, "", "1"),
            "a bar code that Code 128 does not have": lambda: device.print_label("", "", "\u20ac"),
        }

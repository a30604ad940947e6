"""A driver passes the conformance suite unchanged when its objects run in a separate process."""

from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
from arcor2_hw.runtime.own_process.process import DeviceProcess
from arcor2_hw.testing.conformance import Conformance
from tests.drivers.benches.barcode_reader_bench import BarcodeReaderBench


class OwnProcessBench(BarcodeReaderBench):
    label = "BarcodeReader_in_its_own_process"

    def start(self) -> None:
        super().start()
        self.processes: list[DeviceProcess] = []

    def build(self, port: str) -> BarcodeReader:
        process = DeviceProcess(BarcodeReader, "reader")
        self.processes.append(process)
        settings = BarcodeReaderSettings(port, answer_timeout=0.5)
        reader = process.make(("reader_id", "reader"), {"settings": settings})
        assert isinstance(reader, BarcodeReader)
        return reader

    def release(self) -> None:
        super().release()
        while self.processes:
            self.processes.pop().end()


class TestConformance(Conformance):
    benches = (OwnProcessBench,)

    # The process and its socket exist from the constructor until the cell host ends it, which
    # tests/runtime/test_own_process.py shows. The level belongs to the driver, not to where it runs.
    test_constructor_opens_nothing = None
    test_nothing_is_left_behind = None
    test_level = None

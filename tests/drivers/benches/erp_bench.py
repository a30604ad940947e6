"""The planning service on its fake; a request for an order is the communication under test."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from arcor2_drivers.erp.erp_service import ErpService
from arcor2_drivers.erp.settings import ErpSettings
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from tests.drivers.fake_bench import FakeBench


class ErpServiceBench(FakeBench):
    object_type = ErpService
    stale_after = 0.2
    module = "erp"
    port = "url"
    nowhere = "http://127.0.0.1:1/api"

    def reset(self) -> None:
        for command in ("heal", "work", "forget"):
            self.do(command)
        shutil.rmtree(Path(self.folder.name), ignore_errors=True)

    def build(self, address: str) -> ErpService:
        settings = ErpSettings(address, outbox=self.folder.name, request_timeout=1.0, longest_pause=1.0, poll=0.1)
        return ErpService("erp_id", "planning", settings)

    def writes(self) -> Any:
        return [each for each in self.do("received") if each["method"] != "GET"]

    def observe(self, device: Generic) -> object:
        return device.identify()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, ErpService)
        return device.next_order(0.0)

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        return {}  # its optional methods only read

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, ErpService)
        for order, product, quantity in (("A-1", "PCB", 2), ("B-1", "cover", 1)):
            self.do("add_order", order=order, product=product, quantity=quantity)
            for left in range(quantity, 0, -1):
                yield Check("next_order", list(device.next_order(1.0)), [True, order, product, quantity, left])
                yield Check("results_waiting", device.results_waiting(), 0)
                self.do("fail", status=503, count=-1, path="/results")
                device.report_result(order, f"{order} {left}", True)
                yield Check("results_waiting", device.results_waiting(), 1)
                self.do("work")
                device.wait_until_sent(5.0)
        yield Check("resend_refused", device.resend_refused(), 0)
        device.report_result("C-9", "S-1", True)  # no such order
        device.wait_until_sent(5.0)
        yield Check("resend_refused", device.resend_refused(), 1)

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, ErpService)
        return {
            "a result without an order": lambda: device.report_result("", "S-1", True),
            "a result without a serial number": lambda: device.report_result("A-1", "", True),
            "a note that is too long": lambda: device.report_result("A-1", "S-1", True, "x" * 1000),
            "a closing without a reason": lambda: device.close_order("A-1", ""),
        }

"""The planning service on its fake; asking for an order is what speaks with it."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from arcor2_drivers.erp.erp_service import ErpService
from arcor2_drivers.erp.settings import ErpSettings
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from tests.fakes.conftest import FakeProcess


class ErpServiceBench(Bench):
    object_type = ErpService
    stale_after = 0.2
    fake: FakeProcess

    def start(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.fake = FakeProcess("erp")
        self.do = self.fake.control.do

    def end(self) -> None:
        self.fake.end()
        self.folder.cleanup()

    def reset(self) -> None:
        for command in ("heal", "work", "forget"):
            self.do(command)
        shutil.rmtree(Path(self.folder.name), ignore_errors=True)

    @property
    def address(self) -> str:
        return str(self.fake.ready["url"])

    def _build(self, url: str) -> ErpService:
        settings = ErpSettings(url, outbox=self.folder.name, request_timeout=1.0, longest_pause=1.0, poll=0.1)
        return ErpService("erp_id", "planning", settings)

    def make(self) -> ErpService:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build("http://127.0.0.1:1/api"), "http://127.0.0.1:1/api"

    def writes(self) -> Any:
        return [each for each in self.do("received") if each["method"] != "GET"]

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        self.do("heal")

    def observe(self, device: Generic) -> object:
        return device.identify()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, ErpService)
        return device.next_order(0.0)

    def reset_link(self) -> None:
        self.do("reset")

    def half_frame(self) -> None:
        self.do("half_frame")

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        return {}  # no optional method but those that read

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, ErpService)
        return {
            "a result of no order": lambda: device.report_result("", "S-1", True),
            "a result of no piece": lambda: device.report_result("A-1", "", True),
            "a note as long as a book": lambda: device.report_result("A-1", "S-1", True, "x" * 1000),
            "a closing without a reason": lambda: device.close_order("A-1", ""),
        }

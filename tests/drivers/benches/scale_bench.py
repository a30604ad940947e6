"""The scale on its fake, on a pty."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from arcor2_drivers.scale.mt_sics_scale import MtSicsScale
from arcor2_drivers.scale.settings import MtSicsScaleSettings
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench, Check
from tests.fakes.conftest import FakeProcess

ACTING = ("T", "Z", "@", "TI", "ZI", "TA ", "M21")
"""How the commands begin that change something in the scale; TA alone asks."""


class MtSicsScaleBench(Bench):
    object_type = MtSicsScale
    fake: FakeProcess

    def start(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.fake = FakeProcess("scale", "--link", str(Path(self.folder.name) / "ttySCALE"), "--settling", "0.1")
        self.do = self.fake.control.do

    def end(self) -> None:
        self.fake.end()
        self.folder.cleanup()

    def reset(self) -> None:
        self.do("heal")
        self.do("power_cycle")
        self.do("put", kg=0.5)
        self.fake.control.wait_until(lambda truth: truth["stable"])

    @property
    def address(self) -> str:
        return str(self.fake.ready["port"])

    def _build(self, port: str) -> MtSicsScale:
        return MtSicsScale("scale_id", "scale", settings=MtSicsScaleSettings(port, answer_timeout=0.4))

    def make(self) -> MtSicsScale:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build("/dev/does-not-exist"), "/dev/does-not-exist"

    def writes(self) -> Any:
        truth = self.fake.truth()
        acting = [line for line in truth["received"] if line != "TA" and line.startswith(ACTING)]
        return acting, truth["zero"], truth["tare"]

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        self.do("heal")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, MtSicsScale)
        reading = device.weigh()
        assert abs(reading.value - 0.5) < 1e-6
        return reading

    def ask(self, device: Generic) -> object:
        return self.observe(device)

    def reset_link(self) -> None:
        self.do("reset")

    def half_frame(self) -> None:
        self.do("half_frame")

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        return {}  # no optional method but those that read

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, MtSicsScale)
        truth = self.fake.truth()
        return [Check("the weight, kg", device.weigh().value, truth["load"] - truth["zero"] - truth["tare"], 1e-4)]

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, MtSicsScale)
        return {"limits the wrong way round": lambda: device.weight_within(0.6, 0.4)}

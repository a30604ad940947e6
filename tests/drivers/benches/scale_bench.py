"""The scale on its fake, on a pty."""

from collections.abc import Callable, Iterator
from typing import Any

from arcor2_drivers.scale.mt_sics_scale import MtSicsScale
from arcor2_drivers.scale.settings import MtSicsScaleSettings
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from tests.drivers.fake_bench import FakeBench

ACTING = ("T", "Z", "@", "TI", "ZI", "TA ", "M21")
"""Prefixes of commands that change something in the scale; TA without a value only reads."""


class MtSicsScaleBench(FakeBench):
    object_type = MtSicsScale
    module = "scale"
    options = ("--settling", "0.1")
    link = "ttySCALE"
    nowhere = "/dev/does-not-exist"

    def reset(self) -> None:
        self.do("heal")
        self.do("renew")  # clears the list of received commands, too, which drops the oldest when it is long
        self.do("power_cycle")
        self.do("put", kg=0.5)
        self.fake.control.wait_until(lambda truth: truth["stable"])

    def build(self, address: str) -> MtSicsScale:
        return MtSicsScale("scale_id", "scale", settings=MtSicsScaleSettings(address, answer_timeout=0.8))

    def writes(self) -> Any:
        truth = self.fake.truth()
        acting = [line for line in truth["received"] if line != "TA" and line.startswith(ACTING)]
        return acting, truth["zero"], truth["tare"]

    def observe(self, device: Generic) -> object:
        assert isinstance(device, MtSicsScale)
        reading = device.weigh()
        assert abs(reading.value - 0.5) < 1e-6
        return reading

    def ask(self, device: Generic) -> object:
        return self.observe(device)

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        return {}  # its optional methods only read

    def readings(self, device: Generic) -> list[Check]:
        assert isinstance(device, MtSicsScale)
        truth = self.fake.truth()
        return [Check("the weight, kg", device.weigh().value, truth["load"] - truth["zero"] - truth["tare"], 1e-4)]

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, MtSicsScale)
        for load in (0.5, 0.8):
            self.do("put", kg=load)
            yield Check("weight", device.weight(), load, 1e-4)
            yield Check("weight_within", device.weight_within(0.4, 0.6), 0.4 <= load <= 0.6)

    def beyond_limits(self, device: Generic) -> dict[str, Callable[[], object]]:
        assert isinstance(device, MtSicsScale)
        return {"limits the wrong way round": lambda: device.weight_within(0.6, 0.4)}

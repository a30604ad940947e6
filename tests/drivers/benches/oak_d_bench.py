"""The OAK-D on a network source; nothing of it moves or is controlled, so the cases of long acts are not run."""

from typing import Any

from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import OakDSettings
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench
from tests.fakes.conftest import FakeProcess


class OakDBench(Bench):
    object_type = OakD
    connect_timeout = 5.0  # a network source renders its first picture only then
    stale_after = 1.0
    fake: FakeProcess

    def start(self) -> None:
        self.fake = FakeProcess("oak_d", "--width", "320", "--height", "180")
        self.do = self.fake.control.do
        first = self.make()
        first.connect(20.0)  # Open3D is loaded for the first that looks
        first.disconnect()

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        self.do("heal")

    @property
    def address(self) -> str:
        return str(self.fake.ready["stream"])

    def _build(self, address: str) -> OakD:
        pose = Pose(Position(0.0, 0.0, 0.8), Orientation(1.0, 0.0, 0.0, 0.0))
        return OakD("camera_id", "camera", pose, None, OakDSettings(address, frame_timeout=0.8))

    def make(self) -> OakD:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build("127.0.0.1:1"), "127.0.0.1:1"

    def writes(self) -> Any:
        return self.fake.truth()["received"]

    def cut(self) -> None:
        self.do("silence")

    def heal(self) -> None:
        self.do("heal")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, OakD)
        return device.capture()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, OakD)
        return device.trigger()

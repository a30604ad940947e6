"""The OAK-D on a network source; nothing of it moves or is controlled, so the cases of long acts are not run."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import OakDSettings
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench, Check
from tests.fakes.conftest import FakeProcess

BOARD = {"name": "board", "pose": {"position": [0.12, 0.06, 0.05]}, "size": [0.1, 0.06, 0.1]}


class OakDBench(Bench):
    object_type = OakD
    connect_timeout = 5.0  # a network source renders its first picture only then
    stale_after = 1.5
    fake: FakeProcess

    def start(self) -> None:
        self.fake = FakeProcess("oak_d", "--width", "320", "--height", "180")
        self.do = self.fake.control.do
        self.do("scene", things=[BOARD])
        first = self.make()
        first.connect(60.0)  # Open3D is loaded for the first that looks
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
        return OakD("camera_id", "camera", pose, None, OakDSettings(address, max_age=1.0, frame_timeout=1.5))

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

    def reset_link(self) -> None:
        self.do("reset")

    def half_frame(self) -> None:
        self.do("half_frame")

    def readings(self, device: Generic) -> Iterable[Check]:
        assert isinstance(device, OakD)
        truth = self.fake.truth()
        board, height = truth["things"][0], truth["camera"]["position"][2]
        frame = device.trigger()
        assert frame.depth is not None
        points = device.point_cloud(frame)
        top = points[np.abs(points[..., 2] - (height - 0.1)) < 0.01].mean(axis=0)
        x, y, _ = board["pose"]["position"]
        yield Check("x of the board in the optical frame, m", float(top[0]), x, 0.004)
        yield Check("y of the board in the optical frame, m", float(top[1]), -y, 0.004)
        yield Check("distance of the table, m", float(np.nanmedian(points[..., 2])), height, 0.003)
        parameters = device.color_camera_params
        assert parameters is not None
        across = (parameters.cx + parameters.fx * x / (height - 0.1)) / frame.color.shape[1]
        yield Check("column of the board in the picture", _column(frame.depth), across, 0.01)
        device.set_exposure(0.006)
        self.fake.control.wait_until(lambda now: now["exposure"] is not None)
        yield Check("exposure, s", device.trigger().exposure or 0.0, self.fake.truth()["exposure"], 1e-5)

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, OakD)
        return {
            "no exposure": lambda: device.set_exposure(0.0),
            "an exposure longer than a frame": lambda: device.set_exposure(0.05),
            "the mean of no frame": lambda: device.depth_image(0),
            "the mean of too many frames": lambda: device.depth_image(101),
        }

    def works(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, OakD)
        return {
            "capture": device.capture,
            "trigger": device.trigger,
            "depth_image": device.depth_image,
            "depth_range": device.depth_range,
            "modes": device.modes,
            "set_exposure": lambda: device.set_exposure(0.01),
        }


def _column(depth: Any) -> float:
    """Where the board is across the picture, 0 to 1."""
    columns = np.nonzero(np.abs(depth.astype(int) - 700) < 10)[1]
    return float(columns.mean()) / depth.shape[1]

"""The OAK-D on a network source. It has neither motion nor control, so the cases of long actions are not run."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import OakDSettings
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from tests.drivers.fake_bench import FakeBench

BOARD = {"name": "board", "pose": {"position": [0.12, 0.06, 0.05]}, "size": [0.1, 0.06, 0.1]}


class OakDBench(FakeBench):
    object_type = OakD
    connect_timeout = 5.0  # a network source renders its first picture after connecting
    stale_after = 1.5
    module = "oak_d"
    options = ("--width", "320", "--height", "180")
    port = "stream"

    def start(self) -> None:
        super().start()
        self.do("scene", things=[BOARD])
        first = self.make()
        first.connect(60.0)  # the first client loads Open3D
        first.disconnect()

    def reset(self) -> None:
        self.do("heal")

    def build(self, address: str) -> OakD:
        pose = Pose(Position(0.0, 0.0, 0.8), Orientation(1.0, 0.0, 0.0, 0.0))
        return OakD("camera_id", "camera", pose, None, OakDSettings(address, max_age=1.0, frame_timeout=1.5))

    def writes(self) -> Any:
        return self.fake.truth()["received"]

    def observe(self, device: Generic) -> object:
        assert isinstance(device, OakD)
        return device.capture()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, OakD)
        return device.trigger()

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

    def results(self, device: Generic) -> Iterable[Check]:
        assert isinstance(device, OakD)
        parameters = device.color_camera_params
        assert parameters is not None
        for x in (0.12, -0.12):
            self.do("scene", things=[BOARD | {"pose": {"position": [x, 0.06, 0.05]}}])
            truth = self.fake.truth()
            real_x, height = truth["things"][0]["pose"]["position"][0], truth["camera"]["position"][2]
            depth = np.asarray(device.depth_image())
            across = (parameters.cx + parameters.fx * real_x / (height - 0.1)) / depth.shape[1]
            yield Check("depth_image", _column(depth), across, 0.01)
            with_board = np.asarray(device.color_image())
            self.do("scene", things=[])
            changed = np.abs(np.asarray(device.color_image()).astype(int) - with_board).max(axis=2) > 30
            yield Check("color_image", float(np.nonzero(changed)[1].mean()) / changed.shape[1], across, 0.06)

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, OakD)
        return {
            "no exposure": lambda: device.set_exposure(0.0),
            "an exposure longer than a frame": lambda: device.set_exposure(0.05),
            "the mean of zero frames": lambda: device.depth_image(0),
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
    """Return the horizontal position of the board in the picture, 0 to 1."""
    columns = np.nonzero(np.abs(depth.astype(int) - 700) < 10)[1]
    return float(columns.mean()) / depth.shape[1]

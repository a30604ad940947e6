"""Bin and blister, which have no device; the bin gets a synthetic picture."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from PIL import Image

from arcor2_drivers.bin_picking.bin import Bin
from arcor2_drivers.bin_picking.blister import Blister
from arcor2_drivers.bin_picking.settings import BinSettings, BlisterSettings
from arcor2_hw.data.base import now
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.objects import Generic
from arcor2_hw.objects.frame import PictureNote
from arcor2_hw.testing.bench import Bench, Check

LENS = CameraParameters(500.0, 500.0, 320.0, 240.0, [0.0] * 4)
ABOVE = Pose(Position(0.0, 0.0, 0.5), Orientation(1.0, 0.0, 0.0, 0.0))
PART = (0.08, 0.05, 0.04)
PLACE = (0.06, -0.03)


def picture() -> Any:
    """Return a picture of a part in a crate, seen from 0.5 m above the floor."""
    depth = np.full((480, 640), 500, np.uint16)
    scale = LENS.fx / (0.5 - PART[2])
    left, right = (round(LENS.cx + scale * (PLACE[0] + side * PART[0] / 2)) for side in (-1, 1))
    top, bottom = (round(LENS.cy - scale * (PLACE[1] + side * PART[1] / 2)) for side in (1, -1))
    depth[top:bottom, left:right] = round(1000 * (0.5 - PART[2]))
    return PictureNote(LENS, ABOVE, now(), "camera").put_on(Image.fromarray(depth))


class BinBench(Bench):
    object_type = Bin
    connect_timeout = 5.0  # the first object loads Open3D
    address = "crate"

    def start(self) -> None:
        import open3d  # noqa: F401 - so that the import does not count as time of the first case

    def make(self) -> Generic:
        return Bin("crate_id", "crate", Pose(), BinSettings(0.4, 0.3, 0.1, *PART))

    def absent(self) -> tuple[Generic, str]:
        path = "/nowhere/part.stl"
        return Bin("crate_id", "crate", Pose(), BinSettings(0.3, 0.2, 0.1, part_mesh=path)), path

    def readings(self, device: Generic) -> Iterable[Check]:
        assert isinstance(device, Bin)
        pose, quality = device.next_part(picture())
        for axis, by_device in zip("xyz", (*PLACE, PART[2] / 2), strict=True):
            yield Check(f"{axis} of the part, m", getattr(pose.position, axis), by_device, 0.0015)
        yield Check("quality", quality, 1.0, 0.1)

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, Bin)
        wrong = PictureNote.of(picture()).put_on(Image.new("RGB", (640, 480)))
        return {"a colour picture": lambda: device.next_part(wrong)}


class BlisterBench(Bench):
    object_type = Blister
    address = "tray"

    def make(self) -> Generic:
        at = Pose(Position(0.5, 0.2, 0.1), Orientation(0.0, 0.0, 1.0, 0.0))
        return Blister("tray_id", "tray", at, BlisterSettings(2, 3, 0.04, 0.03, origin_x=0.01))

    def absent(self) -> tuple[Generic, str]:
        path = "/nowhere/tray.json"
        return Blister("tray_id", "tray", Pose(), BlisterSettings(2, 3, 0.04, 0.03, state_file=path)), path

    def readings(self, device: Generic) -> Iterable[Check]:
        assert isinstance(device, Blister)
        last = device.place(1, 2).position
        for axis, by_hand in (("x", 0.5 - 0.07), ("y", 0.2 - 0.04), ("z", 0.1)):
            yield Check(f"{axis} of the last place, m", getattr(last, axis), by_hand, 1e-9)

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, Blister)
        return {
            "a row that does not exist": lambda: device.place(2, 0),
            "a column that does not exist": lambda: device.set_place(0, 3, True),
            "taking a part that was not requested": device.part_taken,
        }

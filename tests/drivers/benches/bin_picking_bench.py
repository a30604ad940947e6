"""Bin and blister: no device is behind them, so only what concerns every object is run."""

from arcor2_drivers.bin_picking.bin import Bin
from arcor2_drivers.bin_picking.blister import Blister
from arcor2_drivers.bin_picking.settings import BinSettings, BlisterSettings
from arcor2_hw.data.geometry import Pose
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench


class BinBench(Bench):
    object_type = Bin
    connect_timeout = 5.0  # Open3D is loaded by the first
    address = "crate"

    def make(self) -> Generic:
        return Bin("crate_id", "crate", Pose(), BinSettings(0.3, 0.2, 0.1, 0.05, 0.04, 0.03))

    def absent(self) -> tuple[Generic, str]:
        path = "/nowhere/part.stl"
        return Bin("crate_id", "crate", Pose(), BinSettings(0.3, 0.2, 0.1, part_mesh=path)), path


class BlisterBench(Bench):
    object_type = Blister
    address = "tray"

    def make(self) -> Generic:
        return Blister("tray_id", "tray", Pose(), BlisterSettings(2, 3, 0.04, 0.03))

    def absent(self) -> tuple[Generic, str]:
        path = "/nowhere/tray.json"
        return Blister("tray_id", "tray", Pose(), BlisterSettings(2, 3, 0.04, 0.03, state_file=path)), path

"""cell.yaml: the devices of one workplace, by name: what they are and where they are reached."""

from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset, is_valid_name
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData, NotFound

MAX_SIZE: Final = 1 << 20
"""Bytes; a cell of hundreds of devices has some ten thousand."""


class CellDevice(Data, frozen=True, forbid_unknown_fields=True):
    """One device: its name in the scene, its object type, its settings by name.

    bench: for the conformance suite, `module:Class` of a bench that knows more of the device than its settings say.
    wire: for the suite, the settings that name host and port, or the port alone, of the connection that it may cut; a
    number is a port that the device always has. real: whether it is a real device, which the suite does not touch
    unasked; where it is not given, whatever is not on this machine is real.
    """

    name: str
    type: str
    settings: dict[str, Any] = field(default_factory=dict)
    pose: Pose | Unset = UNSET
    bench: str | Unset = UNSET
    wire: list[str | int] | Unset = UNSET
    real: bool | Unset = UNSET

    def __post_init__(self) -> None:
        if not is_valid_name(self.name):
            raise ValueError(f"{self.name!r} is no name for an object")


class Cell(Data, frozen=True, forbid_unknown_fields=True):
    """The devices of a workplace; their names are unique."""

    devices: list[CellDevice]

    def __post_init__(self) -> None:
        names = [device.name for device in self.devices]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"named twice: {', '.join(twice)}")

    def device(self, name: str) -> CellDevice | None:
        """Give a device by its name, None when it is not there."""
        return next((device for device in self.devices if device.name == name), None)


def read_cell(path: Path) -> Cell:
    """Read a cell.yaml. Raises NotFound, or InvalidData naming the file, the device and what is wrong there."""
    try:
        if path.stat().st_size > MAX_SIZE:
            raise InvalidData(f"{path} is larger than {MAX_SIZE} bytes: it is no cell.yaml")
        return msgspec.yaml.decode(path.read_bytes(), type=Cell)
    except FileNotFoundError:
        raise NotFound(f"there is no {path}") from None
    except OSError as error:
        raise InvalidData(f"{path} cannot be read: {error.strerror}") from None
    except msgspec.DecodeError as error:  # also for a wrong value
        raise InvalidData(f"{path}: {error}") from None


def write_cell(cell: Cell) -> bytes:
    """Give the text of a cell.yaml, which `read_cell` reads."""
    return msgspec.yaml.encode(cell)

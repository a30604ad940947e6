"""cell.yaml: the devices of one workplace, by name: what they are and where they are reached."""

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset, is_valid_name
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import Scene, SceneObjectOverride
from arcor2_hw.data.secret import is_reference
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
    """The devices of a workplace; their names are unique.

    calibration: which markers stand where, in the form of a file of markers (arcor2_hw.calibration.configuration).
    """

    devices: list[CellDevice]
    calibration: dict[str, Any] | Unset = UNSET

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


def overlay(cell: Cell, scene: Scene) -> list[SceneObjectOverride]:
    """Give the settings that a cell lays over those of a scene's objects of the same names.

    Poses stay the scene's: action points are taught relative to them. A device that is not in the scene is left out;
    `strangers` gives those. Raises InvalidData naming the object when its type is another one.
    """
    found = []
    for scene_object in scene.objects:
        device = cell.device(scene_object.name)
        if device is None or not device.settings:
            continue
        if device.type != scene_object.type:
            raise InvalidData(
                f"{device.name} is a {scene_object.type} in the scene {scene.name} and a {device.type} in the cell file"
            )
        found.append(SceneObjectOverride(scene_object.id, parameters_of(device)))
    return found


def parameters_of(device: CellDevice) -> list[Parameter]:
    """Give the settings of a device as the parameters of a scene's object."""
    return [
        Parameter(name, _kind(value), msgspec.json.encode(value).decode()) for name, value in device.settings.items()
    ]


def exported(scene: Scene, left_out: Collection[str] = ()) -> Cell:
    """Return the objects of a scene as a cell without secrets, besides those whose type is left out."""
    return Cell(
        [
            CellDevice(
                scene_object.name,
                scene_object.type,
                {
                    one.name: value
                    for one in scene_object.parameters
                    if not is_reference(value := msgspec.json.decode(one.value))
                },
                scene_object.pose,
            )
            for scene_object in scene.objects
            if scene_object.type not in left_out
        ]
    )


def _values(parameters: Iterable[Parameter]) -> list[tuple[str, Any]]:
    return [(one.name, msgspec.json.decode(one.value)) for one in parameters]


def strangers(cell: Cell, scene: Scene) -> list[str]:
    """Give the names in a cell that no object of the scene has: misspelt, or not used there."""
    names = {scene_object.name for scene_object in scene.objects}
    return [device.name for device in cell.devices if device.name not in names]


def _kind(value: Any) -> str:
    """Give the parameter type of the protocol for a plain value; the driver's own hints decide in the end."""
    match value:
        case bool():
            return "boolean"
        case int():
            return "integer"
        case float():
            return "double"
    return "string"


def write_cell(cell: Cell) -> bytes:
    """Give the text of a cell.yaml, which `read_cell` reads."""
    return msgspec.yaml.encode(cell)

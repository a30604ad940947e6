"""cell.yaml: the devices of one workplace by name, with their types and settings."""

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Unset, is_valid_name
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.nodes import NodeName
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.data.secret import is_reference
from arcor2_hw.exceptions import InvalidData, NotFound

MAX_SIZE: Final = 1 << 20
"""Maximum size, bytes; a cell of hundreds of devices has some ten thousand."""
MAX_DEAD_BAND: Final = 1e12
"""Maximum dead band."""
BROKER_URL: Final = "ARCOR2_HW_NATS_URL"
"""The variable with the address of the broker between a server and its nodes. It may contain a password."""
LOCAL_BROKER: Final = "nats://127.0.0.1:4222"
"""The address of the broker if the variable is not set."""
BROKER_AUTHORITY: Final = "ARCOR2_HW_NATS_CA"
"""The variable with the file of the certificate to trust for tls://."""
BROKER_CREDENTIALS: Final = "ARCOR2_HW_NATS_CREDENTIALS"
"""The variable that names the file of the broker's credentials. BROKER_URL has precedence."""


class CellDevice(Data, frozen=True, forbid_unknown_fields=True):
    """One device: its name in the scene, its object type, its settings by name.

    bench: for the conformance suite, `module:Class` of a bench with knowledge that the settings don't contain. wire:
    for the suite, the settings with host and port, or the port alone, of the connection that it may interrupt; a number
    is a fixed port of the device. real: whether it is a real device, which the suite uses only when asked; default:
    whether it is on another machine. node: the computer (`arcor2-hw node`) on which it runs.
    """

    name: str
    type: str
    settings: dict[str, Any] = field(default_factory=dict)
    pose: Pose | Unset = UNSET
    bench: str | Unset = UNSET
    wire: list[str | int] | Unset = UNSET
    real: bool | Unset = UNSET
    node: NodeName | Unset = UNSET
    dead_bands: dict[str, Annotated[float, Meta(ge=0, le=MAX_DEAD_BAND)]] | Unset = UNSET

    def __post_init__(self) -> None:
        if not is_valid_name(self.name):
            raise ValueError(f"{self.name!r} is not a valid name of an object")


class Cell(Data, frozen=True, forbid_unknown_fields=True):
    """The devices of a workplace; their names are unique.

    calibration: markers and their poses, in the form of a marker file (arcor2_hw.calibration.configuration).
    """

    devices: list[CellDevice]
    calibration: dict[str, Any] | Unset = UNSET

    def __post_init__(self) -> None:
        names = [device.name for device in self.devices]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"several devices have the same name: {', '.join(twice)}")

    def device(self, name: str) -> CellDevice | None:
        """Return a device by its name, or None if there is none."""
        return next((device for device in self.devices if device.name == name), None)


def read_cell(path: Path) -> Cell:
    """Read a cell.yaml.

    Raises:
        NotFound: The file does not exist.
        InvalidData: The file is invalid; the message names the file, the device and the error.
    """
    try:
        if path.stat().st_size > MAX_SIZE:
            raise InvalidData(
                "{path} is larger than {max_size} bytes, so it is not a cell.yaml", path=path, max_size=MAX_SIZE
            )
        return msgspec.yaml.decode(path.read_bytes(), type=Cell)
    except FileNotFoundError:
        raise NotFound("{path} does not exist", path=path) from None
    except OSError as error:
        raise InvalidData("{path} cannot be read: {reason}", path=path, reason=error.strerror) from None
    except msgspec.DecodeError as error:  # also raised for a wrong value
        raise InvalidData("{path}: {reason}", path=path, reason=error) from None


def overlay(cell: Cell, scene: Scene) -> list[SceneObjectOverride]:
    """Return the settings of a cell that override those of scene objects with the same names.

    Poses are taken from the scene, because action points are taught relative to them. Devices that are not in the scene
    are ignored; see `strangers`.

    Raises:
        InvalidData: An object has another type; the message names it.
    """
    found = []
    for scene_object in scene.objects:
        device = cell.device(scene_object.name)
        if device is None or not device.settings:
            continue
        if device.type != scene_object.type:
            raise InvalidData(
                "{name} is a {type} in the scene {scene_name} and a {device_type} in the cell file",
                name=device.name,
                type=scene_object.type,
                scene_name=scene.name,
                device_type=device.type,
            )
        found.append(SceneObjectOverride(scene_object.id, parameters_of(device)))
    return found


def node_of(cell: Cell | None, scene_object: SceneObject) -> str:
    """Return the node that an object names; empty for none. The cell file has precedence over the scene."""
    own = "" if isinstance(scene_object.node, Unset) else scene_object.node
    return assigned_nodes(cell).get(scene_object.name, own)


def objects_by_node(cell: Cell | None, objects: Iterable[SceneObject]) -> dict[str, list[str]]:
    """Return the names of the objects by the node that they name. The cell file has precedence over the scene."""
    found: dict[str, list[str]] = {}
    for each in objects:
        if node := node_of(cell, each):
            found.setdefault(node, []).append(each.name)
    return found


def assigned_nodes(cell: Cell | None) -> dict[str, str]:
    """Return the nodes that a cell file names, by name of the device."""
    return {
        device.name: device.node
        for device in ([] if cell is None else cell.devices)
        if not isinstance(device.node, Unset)
    }


def parameters_of(device: CellDevice) -> list[Parameter]:
    """Return the settings of a device as parameters of a scene object."""
    return [
        Parameter(name, _kind(value), msgspec.json.encode(value).decode()) for name, value in device.settings.items()
    ]


def exported(scene: Scene, left_out: Collection[str] = ()) -> Cell:
    """Return the objects of a scene, except those of excluded types, as a cell without secrets."""
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
                node=scene_object.node,
            )
            for scene_object in scene.objects
            if scene_object.type not in left_out
        ]
    )


def _values(parameters: Iterable[Parameter]) -> list[tuple[str, Any]]:
    return [(one.name, msgspec.json.decode(one.value)) for one in parameters]


def unknown_objects(cell: Cell, scene: Scene) -> list[str]:
    """Return the names in a cell that no object of the scene has: misspelt or unused."""
    names = {scene_object.name for scene_object in scene.objects}
    return [device.name for device in cell.devices if device.name not in names]


def _kind(value: Any) -> str:
    """Return the parameter type of the protocol for a plain value; the driver's type hints have precedence."""
    match value:
        case bool():
            return "boolean"
        case int():
            return "integer"
        case float():
            return "double"
    return "string"


def write_cell(cell: Cell) -> bytes:
    """Return the text of a cell.yaml, as `read_cell` reads it."""
    return msgspec.yaml.encode(cell)


# Names before version 0.2.
LARGEST_BAND, strangers = MAX_DEAD_BAND, unknown_objects

"""Which markers stand where, as a technician writes it into a file: ours, and that of the original's service.

    marker_size: 0.1            # m, side of the black square
    dictionary: 4x4_50
    markers:                    # a list of marker_id and pose, or a mapping by id as in the original
      10: {pose: {position: {x: 0.2, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}}
    boards: []                  # ChArUco boards
    blur_threshold: 150         # least sharpness of a picture
    min_distance: 0.3           # m, at which a marker counts fully, and no more
    max_distance: 2.0
    lowest: 0                   # m, the least height at which the camera can hang above the origin

Imports no numerics: the server knows it.
"""

from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import field

from arcor2_hw.calibration.camera_results import PoseMethod, PoseOptions
from arcor2_hw.calibration.layout import CharucoBoard, Layout, Marker, MarkerDictionary
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.exceptions import InvalidData, NotFound

MAX_SIZE: Final = 1 << 20
"""Bytes of a file."""
MAX_MARKERS: Final = 1000


class CalibrationConfiguration(Data, frozen=True, forbid_unknown_fields=True):
    """The file's content. See PoseOptions for the options."""

    marker_size: float = 0.1
    dictionary: MarkerDictionary = "4x4_50"
    markers: list[Marker] = field(default_factory=list)
    boards: list[CharucoBoard] = field(default_factory=list)
    method: PoseMethod = "joint"
    blur_threshold: float = 150.0
    min_distance: float = 0.3
    max_distance: float = 2.0
    lowest: float | Unset = UNSET

    def __post_init__(self) -> None:
        if not 0.0 < self.marker_size < 100.0:
            raise ValueError(f"marker_size has to be above 0 m and below 100 m, not {self.marker_size:g}")
        if not 0.0 <= self.min_distance < self.max_distance:
            raise ValueError("min_distance has to be below max_distance, and not below 0")
        ids = [marker.marker_id for marker in self.markers]
        if twice := sorted({one for one in ids if ids.count(one) > 1}):
            raise ValueError(f"marker {twice[0]} is listed twice")
        if len(ids) > MAX_MARKERS:
            raise ValueError(f"there are {len(ids)} markers; {MAX_MARKERS} are the most")
        for marker in self.markers:
            if marker.marker_id < 0:
                raise ValueError(f"marker {marker.marker_id}: an id is not below 0")
            if not isinstance(marker.size, Unset) and not 0.0 < marker.size < 100.0:
                raise ValueError(f"marker {marker.marker_id}: size has to be above 0 m and below 100 m")

    @property
    def layout(self) -> Layout:
        """Give markers and boards."""
        return Layout(self.markers, self.boards, self.marker_size, self.dictionary)

    @property
    def options(self) -> PoseOptions:
        """Give how poses are computed."""
        return PoseOptions(
            method=self.method,
            blur_threshold=self.blur_threshold,
            min_distance=self.min_distance,
            max_distance=self.max_distance,
            lowest=self.lowest,
        )


_OLDER: Final = {"min_dist": "min_distance", "max_dist": "max_distance"}
"""Names of the original's file, from general knowledge of it."""


def configuration_of(content: Any, where: str) -> CalibrationConfiguration:
    """Read plain data. InvalidData naming `where`, and the marker."""
    if not isinstance(content, dict):
        raise InvalidData(f"{where}: a mapping with marker_size and markers is expected.")
    content = {_OLDER.get(key, key): value for key, value in content.items()}
    if isinstance(markers := content.get("markers"), dict):
        content["markers"] = [_listed(key, value, where) for key, value in markers.items()]
    try:
        return msgspec.convert(content, CalibrationConfiguration)
    except msgspec.ValidationError as error:
        raise InvalidData(f"{where}: {error}.") from None


def _listed(key: Any, value: Any, where: str) -> dict[str, Any]:
    try:
        number = int(key)
    except (TypeError, ValueError):
        raise InvalidData(f"{where}: {key!r} is no id of a marker.") from None
    if not isinstance(value, dict):
        raise InvalidData(f"{where}: marker {number} needs a pose.")
    return {"marker_id": number} | (value if "pose" in value else {"pose": value})


def read_configuration(path: Path) -> CalibrationConfiguration:
    """Read a file. NotFound, or InvalidData naming the file and what is wrong there; a marker listed twice is."""
    try:
        if path.stat().st_size > MAX_SIZE:
            raise InvalidData(f"{path} is larger than {MAX_SIZE} bytes: it is no configuration of markers.")
        text = path.read_bytes()
    except FileNotFoundError:
        raise NotFound(f"There is no {path}.") from None
    except OSError as error:
        raise InvalidData(f"{path} cannot be read: {error.strerror}.") from None
    return configuration_of(yaml_of(text, str(path)), str(path))


def yaml_of(text: bytes, where: str) -> Any:
    """Read YAML; InvalidData naming `where`, also for a key that is there twice, of which YAML would take the last."""
    import yaml  # 10 ms that the server's start does without

    try:
        root = yaml.compose(text, yaml.SafeLoader)
        _refuse_twice(root, where)
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InvalidData(f"{where}: {' '.join(str(error).split())}.") from None


def _refuse_twice(node: Any, where: str) -> None:
    import yaml

    if isinstance(node, yaml.SequenceNode):
        for item in node.value:
            _refuse_twice(item, where)
    elif isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            name = str(key.value)
            if name in seen:
                what = f"marker {name}" if name.isdecimal() else name
                raise InvalidData(
                    f"{where}: {what} is listed twice, the second time in line {key.start_mark.line + 1}."
                )
            seen.add(name)
            _refuse_twice(value, where)

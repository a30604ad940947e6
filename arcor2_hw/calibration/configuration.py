"""The configuration file of markers, in our format and in that of the original calibration service.

    marker_size: 0.1            # m, side of the black square
    dictionary: 4x4_50
    markers:                    # a list of marker_id and pose, or a mapping by id as in the original
      10: {pose: {position: {x: 0.2, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}}
    boards: []                  # ChArUco boards
    blur_threshold: 150         # minimum sharpness of an image
    min_distance: 0.3           # m, up to which a marker has full weight
    max_distance: 2.0
    lowest: 0                   # m, minimum height of the camera above the origin

Imports no numerics, so that the server can use it.
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
"""Maximum size of a file, bytes."""
MAX_MARKERS: Final = 1000


class CalibrationConfiguration(Data, frozen=True, forbid_unknown_fields=True):
    """The content of the file. See PoseOptions for the options."""

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
            raise ValueError(f"marker_size must be above 0 m and below 100 m, not {self.marker_size:g}")
        if not 0.0 <= self.min_distance < self.max_distance:
            raise ValueError("min_distance must be 0 or more, and below max_distance")
        ids = [marker.marker_id for marker in self.markers]
        if twice := sorted({one for one in ids if ids.count(one) > 1}):
            raise ValueError(f"marker {twice[0]} is listed twice")
        if len(ids) > MAX_MARKERS:
            raise ValueError(f"there are {len(ids)} markers; the maximum is {MAX_MARKERS}")
        for marker in self.markers:
            if marker.marker_id < 0:
                raise ValueError(f"marker {marker.marker_id}: the id must not be negative")
            if not isinstance(marker.size, Unset) and not 0.0 < marker.size < 100.0:
                raise ValueError(f"marker {marker.marker_id}: size must be above 0 m and below 100 m")

    @property
    def layout(self) -> Layout:
        """Return markers and boards."""
        return Layout(self.markers, self.boards, self.marker_size, self.dictionary)

    @property
    def options(self) -> PoseOptions:
        """Return the options for computing poses."""
        return PoseOptions(
            method=self.method,
            blur_threshold=self.blur_threshold,
            min_distance=self.min_distance,
            max_distance=self.max_distance,
            lowest=self.lowest,
        )


_OLDER: Final = {"min_dist": "min_distance", "max_dist": "max_distance"}
"""Names of the original file, from general knowledge of it."""


def configuration_of(content: Any, source: str) -> CalibrationConfiguration:
    """Read plain data.

    Raises:
        InvalidData: The data is invalid; the message names `source` and the marker.
    """
    if not isinstance(content, dict):
        raise InvalidData("{place}: expected a mapping with marker_size and markers.", place=source)
    content = {_OLDER.get(key, key): value for key, value in content.items()}
    if isinstance(markers := content.get("markers"), dict):
        content["markers"] = [_listed(key, value, source) for key, value in markers.items()]
    try:
        return msgspec.convert(content, CalibrationConfiguration)
    except msgspec.ValidationError as error:
        raise InvalidData("{place}: {reason}.", place=source, reason=error) from None


def _listed(key: Any, value: Any, source: str) -> dict[str, Any]:
    try:
        number = int(key)
    except (TypeError, ValueError):
        raise InvalidData("{place}: {key!r} is not the id of a marker.", place=source, key=key) from None
    if not isinstance(value, dict):
        raise InvalidData("{place}: marker {number} needs a pose.", place=source, number=number)
    return {"marker_id": number} | (value if "pose" in value else {"pose": value})


def read_configuration(path: Path) -> CalibrationConfiguration:
    """Read a file.

    Raises:
        NotFound: The file does not exist.
        InvalidData: The file is invalid, such as a marker listed twice; the message names the file and the place.
    """
    try:
        if path.stat().st_size > MAX_SIZE:
            raise InvalidData(
                "{path} is larger than {max_size} bytes, so it is not a configuration of markers.",
                path=path,
                max_size=MAX_SIZE,
            )
        text = path.read_bytes()
    except FileNotFoundError:
        raise NotFound("File {path} does not exist.", path=path) from None
    except OSError as error:
        raise InvalidData("{path} cannot be read: {reason}.", path=path, reason=error.strerror) from None
    return configuration_of(yaml_of(text, str(path)), str(path))


def yaml_of(text: bytes, source: str) -> Any:
    """Parse YAML.

    Raises:
        InvalidData: It is invalid, or a key is repeated, which YAML itself ignores; the message names `source`.
    """
    import yaml  # imported here because it takes 10 ms of the server's start

    try:
        root = yaml.compose(text, yaml.SafeLoader)
        _refuse_twice(root, source)
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InvalidData("{place}: {reason}.", place=source, reason=" ".join(str(error).split())) from None


def _refuse_twice(node: Any, source: str) -> None:
    import yaml

    if isinstance(node, yaml.SequenceNode):
        for item in node.value:
            _refuse_twice(item, source)
    elif isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            name = str(key.value)
            if name in seen:
                what = f"marker {name}" if name.isdecimal() else name
                raise InvalidData(
                    "{place}: {what} is listed twice, the second time in line {line}.",
                    place=source,
                    what=what,
                    line=key.start_mark.line + 1,
                )
            seen.add(name)
            _refuse_twice(value, source)

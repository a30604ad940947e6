"""Position, orientation and pose with the algebra of rigid motion (quaternions x, y, z, w; lengths in m)."""

import functools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from msgspec import field

from arcor2_hw.data.base import MutableData

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Vector = npt.NDArray[np.float64]


@functools.cache
def _quaternions() -> Any:
    """Return transforms3d's algebra, imported here because with numpy it takes 0.1 s of the server's start."""
    from transforms3d import quaternions

    return quaternions


class Position(MutableData):
    """A point, or a displacement, m."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __iter__(self) -> Iterator[float]:
        return iter((self.x, self.y, self.z))

    def __getitem__(self, index: int) -> float:
        return (self.x, self.y, self.z)[index]

    def __add__(self, other: "Position") -> "Position":
        return Position(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: "Position") -> "Position":
        return Position(self.x - other.x, self.y - other.y, self.z - other.z)

    def distance_to(self, other: "Position") -> float:
        """Return the Euclidean distance to `other`, m."""
        return math.dist((self.x, self.y, self.z), (other.x, other.y, other.z))

    def rotated(self, by: "Orientation") -> "Position":
        """Return this vector rotated by `by`."""
        return Position(
            *map(float, _quaternions().rotate_vector((self.x, self.y, self.z), by.wxyz(), is_normalized=True))
        )


class Orientation(MutableData):
    """A unit quaternion x, y, z, w, normalized at construction.

    Raises ValueError for the zero quaternion and for numbers that are not finite.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0

    def __post_init__(self) -> None:
        square = self.x * self.x + self.y * self.y + self.z * self.z + self.w * self.w
        if not math.isfinite(square) or square < 1e-24:
            raise ValueError("an orientation needs a finite, non-zero quaternion")
        if abs(square - 1.0) > 1e-12:
            norm = math.sqrt(square)
            self.x /= norm
            self.y /= norm
            self.z /= norm
            self.w /= norm

    def __iter__(self) -> Iterator[float]:
        return iter((self.x, self.y, self.z, self.w))

    def __getitem__(self, index: int) -> float:
        return (self.x, self.y, self.z, self.w)[index]

    def __mul__(self, other: "Orientation") -> "Orientation":
        return Orientation.from_wxyz(_quaternions().qmult(self.wxyz(), other.wxyz()))

    def wxyz(self) -> tuple[float, float, float, float]:
        """Return the components with the scalar first, as transforms3d needs them."""
        return self.w, self.x, self.y, self.z

    @classmethod
    def from_wxyz(cls, quaternion: "Vector | tuple[float, ...]") -> "Orientation":
        """Create an orientation from four components, scalar first."""
        w, x, y, z = map(float, quaternion)
        return cls(x, y, z, w)

    def inverted(self) -> "Orientation":
        """Return the inverse rotation."""
        return Orientation.from_wxyz(_quaternions().qconjugate(self.wxyz()))

    def matrix(self) -> "Vector":
        """Return the rotation matrix, shape (3, 3)."""
        import numpy as np

        return np.asarray(_quaternions().quat2mat(self.wxyz()), dtype=np.float64)

    @classmethod
    def from_matrix(cls, matrix: "Vector") -> "Orientation":
        """Create an orientation from a rotation matrix, shape (3, 3)."""
        return cls.from_wxyz(_quaternions().mat2quat(matrix))

    @classmethod
    def from_rotation_vector(cls, x: float, y: float, z: float) -> "Orientation":
        """Create an orientation from axis times angle, rad."""
        angle = math.sqrt(x * x + y * y + z * z)
        if angle < 1e-12:
            return cls(x / 2, y / 2, z / 2, 1.0)
        s = math.sin(angle / 2) / angle
        return cls(x * s, y * s, z * s, math.cos(angle / 2))

    def rotation_vector(self) -> tuple[float, float, float]:
        """Return axis times angle, rad, with an angle from 0 to pi."""
        sign = -1.0 if self.w < 0 else 1.0
        x, y, z, w = sign * self.x, sign * self.y, sign * self.z, sign * self.w
        s = math.sqrt(x * x + y * y + z * z)
        factor = 2.0 if s < 1e-12 else 2.0 * math.atan2(s, w) / s
        return x * factor, y * factor, z * factor

    def angle_to(self, other: "Orientation") -> float:
        """Return the angle of the rotation between the two, rad, 0 to pi."""
        return math.hypot(*(self.inverted() * other).rotation_vector())


class Pose(MutableData):
    """Position and orientation of a frame in its parent frame."""

    position: Position = field(default_factory=Position)
    orientation: Orientation = field(default_factory=Orientation)

    def __mul__(self, other: "Pose") -> "Pose":
        """Compose two poses: a_from_b * b_from_c = a_from_c."""
        return Pose(self.position + other.position.rotated(self.orientation), self.orientation * other.orientation)

    def inverted(self) -> "Pose":
        """Return the inverse motion: b_from_a for a_from_b."""
        back = self.orientation.inverted()
        p = self.position
        return Pose(Position(-p.x, -p.y, -p.z).rotated(back), back)

    def matrix(self) -> "Vector":
        """Return the homogeneous matrix, shape (4, 4)."""
        import numpy as np

        result = np.eye(4)
        result[:3, :3] = self.orientation.matrix()
        result[:3, 3] = tuple(self.position)
        return result

    @classmethod
    def from_matrix(cls, matrix: "Vector") -> "Pose":
        """Create a pose from a homogeneous matrix, shape (4, 4)."""
        return cls(Position(*map(float, matrix[:3, 3])), Orientation.from_matrix(matrix[:3, :3]))


def make_pose_abs(parent: Pose, child: Pose) -> Pose:
    """Convert a pose from the frame `parent` to the frame in which `parent` is stated."""
    return parent * child


def make_pose_rel(parent: Pose, child: Pose) -> Pose:
    """Convert a pose to the frame `parent`; both are stated in the same frame."""
    return parent.inverted() * child

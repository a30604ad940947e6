"""The outside of a robot in one joint state, as triangles in its base frame: what a camera is compared with."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from arcor2_hw.exceptions import InvalidData

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

MOST_TRIANGLES = 2_000_000


@dataclass(frozen=True)
class RobotSurface:
    """Triangles of all links: vertices (n, 3) in m in the robot's base frame, triangles (m, 3) of indices into them.

    Raises InvalidData when there are none, too many (MOST_TRIANGLES), not finite numbers or indices out of range.
    """

    vertices: Floats
    triangles: Indices
    name: str = "the robot"

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or not len(self.vertices):
            raise InvalidData(f"The model of {self.name} has no vertices of three coordinates.")
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3 or not len(self.triangles):
            raise InvalidData(f"The model of {self.name} has no triangles: it cannot be seen.")
        if len(self.triangles) > MOST_TRIANGLES:
            raise InvalidData(
                f"The model of {self.name} has {len(self.triangles)} triangles; {MOST_TRIANGLES} are the most."
            )
        if not np.isfinite(self.vertices).all():
            raise InvalidData(f"The model of {self.name} has vertices that are not finite.")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise InvalidData(f"The model of {self.name} has a triangle of a vertex that does not exist.")

    @classmethod
    def of_links(cls, links: Iterable[tuple[Floats, Indices, Floats]], name: str = "the robot") -> "RobotSurface":
        """Put links together: of each, vertices in its own frame, triangles, and base_from_link as a 4 × 4 matrix."""
        vertices: list[Floats] = []
        triangles: list[Indices] = []
        count = 0
        for own, indices, base_from_link in links:
            vertices.append(own @ base_from_link[:3, :3].T + base_from_link[:3, 3])
            triangles.append(np.asarray(indices, dtype=np.int64) + count)
            count += len(own)
        if not vertices:
            raise InvalidData(f"The model of {name} has no links that could be seen.")
        return cls(np.concatenate(vertices), np.concatenate(triangles), name)

    @property
    def size(self) -> float:
        """Give the length of the diagonal of the box around it, m."""
        return float(np.linalg.norm(self.vertices.max(axis=0) - self.vertices.min(axis=0)))

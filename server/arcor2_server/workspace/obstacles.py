"""Obstacles that clients add over REST."""

from collections.abc import Callable
from typing import Final

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.exceptions import NotFound

INFLATION: Final = 0.01
"""Inflation of body sizes for safe line checks, m (protocol, section 14)."""


class ObstacleRegistry:
    """Obstacles added over REST. They exist until they are deleted or the scene is stopped over REST.

    `started`: whether the scene was started over REST. `inflation`: see `INFLATION`.
    """

    def __init__(self, inflation: float = INFLATION) -> None:
        self.started = False
        self.inflation = inflation
        self._obstacles: dict[str, Obstacle] = {}
        self.on_change: list[Callable[[], None]] = []
        """Called when obstacles changed."""
        self.on_put: list[Callable[[Obstacle], None]] = []
        """Called with an added, moved, attached or detached obstacle."""
        self.on_remove: list[Callable[[list[str]], None]] = []
        """Called with the ids of removed obstacles."""

    @property
    def obstacles(self) -> dict[str, Obstacle]:
        """Return the obstacles by id."""
        return dict(self._obstacles)

    def put(self, obstacle: Obstacle) -> None:
        """Add an obstacle, or replace the one with its id."""
        self._obstacles[obstacle.model.id] = obstacle
        for notify in self.on_put:
            notify(obstacle)
        self._changed()

    def get(self, key: str) -> Obstacle:
        """Return an obstacle. Raise NotFound if there is none."""
        if (obstacle := self._obstacles.get(key)) is None:
            raise NotFound("Collision model {key!r} does not exist.", key=key)
        return obstacle

    def remove(self, key: str) -> None:
        """Remove an obstacle. Raise NotFound if there is none."""
        if self._obstacles.pop(key, None) is None:
            raise NotFound("Collision model {key!r} does not exist.", key=key)
        self._removed([key])

    def start(self) -> None:
        """Mark the scene as started."""
        self.started = True

    def stop(self) -> None:
        """Stop and remove all obstacles."""
        self.started = False
        removed = list(self._obstacles)
        self._obstacles.clear()
        self._removed(removed)

    def _removed(self, keys: list[str]) -> None:
        for notify in self.on_remove:
            notify(keys)
        self._changed()

    def _changed(self) -> None:
        for notify in self.on_change:
            notify()

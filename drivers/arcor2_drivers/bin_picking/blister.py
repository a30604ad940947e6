"""Blister: a blister, tray or magazine with places in a grid that counts its parts."""

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import LossReaction
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import NotConnected, OutOfRange
from arcor2_hw.objects import GenericWithPose
from arcor2_hw.objects.connected import Connected

from .errors import Empty, NoFreePlace
from .places import BadState, Places
from .poses import grip_pose
from .settings import BlisterSettings


class Blister(Connected, GenericWithPose):
    """A grid of places for parts that counts the parts without a sensor.

    A program reports each part that it took or placed by part_taken or part_put; until then next_part and next_free
    return the same place.
    """

    _ABSTRACT = False
    display_name = "Blister"
    category = "Containers"
    icon = "blister"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()  # there is no device

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: BlisterSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._config = settings
        file = Path(settings.state_file) if settings.state_file else None
        self._places = Places(settings.rows, settings.columns, settings.snake, settings.starts_full, file)
        self._next_part: tuple[int, int] | None = None
        self._next_free: tuple[int, int] | None = None
        self.keep_connection(name)

    # -------------------------------------------------------------------------------- connection
    def open_link(self, timeout: float) -> None:
        """Read the state file, if there is one. Raises NotConnected when it cannot be read or written."""
        try:
            self._places.load()
        except (BadState, OSError) as error:
            raise NotConnected(
                "{name}: the state file cannot be used: {reason}", self._config.state_file, name=self.name, reason=error
            ) from error

    def close_link(self) -> None:
        """Forget which place was returned last."""
        self._next_part = self._next_free = None

    # -------------------------------------------------------------------------------- actions
    @action(quick=True)
    def next_part(self, *, an: str | None = None) -> Pose:
        """Return the pose of the next part; it is the same until part_taken."""
        self.observing.check()
        found = self._places.next(full=True)
        if found is None:
            raise Empty("{name} is empty. Fill it, then call refill.", name=self.name)
        self._next_part = found
        return self._pose_of(*found)

    @action(quick=True)
    def part_taken(self, *, an: str | None = None) -> None:
        """Record that the part at the pose from next_part was taken."""
        self.observing.check()
        if self._next_part is None:
            raise Empty("{name}: part_taken needs a call of next_part first", name=self.name)
        self._set(*self._next_part, False)
        self._next_part = None

    @action(quick=True)
    def next_free(self, *, an: str | None = None) -> Pose:
        """Return the pose of the next free place; it is the same until part_put."""
        self.observing.check()
        found = self._places.next(full=False)
        if found is None:
            raise NoFreePlace("{name} is full. Empty it, then call clear.", name=self.name)
        self._next_free = found
        return self._pose_of(*found)

    @action(quick=True)
    def part_put(self, *, an: str | None = None) -> None:
        """Record that a part was placed at the pose from next_free."""
        self.observing.check()
        if self._next_free is None:
            raise NoFreePlace("{name}: part_put needs a call of next_free first", name=self.name)
        self._set(*self._next_free, True)
        self._next_free = None

    @action(quick=True)
    def grip_pose(self, part: Pose, above: float = 0.0, *, an: str | None = None) -> Pose:
        """Return the pose of the tool for gripping a part or reaching a place: z points down into it.

        :param part: pose from next_part or next_free
        :param above: distance above the grip pose, for approach and departure, m
        """
        assert 0.0 <= above <= 2.0

        return grip_pose(part, self.pose, 0.0, above)

    @action(quick=True)
    def place(self, row: int, column: int, *, an: str | None = None) -> Pose:
        """Return the pose of a place, with or without a part.

        :param row: counted from 0, along y
        :param column: counted from 0, along x
        """
        self._check_place(row, column)
        return self._pose_of(row, column)

    @action(quick=True)
    def set_place(self, row: int, column: int, full: bool, *, an: str | None = None) -> None:
        """Record whether a place has a part.

        :param row: counted from 0, along y
        :param column: counted from 0, along x
        :param full: whether the place has a part
        """
        self.observing.check()
        self._check_place(row, column)
        self._set(row, column, full)

    @action(quick=True)
    def refill(self, *, an: str | None = None) -> None:
        """Record that all places have a part: the blister was replaced by a full one."""
        self.observing.check()
        self._set_all(True)

    @action(quick=True)
    def clear(self, *, an: str | None = None) -> None:
        """Record that all places are free: the blister was replaced by an empty one."""
        self.observing.check()
        self._set_all(False)

    @action(quick=True)
    def parts(self, *, an: str | None = None) -> int:
        """Return the number of parts."""
        self.observing.check()
        return self._places.count

    @action(quick=True)
    def is_empty(self, *, an: str | None = None) -> bool:
        """Return whether no place has a part."""
        return self.parts() == 0

    @action(quick=True)
    def is_full(self, *, an: str | None = None) -> bool:
        """Return whether every place has a part."""
        return self.parts() == self._config.rows * self._config.columns

    # -------------------------------------------------------------------------------- places
    def _check_place(self, row: int, column: int) -> None:
        try:
            self._places.full(row, column)
        except IndexError as error:
            raise OutOfRange("{name}: {reason}", name=self.name, reason=error) from None

    def _set(self, row: int, column: int, full: bool) -> None:
        with self._storing():
            self._places.set(row, column, full)

    def _set_all(self, full: bool) -> None:
        with self._storing():
            self._places.set_all(full)
        self._next_part = self._next_free = None

    @contextlib.contextmanager
    def _storing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise NotConnected(
                "{name}: the state file cannot be written; the state has not changed", str(error), name=self.name
            ) from error

    def _pose_of(self, row: int, column: int) -> Pose:
        given = self._config
        half = math.radians(given.turn) / 2.0
        local = Pose(
            Position(
                given.origin_x + column * given.column_pitch, given.origin_y + row * given.row_pitch, given.origin_z
            ),
            Orientation(0.0, 0.0, math.sin(half), math.cos(half)),
        )
        return self.pose * local

"""A blister, tray or magazine with places in a grid, as an object type: the next part, the next free place."""

import math
from pathlib import Path
from typing import ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import Connection, LossReaction
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import NotConnected, OutOfRange
from arcor2_hw.objects import GenericWithPose
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .errors import Empty, Full
from .places import BadState, Places
from .poses import gripping
from .settings import BlisterSettings


class Blister(GenericWithPose):
    """A grid of places for parts. It counts; it does not look.

    A part that was taken, or put, is told by part_taken, part_put: so a part that was not gripped stays the next one.
    """

    _ABSTRACT = False
    category = "Containers"
    icon = "blister"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()  # there is no device that could lose us

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: BlisterSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._given = settings
        file = Path(settings.state_file) if settings.state_file else None
        self._places = Places(settings.rows, settings.columns, settings.snake, settings.starts_full, file)
        self._connected = Connection.OFFLINE
        self._offered: tuple[int, int] | None = None
        self._free: tuple[int, int] | None = None

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Read the state from its file, if it has one. Raises NotConnected when that cannot be read or written."""
        if self._connected is Connection.ONLINE:
            return
        try:
            self._places.load()
        except (BadState, OSError) as error:
            self._connected = Connection.FAILED
            raise NotConnected(
                "{name}: the state file cannot be used: {reason}", self._given.state_file, name=self.name, reason=error
            ) from error
        self._connected = Connection.ONLINE

    def disconnect(self) -> None:
        """Forget what was offered."""
        self._offered = self._free = None
        self._connected = Connection.OFFLINE

    @property
    def connection(self) -> Connection:
        """Return whether the state is known."""
        return self._connected

    def _check(self) -> None:
        if self._connected is not Connection.ONLINE:
            raise NotConnected("{name} is not connected", name=self.name)

    # -------------------------------------------------------------------------------- actions
    @action(quick=True)
    def next_part(self, *, an: str | None = None) -> Pose:
        """Return the pose of the next part; it stays there until part_taken."""
        self._check()
        found = self._places.next(full=True)
        if found is None:
            raise Empty("{name} is empty: fill it and tell so by refill", name=self.name)
        self._offered = found
        return self._pose_of(*found)

    @action(quick=True)
    def part_taken(self, *, an: str | None = None) -> None:
        """Note that the part that next_part gave is gone."""
        self._check()
        if self._offered is None:
            raise Empty("{name}: no part was given by next_part since the last was taken", name=self.name)
        self._note(*self._offered, False)
        self._offered = None

    @action(quick=True)
    def next_free(self, *, an: str | None = None) -> Pose:
        """Return the pose of the next free place; it stays free until part_put."""
        self._check()
        found = self._places.next(full=False)
        if found is None:
            raise Full("{name} is full: take it away and tell so by clear", name=self.name)
        self._free = found
        return self._pose_of(*found)

    @action(quick=True)
    def part_put(self, *, an: str | None = None) -> None:
        """Note that a part lies at the place that next_free gave."""
        self._check()
        if self._free is None:
            raise Full("{name}: no place was given by next_free since the last part was put", name=self.name)
        self._note(*self._free, True)
        self._free = None

    @action(quick=True)
    def grip_pose(self, part: Pose, above: float = 0.0, *, an: str | None = None) -> Pose:
        """Return the pose for the tool at a part or place: z down into it.

        :param part: what next_part or next_free gave
        :param above: metres by which the tool is higher, for coming near and going away
        """
        assert 0.0 <= above <= 2.0

        return gripping(part, self.pose, 0.0, above)

    @action(quick=True)
    def place(self, row: int, column: int, *, an: str | None = None) -> Pose:
        """Return the pose of a place, whether there is a part or not.

        :param row: counted from 0, along y
        :param column: counted from 0, along x
        """
        self._exists(row, column)
        return self._pose_of(row, column)

    @action(quick=True)
    def set_place(self, row: int, column: int, full: bool, *, an: str | None = None) -> None:
        """Note that a place has a part, or has none.

        :param row: counted from 0, along y
        :param column: counted from 0, along x
        :param full: whether there is a part
        """
        self._check()
        self._exists(row, column)
        self._note(row, column, full)

    @action(quick=True)
    def refill(self, *, an: str | None = None) -> None:
        """Note that all places have a part: a full one was put there."""
        self._check()
        self._all(True)

    @action(quick=True)
    def clear(self, *, an: str | None = None) -> None:
        """Note that all places are free: an empty one was put there."""
        self._check()
        self._all(False)

    @action(quick=True)
    def parts(self, *, an: str | None = None) -> int:
        """Return how many places have a part."""
        self._check()
        return self._places.count

    @action(quick=True)
    def is_empty(self, *, an: str | None = None) -> bool:
        """Return whether no place has a part."""
        return self.parts() == 0

    @action(quick=True)
    def is_full(self, *, an: str | None = None) -> bool:
        """Return whether every place has a part."""
        return self.parts() == self._given.rows * self._given.columns

    # -------------------------------------------------------------------------------- places
    def _exists(self, row: int, column: int) -> None:
        try:
            self._places.full(row, column)
        except IndexError as error:
            raise OutOfRange("{name}: {reason}", name=self.name, reason=error) from None

    def _note(self, row: int, column: int, full: bool) -> None:
        try:
            self._places.set(row, column, full)
        except OSError as error:
            raise self._unkept(error) from error

    def _all(self, full: bool) -> None:
        try:
            self._places.set_all(full)
        except OSError as error:
            raise self._unkept(error) from error
        self._offered = self._free = None

    def _unkept(self, error: OSError) -> NotConnected:
        return NotConnected("{name}: the state cannot be kept, and is as before", str(error), name=self.name)

    def _pose_of(self, row: int, column: int) -> Pose:
        given = self._given
        half = math.radians(given.turn) / 2.0
        local = Pose(
            Position(
                given.origin_x + column * given.column_pitch,
                given.origin_y + row * given.row_pitch,
                given.origin_z,
            ),
            Orientation(0.0, 0.0, math.sin(half), math.cos(half)),
        )
        return self.pose * local

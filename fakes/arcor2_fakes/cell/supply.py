"""The supply of boards: a magazine or a belt."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from arcor2_fakes.cell.layout import Belt, Feeder, Matrix, Place
from arcor2_fakes.cell.world_data import Thing

_TOUCHING = 1e-6


class Supply(Protocol):
    """A supply of boards; times are in s since the start of the world, poses in the world."""

    place: str
    """Name of the place of its boards."""

    def advance(self, now: float, counts: float | None) -> list[tuple[Thing, str, str]]:
        """Advance to the time `now` and the belt position `counts`; return events: board, place, reason."""
        ...

    def top(self) -> Thing | None:
        """Return the board at the pick place."""
        ...

    def under(self, world_from_gripped: Matrix) -> tuple[Thing, Matrix] | None:
        """Return the board between jaws at a pose, and its pose."""
        ...

    def seen_by(self, window: Place) -> Thing | None:
        """Return the board in the view of a reader."""
        ...

    def take(self, board: Thing) -> None:
        """Remove a board."""
        ...

    def accepts(self, world_from_board: Matrix) -> bool:
        """Return whether a board released at a pose lands on the supply."""
        ...

    def put(self, board: Thing, world_from_board: Matrix) -> str | None:
        """Put a board down; return the reason if there is no space."""
        ...

    def pose(self, board: Thing) -> Matrix | None:
        """Return the pose of a board; None if it has not arrived yet."""
        ...


class Magazine:
    """A stack; the next board arrives at the pick place some time after the last one was taken."""

    place = "feeder"

    def __init__(self, feeder: Feeder, things: list[Thing]) -> None:
        self._feeder = feeder
        self._things = list(things)  # the first board is on top
        self._now = self._refilled_at = 0.0

    def advance(self, now: float, counts: float | None) -> list[tuple[Thing, str, str]]:  # noqa: ARG002 - no belt
        """Advance to the time `now`."""
        self._now = now
        return []

    def top(self) -> Thing | None:
        """Return the board at the pick place."""
        return self._things[0] if self._things and self._now >= self._refilled_at else None

    def under(self, world_from_gripped: Matrix) -> tuple[Thing, Matrix] | None:
        """Return the top board if the jaws are at it."""
        top = self.top()
        return (top, self._feeder.pose.matrix()) if top is not None and self.accepts(world_from_gripped) else None

    def seen_by(self, window: Place) -> Thing | None:
        """Return the top board if the pick place is in view."""
        return self.top() if window.holds(self._feeder.pose.matrix()) else None

    def take(self, board: Thing) -> None:
        """Remove a board; if it was the top one, the next one arrives after a while."""
        if board is self.top():
            self._refilled_at = self._now + self._feeder.refill_time
        self._things.remove(board)

    def accepts(self, world_from_board: Matrix) -> bool:
        """Return whether a board released at a pose lands at the pick place."""
        return self._feeder.holds(world_from_board)

    def put(self, board: Thing, world_from_board: Matrix) -> str | None:  # noqa: ARG002 - it slides to the pick place
        """Put a board back."""
        if self.top() is not None:
            return "over the feeder, where there is already a board"
        self._things.insert(0, board)
        self._refilled_at = self._now
        return None

    def pose(self, board: Thing) -> Matrix | None:  # noqa: ARG002 - all boards are at one place
        """Return the pick place."""
        return self._feeder.pose.matrix()


class BoardBelt:
    """Boards on a belt that ends at a stop. A loader adds the next one at the start as soon as there is space.

    The position of a board is `s`, m from the stop, negative. Boards at the stop wait while the belt slips below them.
    """

    place = "belt"

    def __init__(self, belt: Belt, things: list[Thing]) -> None:
        self._belt = belt
        self._loader = list(things)
        self._on: list[tuple[Thing, float]] = []  # nearest to the stop first
        self._counts: float | None = None

    def advance(self, now: float, counts: float | None) -> list[tuple[Thing, str, str]]:  # noqa: ARG002 - moved by counts
        """Move the boards with the belt."""
        belt, happened = self._belt, []
        if counts is not None:
            moved = 0.0 if self._counts is None else (counts - self._counts) / belt.counts_per_metre
            self._counts = counts
            free, on = 0.0, []
            for thing, s in self._on:
                s = min(s + moved, free)
                if s < -belt.length - _TOUCHING:
                    happened.append((thing, "lost", "ran off the belt backwards"))
                    continue
                on.append((thing, s))
                free = s - belt.board_length
            self._on = on
            if self._loader and (not on or on[-1][1] >= belt.pitch - belt.length):
                thing = self._loader.pop(0)
                self._on.append((thing, -belt.length))
                happened.append((thing, "belt", "laid on the belt"))
        return happened

    def places(self) -> list[tuple[Thing, float]]:
        """Return the boards on the belt and their positions, m from the stop, negative."""
        return list(self._on)

    def interrupts(self, at: float) -> bool:
        """Return whether a board interrupts the beam at `at`, m from the stop, negative."""
        return any(abs(s - at) <= self._belt.board_length / 2.0 for _, s in self._on)

    def _pose(self, s: float) -> Matrix:
        shifted = np.eye(4)
        shifted[0, 3] = s
        pose: Matrix = self._belt.pose.matrix() @ shifted
        return pose

    def top(self) -> Thing | None:
        """Return the board at the stop."""
        return self._on[0][0] if self._on and self._on[0][1] >= -_TOUCHING else None

    def under(self, world_from_gripped: Matrix) -> tuple[Thing, Matrix] | None:
        """Return the board at the jaws, anywhere on the belt."""
        local = self._belt.pose.inverse() @ world_from_gripped
        for thing, s in self._on:
            if self._belt.tolerance.allows(local, s):
                return thing, self._pose(s)
        return None

    def seen_by(self, window: Place) -> Thing | None:
        """Return the board in view."""
        return next((thing for thing, s in self._on if window.holds(self._pose(s))), None)

    def take(self, board: Thing) -> None:
        """Remove a board from the belt or the loader."""
        self._on = [(other, s) for other, s in self._on if other is not board]
        self._loader = [other for other in self._loader if other is not board]

    def accepts(self, world_from_board: Matrix) -> bool:
        """Return whether a board released at a pose lands on the belt."""
        local = self._belt.pose.inverse() @ world_from_board
        s = float(local[0, 3])
        return -self._belt.length <= s <= self._belt.tolerance.position and self._belt.tolerance.allows(local, s)

    def put(self, board: Thing, world_from_board: Matrix) -> str | None:
        """Put a board on the belt."""
        s = min(float((self._belt.pose.inverse() @ world_from_board)[0, 3]), 0.0)
        if any(abs(s - other) < self._belt.board_length - _TOUCHING for _, other in self._on):
            return "onto a board that lies on the belt"
        self._on = sorted([*self._on, (board, s)], key=lambda placed: -placed[1])
        return None

    def pose(self, board: Thing) -> Matrix | None:
        """Return the pose of a board on the belt."""
        return next((self._pose(s) for other, s in self._on if other is board), None)

"""The cells that the server of the fleet knows, from what they publish. It does no input or output."""

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Final

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Data, Timestamp, Unset
from arcor2_hw.exceptions import Conflict, NotFound
from arcor2_server.fleet.records import FleetState

SILENT_AFTER: Final = 1.5
"""Time without a state after which a cell has no signal, s: three beats. The page shows it within 2 s."""
DUPLICATE_TIMEOUT: Final = 10.0
"""Time for which two processes with the same data are shown as a conflict after the last change between them, s."""
MAX_CELLS: Final = 1000
"""Maximum number of cells."""
MAX_PER_NAME: Final = 4
"""Maximum number of servers that are shown with one name."""
_BOOTS: Final = 8
"""Number of remembered earlier processes of a cell."""


class FleetCard(Data, frozen=True):
    """A cell on the page.

    id: of the card. alive: whether the cell has a signal. conflict: whether another server uses the same name or the
    same data. seen: when the last state was received. state: the last state; its `number` and `boot` have no meaning.
    """

    id: str
    name: str
    alive: bool
    conflict: bool
    seen: Timestamp
    state: FleetState


class FleetUpdate(Data, frozen=True):
    """An update of the page. cells: changed cards. removed: ids of cards. broker: whether the broker is connected."""

    cells: list[FleetCard]
    removed: list[str]
    broker: bool


class StoredCell(Data, frozen=True):
    """A cell as it is stored."""

    name: str
    seen: Timestamp
    state: FleetState


class _Cell:
    def __init__(self, name: str, state: FleetState, seen: Timestamp, at: float | None) -> None:
        self.name, self.identity = name, state.identity
        self.boot, self.number = state.boot, state.number
        self.boots: deque[str] = deque(maxlen=_BOOTS)
        self.at = at
        """Monotonic time of the last state, s; None if none was received since the start."""
        self.alive = at is not None
        self.duplicate_at: float | None = None
        """Time of the last state of a process that another one had replaced, s."""
        self.revision = 0
        self.card = FleetCard(
            f"{name}:{state.identity}", name, self.alive, False, seen, replace(state, number=0, boot="-")
        )


class Registry:
    """The cells. `revision` grows with every change that the page shows.

    Args:
        stored: the cells that were known before; they have no signal until they publish a state.
    """

    def __init__(self, stored: Iterable[StoredCell] = ()) -> None:
        self.revision = 0
        self._cells: dict[str, _Cell] = {}
        self._removed: deque[tuple[int, str]] = deque(maxlen=MAX_CELLS)
        for each in stored:
            self._add(_Cell(each.name, each.state, each.seen, None))

    def accept(self, name: str, state: FleetState, seen: Timestamp, at: float) -> None:
        """Handle a received state.

        Args:
            name: of the cell, from the subject.
            state: what was received.
            seen: the present time.
            at: the present monotonic time, s.

        Raises:
            Conflict: too many cells, or too many servers with this name, are known.
        """
        cell = self._cells.get(f"{name}:{state.identity}")
        if cell is None:
            same = sum(each.name == name for each in self._cells.values())
            if same >= MAX_PER_NAME:
                raise Conflict("{count} servers use the name already. Remove those that do not exist.", count=same)
            if len(self._cells) >= MAX_CELLS:
                raise Conflict("{count} cells are known already. Remove those that do not exist.", count=MAX_CELLS)
            self._add(_Cell(name, state, seen, at))
            return
        if state.boot != cell.boot:
            if state.boot in cell.boots:  # a process that was replaced is still running
                cell.duplicate_at = at
            else:
                cell.boots.append(cell.boot)
            cell.boot = state.boot
        elif state.number <= cell.number and cell.at is not None:
            return  # delivered late, or twice
        cell.number, cell.at = state.number, at
        self._update_card(cell, state=replace(state, number=0, boot="-"), alive=True, seen=seen)

    def check(self, at: float) -> None:
        """Mark the cells whose last state is too old."""
        for cell in self._cells.values():
            if cell.alive and (cell.at is None or at - cell.at > SILENT_AFTER):
                self._update_card(cell, alive=False)
            if cell.duplicate_at is not None and at - cell.duplicate_at > DUPLICATE_TIMEOUT:
                cell.duplicate_at = None
        self._find_conflicts()

    def lose_all(self) -> None:
        """Mark all cells as without a signal, because the broker is not connected."""
        for cell in self._cells.values():
            self._update_card(cell, alive=False)

    def remove(self, card_id: str) -> tuple[str, str]:
        """Forget a cell without a signal; return its name and identity.

        Raises:
            NotFound: it is not known.
            Conflict: it has a signal.
        """
        cell = self._cells.get(card_id)
        if cell is None:
            raise NotFound("The cell {id!r} is not known.", id=card_id[:80])
        if cell.alive:
            raise Conflict("The cell {name} has a signal. Switch it off, or rename it.", name=cell.name)
        del self._cells[card_id]
        self.revision += 1
        self._removed.append((self.revision, card_id))
        self._find_conflicts()
        return cell.name, cell.identity

    # -------------------------------------------------------------------------------- cards
    def cards(self, since: int = -1) -> list[FleetCard]:
        """Return the cards that have changed after a revision."""
        return [cell.card for cell in self._cells.values() if cell.revision > since]

    def removed(self, since: int) -> list[str]:
        """Return the ids of the cards that were removed after a revision and are not known again."""
        return [card_id for revision, card_id in self._removed if revision > since and card_id not in self._cells]

    def stored(self) -> Iterator[StoredCell]:
        """Return the cells for the file."""
        for cell in self._cells.values():
            yield StoredCell(cell.name, cell.card.seen, cell.card.state)

    def _add(self, cell: _Cell) -> None:
        self._cells[cell.card.id] = cell
        self.revision += 1
        cell.revision = self.revision
        self._find_conflicts()

    def _find_conflicts(self) -> None:
        names: dict[str, int] = {}
        for cell in self._cells.values():
            names[cell.name] = names.get(cell.name, 0) + 1
        for cell in self._cells.values():
            self._update_card(cell, conflict=names[cell.name] > 1 or cell.duplicate_at is not None)

    def _update_card(
        self,
        cell: _Cell,
        *,
        state: FleetState | Unset = UNSET,
        alive: bool | Unset = UNSET,
        conflict: bool | Unset = UNSET,
        seen: Timestamp | Unset = UNSET,
    ) -> None:
        given: dict[str, FleetState | bool | Unset] = {"state": state, "alive": alive, "conflict": conflict}
        changed: dict[str, FleetState | bool | str | Unset] = {
            key: value for key, value in given.items() if value not in (UNSET, getattr(cell.card, key))
        }
        if not isinstance(alive, Unset):
            cell.alive = alive
        if not isinstance(seen, Unset):
            changed["seen"] = seen
        if changed:
            cell.card = replace(cell.card, **changed)
        if changed.keys() - {"seen"}:
            self.revision += 1
            cell.revision = self.revision

"""Records of units: the steps of each part with their results, and the place where the part left the cell."""

import asyncio
from collections import Counter, OrderedDict
from collections.abc import Awaitable, Callable
from typing import Any, Final

import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Timestamp, Unset, now
from arcor2_hw.data.editor import TraceEntry
from arcor2_hw.data.parts import Part, PartInventory, PlaceKind
from arcor2_hw.data.rpc import ListUnitsArgs
from arcor2_hw.data.units import Unit, UnitRecord, UnitState, UnitStep, UsedCalibration
from arcor2_hw.exceptions import Arcor2Error, InvalidData, StorageError
from arcor2_hw.runtime.messages import PartStep
from arcor2_server.background import BackgroundTasks
from arcor2_server.events import EventHub, make_event
from arcor2_server.execution.runs import Runs, RunStart
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.storage.packages import Packages
from arcor2_server.storage.units import UnitStore

log = structlog.get_logger(__name__)

MAX_STEPS: Final = 500
"""Maximum number of stored steps of a unit."""
RECENT: Final = 200
"""Number of units that have left the cell and can still receive steps, such as a report to the planning service."""
_BOXES: Final = {
    PlaceKind.GOOD: UnitState.GOOD,
    PlaceKind.BAD: UnitState.BAD,
    PlaceKind.REJECTED: UnitState.REJECTED,
}


class Units:
    """The records of units. They follow the part inventory. Queries may raise StorageError.

    Args:
        hub: publishes UnitChanged.
        store: stores the records.
        runs: the actions of the present run.
        packages: names and digests of packages.
        calibrations: the calibrations in force.
    """

    def __init__(
        self, hub: EventHub, store: UnitStore, runs: Runs, packages: Packages, calibrations: Calibrations
    ) -> None:
        self._hub, self._store, self._runs = hub, store, runs
        self._packages, self._calibrations = packages, calibrations
        self._in_cell: dict[tuple[str, int], UnitRecord] = {}
        """Records by scene and number of the part."""
        self._recent: OrderedDict[int, UnitRecord] = OrderedDict()
        """The last units that have left the cell, by number."""
        self.left: Counter[UnitState] = Counter()
        """Number of units that have left the cell since the start of the server, by state."""
        self.on_left: list[Callable[[Unit], None]] = []
        """Called with each unit that has left the cell, without its steps."""
        self._next = 1
        self._inventories: dict[str, PartInventory] = {}
        """The last known inventory of each scene."""
        self._run: dict[str, Any] = {}
        """Data of the present run for new units."""
        self._run_number = 0
        self._scene_id = ""
        self._concerned: dict[int, PartStep] = {}
        """Reports about actions whose end is not known yet, by the number of the action."""
        self._unwritten: dict[int, UnitRecord] = {}
        self._deleted: set[int] = set()
        self._writing: asyncio.Task[None] | None = None
        self._background = BackgroundTasks()
        self._describing = asyncio.Lock()

    async def open(self, inventories: Callable[[], Awaitable[list[PartInventory]]]) -> None:
        """Read the records of units in the cell, and compare them with the part inventory.

        Raises:
            StorageError: the records cannot be read.
        """
        self._in_cell = {(record.scene_id, record.part): record for record in await self._store.in_cell()}
        self._next = await self._store.newest_number() + 1
        for inventory in await inventories():
            self.follow(inventory)

    async def close(self) -> None:
        """Store the remaining changes."""
        async with self._describing:  # a query is not interrupted
            await self._background.cancel()
        if self._unwritten or self._deleted:
            self._write_later()
        await self.flush()

    async def flush(self) -> None:
        """Wait until all records are stored."""
        while self._writing is not None:
            await asyncio.gather(self._writing, return_exceptions=True)

    @property
    def in_cell(self) -> int:
        """Number of units in the cell."""
        return len(self._in_cell)

    # -------------------------------------------------------------------------------- a run
    def begin_run(self, number: int, package_id: str, scene_id: str, how: RunStart) -> None:
        """Handle the start of a run."""
        self._run_number, self._scene_id = number, scene_id
        self._concerned.clear()
        self._run = {
            "package_id": package_id,
            "order": how.order,
            "recipe": how.used or UNSET,
            "started_by": how.by,
            "package_hash": "" if how.used is None else how.used.package_hash,
            "calibrations": [],
        }
        self._background.spawn(self._describe(number, package_id, self._run), "description of the units of a run")

    async def _describe(self, number: int, package_id: str, run: dict[str, Any]) -> None:
        try:
            summary = await asyncio.to_thread(self._packages.summary, package_id)
            digest = await asyncio.to_thread(self._packages.digest, package_id)
            async with self._describing:
                latest = await self._calibrations.latest()
        except Arcor2Error as error:
            log.warning("package of the units cannot be read", run=number, reason=str(error))
            return
        run["package_name"] = summary.package_meta.name
        run["package_hash"] = run["package_hash"] or digest
        run["calibrations"] = [
            UsedCalibration(each.id, each.object_id, each.object_name, each.kind.value, each.date) for each in latest
        ]
        for record in (*self._in_cell.values(), *self._recent.values()):  # units that entered, or also left, before
            if record.runs == [number] and not record.package_name:
                self._put(replace(record, **run | {"order": record.order or run["order"]}))

    def concern(self, step: PartStep) -> None:
        """Record that the action that is ending concerns a part."""
        self._concerned[step.action] = step

    def action_ended(self, number: int) -> None:
        """Add an action of the present run that has ended or failed to the record of its part."""
        step = self._concerned.pop(number, None)
        entry = None if step is None else self._runs.entry(number)
        if step is None or entry is None or (record := self._find(step)) is None:
            return
        changes: dict[str, Any] = {}
        if len(record.steps) < MAX_STEPS:
            changes["steps"] = [*record.steps, _step(entry)]
        else:
            changes["dropped"] = record.dropped + 1
        if step.order:
            changes["order"] = step.order
        if step.verdict is not None:
            changes["verdict"] = step.verdict
        if self._run_number not in record.runs:
            changes["runs"] = [*record.runs, self._run_number]
        self._put(replace(record, **changes))

    def _find(self, step: PartStep) -> UnitRecord | None:
        """Return the unit that an action has concerned: in the cell, or one of the last that have left it."""
        scene = self._scene_id
        if not step.serial and (record := self._in_cell.get((scene, step.part))) is not None:
            return record
        for each in (*self._in_cell.values(), *reversed(self._recent.values())):
            if each.scene_id == scene and (each.serial == step.serial if step.serial else each.part == step.part):
                return each
        return None

    # -------------------------------------------------------------------------------- part inventory
    def follow(self, inventory: PartInventory) -> None:
        """Handle the present inventory of a scene."""
        scene = inventory.scene_id
        present = {part.number: part for part in inventory.parts}
        for (of, number), record in list(self._in_cell.items()):
            if of == scene and number not in present:
                self._leave(record, inventory)
        for part in inventory.parts:
            self._update(scene, part)
        self._inventories[scene] = inventory

    def _update(self, scene: str, part: Part) -> None:
        record = self._in_cell.get((scene, part.number))
        if record is None:
            running = scene == self._scene_id and self._run_number
            record = UnitRecord(
                number=self._next,
                serial=part.serial,
                scene_id=scene,
                part=part.number,
                state=UnitState.IN_CELL,
                entered=now(),
                verdict=part.good,
                **(self._run | {"runs": [self._run_number]} if running else {}),
            )
            self._next += 1
            self._put(record, publish=True)
        elif (part.serial, part.good) != (record.serial, record.verdict):
            self._put(replace(record, serial=part.serial, verdict=part.good), publish=True)

    def _leave(self, record: UnitRecord, inventory: PartInventory) -> None:
        """Handle the departure of a part from the cell."""
        before = self._inventories.get(record.scene_id)
        shown = record.serial or f"#{record.part}"
        state = UnitState.UNKNOWN
        for place in inventory.places:
            if place.kind.is_box and shown in Counter(place.parts) - Counter(_parts_in(before, place.id)):
                state = _BOXES[place.kind]
        if state is UnitState.UNKNOWN and before is not None:
            # A person has taken it out; a part without a serial number may also never have existed.
            if inventory.counts.rejected > before.counts.rejected or record.serial:
                state = UnitState.REJECTED
            elif inventory.counts.fed < before.counts.fed:
                self._delete(record)
                return
        del self._in_cell[record.scene_id, record.part]
        self.left[state] += 1
        self._recent[record.number] = record
        if len(self._recent) > RECENT:
            self._recent.popitem(last=False)
        record = replace(record, state=state, left=now())
        self._put(record, publish=True)
        for notify in self.on_left:
            notify(_without_steps(record))

    def _delete(self, record: UnitRecord) -> None:
        del self._in_cell[record.scene_id, record.part]
        self._unwritten.pop(record.number, None)
        self._deleted.add(record.number)
        self._write_later()

    # -------------------------------------------------------------------------------- queries
    async def find(self, args: ListUnitsArgs) -> list[Unit]:
        """Return units without their steps, newest first."""
        await self.flush()
        return await self._store.find(args)

    async def get(self, number: int) -> UnitRecord:
        """Return the record of a unit. Raise NotFound if there is none."""
        await self.flush()
        return await self._store.get(number)

    async def left_between(self, since: Timestamp, until: Timestamp) -> dict[UnitState, int]:
        """Return the number of units that left the cell in a period, by state."""
        await self.flush()
        counts = dict.fromkeys(UnitState, 0)
        for state, _, count in await self._store.left_between(since, until):
            counts[state] += count
        return counts

    # -------------------------------------------------------------------------------- storage
    def _put(self, record: UnitRecord, *, publish: bool = False) -> None:
        if record.state is UnitState.IN_CELL:
            self._in_cell[record.scene_id, record.part] = record
        else:
            self._recent[record.number] = record
        self._unwritten[record.number] = record
        self._write_later()
        if publish and self._hub.subscribers("UnitChanged"):
            self._hub.broadcast(make_event("UnitChanged", _without_steps(record)))

    def _write_later(self) -> None:
        if self._writing is None:
            self._writing = asyncio.create_task(self._write(), name="units")

    async def _write(self) -> None:
        """Store changed records until none is left. Only the newest state of a record is stored."""
        try:
            while self._unwritten or self._deleted:
                records, self._unwritten = list(self._unwritten.values()), {}
                deleted, self._deleted = self._deleted, set()
                try:
                    await self._store.put(records, deleted)
                except StorageError:  # try again with the next change
                    self._unwritten = {record.number: record for record in records} | self._unwritten
                    self._deleted |= deleted
                    raise
        except (StorageError, InvalidData) as error:
            log.warning("records of units not stored", reason=str(error))
        finally:
            self._writing = None


def _without_steps(record: UnitRecord) -> Unit:
    return Unit(**{name: getattr(record, name) for name in Unit.__struct_fields__})


def _parts_in(inventory: PartInventory | None, place_id: str) -> list[str]:
    return [] if inventory is None else next((place.parts for place in inventory.places if place.id == place_id), [])


def _step(entry: TraceEntry) -> UnitStep:
    attempt: int | Unset = entry.attempt
    return UnitStep(
        entry.run,
        entry.number,
        entry.action_id,
        entry.name,
        entry.started,
        entry.duration,
        entry.parameters,
        entry.results,
        entry.error,
        attempt,
        key=entry.key,
        values=entry.values,
    )

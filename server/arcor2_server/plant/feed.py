"""Collects the data for plant systems: only changes, and of each stream only the newest event."""

from collections import deque
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Final

import structlog
from msgspec.structs import replace

from arcor2_hw.data.alarms import AlarmFilter, AlarmRecord
from arcor2_hw.data.base import Unset, now
from arcor2_hw.data.device import Connection, Identity
from arcor2_hw.data.rpc import ListAlarmsArgs, RobotEventKind
from arcor2_hw.data.units import Unit, UnitState
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_hw.plant.messages import DeviceInfo, DeviceState, UnitData, Update
from arcor2_hw.runtime.messages import DeviceChanged
from arcor2_server.alarms.service import Alarms
from arcor2_server.execution.runs import Runs
from arcor2_server.execution.service import Execution
from arcor2_server.hosts.session import HostSession
from arcor2_server.hosts.streams import POINTS
from arcor2_server.maintenance.devices import Devices
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.production.units import Units

log = structlog.get_logger(__name__)

JOINTS_RATE: Final = 10.0
"""Rate at which joints are read, Hz."""
POINTS_RATE: Final = 5.0
"""Rate at which points are read, Hz: as fast as the editor may read them."""
MAX_WAITING_UNITS: Final = 1000
"""Maximum number of units that wait for a process, such as while it restarts. The oldest are dropped."""
OWNER: Final = "plant"
"""Name of this part as an observer of streams."""
_CONNECTED: Final = (Connection.ONLINE, Connection.BACK)
_START: Final = "1970-01-01T00:00:00+00:00"


class FeedReader:
    """The changes that one process for plant systems has not received yet. Created by `CellFeed.reader`."""

    def __init__(self, feed: "CellFeed", *, with_streams: bool) -> None:
        self._feed = feed
        self._watched: frozenset[str] | None = None if with_streams else frozenset()
        """The devices whose points and joints the reader receives; None: all."""
        self._devices: list[DeviceInfo] = []
        self._states: dict[str, DeviceState] = {}
        self._unit: UnitData | None = None
        self.streams: dict[tuple[str, str], bytes] = {}
        self.alarms: dict[int, AlarmRecord] = {}
        self.left: deque[Unit] = deque(maxlen=MAX_WAITING_UNITS)

    def wants(self, object_id: str) -> bool:
        """Return whether the reader receives the points and joints of a device."""
        return self._watched is None or object_id in self._watched

    def watch(self, devices: Iterable[str]) -> None:
        """Receive only the points and joints of these devices."""
        self._watched = frozenset(devices)
        self._feed.observe_wanted()

    async def everything(self) -> Update:
        """Return the present state for a started process, and the units that left while no process was running."""
        self.streams, self.alarms = {}, {}
        update = await self.changes()
        # Records that were not stored yet are reported once more when they are.
        alarms = await self._feed.retained_alarms()
        return replace(update, devices=self._devices, states=dict(self._states), unit=self._unit, alarms=alarms)

    async def changes(self) -> Update:
        """Return the changes since the last call."""
        feed = self._feed
        await feed.refresh()
        unit = feed.unit()
        streams, self.streams = list(self.streams.values()), {}
        alarms, self.alarms = list(self.alarms.values()), {}
        left = list(self.left)
        self.left.clear()
        update = Update(
            feed.devices if feed.devices != self._devices else None,
            {key: state for key, state in feed.states.items() if self._states.get(key) != state},
            streams,
            unit if unit != self._unit else None,
            alarms,
            left,
        )
        self._devices, self._states, self._unit = feed.devices, feed.states, unit
        return update


class CellFeed:
    """Follows the cell from the first reader on.

    Args:
        hosts: the hosts of the scene and of the program. The devices of the last one that has any are shown.
        cell: the cell as a unit of PackML.
        execution: the program.
        runs: names of programs and recipes.
        units: counts of units.
        types: finds the robots.
        cards: identities of devices.
        alarms: the alarms.
    """

    def __init__(
        self,
        hosts: Sequence[HostSession],
        cell: PackmlCell,
        execution: Execution,
        runs: Runs,
        units: Units,
        types: ObjectTypes,
        cards: Devices,
        alarms: Alarms,
    ) -> None:
        self._hosts, self._cell, self._execution, self._runs = hosts, cell, execution, runs
        self._units, self._types, self._cards, self._alarms = units, types, cards, alarms
        self.devices: list[DeviceInfo] = []
        """The devices. A change replaces the list."""
        self.states: dict[str, DeviceState] = {}
        """Their states by id. A change replaces the dictionary."""
        self._counts = dict.fromkeys(UnitState, 0)
        self._devices_changed = self._counts_changed = True
        self._readers: list[FeedReader] = []

    def reader(self, *, with_streams: bool = True) -> FeedReader:
        """Return a new reader.

        It receives all changes from now on; points and joints with `with_streams` or after `watch`.
        """
        if not self._readers:
            self._start()
        reader = FeedReader(self, with_streams=with_streams)
        self._readers.append(reader)
        self.observe_wanted()
        return reader

    def _start(self) -> None:
        for host in self._hosts:
            host.board.on_report.append(lambda report, host=host: self._reported(host, report))  # type: ignore[misc]
            host.board.on_clear.append(lambda _: self._mark_devices())
            host.board.on_connection.append(self._mark_devices)
            host.board.on_identified.append(lambda _: self._mark_devices())
        self._alarms.on_changed.append(self._alarm_changed)
        self._units.on_left.append(self._left)
        self._execution.parts.on_change.append(lambda _: self._mark_counts())
        self._execution.on_state.append(self._mark_devices)
        self._mark_devices()

    def _mark_devices(self) -> None:
        self._devices_changed = True

    def _mark_counts(self) -> None:
        self._counts_changed = True

    def _alarm_changed(self, record: AlarmRecord) -> None:
        for reader in self._readers:
            reader.alarms[record.number] = record

    def _left(self, unit: Unit) -> None:
        for reader in self._readers:
            reader.left.append(unit)

    def _reported(self, host: HostSession, report: DeviceChanged) -> None:
        self._devices_changed = True
        self._observe(host, report)

    def _observe(self, host: HostSession, report: DeviceChanged) -> None:
        """Read the points and joints of a connected device while a reader wants them."""
        if report.connection not in _CONNECTED:
            return
        key = report.object_id
        streams = {POINTS: POINTS_RATE}
        if self._robot_type(host, key):
            streams[RobotEventKind.JOINTS.value] = JOINTS_RATE
        wanted = any(reader.wants(key) for reader in self._readers)
        for kind, rate in streams.items():
            if wanted:
                host.streams.observe(key, kind, rate, partial(self._put, key, kind), owner=OWNER)
            else:
                host.streams.end_observing(key, kind, owner=OWNER)

    def observe_wanted(self) -> None:
        """Read what readers want, and nothing else."""
        for host in self._hosts:
            for report in host.board.reports.values():
                self._observe(host, report)

    def _put(self, object_id: str, kind: str, encoded: bytes) -> None:
        for reader in self._readers:
            if reader.wants(object_id):
                reader.streams[object_id, kind] = encoded

    # -------------------------------------------------------------------------------- data for readers
    async def retained_alarms(self) -> list[AlarmRecord]:
        """Return the alarms that need attention, oldest first."""
        alarms = await self._alarms.find(ListAlarmsArgs(show=AlarmFilter.RETAINED, limit=1000))
        return list(reversed(alarms))

    async def refresh(self) -> None:
        """Collect the changes."""
        if self._devices_changed:
            self._devices_changed = False
            self._collect_devices()
        if self._counts_changed:
            self._counts_changed = False
            try:
                self._counts = await self._units.left_between(_START, now())
            except Arcor2Error as error:
                log.warning("counts of units not read", reason=str(error))

    def _collect_devices(self) -> None:
        """Collect devices and states. Without an open scene, the devices that were known last are offline."""
        identities = self._cards.identities()
        host = next((host for host in reversed(self._hosts) if host.board.reports), None)
        if host is None:
            if not self.devices:
                self.devices = [
                    DeviceInfo(card.object_id, card.name, card.object_type, self._type_of(card.object_type),
                               card.identity)
                    for card in self._cards.all()
                ]  # fmt: skip
            self.states = {info.id: DeviceState() for info in self.devices}
            return
        executing = self._execution.running
        devices, states = [], {}
        for key, report in host.board.reports.items():
            try:
                found = host.board.object(key)
            except NotFound:
                continue  # the names are not known yet; the board repeats its reports when they are
            robot = self._robot_type(host, key)
            if key not in identities and not robot and not self._is_device(found.type):
                continue
            devices.append(DeviceInfo(key, found.name, found.type, robot, identities.get(key, Identity())))
            codes = tuple(alarm.code for alarm in report.alarms)
            states[key] = DeviceState(report.connection, report.health, codes, host.board.answering, executing)
        self.devices, self.states = devices, states

    def _is_device(self, object_type: str) -> bool:
        try:
            return not self._types.derives_from(object_type, "VirtualCollisionObject")
        except Arcor2Error:
            return True

    def _robot_type(self, host: HostSession, object_id: str) -> str:
        try:
            return self._type_of(host.board.object(object_id).type)
        except NotFound:
            return ""

    def _type_of(self, object_type: str) -> str:
        try:
            robot = self._types.derives_from(object_type, "Robot")
            return self._types.robot_meta(object_type).robot_type.value if robot else ""
        except Arcor2Error:  # the type exists only in the package
            return ""

    def unit(self) -> UnitData:
        """Return the cell as a unit."""
        cell, counts = self._cell, self._counts
        run = self._runs.get(self._execution.program.number)
        program = recipe = ""
        if run is not None:
            program = run.package_name
            if not isinstance(run.recipe, Unset):
                recipe = f"{run.recipe.product} {run.recipe.revision}"
        last_job, end = cell.last_job
        return UnitData(
            cell.state, cell.mode, cell.authority.value, cell.job, last_job, end.name.lower(), program,
            self._execution.active, recipe,
            counts[UnitState.GOOD], counts[UnitState.BAD], counts[UnitState.REJECTED],
        )  # fmt: skip

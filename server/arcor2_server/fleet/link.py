"""The connection of a cell to the fleet: it publishes the state of the cell, and delivers its results."""

import asyncio
import importlib.util
import uuid
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from typing import TYPE_CHECKING, Final

import structlog
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.alarms import PRIORITIES, AlarmFilter, AlarmRecord, Priority
from arcor2_hw.data.base import Unset, now
from arcor2_hw.data.cell_state import CellStateName
from arcor2_hw.data.device import Connection
from arcor2_hw.data.rpc import ListAlarmsArgs
from arcor2_hw.data.units import UnitState
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.plant.messages import UnitData
from arcor2_server.alarms.service import Alarms
from arcor2_server.background import BackgroundTasks
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.users import Users
from arcor2_server.execution.runs import Runs
from arcor2_server.execution.service import Execution
from arcor2_server.fleet import records as r
from arcor2_server.fleet.identity import identity_of
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.plant.feed import CellFeed, FeedReader
from arcor2_server.production.units import Units
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.outbox import Outbox

if TYPE_CHECKING:
    from nats.aio.client import Client

    from arcor2_server.fleet.delivery import Delivery
    from arcor2_server.fleet.driver_texts import DriverTexts

log = structlog.get_logger(__name__)

PERIOD: Final = 0.1
"""Shortest time between two states, s."""
STALE_AFTER: Final = 5.0
"""Age of a state after which it is not published any more, s. The fleet then shows the cell without a signal."""
FLUSH_TIMEOUT: Final = 2
"""Time limit for the broker to receive a state, s."""
COUNT_WINDOW: Final = timedelta(hours=8)
"""Period in which units are counted."""
COUNT_PERIOD: Final = 30.0
"""Longest time between two counts of units, s: units leave the period without an event."""
_NOT_CONNECTED: Final = (Connection.LOST, Connection.FAILED)


class FleetLink:
    """The connection to the fleet, if the settings name the cell and the broker.

    Args:
        settings: settings of the server.
        outboxes: the results to send; empty without a fleet.
        feed: follows the state of the cell.
        cell: mode and authority.
        execution: state of the program.
        runs: the users who started programs.
        units: the produced units.
        alarms: the alarms.
        users: the connected users.
        locks: the locks of users.
        types: the object types; they name the folders of drivers.
    """

    def __init__(
        self,
        settings: ServerSettings,
        outboxes: Sequence[Outbox],
        feed: CellFeed,
        cell: PackmlCell,
        execution: Execution,
        runs: Runs,
        units: Units,
        alarms: Alarms,
        users: Users,
        locks: Locks,
        types: ObjectTypes,
    ) -> None:
        self._settings, self._outboxes, self._feed, self._cell = settings, outboxes, feed, cell
        self._execution, self._runs, self._units, self._alarms = execution, runs, units, alarms
        self._users, self._locks = users, locks
        self._types = types
        self._background = BackgroundTasks()
        self.connected = False
        """Whether the broker of the fleet is connected."""
        self._address = ""
        self._reader: FeedReader
        self._delivery: Delivery | None = None
        self._texts: DriverTexts
        self._unit = UnitData()
        self._names: dict[str, str] = {}
        self._missing: set[str] = set()
        self._counts: Counter[UnitState] = Counter()
        self._counted = 0.0
        self._by_priority: Counter[Priority] = Counter()
        self._first_alarm: r.FirstAlarm | Unset = UNSET
        self._alarms_changed = True
        self._state: r.FleetState | None = None
        self._collected = 0.0

    def serve(self, address: str) -> None:
        """Start to publish, if there is a fleet.

        Args:
            address: address of the editor for other computers; empty if there is none.

        Raises:
            StorageError: the identity of the cell cannot be read or written.
        """
        if not self._outboxes:
            return
        if importlib.util.find_spec("nats") is None:
            log.error("the cell does not join the fleet: install the extra `nodes` of arcor2-hw")
            return
        from arcor2_server.fleet.broker import keep_connected  # needs the extra `nodes`
        from arcor2_server.fleet.delivery import Delivery
        from arcor2_server.fleet.driver_texts import DriverTexts
        from arcor2_server.nodes.credentials import load, of_address

        self._address = self._settings.cell_address or address
        self._identity, self._boot, self._number = identity_of(self._settings.data_dir), uuid.uuid4().hex, 0
        self._texts = DriverTexts(self._types.installed_folders)
        self._delivery = Delivery(self._outboxes, self._settings.cell_name, self._identity, self._texts)
        self._reader = self._feed.reader(with_streams=False)
        self._alarms.on_changed.append(lambda _: self._mark_alarms())
        self._background.spawn(self._follow(), "state for the fleet")
        settings = self._settings
        name = settings.cell_name
        if settings.fleet_broker:
            credentials = of_address(settings.fleet_broker, settings.fleet_authority)
            connecting = keep_connected(lambda: credentials, f"arcor2-hw cell {name}", self._publish, lambda: None)
        else:
            connecting = keep_connected(
                lambda: load(settings.fleet_credentials),
                f"arcor2-hw cell {name}",
                self._publish,
                lambda: None,
                r.answer_subject(name),
            )
        self._background.spawn(connecting, "connection to the fleet")

    async def close(self) -> None:
        """End the connection. What is not sent yet is sent after the next start."""
        await self._background.cancel()

    @property
    def configured(self) -> bool:
        """Whether the cell belongs to a fleet."""
        return bool(self._outboxes)

    async def waiting(self) -> int:
        """Return the number of results that wait to be sent. Raise StorageError if it cannot be read."""
        return sum([await outbox.count() for outbox in self._outboxes])

    def _mark_alarms(self) -> None:
        self._alarms_changed = True

    # -------------------------------------------------------------------------------- state
    async def _follow(self) -> None:
        """Collect the state. The database may delay this, but not the publication."""
        while True:
            try:
                await self._collect()
            except Arcor2Error as error:
                log.warning("state for the fleet not read", reason=str(error))
            await asyncio.sleep(PERIOD)

    async def _collect(self) -> None:
        update = await self._reader.changes()
        if update.devices is not None:
            self._names = {device.id: device.name for device in update.devices}
            self._missing &= self._names.keys()
        for key, state in update.states.items():
            if state.connection in _NOT_CONNECTED or not state.answering:
                self._missing.add(key)
            else:
                self._missing.discard(key)
        loop = asyncio.get_running_loop()
        if update.unit is not None:
            before, self._unit = self._unit, update.unit
            if (before.good, before.bad, before.rejected) != (update.unit.good, update.unit.bad, update.unit.rejected):
                self._counted = 0.0
        if loop.time() - self._counted > COUNT_PERIOD:
            since = (datetime.now(UTC) - COUNT_WINDOW).isoformat(timespec="microseconds")
            self._counts = Counter(await self._units.left_between(since, now()))
            self._counted = loop.time()
        if self._alarms_changed:
            self._alarms_changed = False
            await self._summarise(await self._alarms.find(ListAlarmsArgs(show=AlarmFilter.RETAINED, limit=1000)))
        self._state, self._collected = self._current_state(), loop.time()

    async def _summarise(self, alarms: list[AlarmRecord]) -> None:
        self._by_priority = Counter(alarm.priority for alarm in alarms)
        # Of those that nobody has recognised yet, the most urgent one, and of these the oldest one.
        first = min(
            alarms, key=lambda each: (each.acknowledged, -PRIORITIES.index(each.priority), each.raised), default=None
        )
        self._first_alarm = UNSET
        if first is not None:
            device = "" if isinstance(first.object_name, Unset) else first.object_name
            text = first.text[:1000]
            message = first.text_message if text == first.text else UNSET
            translations = await asyncio.to_thread(self._texts.of_text, first)
            self._first_alarm = r.FirstAlarm(first.priority, text, first.raised, _short(device), message, translations)

    def _current_state(self) -> r.FleetState:
        unit, cell, execution = self._unit, self._cell, self._execution
        priorities, counts = self._by_priority, self._counts
        delivery = self._delivery
        assert delivery is not None
        missing = sorted(self._names.get(key, key) for key in self._missing)
        return r.FleetState(
            identity=self._identity,
            boot=self._boot,
            number=0,
            version=version("arcor2-hw"),
            state=CellStateName[cell.state.name],
            mode=cell.data().mode,
            authority=cell.authority,
            program_state=execution.state,
            address=self._address,
            domain=delivery.domain,
            program=_short(unit.program),
            recipe=_short(unit.recipe),
            held=cell.person_needed,
            good=counts[UnitState.GOOD],
            bad=counts[UnitState.BAD],
            rejected=counts[UnitState.REJECTED],
            urgent=priorities[Priority.URGENT],
            high=priorities[Priority.HIGH],
            medium=priorities[Priority.MEDIUM],
            low=priorities[Priority.LOW],
            first_alarm=self._first_alarm,
            started_by=_short(self._runs.starter(execution.program.number)) if execution.active else "",
            users=_first_names(self._users.names()),
            controlling=_first_names(self._locks.owners()),
            missing=_first_names(missing),
            waiting=delivery.waiting,
        )

    # -------------------------------------------------------------------------------- sending
    async def _publish(self, client: "Client") -> None:
        """Publish over a connection until it is lost."""
        tasks = BackgroundTasks()
        assert self._delivery is not None
        tasks.spawn(self._delivery.run(client), "results for the fleet")
        self.connected = True
        try:
            await self._publish_states(client)
        finally:
            self.connected = False
            await tasks.cancel()

    async def _publish_states(self, client: "Client") -> None:
        subject = r.state_subject(self._settings.cell_name)
        loop = asyncio.get_running_loop()
        sent: r.FleetState | None = None
        due = 0.0
        while True:
            state = self._state
            fresh = loop.time() - self._collected < STALE_AFTER
            if state is not None and fresh and (state != sent or loop.time() >= due):
                sent, due = state, loop.time() + r.BEAT_PERIOD
                self._number += 1
                encoded = r.encode(replace(state, number=self._number))
                if len(encoded) > r.MAX_STATE:  # names with many characters outside ASCII
                    encoded = r.encode(replace(state, number=self._number, first_alarm=UNSET, users=(), missing=()))
                await client.publish(subject, encoded)
                await client.flush(FLUSH_TIMEOUT)  # an old state never waits to be sent after a cable was repaired
            await asyncio.sleep(PERIOD)


def _short(name: str) -> str:
    return name[:200]


def _first_names(names: list[str]) -> tuple[str, ...]:
    return tuple(map(_short, names[: r.MAX_NAMES]))

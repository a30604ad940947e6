"""Receives the states and results of all cells from the broker. It publishes nothing that a cell reads."""

import asyncio
import contextlib
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final, NamedTuple, TypeVar

import msgspec
import structlog
from nats.aio.client import Client
from nats.aio.msg import Msg
from nats.errors import Error as NatsError
from nats.js.api import AckPolicy, ConsumerConfig, DiscardPolicy, RetentionPolicy, StorageType
from nats.js.client import JetStreamContext
from nats.js.errors import NotFoundError

from arcor2_hw.data.base import now
from arcor2_hw.exceptions import Arcor2Error, InvalidData, StorageError
from arcor2_server.background import BackgroundTasks
from arcor2_server.fleet import records as r
from arcor2_server.fleet.broker import keep_connected
from arcor2_server.fleet.file import FleetFile, FleetResult, ReceivedResult
from arcor2_server.fleet.registry import MAX_PER_NAME, Registry
from arcor2_server.fleet.reports import FleetReports
from arcor2_server.fleet.summaries import alarm_columns, unit_columns
from arcor2_server.nodes.confirmation import confirm_sent
from arcor2_server.nodes.credentials import Credentials

log = structlog.get_logger(__name__)

CHECK_PERIOD: Final = 0.1
"""Period of looking for cells without a signal, s."""
SAVE_PERIOD: Final = 10.0
"""Period of storing the cells, s."""
CONSUMER: Final = "fleet"
"""Name of the consumer at the stream of each cell."""
STREAM_BYTES: Final = 1 << 30
"""Maximum size of the stream of a cell at the broker, bytes. Further results wait in the cell."""
BATCH: Final = 200
"""Maximum number of results that are stored in one transaction."""
FETCH_TIMEOUT: Final = 10.0
"""Time for which a request for results waits for them, s."""
RETRY_PERIOD: Final = 2.0
"""Time between two attempts to receive the results of a cell, s."""
ACKNOWLEDGE_TIMEOUT: Final = 10.0
"""Time after which the broker delivers a result again that was not acknowledged, s."""
REPORT_PERIOD: Final = 60.0
"""Shortest time between two log entries about refused messages of one cell, s."""
MAX_REPORTED: Final = 2000
"""Maximum number of subjects whose last report is remembered."""
T = TypeVar("T")


class _Source(NamedTuple):
    """Where the results of a cell are stored."""

    name: str
    domain: str


class Collector:
    """The states and results of all cells.

    Args:
        broker: returns address and credentials of the broker, before each attempt to connect.
        file: stores cells and results.
    """

    def __init__(self, broker: Callable[[], Credentials], file: FleetFile) -> None:
        self._broker, self._file = broker, file
        self.registry = Registry(file.cells())
        self.connected = False
        """Whether the broker is connected."""
        self.changed = asyncio.Event()
        """Set, and replaced by a new one, when something that the page shows has changed."""
        self._background = BackgroundTasks()
        self._sources: dict[_Source, asyncio.Task[None]] = {}
        self._writer = ThreadPoolExecutor(1, "fleet file")
        self._reports = FleetReports(file.path)
        self._reader = ThreadPoolExecutor(1, "fleet reports")
        self._reported: dict[str, tuple[float, int]] = {}
        self._seen_revision = self.registry.revision

    def start(self) -> None:
        """Start to receive."""
        connecting = keep_connected(self._broker, "arcor2-hw fleet", self._receive, self._lost)
        self._background.spawn(connecting, "connection to the broker")
        self._background.spawn(self._watch(), "cells without a signal")
        self._background.spawn(self._save(), "stored cells")

    async def close(self) -> None:
        """End the connection, and store the cells."""
        await self._background.cancel()
        with contextlib.suppress(StorageError):
            await self._in_writer(lambda: self._file.put_cells(list(self.registry.stored())))
        for executor in (self._reader, self._writer):
            executor.shutdown()
        self._reports.close()
        self._file.close()

    async def remove(self, card_id: str) -> None:
        """Forget a cell without a signal. Raise NotFound or Conflict as the registry does, or StorageError."""
        name, identity = self.registry.remove(card_id)
        self._notify()
        await self._in_writer(lambda: self._file.remove_cell(name, identity))

    async def results(self, cell: str, kind: str, before: int, limit: int) -> list[FleetResult]:
        """Return stored results, newest first, as FleetFile does."""
        return await self._in_writer(lambda: self._file.results(cell, kind, before, limit))

    async def report(self, work: Callable[[FleetReports], T]) -> T:
        """Return the result of a query, which does not delay the storing of results. Raise what the query raises."""
        return await asyncio.get_running_loop().run_in_executor(self._reader, work, self._reports)

    async def _in_writer(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._writer, work)

    def _notify(self) -> None:
        if self.registry.revision != self._seen_revision:
            self._seen_revision = self.registry.revision
            self.changed.set()
            self.changed = asyncio.Event()

    async def _watch(self) -> None:
        while True:
            await asyncio.sleep(CHECK_PERIOD)
            self.registry.check(time.monotonic())
            self._notify()

    async def _save(self) -> None:
        while True:
            await asyncio.sleep(SAVE_PERIOD)
            cells = list(self.registry.stored())
            try:
                await self._in_writer(lambda cells=cells: self._file.put_cells(cells))  # type: ignore[misc]
            except StorageError as error:
                log.error("cells not stored", reason=str(error))

    # -------------------------------------------------------------------------------- states
    async def _receive(self, client: Client) -> None:
        self._client = client
        await client.subscribe(r.STATES, cb=self._state_arrived)
        await confirm_sent(client)
        self.connected = True
        self._notify_connection()
        await asyncio.Event().wait()

    def _lost(self) -> None:
        self.connected = False
        for task in self._sources.values():
            task.cancel()
        self._sources.clear()
        self.registry.lose_all()
        self._notify_connection()

    def _notify_connection(self) -> None:
        """Let the page show the connection to the broker."""
        self._notify()
        self.changed.set()
        self.changed = asyncio.Event()

    async def _state_arrived(self, message: Msg) -> None:
        try:
            name = r.cell_of(message.subject)
            state = r.decode_state(message.data)
            self.registry.accept(name, state, now(), time.monotonic())
        except Arcor2Error as error:
            self._report(message.subject, "state of a cell refused", error)
            return
        self._notify()
        source = _Source(name, state.domain)
        same = sum(each.name == name for each in self._sources)
        if source not in self._sources and same < MAX_PER_NAME and self.connected:
            task = self._background.spawn(self._collect(self._client, source), f"results of {name}")
            self._sources[source] = task

    def _report(self, subject: str, what: str, error: Exception) -> None:
        """Log a refused message, at most one of each subject in REPORT_PERIOD."""
        subject = subject[:200]
        at = time.monotonic()
        last, skipped = self._reported.get(subject, (0.0, 0))
        if last and at - last < REPORT_PERIOD:
            self._reported[subject] = (last, skipped + 1)
            return
        while len(self._reported) >= MAX_REPORTED:
            del self._reported[next(iter(self._reported))]
        self._reported[subject] = (at, 0)
        log.warning(what, subject=subject, reason=str(error)[:500], others=skipped)

    # -------------------------------------------------------------------------------- results
    async def _collect(self, client: Client, source: _Source) -> None:
        """Store the results of a cell until the connection is lost."""
        reported = ""
        while True:
            try:
                stream = client.jetstream(domain=source.domain or None)
                await _ensure_stream(stream, source.name)
                subscription = await stream.pull_subscribe(
                    "",
                    durable=CONSUMER,
                    stream=r.stream_name(source.name),
                    config=ConsumerConfig(ack_policy=AckPolicy.EXPLICIT, ack_wait=ACKNOWLEDGE_TIMEOUT),
                )
                reported = ""
                while True:
                    try:
                        messages = await subscription.fetch(BATCH, timeout=FETCH_TIMEOUT)
                    except TimeoutError:
                        continue
                    await self._store(source.name, messages)
            except (NatsError, StorageError, OSError, TimeoutError) as error:
                if (reason := f"{type(error).__name__}: {error}") != reported:
                    reported = reason
                    log.warning("results of a cell not received; trying again", cell=source.name, reason=reason[:500])
            await asyncio.sleep(RETRY_PERIOD)

    async def _store(self, name: str, messages: list[Msg]) -> None:
        """Store results, and acknowledge them afterwards. What cannot be a result is refused and not sent again."""
        received, stored = [], []
        for message in messages:
            try:
                received.append(_received(name, message))
                stored.append(message)
            except InvalidData as error:
                self._report(message.subject, "result of a cell refused", error)
                await message.term()
        if received:
            await self._in_writer(lambda: self._file.put_results(received))
        for message in stored:
            await message.ack()


async def _ensure_stream(stream: JetStreamContext, cell: str) -> None:
    """Create the stream of a cell unless it exists. Cells have no right to do it, since a stream can read others."""
    try:
        await stream.stream_info(r.stream_name(cell))
    except NotFoundError:
        await stream.add_stream(
            name=r.stream_name(cell),
            subjects=r.result_subjects(cell),
            retention=RetentionPolicy.WORK_QUEUE,  # a result that was stored here is deleted there
            storage=StorageType.FILE,
            discard=DiscardPolicy.NEW,
            max_bytes=STREAM_BYTES,
            max_msg_size=r.MAX_RESULT,
        )


def _received(name: str, message: Msg) -> ReceivedResult:
    if r.cell_of(message.subject) != name:
        raise InvalidData("The stream of {name} contains a message of another cell.", name=name)
    result = r.decode_result(message.data)
    received = message.metadata.timestamp.timestamp()
    if isinstance(result, r.UnitResult):
        kind, since = "unit", result.record.entered
        columns = unit_columns(result.record, result.translations, int(received))
    else:
        kind, since = "alarm", result.record.raised
        columns = alarm_columns(result.record, result.translations, int(received))
    document = msgspec.json.encode(result.record)
    stamp = int(received * 1e6)
    return ReceivedResult(name, result.identity, kind, result.record.number, since, stamp, document, columns)

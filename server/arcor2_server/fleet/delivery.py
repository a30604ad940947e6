"""Sends the results in the outbox of a cell to the stream of this cell at the broker. It needs the extra `nodes`."""

import asyncio
import contextlib
import hashlib
from collections.abc import Sequence
from typing import Final

import msgspec
import structlog
from msgspec.structs import replace
from nats.aio.client import Client
from nats.errors import Error as NatsError
from nats.js.api import PubAck
from nats.js.client import JetStreamContext
from nats.js.errors import NotFoundError

from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.units import UnitRecord
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.fleet import records as r
from arcor2_server.fleet.driver_texts import DriverTexts
from arcor2_server.storage.outbox import Outbox, OutboxKind, Waiting

log = structlog.get_logger(__name__)

BATCH: Final = 200
"""Maximum number of results that are sent at once."""
STORE_TIMEOUT: Final = 10.0
"""Time limit for the broker to store a batch of results, s."""
POLL_PERIOD: Final = 5.0
"""Period in which the outbox is checked, also without an event, and time before a failed batch is sent again, s."""
STREAM_CHECK_PERIOD: Final = 0.5
"""Time between two checks whether the stream of this cell exists, s."""
_ERROR: Final = b'"error":'
"""Part of each record of a unit with a failed step."""
HEADER_SIZE: Final = 4096
"""Size that is left for the headers of a message, bytes."""


class Delivery:
    """Sends results, each until the broker has stored it.

    Args:
        outboxes: the results.
        name: of the cell.
        identity: of the cell.
        texts: translations of the texts of alarms and units.
    """

    def __init__(self, outboxes: Sequence[Outbox], name: str, identity: str, texts: DriverTexts) -> None:
        self._outboxes, self._name, self._identity, self._texts = outboxes, name, identity, texts
        self._added = asyncio.Event()
        for outbox in outboxes:
            outbox.on_added.append(self._added.set)
        self.waiting = 0
        """Number of results that wait."""
        self.domain = ""
        """JetStream domain of the broker; empty if it has none, or before it is known."""

    async def run(self, client: Client) -> None:
        """Send the results, each until the broker has stored it."""
        reported = ""
        while True:
            try:
                stream = await self._stream(client)
                if reported:
                    log.info("results are stored by the broker again")
                reported = ""
                await self._deliver_to(client, stream)
            except NotFoundError:
                await asyncio.sleep(
                    STREAM_CHECK_PERIOD
                )  # after the server of the page has seen a state with the domain
                continue
            except (NatsError, TimeoutError, Arcor2Error) as error:
                if (reason := f"{type(error).__name__}: {error}") != reported:
                    reported = reason
                    log.warning("results are not stored by the broker; they wait", reason=reason, waiting=self.waiting)
            await asyncio.sleep(POLL_PERIOD)

    async def _stream(self, client: Client) -> JetStreamContext:
        """Return the JetStream of the broker. The server of the page creates the stream of this cell.

        Raises:
            NotFoundError: the stream does not exist yet.
        """
        stream = client.jetstream(timeout=STORE_TIMEOUT)
        self.domain = (await stream.account_info()).domain or ""
        await stream.stream_info(r.stream_name(self._name))
        return stream

    async def _deliver_to(self, client: Client, stream: JetStreamContext) -> None:
        limit = min(client.max_payload, r.MAX_RESULT) - HEADER_SIZE
        while True:
            self._added.clear()
            self.waiting = sum([await outbox.count() for outbox in self._outboxes])
            if not self.waiting:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(POLL_PERIOD):
                        await self._added.wait()
                continue
            for outbox in self._outboxes:
                await self._deliver(outbox, stream, limit)

    async def _deliver(self, outbox: Outbox, stream: JetStreamContext, limit: int) -> None:
        """Send the results of an outbox that wait longest."""
        done: list[int] = []
        sent: list[int] = []
        pending: list[asyncio.Future[PubAck]] = []
        for waiting in await outbox.first(BATCH):
            if waiting.kind is OutboxKind.ALARM or _ERROR in waiting.document:  # reads files of drivers
                encoded = await asyncio.to_thread(self._encoded, waiting, limit)
            else:
                encoded = self._encoded(waiting, limit)
            if len(encoded) > limit:
                log.error("result is too large for the broker and not sent", kind=waiting.kind, size=len(encoded))
                done.append(waiting.number)
                continue
            message_id = hashlib.sha256(b"%d " % waiting.number + encoded).hexdigest()[:32]
            headers = {"Nats-Msg-Id": message_id}  # the broker stores a message once that is sent again
            subject = f"{r.PREFIX}.{self._name}.{waiting.kind}"
            pending.append(
                await stream.publish_async(subject, encoded, stream=r.stream_name(self._name), headers=headers)
            )
            sent.append(waiting.number)
        async with asyncio.timeout(STORE_TIMEOUT):
            answers = await asyncio.gather(*pending, return_exceptions=True)
        failures = [answer for answer in answers if isinstance(answer, BaseException)]
        done += [number for number, answer in zip(sent, answers, strict=True) if not isinstance(answer, BaseException)]
        if done:
            await outbox.remove(done)
        if failures:
            raise failures[0]

    def _encoded(self, waiting: Waiting, limit: int) -> bytes:
        """Return the message of a result. Steps of a unit that do not fit are left out."""
        head: dict[str, object] = {"kind": waiting.kind.value, "identity": self._identity}
        if waiting.kind is OutboxKind.ALARM:
            alarm = msgspec.json.decode(waiting.document, type=AlarmRecord)
            head["translations"] = self._texts.of_alarm(alarm)
        elif _ERROR in waiting.document:
            head["translations"] = self._texts.of_unit(msgspec.json.decode(waiting.document, type=UnitRecord))
        encoded = r.encode(head | {"record": msgspec.Raw(waiting.document)})
        if len(encoded) <= limit or waiting.kind is not OutboxKind.UNIT:
            return encoded
        record = msgspec.json.decode(waiting.document, type=UnitRecord)
        while len(encoded) > limit and record.steps:
            stored = record.steps[: len(record.steps) // 2]
            record = replace(record, steps=stored, dropped=record.dropped + len(record.steps) - len(stored))
            encoded = r.encode(head | {"record": record})
        return encoded

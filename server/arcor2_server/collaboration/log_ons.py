"""The persons who are logged on at devices, and the end of their sessions."""

import asyncio
import hashlib
import secrets
import time
from collections.abc import Callable
from typing import Final

import structlog

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import Event
from arcor2_hw.data.persons import LogOnChangedData
from arcor2_hw.data.rpc import LogOnData
from arcor2_hw.exceptions import NotFound
from arcor2_hw.messages import Message
from arcor2_server.audit.trail import AuditTrail
from arcor2_server.collaboration.persons import LogOnRefused, Persons, shown
from arcor2_server.collaboration.users import Users
from arcor2_server.events import Connection, EventHub, make_event
from arcor2_server.storage.persons import StoredPerson

log = structlog.get_logger(__name__)

RESUME_PERIOD: Final = 120.0
"""Time after a lost connection within which the device may log the person on again without a PIN, s."""

ENDED: Final = Message.of("You were logged off. Log on again.")


class LogOn:
    """A person who is logged on at a device."""

    def __init__(self, person: StoredPerson, client: Connection) -> None:
        self.person = person
        self.device = client.device
        self.client: Connection | None = client
        """The connection; None after it was lost."""
        self.session = secrets.token_hex(32)
        self.active = time.monotonic()
        """Time of the last activity, s of the monotonic clock."""
        self.timer: asyncio.TimerHandle | None = None


class LogOns:
    """The persons who are logged on, each at one device.

    Args:
        hub: publishes LogOnChanged.
        users: registers the persons by their names.
        persons: the persons.
        audit: records when and why a person is logged off.
        log_off_after: time without activity after which a person is logged off, s; 0: never.
    """

    def __init__(self, hub: EventHub, users: Users, persons: Persons, audit: AuditTrail, log_off_after: float) -> None:
        self._hub = hub
        self._users = users
        self._persons = persons
        self._audit = audit
        self.log_off_after = log_off_after
        self._by_person: dict[str, LogOn] = {}
        self._by_session: dict[str, LogOn] = {}
        """Log-ons by the digest of the session, so that the duration of a look-up reveals nothing."""
        self._starting = asyncio.Lock()  # serializes the registration of names
        self.on_end: list[Callable[[Connection, Message], None]] = []
        """Called with the connection at which a person was logged off, and the reason."""
        hub.on_leave.append(self._disconnected)

    # ------------------------------------------------------------------------------------------------ log on
    async def log_on(self, client: Connection, person: StoredPerson) -> tuple[LogOnData, list[Event]]:
        """Log a person on; return the answer, and events for the client.

        Another person at this device, and the same person at another device, are logged off.

        Raises:
            RequestRefused: a connected client has registered the name of the person.
        """
        async with self._starting:
            if (previous := self.at(client)) is not None:
                self._end(previous, Message.of("{name} logged on at this device.", name=person.name))
            if (elsewhere := self._by_person.get(person.id)) is not None:
                self._end(elsewhere, Message.of("{name} logged on at another device.", name=person.name))
            events = await self._users.register(client, person.name)
            started = LogOn(person, client)
            self._by_person[person.id] = started
            self._by_session[_digest(started.session)] = started
            self._attach(started, client)
        return self._answer(started, client), events

    async def resume(self, client: Connection, session: str) -> tuple[LogOnData, list[Event]]:
        """Log a person on again after a lost connection, as `log_on` does.

        Raises:
            LogOnRefused: the session has ended, or belongs to another device.
        """
        async with self._starting:
            found = self._by_session.get(_digest(session))
            if found is None or found.device != client.device:
                raise LogOnRefused(ENDED)
            if (previous := self.at(client)) is not None and previous is not found:
                self._end(previous, Message.of("{name} logged on at this device.", name=found.person.name))
            if found.client is not None and found.client is not client:
                self._detach(found.client)
            events = await self._users.register(client, found.person.name)
            if self._by_person.get(found.person.id) is not found:  # logged off in the meantime
                self._users.unregister(client)
                raise LogOnRefused(ENDED)
            self._attach(found, client)
        return self._answer(found, client), events

    def at(self, client: Connection) -> LogOn | None:
        """Return who is logged on at a connection."""
        if client.person is None:
            return None
        found = self._by_person.get(client.person.id)
        return found if found is not None and found.client is client else None

    def person_of(self, session: str, device: str, *, active: bool) -> StoredPerson | None:
        """Return the person of a session, None if it has ended. `active`: whether the call counts as activity."""
        found = self._by_session.get(_digest(session))
        if found is None or found.device != device:
            return None
        if active:
            found.active = time.monotonic()
        return found.person

    def touch(self, client: Connection) -> None:
        """Record an activity of the person at a connection."""
        if (found := self.at(client)) is not None:
            found.active = time.monotonic()

    def _attach(self, started: LogOn, client: Connection) -> None:
        started.client = client
        client.person = shown(started.person)
        started.active = time.monotonic()
        if client not in self._hub.clients:  # lost in the meantime
            started.client = None
        self._watch(started)
        log.info("person logged on", person=started.person.name, device=started.device, client=client.number)

    def _answer(self, started: LogOn, client: Connection) -> LogOnData:
        return LogOnData(shown(started.person), client.role.identifier, started.session, self.log_off_after)

    # ------------------------------------------------------------------------------------------------ log off
    def log_off(self, client: Connection) -> None:
        """Log off the person at a connection."""
        if (found := self.at(client)) is not None:
            self._end(found, Message.of("{name} logged off.", name=found.person.name))

    async def refresh(self, key: str | None = None) -> None:
        """Apply changes of persons, of one or of all who are logged on. Raise StorageError."""
        for found in [each for each in self._by_person.values() if key in (None, each.person.id)]:
            try:
                person = await self._persons.get(found.person.id)
            except NotFound:
                self._end(found, Message.of("An administrator removed {name}.", name=found.person.name))
                continue
            if person == found.person:
                continue
            if (person.name, person.pin, person.card) != (found.person.name, found.person.pin, found.person.card):
                self._end(found, Message.of("An administrator changed {name}. Log on again.", name=found.person.name))
                continue
            found.person = person
            if (client := found.client) is not None:
                client.person = shown(person)
                self._publish(client)

    def pin_changed(self, person: StoredPerson) -> None:
        """Record that a person has changed their own PIN: they remain logged on."""
        for found in self._by_person.values():
            if found.person.id == person.id:
                found.person = person

    def close(self) -> None:
        """Cancel the timers."""
        for found in self._by_person.values():
            if found.timer is not None:
                found.timer.cancel()

    def _watch(self, found: LogOn) -> None:
        """End a log-on that is idle or whose connection is lost for too long, and check it again later otherwise."""
        if found.timer is not None:
            found.timer.cancel()
            found.timer = None
        limit = self.log_off_after or float("inf")
        if found.client is None:
            limit = min(limit, RESUME_PERIOD)
        if limit == float("inf"):
            return
        if (left := found.active + limit - time.monotonic()) > 0:
            found.timer = asyncio.get_running_loop().call_later(left, self._watch, found)
        else:
            idle = "{name} was logged off after {seconds:g} s without use."
            self._end(found, Message.of(idle, name=found.person.name, seconds=limit))

    def _end(self, found: LogOn, reason: Message) -> None:
        self._by_person.pop(found.person.id, None)
        self._by_session.pop(_digest(found.session), None)
        if found.timer is not None:
            found.timer.cancel()
        client = found.client
        log.info("person logged off", person=found.person.name, device=found.device, reason=str(reason))
        self._audit.note(
            AuditOutcome.DONE,
            "LogOff",
            target=found.person.name,
            user=found.person.name,
            role=found.person.role,
            address="" if client is None else client.address,
            reason=str(reason),
        )
        if client is not None:
            self._detach(client, reason)

    def _detach(self, client: Connection, reason: Message | None = None) -> None:
        """Revoke the rights of the person on a connection, end its hold-to-run motions and release its locks."""
        reason = reason or Message.of("The same person continues at another window.")
        client.person = None
        for notify in self.on_end:
            notify(client, reason)
        self._users.unregister(client)
        self._publish(client, reason)

    def _publish(self, client: Connection, reason: Message | None = None) -> None:
        if client in self._hub.subscribers("LogOnChanged"):
            data = LogOnChangedData(
                client.role.identifier,
                client.person or UNSET,
                "" if reason is None else reason.text,
                **({} if reason is None else reason.translation()),
            )
            self._hub.send(client, make_event("LogOnChanged", data))

    def _disconnected(self, client: Connection) -> None:
        if (found := self.at(client)) is not None:
            found.client = None
            found.active = time.monotonic()
            self._watch(found)


def _digest(session: str) -> str:
    return hashlib.sha256(session.encode(errors="replace")).hexdigest()

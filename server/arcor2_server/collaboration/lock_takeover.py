"""Takes over the locks of users who left."""

from collections.abc import Callable

import structlog

from arcor2_hw.data.base import UNSET, Unset, now
from arcor2_hw.data.events import Event, LockData
from arcor2_hw.data.rpc import HeldLock, LockType
from arcor2_hw.messages import Message
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.users import Users
from arcor2_server.events import make_event

log = structlog.get_logger(__name__)


class LockTakeover:
    """Lists and releases the locks of users.

    Args:
        locks: The lock table.
        users: The registered users.
        name_of: Returns the name of a locked item, empty if it is unknown.
    """

    def __init__(self, locks: Locks, users: Users, name_of: Callable[[str], str]) -> None:
        self._locks = locks
        self._users = users
        self._name_of = name_of

    def held(self, user: str) -> list[HeldLock]:
        """Return the locks that the client of a user requested, without those that the server takes for a request."""
        locks = self._locks
        kinds: dict[str, LockType | Unset] = dict.fromkeys(locks.read_locked_by(user), UNSET)
        for item in locks.write_locked_by(user):
            kinds[item] = LockType.TREE if locks.holds(user, item, tree=True) else LockType.OBJECT
        return [HeldLock(item, self._name_of(item), locks.locked_at(user, item), kind) for item, kind in kinds.items()]

    def release(self, user: str, by: str) -> list[Event]:
        """Release the locks of a user who left; return the events to send. A notice is sent when the user returns."""
        names = [lock.name or lock.object_id for lock in self.held(user)]
        time = now()[:16].replace("T", " ")
        notice = "{by} released your locks at {time} UTC: {names}."
        ids = self._users.release(user, Message.of(notice, by=by, time=time, names=", ".join(names)))
        log.info("locks taken over", user=user, by=by, ids=ids)
        return [make_event("ObjectsUnlocked", LockData(ids, user))] if ids else []

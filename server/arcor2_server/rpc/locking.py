"""Requests that acquire and release locks (protocol, section 6)."""

from dataclasses import dataclass

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import LockData
from arcor2_hw.data.rpc import (
    LockHolder,
    LockType,
    ReadLockArgs,
    ReadUnlockArgs,
    TakeOverLocksArgs,
    TakeOverLocksData,
    UpdateLockArgs,
    WriteLockArgs,
    WriteUnlockArgs,
)
from arcor2_server.collaboration.lock_takeover import LockTakeover
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.users import Users
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class LockRequests:
    """Requests that acquire and release locks (protocol, section 6)."""

    _users: Users
    _locks: Locks
    _lock_takeover: LockTakeover

    @rpc("WriteLock")
    async def write_lock(self, context: Context, args: WriteLockArgs) -> None:
        """Lock an item, or the whole tree it belongs to. No event is sent if the caller holds the lock already."""
        user = context.user
        if ids := await self._locks.write_lock(user, args.object_id, args.lock_tree):
            context.emit("ObjectsLocked", LockData(ids, user))

    @rpc("WriteUnlock")
    async def write_unlock(self, context: Context, args: WriteUnlockArgs) -> None:
        """Release a write lock."""
        user = context.user
        context.emit("ObjectsUnlocked", LockData(await self._locks.write_unlock(user, args.object_id), user))

    @rpc("ReadLock")
    async def read_lock(self, context: Context, args: ReadLockArgs) -> None:
        """Prevent other users from changing an item."""
        await self._locks.read_lock(context.user, args.object_id)

    @rpc("ReadUnlock")
    async def read_unlock(self, context: Context, args: ReadUnlockArgs) -> None:
        """Release a read lock."""
        await self._locks.read_unlock(context.user, args.object_id)

    @rpc("UpdateLock")
    async def update_lock(self, context: Context, args: UpdateLockArgs) -> None:
        """Extend a write lock to the tree of the item, or reduce it to the item."""
        user = context.user
        tree = args.new_type is LockType.TREE
        ids = await self._locks.update_lock(user, args.object_id, tree)
        context.emit("ObjectsLocked" if tree else "ObjectsUnlocked", LockData(ids, user))

    @rpc("ListLocks")
    async def list_locks(self, context: Context, args: None) -> list[LockHolder]:
        """Return the users that hold locks, the times of locking, and when a user left."""
        return [
            LockHolder(user, self._lock_takeover.held(user), self._users.left_at(user) or UNSET)
            for user in self._locks.owners()
        ]

    @rpc("TakeOverLocks")
    async def take_over_locks(self, context: Context, args: TakeOverLocksArgs) -> TakeOverLocksData:
        """Release the locks of a user who left."""
        by = context.user
        self._users.require_left(args.user)
        held = self._lock_takeover.held(args.user)
        if not held:
            raise RequestRefused("{user} holds no locks.", user=args.user)
        if not context.dry_run:
            context.events_after += self._lock_takeover.release(args.user, by)
        return TakeOverLocksData(held)

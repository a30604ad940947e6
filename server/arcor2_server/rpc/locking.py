"""Requests by which clients take and give back locks (protocol, section 6)."""

from arcor2_hw.data.events import LockData
from arcor2_hw.data.rpc import LockType, ReadLockArgs, ReadUnlockArgs, UpdateLockArgs, WriteLockArgs, WriteUnlockArgs
from arcor2_server.rpc.registry import Context, rpc


@rpc("WriteLock")
async def write_lock(context: Context, args: WriteLockArgs) -> None:
    """Lock an object, or the whole tree it belongs to; silent when the caller holds it already."""
    user = context.user
    if ids := await context.services.locks.write_lock(user, args.object_id, args.lock_tree):
        context.emit("ObjectsLocked", LockData(ids, user))


@rpc("WriteUnlock")
async def write_unlock(context: Context, args: WriteUnlockArgs) -> None:
    """Give a write lock back."""
    user = context.user
    context.emit("ObjectsUnlocked", LockData(await context.services.locks.write_unlock(user, args.object_id), user))


@rpc("ReadLock")
async def read_lock(context: Context, args: ReadLockArgs) -> None:
    """Keep others from changing an object."""
    await context.services.locks.read_lock(context.user, args.object_id)


@rpc("ReadUnlock")
async def read_unlock(context: Context, args: ReadUnlockArgs) -> None:
    """Give a read lock back."""
    await context.services.locks.read_unlock(context.user, args.object_id)


@rpc("UpdateLock")
async def update_lock(context: Context, args: UpdateLockArgs) -> None:
    """Widen a write lock to the tree, or narrow it to the object."""
    user = context.user
    tree = args.new_type is LockType.TREE
    ids = await context.services.locks.update_lock(user, args.object_id, tree)
    context.emit("ObjectsLocked" if tree else "ObjectsUnlocked", LockData(ids, user))

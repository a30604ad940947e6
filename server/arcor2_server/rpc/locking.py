"""Requests by which clients take and give back locks (protocol, section 6)."""

import structlog

from arcor2_hw.data.base import UNSET, Unset, now
from arcor2_hw.data.events import Event, LockData
from arcor2_hw.data.rpc import (
    HeldLock,
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
from arcor2_server.collaboration.locks import PROJECT, SCENE
from arcor2_server.documents.changes import Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.events import make_event
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.services import Services

log = structlog.get_logger(__name__)


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


@rpc("ListLocks")
async def list_locks(context: Context, args: None) -> list[LockHolder]:  # noqa: ARG001
    """Return who holds locks, since when, and who of them left."""
    services = context.services
    return [
        LockHolder(user, held_locks(services, user), services.users.left_at(user) or UNSET)
        for user in services.locks.owners()
    ]


@rpc("TakeOverLocks")
async def take_over_locks(context: Context, args: TakeOverLocksArgs) -> TakeOverLocksData:
    """Release the locks of a user who left."""
    services, by = context.services, context.user
    services.users.require_left(args.user)
    held = held_locks(services, args.user)
    if not held:
        raise RequestRefused(f"{args.user} holds no locks.")
    if not context.dry_run:
        context.events_after += release_locks(services, args.user, by)
    return TakeOverLocksData(held)


def held_locks(services: Services, user: str) -> list[HeldLock]:
    """Return what the client of a user locked, without what the server locks for the time of a request."""
    locks = services.locks
    kinds: dict[str, LockType | Unset] = dict.fromkeys(locks.read_by(user), UNSET)
    for item in locks.written_by(user):
        kinds[item] = LockType.TREE if locks.holds(user, item, tree=True) else LockType.OBJECT
    return [HeldLock(item, _name(services, item), locks.since(user, item), kind) for item, kind in kinds.items()]


def release_locks(services: Services, user: str, by: str) -> list[Event]:
    """Release the locks of a user who left and return the events to send; the user is notified on returning."""
    names = [lock.name or lock.object_id for lock in held_locks(services, user)]
    time = now()[:16].replace("T", " ")
    ids = services.users.release(user, f"{by} took over what you had locked, at {time} UTC: {', '.join(names)}.")
    log.info("locks taken over", user=user, by=by, ids=ids)
    return [make_event("ObjectsUnlocked", LockData(ids, user))] if ids else []


def _name(services: Services, item: str) -> str:
    if item in (SCENE, PROJECT):
        return "the scene" if item == SCENE else "the project"
    document = services.session.document
    found = next((each for kind in Kind if (each := document.find(kind, item)) is not None), None)
    return "" if found is None else str(getattr(found.value, "name", ""))

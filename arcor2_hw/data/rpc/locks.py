"""Arguments about locks."""

import enum
from typing import Final

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class ReadLockArgs(Data, frozen=True):
    """Arguments of ReadLock."""

    object_id: str


class ReadUnlockArgs(Data, frozen=True):
    """Arguments of ReadUnlock."""

    object_id: str


class LockType(enum.StrEnum):
    """Kinds of write lock."""

    TREE = "TREE"
    OBJECT = "OBJECT"


class UpdateLockArgs(Data, frozen=True):
    """Arguments of UpdateLock."""

    object_id: str
    new_type: LockType


class WriteLockArgs(Data, frozen=True):
    """Arguments of WriteLock."""

    object_id: str
    lock_tree: bool = False


class WriteUnlockArgs(Data, frozen=True):
    """Arguments of WriteUnlock."""

    object_id: str


class HeldLock(Data, frozen=True):
    """One lock: the locked item, its name if it has one, and the time. `type` is omitted for a read lock."""

    object_id: str
    name: str
    since: Timestamp
    type: LockType | Unset = UNSET


class LockHolder(Data, frozen=True):
    """A user with locks. `left` is the time of the disconnect; omitted while the user is connected."""

    user: str
    locks: list[HeldLock]
    left: Timestamp | Unset = UNSET


class TakeOverLocksArgs(Data, frozen=True):
    """Arguments of TakeOverLocks: a disconnected user."""

    user: str


class TakeOverLocksData(Data, frozen=True):
    """Answer to TakeOverLocks: the released locks."""

    locks: list[HeldLock]


LOCK_RPCS: Final = (
    Rpc("ListLocks", None, list[LockHolder], Role.OPERATOR, additional=True),
    Rpc("ReadLock", ReadLockArgs, None, Role.OPERATOR),
    Rpc("ReadUnlock", ReadUnlockArgs, None, Role.OPERATOR),
    Rpc("TakeOverLocks", TakeOverLocksArgs, TakeOverLocksData, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("UpdateLock", UpdateLockArgs, None, Role.STANDARD_USER),
    Rpc("WriteLock", WriteLockArgs, None, Role.STANDARD_USER),
    Rpc("WriteUnlock", WriteUnlockArgs, None, Role.STANDARD_USER),
)
"""Requests about locks."""

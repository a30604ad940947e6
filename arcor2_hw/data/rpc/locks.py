"""Arguments about locks."""

import enum

from arcor2_hw.data.base import Data


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

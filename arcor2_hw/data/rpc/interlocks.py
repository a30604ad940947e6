"""Requests about interlocks (docs/protocol/interlocks.md)."""

from typing import Final

from arcor2_hw.data.base import Data
from arcor2_hw.data.interlocks import Interlock, InterlockState
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.general import IdArgs


class ListInterlocksData(Data, frozen=True):
    """Answer to ListInterlocks: the interlocks of the open scene, and their states while they are known."""

    interlocks: list[Interlock]
    states: list[InterlockState]


class PutInterlockArgs(Data, frozen=True):
    """Arguments of PutInterlock: a new interlock without an id, or a changed one."""

    interlock: Interlock


class PutInterlockData(Data, frozen=True):
    """Answer to PutInterlock."""

    id: str


INTERLOCK_RPCS: Final = (
    Rpc("DeleteInterlock", IdArgs, None, Role.TECHNICIAN, dry_run=True, additional=True),
    Rpc("ListInterlocks", None, ListInterlocksData, Role.OPERATOR, additional=True),
    Rpc("PutInterlock", PutInterlockArgs, PutInterlockData, Role.TECHNICIAN, dry_run=True, additional=True),
)
"""Requests about interlocks."""

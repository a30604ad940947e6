"""Requests about the cell as a unit of PackML (docs/protocol/cell.md)."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import Data
from arcor2_hw.data.cell_state import MAX_JOBS, CellAuthority, CellJob, CellMode, CellStatus
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class SetCellModeArgs(Data, frozen=True):
    """Arguments of SetCellMode."""

    mode: CellMode


class SetCellAuthorityArgs(Data, frozen=True):
    """Arguments of SetCellAuthority."""

    authority: CellAuthority


class SetCellJobsArgs(Data, frozen=True):
    """Arguments of SetCellJobs: all jobs."""

    jobs: Annotated[list[CellJob], Meta(max_length=MAX_JOBS)]


CELL_RPCS: Final = (
    Rpc("GetCell", None, CellStatus, Role.OPERATOR, additional=True),
    Rpc("SetCellAuthority", SetCellAuthorityArgs, CellStatus, Role.TECHNICIAN, additional=True),
    Rpc("SetCellJobs", SetCellJobsArgs, CellStatus, Role.TECHNICIAN, additional=True),
    Rpc("SetCellMode", SetCellModeArgs, CellStatus, Role.TECHNICIAN, additional=True),
)
"""Requests about the cell as a cell."""

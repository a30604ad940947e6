"""Requests about the cell as a unit of PackML (docs/protocol/cell.md)."""

from dataclasses import dataclass

from arcor2_hw.data.cell_state import CellStatus
from arcor2_hw.data.rpc import SetCellAuthorityArgs, SetCellJobsArgs, SetCellModeArgs
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class CellRequests:
    """Requests about the cell as a unit of PackML (docs/protocol/cell.md)."""

    _cell: PackmlCell

    @rpc("GetCell")
    async def get_cell(self, context: Context, args: None) -> CellStatus:
        """Return state, mode, authority and jobs."""
        return self._cell.data()

    @rpc("SetCellMode")
    async def set_cell_mode(self, context: Context, args: SetCellModeArgs) -> CellStatus:
        """Change the mode while no program runs."""
        await self._cell.set_mode(args.mode, context.client.name)
        return self._cell.data()

    @rpc("SetCellAuthority")
    async def set_cell_authority(self, context: Context, args: SetCellAuthorityArgs) -> CellStatus:
        """Give the authority to the hub, the PLC or nobody."""
        await self._cell.set_authority(args.authority, context.client.name)
        return self._cell.data()

    @rpc("SetCellJobs")
    async def set_cell_jobs(self, context: Context, args: SetCellJobsArgs) -> CellStatus:
        """Replace the jobs of the PLC."""
        await self._cell.set_jobs(args.jobs, context.client.name)
        return self._cell.data()

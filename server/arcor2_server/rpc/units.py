"""Requests about produced units (docs/protocol/units.md)."""

from dataclasses import dataclass

from arcor2_hw.data.rpc import GetProductionArgs, GetUnitArgs, ListUnitsArgs, ListUnitsData
from arcor2_hw.data.units import Production, UnitRecord
from arcor2_server.production.cell_time import CellTime
from arcor2_server.production.units import Units
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class UnitRequests:
    """Requests about produced units (docs/protocol/units.md)."""

    _units: Units
    _cell_time: CellTime

    @rpc("ListUnits")
    async def list_units(self, context: Context, args: ListUnitsArgs | None) -> ListUnitsData:
        """Return units, newest first."""
        return ListUnitsData(await self._units.find(args or ListUnitsArgs()))

    @rpc("GetUnit")
    async def get_unit(self, context: Context, args: GetUnitArgs) -> UnitRecord:
        """Return the record of a unit with its steps."""
        return await self._units.get(args.number)

    @rpc("GetProduction")
    async def get_production(self, context: Context, args: GetProductionArgs | None) -> Production:
        """Return the production of the cell in a period."""
        return await self._cell_time.production(args or GetProductionArgs())

"""Recipes, records of units, and the production of a period over REST."""

from dataclasses import dataclass

from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import GetProductionArgs, ListRecipesArgs, ListRecipesData, ListUnitsArgs
from arcor2_hw.data.units import Production, Unit, UnitRecord
from arcor2_hw.exceptions import NotFound
from arcor2_server.production.cell_time import CellTime
from arcor2_server.production.recipes import Recipes
from arcor2_server.production.units import Units
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import Binary, operation


@dataclass(frozen=True, slots=True)
class ProductionOperations:
    """Recipes, records of units, and the production of a period over REST."""

    _recipes: Recipes
    _units: Units
    _cell_time: CellTime

    @operation("GET", "/api/recipes", SERVER, Role.OPERATOR, plain=True)
    async def recipes(self, query: ListRecipesArgs) -> ListRecipesData:
        """Return recipes with their signatures, and the present production of the cell."""
        return ListRecipesData(self._recipes.find(query), self._recipes.changeover)

    @operation("GET", "/api/units", SERVER, Role.OPERATOR, plain=True)
    async def units(self, query: ListUnitsArgs) -> list[Unit]:
        """Return produced units without their steps, newest first."""
        return await self._units.find(query)

    @operation("GET", "/api/units/export", SERVER, Role.OPERATOR, media_type="text/csv")
    async def export_units(self, query: ListUnitsArgs) -> Binary:
        """Return produced units as CSV, newest first."""
        from arcor2_server.production.export import (
            units_as_csv,
        )  # with a module that is not needed at the start of the server

        return Binary(units_as_csv(await self._units.find(query)), "text/csv", "units.csv")

    @operation("GET", "/api/units/{number}", SERVER, Role.OPERATOR, plain=True)
    async def unit(self, number: str) -> UnitRecord:
        """Return the record of a unit with its steps."""
        if not (number.isascii() and number.isdecimal() and len(number) < 10):
            raise NotFound("There is no record of a unit with the number {number}.", number=number[:20])
        return await self._units.get(int(number))

    @operation("GET", "/api/production", SERVER, Role.OPERATOR, plain=True)
    async def production(self, query: GetProductionArgs) -> Production:
        """Return counts, time per activity and effectiveness of a period, by default of the last 8 hours."""
        return await self._cell_time.production(query)

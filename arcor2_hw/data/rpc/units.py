"""Requests about produced units (docs/protocol/units.md)."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.units import Production, Unit, UnitRecord, UnitState


class ListUnitsArgs(Data, frozen=True):
    """Arguments of ListUnits: selection of units, newest first.

    serial: the beginning of the serial number; case is ignored. order, product, run, state: all must match.
    since, until: of entering the cell. before: number of a record.
    """

    serial: str | Unset = UNSET
    order: str | Unset = UNSET
    product: str | Unset = UNSET
    run: int | Unset = UNSET
    state: UnitState | Unset = UNSET
    since: Timestamp | Unset = UNSET
    until: Timestamp | Unset = UNSET
    before: int | Unset = UNSET
    limit: Annotated[int, Meta(ge=1, le=1000)] = 100


class ListUnitsData(Data, frozen=True):
    """Answer to ListUnits: units without steps, newest first."""

    units: list[Unit]


class GetUnitArgs(Data, frozen=True):
    """Arguments of GetUnit: number of the record."""

    number: int


class GetProductionArgs(Data, frozen=True):
    """Arguments of GetProduction: the period, by default the last 8 hours."""

    since: Timestamp | Unset = UNSET
    until: Timestamp | Unset = UNSET


UNIT_RPCS: Final = (
    Rpc("GetProduction", GetProductionArgs, Production, Role.OPERATOR, args_optional=True, additional=True),
    Rpc("GetUnit", GetUnitArgs, UnitRecord, Role.OPERATOR, additional=True),
    Rpc("ListUnits", ListUnitsArgs, ListUnitsData, Role.OPERATOR, args_optional=True, additional=True),
)
"""Requests about produced units."""

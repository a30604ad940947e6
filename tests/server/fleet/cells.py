"""States and results as a cell publishes them, for tests and benchmarks."""

from typing import Any

from arcor2_hw.data.cell_state import CellAuthority, CellMode, CellStateName
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.units import UnitRecord, UnitState, UnitStep
from arcor2_server.fleet.records import FleetState

ENTERED = "2026-01-02T03:04:05.000000+00:00"


def state_of(identity: str = "a" * 32, boot: str = "b" * 32, number: int = 1, **values: Any) -> FleetState:
    """Return the state of a cell that is ready."""
    values = {
        "version": "0.1.0",
        "state": CellStateName.IDLE,
        "mode": CellMode.PRODUCE,
        "authority": CellAuthority.HUB,
        "program_state": PackageStateEnum.STOPPED,
    } | values
    return FleetState(identity=identity, boot=boot, number=number, **values)


def unit(number: int, steps: int = 4, state: UnitState = UnitState.GOOD) -> UnitRecord:
    """Return the record of a unit that has left the cell, with steps as a program records them."""
    return UnitRecord(
        number,
        f"SN-{number:06}",
        "scn_1",
        number,
        state,
        ENTERED,
        ENTERED,
        state is UnitState.GOOD,
        order="O-1",
        package_id="pkg_1",
        package_name="sorting",
        runs=[1],
        steps=[
            UnitStep(1, step, f"act_{step}", "test", ENTERED, 1.5, ['{"limit": 3.3}'], ['"passed"'])
            for step in range(steps)
        ],
    )

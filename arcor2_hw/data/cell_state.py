"""The cell as a unit of PackML: its state, mode and authority, and the jobs of its PLC (docs/protocol/cell.md)."""

import enum
from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Unset

MAX_JOBS: Final = 500
"""Maximum number of jobs."""


class CellStateName(enum.StrEnum):
    """The states of PackML that the cell has; arcor2_hw.data.packml.MachineState has their numbers."""

    STOPPED = "stopped"
    STARTING = "starting"
    IDLE = "idle"
    EXECUTE = "execute"
    STOPPING = "stopping"
    ABORTING = "aborting"
    ABORTED = "aborted"
    HOLDING = "holding"
    HELD = "held"
    UNHOLDING = "unholding"
    COMPLETE = "complete"


class CellMode(enum.StrEnum):
    """The modes of the cell; arcor2_hw.data.packml.UnitMode has their numbers."""

    PRODUCE = "produce"
    MAINTENANCE = "maintenance"
    MANUAL = "manual"
    CHANGEOVER = "changeover"


class CellAuthority(enum.StrEnum):
    """Who may start programs: clients of the server, the PLC, or nobody."""

    NOBODY = "nobody"
    HUB = "hub"
    PLC = "plc"


class CellJob(Data, frozen=True):
    """A job: the number by which the PLC requests it, and the package that it runs."""

    number: Annotated[int, Meta(ge=1, le=65535)]
    package_id: Annotated[str, Meta(min_length=1)]


class PlcLink(Data, frozen=True):
    """The connection of the PLC.

    listening: address of the Modbus block. peer: address of the PLC that wrote last. alive: whether its life counter
    changes.
    """

    listening: str
    alive: bool
    peer: str | Unset = UNSET


class CellStatus(Data, frozen=True):
    """The cell.

    jobs: by number. job: number of the job that the PLC has started and that has not ended. held_by_plc: whether the
    PLC has commanded the hold. plc: left out if the server has no Modbus block. opcua: whether plant systems can
    command the cell over OPC UA; left out if not.
    """

    state: CellStateName
    mode: CellMode
    authority: CellAuthority
    jobs: list[CellJob]
    held_by_plc: bool = False
    job: int | Unset = UNSET
    plc: PlcLink | Unset = UNSET
    opcua: bool | Unset = UNSET


# Names before version 0.2.
MOST_JOBS = MAX_JOBS

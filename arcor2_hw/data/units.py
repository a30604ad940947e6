"""Records of produced units, and the production of the cell."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
from arcor2_hw.data.recipes import UsedRecipe


class UnitState(enum.StrEnum):
    """Location of a unit: in the cell, in a box for good, bad or rejected parts, or unknown.

    REJECTED includes parts that a person has taken out of the cell. UNKNOWN: it left while the server was off, and the
    inventory no longer contains its serial number.
    """

    IN_CELL = "in_cell"
    GOOD = "good"
    BAD = "bad"
    REJECTED = "rejected"
    UNKNOWN = "unknown"


class UnitStep(TranslatableData, frozen=True):
    """An action that concerned a unit.

    run, number: run, and number of the action in it. duration: s. parameters, results: each as JSON in a string. error:
    reason of a failure, with `key` and `values`. attempt: number of the attempt, if not the first one.
    """

    run: int
    number: int
    action_id: str
    name: str
    started: Timestamp
    duration: float | Unset = UNSET
    parameters: list[str] | Unset = UNSET
    results: list[str] | Unset = UNSET
    error: str | Unset = UNSET
    attempt: int | Unset = UNSET


class UsedCalibration(Data, frozen=True):
    """A calibration that was in force: its record, object, kind and date."""

    id: str
    object_id: str
    object_name: str
    kind: str
    date: Timestamp


class Unit(Data, frozen=True):
    """A unit that the cell has worked on, without its steps.

    number: of the record. serial: serial number; empty if it was never read. scene_id, part: the scene, and the number
    of the part in the inventory. order: id of the order. entered, left: times at which it came into the cell and left
    it.
    verdict: result of its last test. runs: numbers of the runs that worked on it.
    """

    number: int
    serial: str
    scene_id: str
    part: int
    state: UnitState
    entered: Timestamp
    left: Timestamp | Unset = UNSET
    verdict: bool | Unset = UNSET
    order: str = ""
    recipe: UsedRecipe | Unset = UNSET
    package_id: str = ""
    package_name: str = ""
    package_hash: str = ""
    started_by: str = ""
    runs: list[int] = field(default_factory=list)


class UnitRecord(Unit, frozen=True, kw_only=True):
    """A unit with its steps, and the calibrations that were in force when it came into the cell.

    dropped: number of further steps that are not stored.
    """

    steps: list[UnitStep] = field(default_factory=list)
    calibrations: list[UsedCalibration] = field(default_factory=list)
    dropped: int = 0


class CellActivity(enum.StrEnum):
    """The activity of the cell. OFF: the server did not run."""

    RUNNING = "running"
    HELD = "held"
    PAUSED = "paused"
    STARTING = "starting"
    STOPPING = "stopping"
    IDLE = "idle"
    OFF = "off"


class UnitCounts(Data, frozen=True):
    """Units that left the cell, and units that are in it."""

    good: int = 0
    bad: int = 0
    rejected: int = 0
    unknown: int = 0
    in_cell: int = 0


class Effectiveness(Data, frozen=True):
    """Overall equipment effectiveness (ISO 22400-2): each 0 to 1, omitted where it cannot be computed.

    availability: time running / time of the period. performance: planned time of the produced units / time running,
    which is above 1 if the cell is faster than planned. quality: good / produced units. oee: their product.
    """

    availability: float | Unset = UNSET
    performance: float | Unset = UNSET
    quality: float | Unset = UNSET
    oee: float | Unset = UNSET


class Production(Data, frozen=True):
    """The production of the cell in a period, and the time per activity, s."""

    since: Timestamp
    until: Timestamp
    counts: UnitCounts
    seconds: dict[CellActivity, float]
    effectiveness: Effectiveness

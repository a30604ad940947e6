"""quality.yaml: what a driver claims of itself, beside its source, as a checked form."""

import enum
from pathlib import Path
from typing import Final, Literal

import msgspec
from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.testing.frames import KINDS

FILE: Final = "quality.yaml"


class Conformance(enum.StrEnum):
    """Whether the suite runs on the driver: by a bench, or not yet."""

    BENCH = "bench"
    PENDING = "pending"


class Level(enum.IntEnum):
    """What is shown of a driver: bronze, the cases on its fake; silver, recovery and faults; gold, a real device."""

    NONE = 0
    BRONZE = 1
    SILVER = 2
    GOLD = 3


class OutputsOnLoss(enum.StrEnum):
    """What the device's outputs do when it loses us."""

    HOLD = "hold"
    OFF = "off"
    ON = "on"
    SETTING = "setting"
    NONE = "none"


class VersionsTried(Data, frozen=True, forbid_unknown_fields=True):
    """What the driver was tried with; `hardware` names model and firmware, or is "none"."""

    library: str
    controller: list[str]
    hardware: str | list[str]


class Quality(Data, frozen=True, forbid_unknown_fields=True):
    """What is written of one driver folder.

    rules: by rule, numbered as in docs/reference/object-types.md, the tests that show it. not_run: by case of the
    suite, or by `Type.case`, why it cannot be run; a whole type by its name. actions: of all types, or by type.
    outputs_on_loss: YAML reads off and on as false and true, which are taken too. level: what is claimed; the suite
    checks it. tests: the folder of the tests that `rules` names, from the project's root; where it is not given they
    are looked for in all test folders. report: beside this file, what `--report` wrote in a run on the real device.
    frames: how the driver's frames are read, by kind (`arcor2_hw.testing.frames`), with the beginnings of lines that
    act, or the objects that may be written only to observe.
    """

    types: list[str]
    protocol: str
    page: str
    versions_tried: VersionsTried
    actions: list[str] | dict[str, list[str]]
    rules: dict[str, list[str]]
    outputs_on_loss: OutputsOnLoss | bool
    limits: list[str]
    conformance: Conformance = Conformance.PENDING
    not_run: dict[str, str] = field(default_factory=dict)
    level: Literal["none", "bronze", "silver", "gold"] = "none"
    tests: str | Unset = UNSET
    report: str | Unset = UNSET
    frames: dict[str, list[str]] = field(default_factory=dict)

    @property
    def claimed(self) -> Level:
        """Give the level that is claimed."""
        return Level[self.level.upper()]

    def __post_init__(self) -> None:
        if not self.types:
            raise ValueError("types names no object type")
        for what, reason in self.not_run.items():
            if len(reason.split()) < 3:
                raise ValueError(f"not_run: {what} needs a reason that a reader understands, not {reason!r}")
        if unknown := set(self.frames) - set(KINDS):
            raise ValueError(f"frames: there is no kind {', '.join(sorted(unknown))}; there are {', '.join(KINDS)}")

    def actions_of(self, type_name: str) -> list[str]:
        """Give the actions that are claimed for a type."""
        return self.actions.get(type_name, []) if isinstance(self.actions, dict) else self.actions

    def reason(self, type_name: str, case: str) -> str | None:
        """Give the written reason for which a case is not run on a type; None when there is none."""
        for key in (f"{type_name}.{case}", case):
            if key in self.not_run:
                return self.not_run[key]
        return None


def is_bench(path: Path) -> bool:
    """Tell whether the file asks for the whole suite, also where the rest of it is not in order."""
    return _Declared.of(path).conformance == Conformance.BENCH


class _Declared(msgspec.Struct):
    """The one key that decides whether a problem of the file is a failure."""

    conformance: str = Conformance.PENDING.value

    @classmethod
    def of(cls, path: Path) -> "_Declared":
        try:
            return msgspec.yaml.decode(_read(path), type=cls)
        except (InvalidData, NotFound, msgspec.DecodeError):
            return cls()


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise NotFound(f"there is no {FILE} in {path.parent.name}") from None
    except OSError as error:
        raise InvalidData(f"{path.parent.name}/{FILE} cannot be read: {error.strerror}") from None


def read(path: Path) -> Quality:
    """Read a quality.yaml. Raises NotFound, or InvalidData naming folder, key and what is wrong there."""
    try:
        return msgspec.yaml.decode(_read(path), type=Quality)
    except msgspec.DecodeError as error:  # also for a wrong value
        raise InvalidData(f"{path.parent.name}/{FILE}: {error}") from None

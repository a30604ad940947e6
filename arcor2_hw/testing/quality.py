"""quality.yaml: the claims of a driver, next to its source."""

import enum
import functools
import re
from pathlib import Path
from typing import Final, Literal

import msgspec
from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.testing.frames import KINDS

FILE: Final = "quality.yaml"
_SAYS_TESTED: Final = re.compile(r"\b(tested|test_\w+)\b")


class Conformance(enum.StrEnum):
    """Whether the suite runs on the driver."""

    BENCH = "bench"
    PENDING = "pending"


class Level(enum.IntEnum):
    """Evidence for a driver: bronze: cases on its fake; silver: recovery and faults; gold: a real device."""

    NONE = 0
    BRONZE = 1
    SILVER = 2
    GOLD = 3


class OutputsOnLoss(enum.StrEnum):
    """Reaction of the outputs of the device to a connection loss."""

    HOLD = "hold"
    OFF = "off"
    ON = "on"
    SETTING = "setting"
    NONE = "none"


class VersionsTried(Data, frozen=True, forbid_unknown_fields=True):
    """Versions with which the driver was tested; `hardware` names model and firmware, or is "none"."""

    library: str
    controller: list[str]
    hardware: str | list[str]


class Quality(Data, frozen=True, forbid_unknown_fields=True):
    """The claims of one driver folder.

    Attributes:
        rules: By rule, numbered as in docs/reference/object-types.md, the tests that show it.
        not_run: By case of the suite, or by `Type.case`, why it cannot be run; a whole type by its name.
        instead: By entry of `not_run`, the tests that show the behaviour instead of the suite. Required for a whole
            type and for a reason that says that something is tested.
        actions: Actions of all types, or by type.
        outputs_on_loss: YAML reads off and on as false and true, which are accepted.
        level: The claimed level; the suite checks it.
        tests: Folder of the tests in `rules`, from the project's root; default: all test folders.
        report: File in this folder, written by a run on the real device.
        not_on_hardware: By case, why it did not pass on the real device of the report although it passes on the fake.
        frames: How the driver's frames are read, by kind (`arcor2_hw.testing.frames`), with the first words of lines
            that act, or the objects that may be written for observation.
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
    instead: dict[str, list[str]] = field(default_factory=dict)
    level: Literal["none", "bronze", "silver", "gold"] = "none"
    tests: str | Unset = UNSET
    report: str | Unset = UNSET
    not_on_hardware: dict[str, str] = field(default_factory=dict)
    frames: dict[str, list[str]] = field(default_factory=dict)

    @property
    def claimed(self) -> Level:
        """Return the claimed level."""
        return Level[self.level.upper()]

    def named_tests(self) -> dict[str, list[str]]:
        """Return the tests that show the claims, by claim."""
        rules = {f"rule {rule}": tests for rule, tests in self.rules.items()}
        return rules | {f"instead of {entry}": tests for entry, tests in self.instead.items()}

    def __post_init__(self) -> None:
        if not self.types:
            raise ValueError("types names no object type")
        for what, reason in self.not_run.items():
            if len(reason.split()) < 3:
                raise ValueError(f"not_run: {what} needs a reason in words, not {reason!r}")
            if (what in self.types or _SAYS_TESTED.search(reason)) and not self.instead.get(what):
                raise ValueError(f"not_run: {what} needs the tests that show it, under `instead`")
        for what, reason in self.not_on_hardware.items():
            if len(reason.split()) < 3:
                raise ValueError(f"not_on_hardware: {what} needs a reason in words, not {reason!r}")
        if unknown := set(self.instead) - set(self.not_run):
            raise ValueError(f"instead: not_run has no {', '.join(sorted(unknown))}")
        if unknown := set(self.frames) - set(KINDS):
            raise ValueError(f"frames: unknown kind {', '.join(sorted(unknown))}. Available: {', '.join(KINDS)}")

    def actions_of(self, type_name: str) -> list[str]:
        """Return the claimed actions of a type."""
        return self.actions.get(type_name, []) if isinstance(self.actions, dict) else self.actions

    def reason(self, type_name: str, case: str) -> str | None:
        """Return the reason why a case is not run on a type, or None if there is none."""
        for key in (f"{type_name}.{case}", case):
            if key in self.not_run:
                return self.not_run[key]
        return None


def read(path: Path) -> Quality:
    """Read a quality.yaml.

    Raises:
        NotFound: The file does not exist.
        InvalidData: It is invalid; the message names folder, key and error.
    """
    try:
        return _decode(path.read_bytes())
    except FileNotFoundError:
        raise NotFound("{name}/{file} does not exist", file=FILE, name=path.parent.name) from None
    except OSError as error:
        raise InvalidData(
            "{name}/{file} cannot be read: {reason}", name=path.parent.name, file=FILE, reason=error.strerror
        ) from None
    except msgspec.DecodeError as error:  # also raised for a wrong value
        raise InvalidData("{name}/{file}: {reason}", name=path.parent.name, file=FILE, reason=error) from None


@functools.lru_cache(maxsize=4)
def _decode(text: bytes) -> Quality:
    """Decode a quality.yaml, once for the many cases that read the same one."""
    return msgspec.yaml.decode(text, type=Quality)

"""first_day.yaml next to a driver: instructions for a person who uses a real device for the first time."""

import math
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.exceptions import InvalidData

FILE: Final = "first_day.yaml"


class Motion(Data, frozen=True, forbid_unknown_fields=True):
    """A motion of one joint, or a call of an action of the driver.

    Attributes:
        does: What happens, as a sentence. Required for a call.
        joint: Number of the joint, counted from 1.
        by: Distance of the joint, rad (prismatic: m). It moves forth and back between the start and this distance.
        speed: Fraction of the configured speed.
        call: Name of the method.
        arguments: Its arguments.
        asked: By further argument, the question to the person, who types the value.
    """

    does: str = ""
    joint: int | Unset = UNSET
    by: float = 0.0
    speed: float = 0.0
    call: str | Unset = UNSET
    arguments: dict[str, Any] = field(default_factory=dict)
    asked: dict[str, str] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """Return what happens, as a sentence."""
        if isinstance(self.joint, Unset):
            return self.does
        return (
            f"Joint {self.joint} turns by up to {math.degrees(self.by):+.0f}° and back, at {self.speed:.0%} of the "
            f"configured speed.{' ' * bool(self.does)}{self.does}"
        )

    def __post_init__(self) -> None:
        if isinstance(self.joint, Unset) == isinstance(self.call, Unset):
            raise ValueError("a motion needs either joint or call")
        if not isinstance(self.joint, Unset) and not (self.joint > 0 and self.by and 0 < self.speed <= 1):
            raise ValueError("the motion of a joint needs joint from 1 on, by, and speed from 0 to 1")
        if not isinstance(self.call, Unset) and not self.does:
            raise ValueError("a call needs does, the sentence that the person confirms")


class Elsewhere(Data, frozen=True, forbid_unknown_fields=True):
    """Instructions for giving control to another client, such as the pendant, and taking it back."""

    take: str
    give_back: str


class FirstDay(Data, frozen=True, forbid_unknown_fields=True):
    """The first day with one object type.

    Attributes:
        before: What to do before the device is connected.
        limits: Settings of the object that limit motion, force or outputs.
        device_limits: Limits to set in the device itself.
        ready: What to do before control is taken.
        small: A motion of some millimetres or degrees, or a short output.
        full: A motion of at least 5 s.
        elsewhere: Instructions for giving control to another client.
        ask: Method without arguments that communicates with the device; "small" for the small motion.
        display: Where the device itself shows its readings.
        wire: Settings and fixed ports of the connection, as in cell.yaml.
        single_client: Whether the device accepts one connection only.
    """

    before: list[str] = field(default_factory=list)
    limits: list[str] = field(default_factory=list)
    device_limits: list[str] = field(default_factory=list)
    ready: list[str] = field(default_factory=list)
    small: Motion | Unset = UNSET
    full: Motion | Unset = UNSET
    elsewhere: Elsewhere | Unset = UNSET
    ask: str | Unset = UNSET
    display: str | Unset = UNSET
    wire: list[str | int] | Unset = UNSET
    single_client: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.small, Unset) or isinstance(self.full, Unset) or isinstance(self.full.joint, Unset):
            return
        if abs(self.full.by) < 2 * abs(self.small.by):  # otherwise repeated motions may leave the confirmed range
            raise ValueError("the full motion must be at least twice as long as the small one")


def read(folder: Path) -> dict[str, FirstDay]:
    """Return the declarations in a driver's folder by object type, empty without a first_day.yaml.

    Raises:
        InvalidData: It is invalid; the message names folder, key and error.
    """
    path = folder / FILE
    try:
        return msgspec.yaml.decode(path.read_bytes(), type=dict[str, FirstDay])
    except FileNotFoundError:
        return {}
    except (OSError, msgspec.DecodeError) as error:
        raise InvalidData("{name}/{file}: {reason}", name=folder.name, file=FILE, reason=error) from None

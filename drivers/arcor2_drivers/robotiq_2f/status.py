"""Status, commands and faults of the gripper, independent of the wire."""

import dataclasses
import enum
from typing import Final, NamedTuple, Protocol

from arcor2_hw.data.device import Health, Severity
from arcor2_hw.messages import Message


class Object(enum.IntEnum):
    """Object detection (gOBJ)."""

    MOVING = 0
    CONTACT_OPENING = 1
    CONTACT_CLOSING = 2
    ARRIVED = 3


class Activation(enum.IntEnum):
    """Activation status (gSTA)."""

    RESET = 0
    ACTIVATING = 1
    ACTIVE = 3


HELD: Final = (Object.CONTACT_OPENING, Object.CONTACT_CLOSING)


@dataclasses.dataclass(frozen=True)
class Status:
    """Status of the gripper. `echo` is the position request that the gripper uses."""

    act: bool
    go_to: bool
    activation: Activation
    object: Object
    fault: int
    echo: int
    position: int

    @property
    def active(self) -> bool:
        """Return whether the gripper is activated."""
        return self.act and self.activation is Activation.ACTIVE

    @property
    def moving(self) -> bool:
        """Return whether the fingers move."""
        return self.activation is Activation.ACTIVATING or (
            self.active and self.go_to and self.object is Object.MOVING and self.fault < FIRST_MAJOR_FAULT
        )


@dataclasses.dataclass(frozen=True)
class Command:
    """A command; values that are None stay unchanged."""

    act: bool = True
    go_to: bool = True
    position: int | None = None
    speed: int | None = None
    force: int | None = None


class Link(Protocol):
    """A connection to the gripper. Its errors name the device and its address."""

    who: str | Message

    def open(self, timeout: float) -> None:
        """Open within `timeout` s; nothing is sent."""

    def close(self) -> None:
        """Close, if open; a pending request fails at once."""

    def read(self) -> Status:
        """Read the status. If values are read one by one, the object status is read after the requests."""

    def write(self, command: Command) -> None:
        """Send a command; never repeated."""


class Fault(NamedTuple):
    """Text and remedy of a fault."""

    text: str
    remedy: str
    severity: Severity
    health: Health


FIRST_MAJOR_FAULT: Final = 0x0A
"""Lowest code of the faults that only a reset clears."""
_REACTIVATE: Final = "; acknowledge the fault, then activate the gripper"

FAULTS: Final = {
    0x05: Fault(
        "action delayed: the activation must be completed first",
        "wait for the activation",
        Severity.WARNING,
        Health.CHECK_FUNCTION,
    ),
    0x07: Fault("the gripper is not activated", "activate the gripper", Severity.WARNING, Health.CHECK_FUNCTION),
    0x08: Fault(
        "the maximum operating temperature is exceeded", "let the gripper cool down", Severity.WARNING, Health.OFF_SPEC
    ),
    0x09: Fault(
        "no communication for at least 1 s", "check the cable and the host", Severity.INFO, Health.CHECK_FUNCTION
    ),
    0x0A: Fault(
        "under the minimum operating voltage", "check the 24 V supply" + _REACTIVATE, Severity.ERROR, Health.FAILURE
    ),
    0x0B: Fault(
        "automatic release in progress", "wait until it is completed" + _REACTIVATE, Severity.ERROR, Health.FAILURE
    ),
    0x0C: Fault("internal fault", "switch the gripper off and on" + _REACTIVATE, Severity.ERROR, Health.FAILURE),
    0x0D: Fault(
        "activation fault: something interferes",
        "clear the space between and around the fingers" + _REACTIVATE,
        Severity.ERROR,
        Health.FAILURE,
    ),
    0x0E: Fault("overcurrent", "find what jams the fingers" + _REACTIVATE, Severity.ERROR, Health.FAILURE),
    0x0F: Fault("automatic release completed", "remove the part" + _REACTIVATE, Severity.ERROR, Health.FAILURE),
}
"""gFLT, 2F-85 & 2F-140 instruction manual, section 4 (fault status)."""


def fault_of(code: int) -> Fault:
    """Return text and remedy of a fault; an unknown code counts as a failure."""
    unknown = Fault("unknown fault", "see the manual" + _REACTIVATE, Severity.ERROR, Health.FAILURE)
    return FAULTS.get(code, unknown)

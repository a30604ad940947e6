"""What the gripper tells and is told, whatever the wire; its faults with text and remedy."""

import dataclasses
import enum
from typing import Final, NamedTuple, Protocol

from arcor2_hw.data.device import Health, Severity


class Object(enum.IntEnum):
    """gOBJ: object detection."""

    MOVING = 0
    CONTACT_OPENING = 1
    CONTACT_CLOSING = 2
    ARRIVED = 3


class Activation(enum.IntEnum):
    """gSTA."""

    RESET = 0
    ACTIVATING = 1
    ACTIVE = 3


HELD: Final = (Object.CONTACT_OPENING, Object.CONTACT_CLOSING)


@dataclasses.dataclass(frozen=True)
class Status:
    """One reading. `echo` is the position request as the gripper has it."""

    act: bool
    go_to: bool
    activation: Activation
    object: Object
    fault: int
    echo: int
    position: int

    @property
    def active(self) -> bool:
        """Tell whether it is activated and obeys."""
        return self.act and self.activation is Activation.ACTIVE

    @property
    def moving(self) -> bool:
        """Tell whether the fingers move."""
        return self.activation is Activation.ACTIVATING or (
            self.active and self.go_to and self.object is Object.MOVING and self.fault < FIRST_MAJOR
        )


@dataclasses.dataclass(frozen=True)
class Command:
    """What is asked for: only what differs from None is sent on a wire that can."""

    act: bool = True
    go_to: bool = True
    position: int | None = None
    speed: int | None = None
    force: int | None = None


class Link(Protocol):
    """A wire. Every error names the device and its address."""

    who: str

    def open(self, timeout: float) -> None:
        """Open within `timeout` s; nothing is asked."""

    def close(self) -> None:
        """Close; harmless when closed. A request that waits for its answer fails at once."""

    def read(self) -> Status:
        """Read; where one after the other, the object status after the requests it belongs to, and then the width."""

    def write(self, command: Command) -> None:
        """Command; never sent a second time."""


class Fault(NamedTuple):
    """What a fault means, and what to do about it."""

    text: str
    remedy: str
    severity: Severity
    health: Health


FIRST_MAJOR: Final = 0x0A
"""From here on only a reset ends a fault."""
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
        "the maximum operating temperature is exceeded",
        "let the gripper cool down",
        Severity.WARNING,
        Health.OFF_SPEC,
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
    0x0E: Fault("overcurrent", "look for what jams the fingers" + _REACTIVATE, Severity.ERROR, Health.FAILURE),
    0x0F: Fault("automatic release completed", "take the part away" + _REACTIVATE, Severity.ERROR, Health.FAILURE),
}
"""gFLT, 2F-85 & 2F-140 instruction manual, section 4 (fault status)."""


def fault_of(code: int) -> Fault:
    """Give what a fault means; one the manual does not know is severe."""
    unknown = Fault(f"fault {code}", "see the manual" + _REACTIVATE, Severity.ERROR, Health.FAILURE)
    return FAULTS.get(code, unknown)

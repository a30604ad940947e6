"""Alarms of the Magician and their remedies. Source: Dobot, "Alarm Description"."""

from typing import Final

from arcor2_hw.data.device import Severity

RESET: Final = 0x00
"""Active after the arm was switched on; it does not prevent motion."""

_PLAN: Final = "Choose a target within reach, or another path to it, then acknowledge."
_LIMIT: Final = "Move the arm away from the limit by hand (unlock button), acknowledge, then home it."
_SERVICE: Final = "Switch the arm off and on, then home it. If the alarm returns, have the arm repaired."

_TEXTS: Final[dict[int, tuple[str, str]]] = {
    0x00: ("the arm was reset", "Home the arm, then acknowledge."),
    0x01: ("the controller received an unknown instruction", _SERVICE),
    0x02: ("the controller's file system has failed", _SERVICE),
    0x03: ("the communication between the controller's processors failed", _SERVICE),
    0x04: ("an angle sensor cannot be read", _SERVICE),
    0x10: ("the planned target cannot be resolved to joint angles", _PLAN),
    0x11: ("the planned target is beyond the workspace", _PLAN),
    0x12: ("points of an arc coincide", _PLAN),
    0x13: ("the parameters of an arc are invalid", _PLAN),
    0x14: ("the parameters of a jump are invalid", "Check jump_height and jump_limit, then acknowledge."),
    0x20: ("the path led to a position that cannot be resolved to joint angles", _PLAN),
    0x21: ("the path led beyond the workspace", _PLAN),
    0x22: ("points of an arc coincide on the path", _PLAN),
    0x23: ("the parameters of an arc are invalid on the path", _PLAN),
    0x24: ("the parameters of a jump are invalid on the path", _PLAN),
    **{0x30 + i: (f"joint {i + 1} was too fast", "Lower the speed, then acknowledge.") for i in range(4)},
    **{0x40 + 2 * i: (f"joint {i + 1} is at its positive limit", _LIMIT) for i in range(4)},
    **{0x41 + 2 * i: (f"joint {i + 1} is at its negative limit", _LIMIT) for i in range(4)},
    0x48: ("the parallelogram is at its positive limit", _LIMIT),
    0x49: ("the parallelogram is at its negative limit", _LIMIT),
    **{
        0x50 + i: (f"joint {i + 1} has lost steps", "Remove the obstacle, acknowledge, then home it.") for i in range(4)
    },
}


def describe(code: int) -> tuple[str, str, Severity]:
    """Return text, remedy and severity of an alarm."""
    text, remedy = _TEXTS.get(code, (f"alarm {code:02X}h", "See the vendor's alarm description, then acknowledge."))
    if code == RESET:
        return text, remedy, Severity.INFO
    return text, remedy, Severity.CRITICAL if code < 0x10 else Severity.ERROR


def codes(bits: bytes) -> frozenset[int]:
    """Return the codes in a bit field (id 20), lowest bit of the first byte first."""
    return frozenset(8 * i + bit for i, byte in enumerate(bits) for bit in range(8) if byte >> bit & 1)


def title(code: int) -> str:
    """Return a code as the vendor writes it."""
    return f"{code:02X}h"

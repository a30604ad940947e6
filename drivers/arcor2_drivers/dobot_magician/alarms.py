"""Alarms of the Magician and their remedies.

Source: Dobot, "Alarm Description"; the order of the codes from 10h and 20h on is that of the vendor's alarms.h.
"""

from typing import Final

from arcor2_hw.data.device import Severity
from arcor2_hw.messages import Message, translatable

RESET: Final = 0x00
"""Active after the arm was switched on; it does not prevent motion."""

_PLAN: Final = "Choose a target within reach, or another path to it, then acknowledge."
_LIMIT: Final = "Move the arm away from the limit by hand (unlock button), acknowledge, then home it."
_SERVICE: Final = "Switch the arm off and on, then home it. If the alarm returns, have the arm repaired."

_TEXTS: Final[dict[int, tuple[str | Message, str]]] = translatable(
    {
        0x00: ("the arm was reset", "Home the arm, then acknowledge."),
        0x01: ("the controller received an unknown instruction", _SERVICE),
        0x02: ("the controller's file system has failed", _SERVICE),
        0x03: ("the communication between the controller's processors failed", _SERVICE),
        0x04: ("an angle sensor cannot be read", _SERVICE),
        0x10: ("the planned target cannot be resolved to joint angles", _PLAN),
        0x11: ("the planned target is beyond the workspace", _PLAN),
        0x12: ("the planned target is beyond a joint limit", _PLAN),
        0x13: ("points of an arc coincide", _PLAN),
        0x14: ("the parameters of an arc are invalid", _PLAN),
        0x15: ("the parameters of a jump are invalid", "Check jump_height and jump_limit, then acknowledge."),
        0x20: ("the path led to a position that cannot be resolved to joint angles", _PLAN),
        0x21: ("the path led beyond the workspace", _PLAN),
        0x22: ("the path led beyond a joint limit", _PLAN),
        **{
            0x30 + i: (Message.of("joint {number} was too fast", number=i + 1), "Lower the speed, then acknowledge.")
            for i in range(4)
        },
        **{
            0x40 + 2 * i: (Message.of("joint {number} is at its positive limit", number=i + 1), _LIMIT)
            for i in range(4)
        },
        **{
            0x41 + 2 * i: (Message.of("joint {number} is at its negative limit", number=i + 1), _LIMIT)
            for i in range(4)
        },
        0x48: ("the parallelogram is at its positive limit", _LIMIT),
        0x49: ("the parallelogram is at its negative limit", _LIMIT),
        **{
            0x50 + i: (
                Message.of("joint {number} has lost steps", number=i + 1),
                "Remove the obstacle, acknowledge, then home it.",
            )
            for i in range(4)
        },
    }
)


def describe(code: int) -> tuple[str | Message, str, Severity]:
    """Return text, remedy and severity of an alarm."""
    unknown = (
        Message.of("alarm {code}", code=title(code)),
        translatable("See the vendor's alarm description, then acknowledge."),
    )
    text, remedy = _TEXTS.get(code, unknown)
    if code == RESET:
        return text, remedy, Severity.INFO
    return text, remedy, Severity.CRITICAL if code < 0x10 else Severity.ERROR


def codes(bits: bytes) -> frozenset[int]:
    """Return the codes in a bit field (id 20), lowest bit of the first byte first."""
    return frozenset(8 * i + bit for i, byte in enumerate(bits) for bit in range(8) if byte >> bit & 1)


def title(code: int) -> str:
    """Return a code as the vendor writes it."""
    return f"{code:02X}h"

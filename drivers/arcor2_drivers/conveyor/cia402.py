"""Parts of CiA 301 and 402: indices, states and control words. Pure functions."""

import enum
from typing import Final, NamedTuple


class Entry(NamedTuple):
    """An entry of the object dictionary with the struct format of its value and its name."""

    at: int
    subindex: int
    form: str
    title: str


DEVICE_TYPE: Final = Entry(0x1000, 0, "<I", "device type")
CONSUMER_HEARTBEAT: Final = Entry(0x1016, 1, "<I", "consumer heartbeat")
VENDOR: Final = Entry(0x1018, 1, "<I", "vendor")
PRODUCT: Final = Entry(0x1018, 2, "<I", "product")
REVISION: Final = Entry(0x1018, 3, "<I", "revision")
SERIAL: Final = Entry(0x1018, 4, "<I", "serial number")
ABORT_OPTION: Final = Entry(0x6007, 0, "<h", "abort connection option")
ERROR_CODE: Final = Entry(0x603F, 0, "<H", "error code")
CONTROLWORD: Final = Entry(0x6040, 0, "<H", "control word")
STATUSWORD: Final = Entry(0x6041, 0, "<H", "status word")
QUICK_STOP_OPTION: Final = Entry(0x605A, 0, "<h", "quick stop option")
MODE: Final = Entry(0x6060, 0, "<b", "mode of operation")
MODE_DISPLAY: Final = Entry(0x6061, 0, "<b", "mode of operation display")
POSITION: Final = Entry(0x6064, 0, "<i", "position actual value")
VELOCITY: Final = Entry(0x606C, 0, "<i", "velocity actual value")
TARGET_POSITION: Final = Entry(0x607A, 0, "<i", "target position")
PROFILE_VELOCITY: Final = Entry(0x6081, 0, "<I", "profile velocity")
ACCELERATION: Final = Entry(0x6083, 0, "<I", "profile acceleration")
DECELERATION: Final = Entry(0x6084, 0, "<I", "profile deceleration")
QUICK_STOP_DECELERATION: Final = Entry(0x6085, 0, "<I", "quick stop deceleration")
HOMING_METHOD: Final = Entry(0x6098, 0, "<b", "homing method")
HOMING_SPEED_SEARCH: Final = Entry(0x6099, 1, "<I", "homing speed, search for switch")
HOMING_SPEED_ZERO: Final = Entry(0x6099, 2, "<I", "homing speed, search for zero")
HOMING_ACCELERATION: Final = Entry(0x609A, 0, "<I", "homing acceleration")
TARGET_VELOCITY: Final = Entry(0x60FF, 0, "<i", "target velocity")

PROFILE: Final = 402
QUICK_STOP_ON_LOSS: Final = 3
"""Value of 6007h: quick stop on a lost connection."""
SLOW_DOWN_AND_DISABLE: Final = 2
"""Value of 605Ah: decelerate on the quick stop ramp, then Switch on disabled."""


class Mode(enum.IntEnum):
    """Modes of operation."""

    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6


class Power(enum.StrEnum):
    """States of the drive (CiA 402)."""

    NOT_READY = "Not ready to switch on"
    SWITCH_ON_DISABLED = "Switch on disabled"
    READY = "Ready to switch on"
    SWITCHED_ON = "Switched on"
    ENABLED = "Operation enabled"
    QUICK_STOP = "Quick stop active"
    FAULT_REACTION = "Fault reaction active"
    FAULT = "Fault"


_STATES: Final = (
    (0x4F, 0x00, Power.NOT_READY),
    (0x4F, 0x40, Power.SWITCH_ON_DISABLED),
    (0x6F, 0x21, Power.READY),
    (0x6F, 0x23, Power.SWITCHED_ON),
    (0x6F, 0x27, Power.ENABLED),
    (0x6F, 0x07, Power.QUICK_STOP),
    (0x4F, 0x0F, Power.FAULT_REACTION),
    (0x4F, 0x08, Power.FAULT),
)
FAULTY: Final = frozenset({Power.FAULT, Power.FAULT_REACTION})
SWITCHED_OFF: Final = frozenset({Power.SWITCH_ON_DISABLED, Power.READY, Power.SWITCHED_ON, Power.FAULT})
"""States without torque."""

TARGET_REACHED: Final = 1 << 10
SETPOINT_ACKNOWLEDGE: Final = 1 << 12
HOMING_ATTAINED: Final = 1 << 12
HOMING_ERROR: Final = 1 << 13

CW_DISABLE_VOLTAGE: Final = 0x0000
CW_QUICK_STOP: Final = 0x0002
CW_SHUTDOWN: Final = 0x0006
CW_SWITCH_ON: Final = 0x0007
CW_ENABLE: Final = 0x000F
CW_START: Final = 0x0010
CW_AT_ONCE: Final = 0x0020
CW_RELATIVE: Final = 0x0040
CW_FAULT_RESET: Final = 0x0080
CW_HALT: Final = 0x0100


def power(statusword: int) -> Power:
    """Return the state in a status word. Raises ValueError for an invalid one."""
    for mask, value, state in _STATES:
        if statusword & mask == value:
            return state
    raise ValueError(f"status word {statusword:04X}h is not a state of CiA 402")


class State(NamedTuple):
    """State of the drive; position in counts, velocity in counts/s."""

    power: Power
    statusword: int
    mode: int
    position: int
    velocity: int
    error_code: int

    @classmethod
    def of(cls, statusword: int, mode: int, position: int, velocity: int, error_code: int) -> "State":
        """Return the state with a status word. Raises ValueError for an invalid one."""
        return cls(power(statusword), statusword, mode, position, velocity, error_code)

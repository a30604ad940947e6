"""Control table of X-series servos: addresses, units and bits in use. Pure functions."""

import math
from typing import Final, NamedTuple

from arcor2_hw.messages import translatable

from .settings import TwoAxisRobotSettings

TICK: Final = math.tau / 4096
"""Angle of one step of the encoder, rad."""
MIDDLE: Final = 2048
VELOCITY: Final = 0.229 * math.tau / 60.0
"""Unit of velocities, rad/s."""
ACCELERATION: Final = 214.577 * math.tau / 3600.0
"""Unit of accelerations, rad/s²."""
CURRENT: Final = 2.69e-3
"""Unit of currents, A."""
WATCHDOG: Final = 0.02
"""Unit of the bus watchdog, s."""
TRIPPED: Final = 0xFF
POSITION_CONTROL: Final = 3


class Register(NamedTuple):
    """Address and size of a register, bytes."""

    address: int
    size: int


OPERATING_MODE: Final = Register(11, 1)
HOMING_OFFSET: Final = Register(20, 4)
CURRENT_LIMIT: Final = Register(38, 2)
MAX_POSITION: Final = Register(48, 4)
MIN_POSITION: Final = Register(52, 4)
TORQUE: Final = Register(64, 1)
LED: Final = Register(65, 1)
HARDWARE_ERROR: Final = Register(70, 1)
BUS_WATCHDOG: Final = Register(98, 1)
PROFILE_ACCELERATION: Final = Register(108, 4)
PROFILE_VELOCITY: Final = Register(112, 4)
GOAL: Final = Register(116, 4)
MOVING: Final = Register(122, 1)
PRESENT_CURRENT: Final = Register(126, 2)
PRESENT_VELOCITY: Final = Register(128, 4)
PRESENT_POSITION: Final = Register(132, 4)
VOLTAGE: Final = Register(144, 2)
TEMPERATURE: Final = Register(146, 1)

PARAMETERS: Final = {
    "drive mode": Register(10, 1),
    "operating mode": OPERATING_MODE,
    "moving threshold": Register(24, 4),
    "temperature limit": Register(31, 1),
    "max voltage limit": Register(32, 2),
    "min voltage limit": Register(34, 2),
    "PWM limit": Register(36, 2),
    "velocity limit": Register(44, 4),
    "max position limit": MAX_POSITION,
    "min position limit": MIN_POSITION,
    "shutdown": Register(63, 1),
}
"""Registers of the EEPROM area that a technician sets up, by their name in the manual.

The driver writes homing offset and current limit from its settings. Identifier and baud rate address the servo.
"""
PARAMETER_UNITS: Final = {
    "moving threshold": "0.229 rpm",
    "temperature limit": "°C",
    "max voltage limit": "0.1 V",
    "min voltage limit": "0.1 V",
    "PWM limit": "0.113 %",
    "velocity limit": "0.229 rpm",
    "max position limit": "0.088°",
    "min position limit": "0.088°",
}
"""Units of these registers."""

STATE: Final = Register(64, 83)
"""All registers that change, read at once."""
EEPROM: Final = Register(0, 64)
"""All registers of the setup."""

HARDWARE_ERRORS: Final = translatable(
    {
        0: ("input voltage out of range", "Check the supply"),
        2: ("overheating", "Let it cool down, and reduce the load"),
        3: ("encoder fault", "Replace the servo"),
        4: ("electrical shock, or not enough power", "Check supply and wiring"),
        5: ("overload", "Remove what blocks the joint"),
    }
)
STATUS_ERRORS: Final = translatable(
    {
        1: "the instruction failed",
        2: "the instruction is unknown",
        3: "the packet was damaged",
        4: "the value is out of range, or its bus watchdog has tripped",
        5: "the length of the data is wrong",
        6: "the value is beyond the register's limit",
        7: "the register cannot be accessed now",
    }
)


def signed(value: int, size: int) -> int:
    """Return a register's value with its sign; the library returns unsigned values."""
    return value - (1 << 8 * size) if value >> (8 * size - 1) else value


def pick(block: bytes, start: int, register: Register, with_sign: bool = False) -> int:
    """Return a register's value out of a block read from address `start` on."""
    part = block[register.address - start :][: register.size]
    return int.from_bytes(part, "little", signed=with_sign)


class ServoState(NamedTuple):
    """State of a servo at one instant, in the servo's units."""

    torque: bool
    hardware_error: int
    watchdog: int
    profile_acceleration: int
    profile_velocity: int
    goal: int
    moving: bool
    current: int
    velocity: int
    position: int
    voltage: int
    temperature: int


def decode(block: bytes) -> ServoState:
    """Decode the block STATE."""

    def get(register: Register, with_sign: bool = False) -> int:
        return pick(block, STATE.address, register, with_sign)

    return ServoState(
        torque=bool(get(TORQUE)),
        hardware_error=get(HARDWARE_ERROR),
        watchdog=get(BUS_WATCHDOG),
        profile_acceleration=get(PROFILE_ACCELERATION),
        profile_velocity=get(PROFILE_VELOCITY),
        goal=get(GOAL, True),
        moving=bool(get(MOVING)),
        current=get(PRESENT_CURRENT, True),
        velocity=get(PRESENT_VELOCITY, True),
        position=get(PRESENT_POSITION, True),
        voltage=get(VOLTAGE),
        temperature=get(TEMPERATURE),
    )


class ServoSetup(NamedTuple):
    """Setup of a servo, in the servo's units."""

    model: int
    firmware: int
    operating_mode: int
    homing_offset: int
    current_limit: int
    max_position: int
    min_position: int


def decode_setup(block: bytes) -> ServoSetup:
    """Decode the block EEPROM."""
    return ServoSetup(
        model=pick(block, 0, Register(0, 2)),
        firmware=pick(block, 0, Register(6, 1)),
        operating_mode=pick(block, 0, OPERATING_MODE),
        homing_offset=pick(block, 0, HOMING_OFFSET, True),
        current_limit=pick(block, 0, CURRENT_LIMIT),
        max_position=pick(block, 0, MAX_POSITION),
        min_position=pick(block, 0, MIN_POSITION),
    )


def to_ticks(angle: float, direction: int) -> int:
    """Return the servo's position for a joint's angle, rad."""
    return MIDDLE + direction * round(angle / TICK)


def to_angle(ticks: int, direction: int) -> float:
    """Return the joint's angle, rad, for a servo's position."""
    return direction * (ticks - MIDDLE) * TICK


def profile(speed: float, acceleration: float) -> tuple[int, int]:
    """Return profile acceleration and velocity for rad/s² and rad/s; never 0, which means no limit."""
    return max(1, round(acceleration / ACCELERATION)), max(1, round(speed / VELOCITY))


def wanted_setup(settings: TwoAxisRobotSettings, joint: int) -> dict[Register, int]:
    """Return the setup that the settings require for the servo of joint 0 or 1."""
    offset = (settings.homing_offset_1, settings.homing_offset_2)[joint]
    return {HOMING_OFFSET: round(offset / TICK), CURRENT_LIMIT: round(settings.current_limit / CURRENT)}

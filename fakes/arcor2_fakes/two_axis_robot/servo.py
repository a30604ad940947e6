"""One servo: control table and motion, independent of packets."""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

TICKS: Final = 4096  # per turn
VELOCITY_UNIT: Final = 0.229 * TICKS / 60.0  # ticks/s
ACCELERATION_UNIT: Final = 214.577 * TICKS / 3600.0  # ticks/s²
WATCHDOG_UNIT: Final = 0.02  # s
MAX_ACCELERATION: Final = 80_000.0  # ticks/s²: acceleration of the motor without a profile
STEP: Final = 0.001  # s
REBOOT_TIME: Final = 0.3  # s without an answer
EEPROM_END: Final = 64
TABLE_END: Final = 147
TRIPPED: Final = 0xFF

OK, RESULT_FAIL, BAD_INSTRUCTION, BAD_CRC, BAD_RANGE, BAD_LENGTH, BAD_LIMIT, NO_ACCESS = range(8)
ALERT: Final = 0x80


class Field(NamedTuple):
    """A register: address, size, value after a reset, and range that may be written (none: read only)."""

    address: int
    size: int
    default: int = 0
    low: int | None = None
    high: int = 0
    signed: bool = False


FIELDS: Final = {
    "model": Field(0, 2, 1020),
    "firmware": Field(6, 1, 45),
    "id": Field(7, 1, 1),
    "baud_rate": Field(8, 1, 3, 0, 7),
    "drive_mode": Field(10, 1, 0, 0, 5),
    "operating_mode": Field(11, 1, 3, 0, 16),
    "homing_offset": Field(20, 4, 0, -1024, 1024, signed=True),
    "moving_threshold": Field(24, 4, 10, 0, 1023),
    "temperature_limit": Field(31, 1, 80, 0, 100),
    "max_voltage_limit": Field(32, 2, 160, 95, 160),
    "min_voltage_limit": Field(34, 2, 95, 95, 160),
    "pwm_limit": Field(36, 2, 885, 0, 885),
    "current_limit": Field(38, 2, 1193, 0, 1193),
    "velocity_limit": Field(44, 4, 200, 0, 1023),
    "max_position": Field(48, 4, 4095, 0, 4095),
    "min_position": Field(52, 4, 0, 0, 4095),
    "shutdown": Field(63, 1, 0x34, 0, 255),
    "torque": Field(64, 1, 0, 0, 1),
    "led": Field(65, 1, 0, 0, 1),
    "hardware_error": Field(70, 1),
    "watchdog": Field(98, 1, 0, 0, 127),
    "profile_acceleration": Field(108, 4, 0, 0, 32767),
    "profile_velocity": Field(112, 4, 0, 0, 32767),
    "goal": Field(116, 4, 0, 0, 4095, signed=True),
    "tick": Field(120, 2),
    "moving": Field(122, 1),
    "current": Field(126, 2, 0, signed=True),
    "velocity": Field(128, 4, 0, signed=True),
    "position": Field(132, 4, 0, signed=True),
    "voltage": Field(144, 2, 120),
    "temperature": Field(146, 1, 35),
}
GOALS: Final = ("goal",)
OVERHEATED: Final = 0x04  # of hardware_error


class Servo:
    """A servo with id `number`; `clock` returns monotonic seconds, `position` is that of the shaft, in ticks.

    The clock runs `time_scale` times faster than real time; the bus watchdog runs in real time.
    """

    def __init__(
        self,
        number: int,
        clock: Callable[[], float],
        position: float = 2048.0,
        time_scale: float = 1.0,
        firmware: int = FIELDS["firmware"].default,
    ) -> None:
        self.number = number
        self._time_scale = time_scale
        self._clock = clock
        self._values = {name: field.default for name, field in FIELDS.items()}
        self._values["id"] = number
        self._values["firmware"] = firmware
        self._now = self._instructed_at = self._booted_at = clock()
        self._rebooting_until = -math.inf
        self._shaft = position
        self._speed = 0.0
        self._target = position
        self.absent = False
        self.writes: list[tuple[str, int]] = []

    def __getitem__(self, name: str) -> int:
        return self._values[name]

    # ------------------------------------------------------------------------------------------------ simulated world
    def advance(self) -> None:
        """Advance the simulation to the present."""
        now = self._clock()
        limit = self._values["watchdog"]
        if self._values["torque"] and 0 < limit < TRIPPED:
            trips = self._instructed_at + limit * WATCHDOG_UNIT * self._time_scale
            if trips < now:
                self._move_until(trips)
                self._values["watchdog"] = TRIPPED
                self._halt()
        self._move_until(now)

    def _halt(self) -> None:
        self._speed, self._target = 0.0, self._shaft
        self._values["goal"] = round(self.position)

    @property
    def position(self) -> float:
        """Return the position of the horn as counted by the servo, ticks."""
        return self._shaft + self._values["homing_offset"]

    @property
    def speed(self) -> float:
        """Return the speed, ticks/s."""
        return self._speed

    def place(self, position: float) -> None:
        """Turn the horn by hand. Raise ValueError under torque."""
        self.advance()
        if self._values["torque"]:
            raise ValueError(f"servo {self.number} holds: torque is on")
        self._shaft = self._target = position - self._values["homing_offset"]

    def fail(self, bits: int) -> None:
        """Raise a hardware error, which shuts the servo down."""
        self.advance()
        self._values["hardware_error"] = bits
        self._values["torque"] = 0
        self._speed = 0.0

    def warm(self, temperature: int) -> None:
        """Set the temperature, °C. Above its limit, the servo shuts down."""
        self._values["temperature"] = temperature
        if temperature > self._values["temperature_limit"]:
            self.fail(self._values["hardware_error"] | OVERHEATED)

    def reboot(self) -> None:
        """Reboot: reset the RAM half of the table."""
        self.advance()
        for name, field in FIELDS.items():
            if field.address >= EEPROM_END:
                self._values[name] = field.default
        self._speed = 0.0
        self._booted_at = self._now
        self._rebooting_until = self._now + REBOOT_TIME

    @property
    def answers(self) -> bool:
        """Return whether the servo is connected and has booted."""
        return not self.absent and self._clock() >= self._rebooting_until

    def _move_until(self, until: float) -> None:
        if not self._values["torque"]:
            self._speed = 0.0
        elif self._speed or self._target != self._shaft:
            acceleration = self._values["profile_acceleration"] * ACCELERATION_UNIT or MAX_ACCELERATION
            limit = self._values["velocity_limit"]
            fastest = min(self._values["profile_velocity"] or limit, limit) * VELOCITY_UNIT
            while self._now < until and (self._speed or self._target != self._shaft):
                step = min(STEP, until - self._now)
                self._now += step
                self._step(step, acceleration, fastest)
        self._now = until

    def _step(self, step: float, acceleration: float, fastest: float) -> None:
        left = self._target - self._shaft
        change = acceleration * step
        # Highest speed from which the servo can still stop at the goal, at the middle of this step.
        allowed = math.sqrt(2.0 * acceleration * abs(left) + change * change / 4.0) - change / 2.0
        wanted = math.copysign(min(fastest, max(allowed, 0.0)), left)
        self._speed += max(-change, min(change, wanted - self._speed))
        if abs(left) <= max(abs(self._speed) * step, 0.05) and abs(self._speed) <= 2.0 * change:
            self._shaft, self._speed = self._target, 0.0
        else:
            self._shaft += self._speed * step

    # ------------------------------------------------------------------------------------------------ the bus' side
    @property
    def alert(self) -> int:
        """Return the alert bit of its status packets."""
        return ALERT if self._values["hardware_error"] else 0

    def restart_watchdog(self) -> None:
        """Restart the bus watchdog: an instruction was received."""
        self.advance()
        self._instructed_at = self._now

    def read(self, address: int, size: int) -> bytes | int:
        """Return bytes of the table, or an error."""
        if size < 1 or address + size > TABLE_END:
            return BAD_RANGE
        values = self._values
        values["tick"] = int((self._now - self._booted_at) * 1000.0) % 32768
        values["position"] = round(self.position)
        values["velocity"] = round(self._speed / VELOCITY_UNIT)
        values["moving"] = int(abs(values["velocity"]) > values["moving_threshold"])
        table = bytearray(TABLE_END)
        for name, field in FIELDS.items():
            end = field.address + field.size
            table[field.address : end] = values[name].to_bytes(field.size, "little", signed=values[name] < 0)
        return bytes(table[address : address + size])

    def write(self, address: int, data: bytes) -> int:
        """Write whole registers from `address` on; return an error, or OK."""
        end = address + len(data)
        found = [(n, f) for n, f in FIELDS.items() if address <= f.address and f.address + f.size <= end]
        if not data or end > TABLE_END:
            return BAD_RANGE
        if sum(field.size for _, field in found) != len(data):
            return BAD_LENGTH if found else NO_ACCESS
        new: dict[str, int] = {}
        for name, field in found:
            part = data[field.address - address : field.address - address + field.size]
            new[name] = int.from_bytes(part, "little", signed=field.signed)
            if error := self._error(name, field, new[name]):
                return error
        for name, value in new.items():
            self._store(name, value)
        return OK

    def _error(self, name: str, field: Field, value: int) -> int:
        values = self._values
        if field.low is None or (field.address < EEPROM_END and values["torque"]):
            return NO_ACCESS
        if name in GOALS and values["watchdog"] == TRIPPED:
            return BAD_RANGE
        if name == "torque" and value and values["hardware_error"]:
            return NO_ACCESS
        low, high = field.low, field.high
        if name == "goal":
            low, high = values["min_position"], values["max_position"]
        return OK if low <= value <= high else BAD_LIMIT

    def _store(self, name: str, value: int) -> None:
        self.writes.append((name, value))
        was, self._values[name] = self._values[name], value
        if name == "goal" or (name == "torque" and value and not was):
            goal = self._values["goal"]
            # The encoder resolves whole ticks: a shaft that is at the goal within this resolution does not move.
            self._target = self._shaft if goal == round(self.position) else goal - self._values["homing_offset"]
        elif name == "torque" and not value:
            self._speed = 0.0

"""A fake screwdriver controller on Modbus, written from the table in docs/how-to/modbus-device-from-a-map.md.

It tightens in real time. Not modelled: the feeder, the spindle's temperature, the display of the panel.
"""

import sys
import time
from typing import Any, ClassVar

from arcor2_fakes.register_map import Place, coil, discrete_input, holding_register, input_register
from arcor2_fakes.registers import HOST, MappedDevice, Refusal, serve_device

IDLE, TIGHTENING, OK, NOT_OK = range(4)
SLIPPED = 1
RATES = {1: 1.0, 2: 10.0}  # N m/s, of the programs
TURNING = 3600.0  # tenths of a degree per second


class Screwdriver(MappedDevice):
    """The controller. Its registers are read and written as the table says."""

    places: ClassVar[dict[str, Place]] = {
        "state": input_register(100),
        "fault": input_register(101),
        "torque": input_register(102, "float32", low_first=True),
        "angle": input_register(104, "int32", low_first=True),
        "owner": input_register(110),
        "working": input_register(111, bit=4),
        "screw": discrete_input(7),
        "program": holding_register(4000),
        "limit": holding_register(4002, "float32", low_first=True),
        "watchdog": holding_register(4010),
        "life": holding_register(4011),
        "start": coil(16),
        "reset": coil(17),
        "light": coil(20),
    }
    unrecorded = ("life",)

    def power_on(self) -> None:
        """Switch on, with a screw in the bit."""
        self.slips_at = 100.0  # N m
        self.deaf = self.stuck = False
        self.registers.screw = True

    @property
    def busy(self) -> bool:
        """Return whether it tightens."""
        return bool(self.registers.working)

    def advance(self, now: float) -> None:
        """Turn the screw."""
        if not self.busy:
            return
        values, elapsed = self.registers, now - self.began
        values.torque = min(RATES[values.program] * elapsed, values.limit, self.slips_at)
        values.angle = TURNING * elapsed
        if values.torque == self.slips_at:
            values.fault = SLIPPED
            self._end(NOT_OK)
        elif values.torque == values.limit and not self.stuck:
            self._end(OK)

    def heard(self) -> None:
        """Advance to the present. Only writes to the life register feed the watchdog."""
        self.update()

    def let_go(self) -> None:
        """Stop, because nobody has control any more."""
        if self.busy:
            self._end(IDLE)

    def changed(self, name: str, value: Any) -> None:
        """Handle that the host wrote a register or a coil."""
        if name == "watchdog":
            self.spoke = time.monotonic()
            self.guard(value / 1000.0)
        elif name == "life":
            self.spoke = time.monotonic()
        elif self.owner != HOST:
            raise Refusal("nobody has control")
        elif name == "start" and value and not self.deaf:
            self._start()
        elif name == "start":
            self.let_go()
        elif name == "reset" and value:
            self.registers.fault, self.registers.state = 0, IDLE

    def _start(self) -> None:
        values = self.registers
        if (
            self.busy
            or values.fault
            or not values.screw
            or values.program not in RATES
            or not 0.1 <= values.limit <= 12.0
        ):
            raise Refusal("not ready")
        values.state, values.working, self.began = TIGHTENING, True, time.monotonic()

    def _end(self, state: int) -> None:
        self.registers.state, self.registers.working = state, False

    def set(self, **values: Any) -> None:
        """Set registers, for tests."""
        vars(self.registers).update(values)

    def misbehave(self, deaf: bool = False, stuck: bool = False, slips_at: float = 100.0) -> None:
        """Ignore the start, never reach the torque, or slip at a torque, N m."""
        self.deaf, self.stuck, self.slips_at = deaf, stuck, slips_at


def main() -> int:
    """Run the fake."""
    return serve_device("screwdriver", Screwdriver, "modbus", "set", "misbehave")


if __name__ == "__main__":
    sys.exit(main())

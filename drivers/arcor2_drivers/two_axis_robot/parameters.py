"""Parameters: the setup of both servos in their EEPROM areas, for backups."""

import re
from functools import partial
from typing import Final

from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure
from arcor2_hw.exceptions import InvalidData, Refused

from . import registers as reg
from .bus import Bus
from .observer import Observer

LONGEST: Final = 5.0
"""Time limit for writing all parameters, s. Each takes some milliseconds."""
_NAME: Final = re.compile(r"servo (\d+): (.+)")


class Parameters:
    """Reads and writes the parameters on the thread that uses the bus. A name is "servo 1: velocity limit"."""

    def __init__(self, name: str, observer: Observer, ids: tuple[int, ...]) -> None:
        self._name, self._observer, self._ids = name, observer, ids

    def dump(self) -> list[DeviceParameter]:
        """Read all parameters. Raise NotConnected, ConnectionLost or DeviceTimeout."""
        blocks = self._observer.do(self._read)
        return [
            DeviceParameter(f"servo {joint}: {name}", reg.pick(block, 0, register), reg.PARAMETER_UNITS.get(name, ""))
            for joint, block in enumerate(blocks, start=1)
            for name, register in reg.PARAMETERS.items()
        ]

    def restore(self, parameters: list[DeviceParameter]) -> list[ParameterFailure]:
        """Write parameters and return those that a servo refused. Raise Refused under torque, ConnectionLost."""
        if any(servo.torque for servo in self._observer.fresh().value.servos):
            raise Refused(
                "{name}: parameters can be written only without torque. "
                "Support the arm, and switch its power off and on.",
                name=self._name,
            )
        failures: list[ParameterFailure] = []
        for each in parameters:
            try:
                number, register, value = self._target(each)
                self._observer.do(partial(self._write, number, register, value), timeout=LONGEST)
            except (Refused, InvalidData) as error:
                message = error.message
                failures.append(ParameterFailure(each.name, message.text, **message.translation()))
        self._observer.setups = self._observer.do(self._read_setups)
        return failures

    def _target(self, parameter: DeviceParameter) -> tuple[int, reg.Register, int]:
        found = _NAME.fullmatch(parameter.name)
        joint = int(found[1]) if found is not None else 0
        if found is None or not 1 <= joint <= len(self._ids) or (register := reg.PARAMETERS.get(found[2])) is None:
            raise InvalidData("The servos have no parameter {parameter}.", parameter=parameter.name)
        value = parameter.value
        if type(value) is not int or not 0 <= value < 1 << 8 * register.size:
            raise InvalidData("{value} is not a value of a register of {size} bytes.", value=value, size=register.size)
        return self._ids[joint - 1], register, value

    def _write(self, number: int, register: reg.Register, value: int, bus: Bus) -> None:
        bus.write(number, register, value)

    def _read(self, bus: Bus) -> list[bytes]:
        return [bus.again(partial(bus.read, number, reg.EEPROM)) for number in self._ids]

    def _read_setups(self, bus: Bus) -> tuple[reg.ServoSetup, ...]:
        return tuple(reg.decode_setup(block) for block in self._read(bus))

"""The register map of the block on Modbus."""

from __future__ import annotations

from pymodbus.constants import ExcCodes
from pymodbus.pdu.device import ModbusDeviceIdentification
from pymodbus.simulator import DataType, SimData, SimDevice

from arcor2_fakes.remote_io.block import ANALOG_OUT, DIGITAL, WATCHDOGS, Block, Locked

UNIT_ID = 1
IDENTITY = ModbusDeviceIdentification(  # type: ignore[no-untyped-call]
    info_name={
        "VendorName": "Fake Field Devices",
        "ProductCode": "RIO-16",
        "MajorMinorRevision": "2.0",
        "ProductName": "Remote I/O block",
    }
)
_INPUT_WORDS = 17
_HOLDING_WORDS = 128
_PULSE = 16
_WATCHDOG, _WATCHDOG_STEP, _WATCHDOG_WORDS = 64, 16, 10
_LONGEST_PULSE, _SHORTEST_WATCHDOG, _LONGEST_WATCHDOG = 60000, 100, 60000
_READ_COILS, _READ_INPUT, _READ_DISCRETE, _WRITE_COIL, _WRITE_COILS = 1, 4, 2, 5, 15


class RegisterMap:
    """Maps the block to the registers of a simulated Modbus device."""

    def __init__(self, block: Block) -> None:
        self._block = block

    def device(self) -> SimDevice:
        """Return the device for the Modbus server."""
        return SimDevice(
            UNIT_ID,
            simdata=(
                [SimData(0, values=[False] * DIGITAL, datatype=DataType.BITS)],
                [SimData(0, values=[False] * DIGITAL, datatype=DataType.BITS)],
                [SimData(0, values=[0] * _HOLDING_WORDS, datatype=DataType.REGISTERS)],
                [SimData(0, values=[0] * _INPUT_WORDS, datatype=DataType.REGISTERS)],
            ),
            identity=IDENTITY,
            action=self._access,
        )

    async def _access(
        self,
        function_code: int,
        start_address: int,  # noqa: ARG002 - every table starts at 0
        address: int,
        count: int,
        registers: list[int],
        set_values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        """Update the registers before a read, execute a write."""
        self._block.advance()
        if set_values is not None:
            self._block.writes += 1
            try:
                if function_code in (_WRITE_COIL, _WRITE_COILS):
                    self._write_coils(address, [bool(value) for value in set_values])
                else:
                    return self._write_holding(address, [int(value) for value in set_values])
            except Locked:
                return ExcCodes.DEVICE_FAILURE
        elif function_code == _READ_INPUT:
            registers[:_INPUT_WORDS] = self._image()
        elif function_code == _READ_DISCRETE:
            registers[0] = _bits(self._block.inputs)
        elif function_code in (_READ_COILS, _WRITE_COIL, _WRITE_COILS):
            registers[0] = _bits(self._block.outputs)
        elif not all(_exists(each) for each in range(address, address + count)):
            return ExcCodes.ILLEGAL_ADDRESS
        else:
            registers[:_HOLDING_WORDS] = self._holding()
        return None

    def _image(self) -> list[int]:
        block = self._block
        words = [
            _bits(block.inputs),
            _bits(block.outputs),
            *block.analog_inputs,
            *block.analog_outputs,
            block.diagnosis(),
            *(dog.state for dog in block.watchdogs),
            *(dog.number for dog in block.watchdogs),
        ]
        return [int(word) & 0xFFFF for word in words]

    def _holding(self) -> list[int]:
        words = [0] * _HOLDING_WORDS
        words[:ANALOG_OUT] = self._block.analog_outputs
        for index, dog in enumerate(self._block.watchdogs):
            first = _WATCHDOG + _WATCHDOG_STEP * index
            words[first : first + _WATCHDOG_WORDS] = [
                dog.time_ms,
                dog.number,
                0,
                dog.do_guarded,
                dog.do_switched,
                dog.do_safe,
                dog.ao_guarded,
                dog.ao_switched,
                *dog.ao_safe,
            ]
        return [word & 0xFFFF for word in words]

    def _write_coils(self, first: int, values: list[bool]) -> None:
        self._block.check_unlocked(digital=((1 << len(values)) - 1) << first)
        for number, on in enumerate(values, first):
            self._block.write_digital(number, on=on)

    def _write_holding(self, address: int, values: list[int]) -> ExcCodes | None:
        """Execute all writes of a request, or none."""
        written = dict(enumerate(values, address))
        if not all(_exists(each) for each in written):
            return ExcCodes.ILLEGAL_ADDRESS
        if not all(_allowed(each, value) for each, value in written.items()):
            return ExcCodes.ILLEGAL_VALUE
        self._block.check_unlocked(
            digital=sum(1 << (each - _PULSE) for each in written if _PULSE <= each < _PULSE + DIGITAL),
            analog=sum(1 << each for each in written if each < ANALOG_OUT),
        )
        for each, value in written.items():
            if each < ANALOG_OUT:
                self._block.write_analog(each, _signed(value))
            elif each < _WATCHDOG:
                self._block.pulse(each - _PULSE, value)
            else:
                self._write_watchdog(*divmod(each - _WATCHDOG, _WATCHDOG_STEP), value)
        return None

    def _write_watchdog(self, index: int, place: int, value: int) -> None:
        dog = self._block.watchdogs[index]
        if place == 1:
            self._block.trigger(dog, value)
        elif place == 2:
            self._block.command(dog, value)
        elif place >= 8:
            dog.ao_safe[place - 8] = _signed(value)
        else:
            names = {0: "time_ms", 3: "do_guarded", 4: "do_switched", 5: "do_safe", 6: "ao_guarded", 7: "ao_switched"}
            setattr(dog, names[place], value)


def _exists(address: int) -> bool:
    index, place = divmod(address - _WATCHDOG, _WATCHDOG_STEP)
    return (
        address < ANALOG_OUT
        or _PULSE <= address < _PULSE + DIGITAL
        or (0 <= index < WATCHDOGS and place < _WATCHDOG_WORDS)
    )


def _allowed(address: int, value: int) -> bool:
    if _PULSE <= address < _PULSE + DIGITAL:
        return value <= _LONGEST_PULSE
    if address >= _WATCHDOG and (address - _WATCHDOG) % _WATCHDOG_STEP == 0:
        return value == 0 or _SHORTEST_WATCHDOG <= value <= _LONGEST_WATCHDOG
    if address >= _WATCHDOG and (address - _WATCHDOG) % _WATCHDOG_STEP == 2:
        return value <= 2
    return True


def _bits(values: list[bool]) -> int:
    return sum(value << place for place, value in enumerate(values))


def _signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word

"""The register map of the block on Modbus."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from pymodbus.constants import ExcCodes
from pymodbus.pdu.device import ModbusDeviceIdentification
from pymodbus.simulator import DataType, SimData, SimDevice

from arcor2_fakes.remote_io.block import ANALOG_OUT, DIGITAL, WATCHDOGS, Block, Locked, Watchdog

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
_WATCHDOG, _WATCHDOG_STEP = 64, 16
_READ_COILS, _READ_INPUT, _READ_DISCRETE, _WRITE_COIL, _WRITE_COILS = 1, 4, 2, 5, 15


class Register(NamedTuple):
    """A holding register: allowed values (0, or `shortest` to `longest`), and the outputs it switches (bit masks)."""

    read: Callable[[], int]
    write: Callable[[int], object]
    shortest: int = 1
    longest: int = 0xFFFF
    digital: int = 0
    analog: int = 0


class RegisterMap:
    """Maps the block to the registers of a simulated Modbus device."""

    def __init__(self, block: Block) -> None:
        self._block = block
        self._holding: dict[int, Register] = {}
        for number in range(ANALOG_OUT):
            read, write = partial(self._analog, number), partial(self._write_analog, number)
            self._holding[number] = Register(read, write, analog=1 << number)
        for number in range(DIGITAL):
            pulse = Register(lambda: 0, partial(block.pulse, number), longest=60000, digital=1 << number)
            self._holding[_PULSE + number] = pulse
        for index in range(WATCHDOGS):
            for place, register in enumerate(self._watchdog(index)):
                self._holding[_WATCHDOG + _WATCHDOG_STEP * index + place] = register

    def _analog(self, number: int) -> int:
        return self._block.analog_outputs[number]

    def _write_analog(self, number: int, word: int) -> None:
        self._block.write_analog(number, _signed(word))

    def _watchdog(self, index: int) -> list[Register]:
        def dog() -> Watchdog:
            return self._block.watchdogs[index]

        def attribute(name: str) -> Register:
            return Register(lambda: getattr(dog(), name), lambda value: setattr(dog(), name, value))

        def safe(number: int) -> Register:
            return Register(lambda: dog().ao_safe[number], lambda word: dog().set_safe(number, _signed(word)))

        return [
            attribute("time_ms")._replace(shortest=100, longest=60000),
            Register(lambda: dog().number, lambda number: self._block.trigger(dog(), number)),
            Register(lambda: 0, lambda command: self._block.command(dog(), command), longest=2),
            *(attribute(name) for name in ("do_guarded", "do_switched", "do_safe", "ao_guarded", "ao_switched")),
            *(safe(number) for number in range(ANALOG_OUT)),
        ]

    def device(self) -> SimDevice:
        """Return the device for the Modbus server."""
        bits = [SimData(0, values=[False] * DIGITAL, datatype=DataType.BITS)]
        holding = [SimData(0, values=[0] * _HOLDING_WORDS, datatype=DataType.REGISTERS)]
        inputs = [SimData(0, values=[0] * _INPUT_WORDS, datatype=DataType.REGISTERS)]
        return SimDevice(UNIT_ID, simdata=(bits, bits, holding, inputs), identity=IDENTITY, action=self._access)

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
        block = self._block
        block.advance()
        try:
            if set_values is not None:
                block.writes += 1
                if function_code not in (_WRITE_COIL, _WRITE_COILS):
                    return self._write(dict(enumerate(map(int, set_values), address)))
                block.check_unlocked(digital=((1 << len(set_values)) - 1) << address)
                for number, on in enumerate(set_values, address):
                    block.write_digital(number, on=bool(on))
            elif function_code == _READ_INPUT:
                registers[:_INPUT_WORDS] = self._image()
            elif function_code in (_READ_COILS, _READ_DISCRETE, _WRITE_COIL, _WRITE_COILS):
                registers[0] = _bits(block.inputs if function_code == _READ_DISCRETE else block.outputs)
            else:
                for each in range(address, address + count):
                    registers[each] = self._holding[each].read() & 0xFFFF
        except KeyError:
            return ExcCodes.ILLEGAL_ADDRESS
        except Locked:
            return ExcCodes.DEVICE_FAILURE
        return None

    def _write(self, words: dict[int, int]) -> ExcCodes | None:
        """Execute all writes of a request, or none."""
        writes = [(self._holding[address], word) for address, word in words.items()]
        if not all(word == 0 or register.shortest <= word <= register.longest for register, word in writes):
            return ExcCodes.ILLEGAL_VALUE
        self._block.check_unlocked(
            digital=sum(register.digital for register, _ in writes),
            analog=sum(register.analog for register, _ in writes),
        )
        for register, word in writes:
            register.write(word)
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


def _bits(values: list[bool]) -> int:
    return sum(value << place for place, value in enumerate(values))


def _signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word

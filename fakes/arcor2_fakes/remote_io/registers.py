"""The register map of the block on Modbus."""

from __future__ import annotations

from arcor2_fakes.modbus import ExceptionCode, ModbusRefusal, ModbusTables
from arcor2_fakes.remote_io.block import ANALOG_OUT, DIGITAL, WATCHDOGS, Block, OutputLocked, WatchdogState

_WORDS = ("time_ms", "number", "command", "do_guarded", "do_switched", "do_safe", "ao_guarded", "ao_switched")
_SAFE = ("ao_safe_0", "ao_safe_1")
_HOLDING: dict[int, tuple[str, int]] = {
    **{number: ("analog", number) for number in range(ANALOG_OUT)},
    **{16 + number: ("pulse", number) for number in range(DIGITAL)},
    **{64 + 16 * dog + place: (name, dog) for dog in range(WATCHDOGS) for place, name in enumerate(_WORDS + _SAFE)},
}
"""Contents of each holding register, and the number of the output or watchdog."""
_ALLOWED = {"pulse": range(1, 60001), "time_ms": range(100, 60001), "command": range(1, 3)}
"""Allowed values besides 0; all for other registers."""


class RegisterMap(ModbusTables):
    """Maps the block to the tables of a Modbus device."""

    identity = ("Fake Field Devices", "RIO-16", "2.0", "Remote I/O block")
    coils = discrete_inputs = DIGITAL
    holding_registers, input_registers = 128, 17

    def __init__(self, block: Block) -> None:
        self._block = block

    def request_arrived(self) -> None:
        """Apply the changes that are due."""
        self._block.advance()

    def read_coils(self) -> list[bool]:
        """Return the outputs."""
        return self._block.outputs

    def read_discrete_inputs(self) -> list[bool]:
        """Return the inputs."""
        return self._block.inputs

    def write_coils(self, address: int, values: list[bool]) -> None:
        """Switch outputs."""
        self._block.writes += 1
        self._check_unlocked(digital=((1 << len(values)) - 1) << address)
        for number, on in enumerate(values, address):
            self._block.write_digital(number, on=on)

    def read_input_registers(self) -> list[int]:
        """Return the process image."""
        block = self._block
        digital = [sum(on << place for place, on in enumerate(points)) for points in (block.inputs, block.outputs)]
        watchdogs = [*(dog.state for dog in block.watchdogs), *(dog.number for dog in block.watchdogs)]
        return [*digital, *block.analog_inputs, *block.analog_outputs, block.diagnosis, *watchdogs]

    def read_holding_register(self, address: int) -> int:
        """Return a holding register; pulses and commands read as 0."""
        name, number = self._contents(address)
        if name == "analog":
            return self._block.analog_outputs[number]
        dog = self._block.watchdogs[number]
        return dog.ao_safe[_SAFE.index(name)] if name in _SAFE else getattr(dog, name, 0)

    def write_holding_registers(self, address: int, values: list[int]) -> None:
        """Execute all writes of a request, or none."""
        writes = [(*self._contents(each), word) for each, word in enumerate(values, address)]
        dogs = enumerate(self._block.watchdogs)
        running = {("number", number, dog.number) for number, dog in dogs if dog.state is WatchdogState.RUNNING}
        self._block.writes += not running.issuperset(writes)  # a trigger by the same host is only a keep-alive message
        for name, _, word in writes:
            if word and word not in _ALLOWED.get(name, range(0x10000)):
                raise ModbusRefusal(ExceptionCode.ILLEGAL_VALUE)
        masks = {kind: sum(1 << number for name, number, _ in writes if name == kind) for kind in ("pulse", "analog")}
        self._check_unlocked(masks["pulse"], masks["analog"])
        for name, number, word in writes:
            self._write(name, number, word)

    def _write(self, name: str, number: int, word: int) -> None:
        block, watchdogs = self._block, self._block.watchdogs
        signed = word - 0x10000 if word & 0x8000 else word
        if name == "analog":
            block.write_analog(number, signed)
        elif name == "pulse":
            block.pulse(number, word)
        elif name == "number":
            block.trigger(watchdogs[number], word)
        elif name == "command":
            block.command(watchdogs[number], word)
        elif name in _SAFE:
            watchdogs[number].ao_safe[_SAFE.index(name)] = signed
        else:
            setattr(watchdogs[number], name, word)

    @staticmethod
    def _contents(address: int) -> tuple[str, int]:
        if address not in _HOLDING:
            raise ModbusRefusal(ExceptionCode.ILLEGAL_ADDRESS)
        return _HOLDING[address]

    def _check_unlocked(self, digital: int = 0, analog: int = 0) -> None:
        try:
            self._block.check_unlocked(digital, analog)
        except OutputLocked:
            raise ModbusRefusal(ExceptionCode.DEVICE_FAILURE) from None

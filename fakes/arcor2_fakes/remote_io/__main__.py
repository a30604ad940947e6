"""Start the fake remote I/O block: `python -m arcor2_fakes.remote_io`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from arcor2_fakes.modbus import serial_line, tcp_wire
from arcor2_fakes.process import OwnTime
from arcor2_fakes.program import program
from arcor2_fakes.remote_io.block import ANALOG_IN, DIGITAL, Block
from arcor2_fakes.remote_io.registers import RegisterMap
from arcor2_fakes.serving import Fake


def outputs(block: Block) -> dict[str, Any]:
    """Return the outputs; the cell reads them 100 times per second."""
    block.advance()
    return {"outputs": list(block.outputs), "analog_outputs": list(block.analog_outputs)}


def truth(block: Block) -> dict[str, Any]:
    """Return the real state of the block."""
    return outputs(block) | {
        "inputs": list(block.inputs),
        "analog_inputs": list(block.analog_inputs),
        "watchdogs": [{"state": dog.state.name.lower(), "time_ms": dog.time_ms} for dog in block.watchdogs],
        "writes": block.writes,
        "history": [{"time": at, "output": number, "on": on} for at, number, on in block.history],
    }


def register_commands(fake: Fake, block: Block) -> None:
    """Register the commands of the control channel."""

    def set_inputs(inputs: dict[str, bool]) -> None:
        """Switch several inputs at the same time, as {"3": true}."""
        wanted = {int(number): bool(on) for number, on in inputs.items()}
        if not wanted.keys() <= set(range(DIGITAL)):
            raise ValueError(f"the numbers must be 0 to {DIGITAL - 1}")
        for number, on in wanted.items():
            block.inputs[number] = on

    def set_analog(number: int, raw: int) -> None:
        if number not in range(ANALOG_IN) or not -32768 <= raw <= 32767:
            raise ValueError(f"number must be 0 to {ANALOG_IN - 1}, raw must be a signed 16-bit number")
        block.analog_inputs[number] = raw

    def diagnosis(supply_missing: bool = False, overload: bool = False) -> None:
        block.diagnosis = bool(supply_missing) | bool(overload) << 1

    def power_cycle() -> None:
        block.power_on()
        fake.reset_wires()  # a serial port stays open when the block restarts

    fake.renewable(block.as_delivered)
    fake.commands(
        set_input=lambda number, on: set_inputs({number: on}),
        set_inputs=set_inputs,
        set_analog=set_analog,
        diagnosis=diagnosis,
        watchdogs_start=lambda on=True: setattr(block, "watchdogs_start", bool(on)),  # or do not, by a fault
        power_cycle=power_cycle,
    )


@program("remote_io", "Fake remote I/O block on Modbus TCP or RTU.")
async def main(
    fake: Fake, *, host: str = "127.0.0.1", port: int = 0, serial: bool = False, link: Path | None = None
) -> None:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        host: address to serve Modbus TCP on.
        port: port to serve Modbus TCP on; 0 takes a free one.
        serial: serve Modbus RTU on a pty instead.
        link: Symbolic link to the pty; without it, one in a temporary directory.
    """
    own_time = OwnTime()
    block = Block(own_time)
    registers = RegisterMap(block)
    modbus = serial_line(registers, link) if serial else tcp_wire(registers, host, port)
    register_commands(fake, block)
    fake.wires(("modbus",) if serial else (), modbus=modbus)
    fake.truth(lambda: truth(block))
    fake.channel.source("outputs", lambda: outputs(block))
    own_time.run()
    await fake.run(modbus=modbus)


if __name__ == "__main__":
    sys.exit(main())

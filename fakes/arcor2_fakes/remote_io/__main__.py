"""Starts the fake remote I/O block: `python -m arcor2_fakes.remote_io`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from cyclopts import App

from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.process import announce, run, until_told_to_end
from arcor2_fakes.remote_io.block import ANALOG_IN, DIGITAL, Block
from arcor2_fakes.remote_io.modbus import SerialPort, TcpPort
from arcor2_fakes.remote_io.registers import RegisterMap
from arcor2_fakes.wire import register_faults

app = App(name="arcor2_fakes.remote_io", help="Fake remote I/O block on Modbus TCP or RTU.", version_flags=[])


def truth(block: Block) -> dict[str, Any]:
    """Give what is really so in the block, whatever the wire says."""
    block.advance()
    return {
        "inputs": list(block.inputs),
        "outputs": list(block.outputs),
        "analog_inputs": list(block.analog_inputs),
        "analog_outputs": list(block.analog_outputs),
        "watchdogs": [{"state": dog.state.name.lower(), "time_ms": dog.time_ms} for dog in block.watchdogs],
        "writes": block.writes,
        "history": [{"time": at, "output": number, "on": on} for at, number, on in block.history],
    }


def outputs(block: Block) -> dict[str, Any]:
    """Give the outputs alone, for a world that asks a hundred times a second."""
    block.advance()
    return {"outputs": list(block.outputs), "analog_outputs": list(block.analog_outputs)}


def register_commands(control: ControlServer, block: Block, port: TcpPort | SerialPort) -> None:
    """Make what the world can do to the block known to the control channel."""

    def set_input(number: int, on: bool) -> None:
        if number not in range(DIGITAL):
            raise ValueError(f"number is 0 to {DIGITAL - 1}")
        block.inputs[number] = bool(on)

    def set_inputs(inputs: dict[str, bool]) -> None:
        """Switch several inputs at one instant, as {"3": true}."""
        wanted = {int(number): bool(on) for number, on in inputs.items()}
        if not wanted.keys() <= set(range(DIGITAL)):
            raise ValueError(f"numbers are 0 to {DIGITAL - 1}")
        for number, on in wanted.items():
            block.inputs[number] = on

    def set_analog(number: int, raw: int) -> None:
        if number not in range(ANALOG_IN) or not -32768 <= raw <= 32767:
            raise ValueError(f"number is 0 to {ANALOG_IN - 1}, raw is a signed 16-bit number")
        block.analog_inputs[number] = raw

    def diagnosis(supply_missing: bool = False, overload: bool = False) -> None:
        block.supply_missing, block.overload = bool(supply_missing), bool(overload)

    def power_cycle() -> None:
        block.power_on()
        port.reset()

    async def renew() -> None:
        """Be as it is when the process starts: for tests that share one."""
        block.as_delivered()
        await port.fault("heal")
        port.reset()

    control.command("renew", renew)
    control.command("set_input", set_input)
    control.command("set_inputs", set_inputs)
    control.command("set_analog", set_analog)
    control.command("diagnosis", diagnosis)
    control.command("power_cycle", power_cycle)


@app.default
def main(
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    serial: bool = False,
    link: Path | None = None,
    control: str = "127.0.0.1:0",
) -> int:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        host: address to serve Modbus TCP on.
        port: port to serve Modbus TCP on; 0 takes a free one.
        serial: serve Modbus RTU on a pty instead.
        link: symbolic link to keep on the pty, whose own path changes when it is unplugged and plugged.
        control: HOST:PORT of the control channel; port 0 takes a free one.
    """
    try:
        control_host, control_port = parse_address(control)
    except ValueError as e:
        sys.stderr.write(f"remote_io: {e}\n")
        return 2

    async def body() -> None:
        block = Block()
        registers = RegisterMap(block)
        modbus = SerialPort(registers, link) if serial else TcpPort(host, port, registers)
        channel = ControlServer(control_host, control_port)
        register_commands(channel, block, modbus)
        register_faults(channel, {"modbus": modbus}, checked=("modbus",) if serial else ())
        channel.source("truth", lambda: truth(block))
        channel.source("outputs", lambda: outputs(block))
        await modbus.open()
        try:
            announce(name="remote_io", modbus=modbus.address, control=await channel.start())
            await until_told_to_end()
        finally:
            await modbus.close()
            await channel.close()

    return run(body, "remote_io")


if __name__ == "__main__":
    sys.exit(app())

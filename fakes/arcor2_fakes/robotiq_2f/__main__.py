"""Starts the fake gripper: `python -m arcor2_fakes.robotiq_2f`."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.process import announce, run, until_told_to_end
from arcor2_fakes.robotiq_2f.ascii_port import AsciiPort
from arcor2_fakes.robotiq_2f.gripper import Gripper, Mechanics, Pace
from arcor2_fakes.robotiq_2f.rtu_port import RtuPort
from arcor2_fakes.wire import register_faults

app = App(name="arcor2_fakes.robotiq_2f", help="Fake Robotiq 2F gripper.", version_flags=[])


def register_commands(control: ControlServer, gripper: Gripper) -> None:
    """Make what the world and a test can do to the gripper known to the control channel."""
    control.command("put_part", gripper.put_part)
    control.command("remove_part", gripper.remove_part)
    control.command("block", gripper.block)
    control.command("fault", gripper.fault)
    control.command("stops", lambda: list(gripper.stops))
    control.command("power_cycle", gripper.power_cycle)


@app.default
def main(
    *,
    ascii_port: Annotated[str, Parameter(name="--ascii")] = "127.0.0.1:0",
    link: Path | None = None,
    control: str = "127.0.0.1:0",
    stroke: Annotated[float, Parameter(validator=validators.Number(gt=0))] = 0.085,
    latency: Annotated[float, Parameter(validator=validators.Number(gte=0))] = 0.015,
    time_scale: Annotated[float, Parameter(validator=validators.Number(gt=0))] = 1.0,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        ascii_port: HOST:PORT of the URCap's ASCII port; port 0 takes a free one.
        link: symbolic link to keep on the pty of Modbus RTU, whose own path changes when it is unplugged and plugged.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        stroke: width between the fingers when open, m.
        latency: seconds of the gripper's own between a request and its effect.
        time_scale: how much faster than real the gripper is.
    """
    try:
        control_address, ascii_address = parse_address(control), parse_address(ascii_port)
    except ValueError as e:
        sys.stderr.write(f"robotiq_2f: {e}\n")
        return 2

    async def body() -> None:
        loop = asyncio.get_running_loop()
        pace = Pace(loop.time, time_scale)
        gripper = Gripper(pace, Mechanics(stroke=stroke, latency=latency))
        port = AsciiPort(*ascii_address, gripper)
        serial = RtuPort(gripper, link)
        channel = ControlServer(*control_address)
        register_commands(channel, gripper)
        channel.command("pace", pace.set)
        register_faults(channel, {"ascii": port.wire, "rtu": serial.line}, checked=("rtu",))

        def truth() -> dict[str, Any]:
            return {
                **gripper.truth(),
                "sets": list(port.sets),
                "received": list(port.received),
                "writes": list(serial.writes),
            }

        channel.source("truth", truth)
        await serial.line.plug()
        try:
            addresses = {"ascii": await port.wire.listen(), "rtu": serial.line.port}
            announce(name="robotiq_2f", **addresses, control=await channel.start())
            await until_told_to_end()
        finally:
            port.wire.close()
            await serial.line.unplug()
            await channel.close()

    return run(body, "robotiq_2f")


if __name__ == "__main__":
    sys.exit(app())

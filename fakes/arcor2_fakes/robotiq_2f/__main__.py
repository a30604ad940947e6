"""Start the fake gripper: `python -m arcor2_fakes.robotiq_2f`."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from cyclopts.types import NonNegativeFloat, PositiveFloat

from arcor2_fakes.control import parse_address
from arcor2_fakes.modbus import serial_line
from arcor2_fakes.program import program
from arcor2_fakes.robotiq_2f.ascii_port import AsciiPort
from arcor2_fakes.robotiq_2f.gripper import Gripper, Mechanics, Pace
from arcor2_fakes.robotiq_2f.rtu_port import RtuRegisters
from arcor2_fakes.serving import Fake


@program("robotiq_2f", "Fake Robotiq 2F gripper.")
async def main(
    fake: Fake,
    *,
    ascii_port: Annotated[str, Parameter(name="--ascii")] = "127.0.0.1:0",
    link: Path | None = None,
    stroke: PositiveFloat = 0.085,
    latency: NonNegativeFloat = 0.015,
    time_scale: PositiveFloat = 1.0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its addresses, and exits on SIGTERM.

    Args:
        ascii_port: HOST:PORT of the URCap's ASCII port; port 0 takes a free one.
        link: Symbolic link to the pty of Modbus RTU; without it, one in a temporary directory.
        stroke: Width between the open fingers, m.
        latency: Time between a request and its effect, s.
        time_scale: Speed of the simulation; 1 is real time.
    """
    pace = Pace(asyncio.get_running_loop().time, time_scale)
    gripper = Gripper(pace, Mechanics(stroke=stroke, latency=latency))
    port = AsciiPort(*parse_address(ascii_port), gripper)
    registers = RtuRegisters(gripper)
    rtu = serial_line(registers, link)
    fake.commands(
        put_part=gripper.put_part,
        remove_part=gripper.remove_part,
        block=gripper.block,
        fault=gripper.fault,
        stops=lambda: list(gripper.stops),
        power_cycle=gripper.power_cycle,
        pace=pace.set,
    )
    fake.wires(("rtu",), ascii=port.wire, rtu=rtu)

    def truth() -> dict[str, Any]:
        return {
            **gripper.truth(),
            "sets": list(port.sets),
            "received": list(port.received),
            "writes": list(registers.writes),
        }

    fake.truth(truth)
    await fake.run(ascii=port.wire, rtu=rtu)


if __name__ == "__main__":
    sys.exit(main())

"""Start the fake arm: `python -m arcor2_fakes.dobot_magician`."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.dobot_magician.arm import Arm
from arcor2_fakes.dobot_magician.commands import Commands
from arcor2_fakes.process import announce, run, until_told_to_end
from arcor2_fakes.serial_line import PtyLine
from arcor2_fakes.wire import register_faults

_TICK = 0.005  # s
JOINT_TO_ANGLES = 4
"""Mode of a point-to-point motion: joint angles, in degrees."""

app = App(name="arcor2_fakes.dobot_magician", help="Fake Dobot Magician on a pty.", version_flags=[])


def register_commands(control: ControlServer, arm: Arm, commands: Commands) -> None:
    """Register the commands of the control channel."""

    def alarm(code: int) -> None:
        if not 0 <= code < 128:
            raise ValueError("code is 0 to 127")
        arm.raise_alarm(code)

    def wrong_checksum(count: int = 1) -> None:
        if not 0 <= count <= 1000:
            raise ValueError("count is 0 to 1000")
        commands.spoiled = count

    def mute(number: int, on: bool = True) -> None:
        (commands.mute.add if on else commands.mute.discard)(number)

    def renew() -> None:
        arm.as_delivered()
        commands.renew()

    def drive(turn: float, percent: float = 5.0) -> None:
        """Turn the base, like a program on another host."""
        arm.set.speed_ratio = float(percent)
        first, second, third, fourth = arm.joints
        target = (first + float(turn), second, third, fourth)
        arm.enqueue(lambda: arm.point_to_point(JOINT_TO_ANGLES, target))
        arm.running = True

    control.command("renew", renew)

    def pace(factor: float) -> None:
        if not 0.0 < factor <= 100.0:
            raise ValueError("factor is above 0, to 100")
        arm.pace = float(factor)

    control.command("drive", drive)
    control.command("pace", pace)
    control.command("alarm", alarm)
    control.command("wrong_checksum", wrong_checksum)
    control.command("mute", mute)
    control.command("stops", lambda: list(commands.stops))
    control.command("power_cycle", arm.power_cycle)


async def live(arm: Arm) -> None:
    """Advance the simulation."""
    loop = asyncio.get_running_loop()
    last = loop.time()
    while True:
        await asyncio.sleep(_TICK)
        now = loop.time()
        arm.advance(now - last)
        last = now


@app.default
def main(
    *,
    link: Path | None = None,
    control: str = "127.0.0.1:0",
    pace: Annotated[
        float, Parameter(name=("--time-scale", "--pace"), validator=validators.Number(gt=0, lte=100))
    ] = 1.0,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its port and exits on SIGTERM.

    Args:
        link: Symbolic link to the pty, whose path changes when it is unplugged and plugged.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        pace: Speed of the simulation; 1 is real time.
    """
    try:
        control_address = parse_address(control)
    except ValueError as e:
        sys.stderr.write(f"dobot_magician: {e}\n")
        return 2

    async def body() -> None:
        arm = Arm(pace)
        commands = Commands(arm, lambda frame: line.send(frame))
        line = PtyLine(commands.feed, link)

        async def plug() -> str:
            await line.plug()
            return line.port

        async def unplug() -> None:
            await line.unplug()
            commands.drop_input()

        def truth() -> dict[str, Any]:
            return arm.truth() | {"plugged": line.plugged, "port": line.port, "received": list(commands.received)}

        channel = ControlServer(*control_address)
        register_commands(channel, arm, commands)
        register_faults(channel, {"serial": line})
        channel.command("plug", plug)
        channel.command("unplug", unplug)
        channel.source("truth", truth)
        await line.plug()
        life = asyncio.create_task(live(arm))
        try:
            announce(name="dobot_magician", port=line.port, control=await channel.start())
            await until_told_to_end()
        finally:
            life.cancel()
            await asyncio.gather(life, return_exceptions=True)
            await line.unplug()
            await channel.close()

    return run(body, "dobot_magician")


if __name__ == "__main__":
    sys.exit(app())

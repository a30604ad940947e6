"""Start the fake arm: `python -m arcor2_fakes.dobot_magician`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.dobot_magician.arm import Arm
from arcor2_fakes.dobot_magician.commands import Commands
from arcor2_fakes.serial_line import PtyLine
from arcor2_fakes.serving import Fake, serve

_TICK = 0.005  # s
JOINT_TO_ANGLES = 4
"""Mode of a point-to-point motion: joint angles, in degrees."""

app = App(name="arcor2_fakes.dobot_magician", help="Fake Dobot Magician on a pty.", version_flags=[])


def register_commands(fake: Fake, arm: Arm, commands: Commands) -> None:
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
        arm.settings.speed_ratio = float(percent)
        first, second, third, fourth = arm.joints
        target = (first + float(turn), second, third, fourth)
        arm.enqueue(lambda: arm.point_to_point(JOINT_TO_ANGLES, target))
        arm.running = True

    def pace(factor: float) -> None:
        if not 0.0 < factor <= 100.0:
            raise ValueError("factor is above 0, to 100")
        arm.pace = float(factor)

    fake.commands(
        renew=renew,
        drive=drive,
        pace=pace,
        alarm=alarm,
        wrong_checksum=wrong_checksum,
        mute=mute,
        stops=lambda: list(commands.stops),
        power_cycle=arm.power_cycle,
    )


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

    async def body(fake: Fake) -> None:
        arm = Arm(pace)
        commands = Commands(arm, lambda frame: line.send(frame))
        line = PtyLine(commands.feed, link)

        def truth() -> dict[str, Any]:
            return arm.truth() | {"plugged": line.plugged, "port": line.port, "received": list(commands.received)}

        register_commands(fake, arm, commands)
        fake.line(line, commands.drop_input)
        fake.truth(truth)
        fake.simulate(arm.advance, _TICK)
        await fake.run(port=line)

    return serve("dobot_magician", control, body)


if __name__ == "__main__":
    sys.exit(app())

"""Start the fake arm: `python -m arcor2_fakes.dobot_magician`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from arcor2_fakes.control import within
from arcor2_fakes.dobot_magician.arm import Arm
from arcor2_fakes.dobot_magician.commands import Commands
from arcor2_fakes.program import program
from arcor2_fakes.serial_line import PtyLine
from arcor2_fakes.serving import Fake

_TICK = 0.005  # s
JOINT_TO_ANGLES = 4
"""Mode of a point-to-point motion: joint angles, in degrees."""


def register_commands(fake: Fake, arm: Arm, commands: Commands) -> None:
    """Register the commands of the control channel."""

    def alarm(code: int) -> None:
        arm.raise_alarm(within("code", code, 0, 127))

    def wrong_checksum(count: int = 1) -> None:
        commands.spoiled = within("count", count, 0, 1000)

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
            raise ValueError("factor must be above 0 and at most 100")
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


@program("dobot_magician", "Fake Dobot Magician on a pty.")
async def main(
    fake: Fake,
    *,
    link: Path | None = None,
    pace: Annotated[
        float, Parameter(name=("--time-scale", "--pace"), validator=validators.Number(gt=0, lte=100))
    ] = 1.0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its port and exits on SIGTERM.

    Args:
        link: Symbolic link to the pty; without it, one in a temporary directory.
        pace: Speed of the simulation; 1 is real time.
    """
    arm = Arm(pace)
    commands = Commands(arm, lambda frame: line.send(frame))
    line = PtyLine(commands.feed, link)

    register_commands(fake, arm, commands)
    fake.line(line, commands.drop_input)
    fake.truth(lambda: arm.truth() | {"received": list(commands.received)})
    fake.simulate(arm.advance, _TICK)
    await fake.run(port=line)


if __name__ == "__main__":
    sys.exit(main())

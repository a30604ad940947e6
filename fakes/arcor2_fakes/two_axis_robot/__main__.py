"""Start the fake two-axis robot: `python -m arcor2_fakes.two_axis_robot`."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, validators

from arcor2_fakes.control import within
from arcor2_fakes.process import OwnTime
from arcor2_fakes.program import program
from arcor2_fakes.serial_line import PtyLine
from arcor2_fakes.serving import Fake
from arcor2_fakes.two_axis_robot.bus import Bus
from arcor2_fakes.two_axis_robot.servo import TICKS, VELOCITY_UNIT, Servo


def truth(bus: Bus) -> dict[str, Any]:
    """Return the true state, regardless of line faults; angles in rad from the middle."""
    found = {}
    for number, servo in bus.servos.items():
        servo.advance()
        found[str(number)] = {
            "angle": (servo.position - TICKS / 2) * math.tau / TICKS,
            "speed": servo.speed * math.tau / TICKS,
            "ticks": servo.position,
            "answers": servo.answers,
            "velocity": servo.speed / VELOCITY_UNIT,
            **{name: servo[name] for name in ("torque", "goal", "watchdog", "hardware_error", "homing_offset")},
            **{name: servo[name] for name in ("profile_velocity", "profile_acceleration", "current_limit")},
            "writes": servo.writes[-200:],
        }
    return {"servos": found, "packets": bus.packets}


def motion(bus: Bus) -> dict[str, Any]:
    """Return the angles, rad from the middle, for a simulated world that polls them a hundred times per second."""
    for servo in bus.servos.values():
        servo.advance()
    return {"angles": {str(n): (s.position - TICKS / 2) * math.tau / TICKS for n, s in bus.servos.items()}}


def register_commands(fake: Fake, bus: Bus) -> None:
    """Register the commands of the control channel."""

    def at(number: int) -> Servo:
        if number not in bus.servos:
            raise ValueError(f"servo {number} does not exist; available: {', '.join(map(str, bus.servos))}")
        return bus.servos[number]

    def wrong_crc(count: int = 1) -> None:
        bus.wrong_crcs = count

    def absent(servo: int, on: bool = True) -> None:
        at(servo).absent = on

    def power_cycle() -> None:
        for one in bus.servos.values():
            one.reboot()

    fake.commands(
        hardware_error=lambda servo, bits=0x20: at(servo).fail(within("bits", bits, 0, 255)),
        temperature=lambda servo, celsius: at(servo).warm(within("celsius", celsius, 0, 255)),
        place=lambda servo, ticks: at(servo).place(ticks),
        status_error=lambda servo, error=1: bus.refuse_next(at(servo).number, within("error", error, 0, 255)),
        wrong_crc=wrong_crc,
        sync_writes=lambda: list(bus.sync_writes),
        absent=absent,
        power_cycle=power_cycle,
    )


@program("two_axis_robot", "Fake servos on a pty, Dynamixel protocol 2.0.")
async def main(
    fake: Fake,
    *,
    link: Path | None = None,
    ids: tuple[int, ...] = (1, 2),
    time_scale: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=20))] = 1.0,
    firmware: Annotated[int, Parameter(validator=validators.Number(gte=1, lte=255))] = 45,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its port and exits on SIGTERM.

    Args:
        link: Symbolic link to the pty; without it, one in a temporary directory.
        ids: Ids of the servos on the bus.
        time_scale: Speed of the servos; 1 is real time. Their watchdogs always run in real time.
        firmware: Version of the firmware of the servos.
    """
    if len(set(ids)) != len(ids) or not all(0 <= number <= 252 for number in ids):
        raise ValueError("ids must be 0 to 252, each once")

    own = OwnTime()

    def clock() -> float:
        return own() * time_scale

    servos = [Servo(number, clock, time_scale=time_scale, firmware=firmware) for number in ids]
    bus = Bus(servos, lambda frame: line.send(frame))
    line = PtyLine(bus.feed, link)
    register_commands(fake, bus)
    fake.line(line, bus.clear, checked=True)
    fake.truth(lambda: truth(bus))
    fake.channel.source("motion", lambda: motion(bus))
    own.run()
    await fake.run(port=line)


if __name__ == "__main__":
    sys.exit(main())

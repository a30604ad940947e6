"""Start the fake two-axis robot: `python -m arcor2_fakes.two_axis_robot`."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.process import OwnTime
from arcor2_fakes.serial_line import PtyLine
from arcor2_fakes.serving import Fake, serve
from arcor2_fakes.two_axis_robot.bus import Bus
from arcor2_fakes.two_axis_robot.servo import TICKS, VELOCITY_UNIT, Servo

app = App(name="arcor2_fakes.two_axis_robot", help="Fake servos on a pty, Dynamixel protocol 2.0.", version_flags=[])


def truth(bus: Bus, line: PtyLine) -> dict[str, Any]:
    """Return the true state, whatever the faults of the line; angles in rad from the middle."""
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
    return {"servos": found, "packets": bus.packets, "plugged": line.plugged, "port": line.port}


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

    def byte(name: str, value: int) -> int:
        if not 0 <= value <= 255:
            raise ValueError(f"{name} is 0 to 255")
        return value

    def wrong_crc(count: int = 1) -> None:
        bus.wrong_crcs = count

    def absent(servo: int, on: bool = True) -> None:
        at(servo).absent = on

    def power_cycle() -> None:
        for one in bus.servos.values():
            one.reboot()

    fake.commands(
        hardware_error=lambda servo, bits=0x20: at(servo).fail(byte("bits", bits)),
        temperature=lambda servo, celsius: at(servo).warm(byte("celsius", celsius)),
        place=lambda servo, ticks: at(servo).place(ticks),
        status_error=lambda servo, error=1: bus.refuse_next(at(servo).number, byte("error", error)),
        wrong_crc=wrong_crc,
        sync_writes=lambda: list(bus.sync_writes),
        absent=absent,
        power_cycle=power_cycle,
    )


@app.default
def main(
    *,
    link: Path | None = None,
    control: str = "127.0.0.1:0",
    ids: tuple[int, ...] = (1, 2),
    time_scale: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=20))] = 1.0,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its port and exits on SIGTERM.

    Args:
        link: Symbolic link to the pty, whose path changes when it is unplugged and plugged.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        ids: Ids of the servos on the bus.
        time_scale: Speed of the servos; 1 is real time. Their watchdogs always run in real time.
    """
    if len(set(ids)) != len(ids) or not all(0 <= number <= 252 for number in ids):
        sys.stderr.write("two_axis_robot: ids are 0 to 252, each once\n")
        return 2

    async def body(fake: Fake) -> None:
        own = OwnTime()

        def clock() -> float:
            return own() * time_scale

        bus = Bus([Servo(number, clock, time_scale=time_scale) for number in ids], lambda frame: line.send(frame))
        line = PtyLine(bus.feed, link)
        register_commands(fake, bus)
        fake.line(line, bus.clear, checked=True)
        fake.truth(lambda: truth(bus, line))
        fake.channel.source("motion", lambda: motion(bus))
        own.run()
        await fake.run(port=line)

    return serve("two_axis_robot", control, body)


if __name__ == "__main__":
    sys.exit(app())

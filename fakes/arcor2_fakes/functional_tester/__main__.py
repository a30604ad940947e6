"""Start the fake functional tester: `python -m arcor2_fakes.functional_tester`."""

from __future__ import annotations

import sys
import time
from collections import deque
from typing import Any

import msgspec
from cyclopts.types import PositiveFloat

from arcor2_fakes.control import one_of
from arcor2_fakes.functional_tester.board import Board
from arcor2_fakes.functional_tester.registers import RegisterMap
from arcor2_fakes.functional_tester.station import Command, Fault, Station
from arcor2_fakes.modbus import tcp_wire
from arcor2_fakes.program import program
from arcor2_fakes.serving import Fake

_STORED_FRAMES = 20
_MODES = {"produce": 1, "maintenance": 2, "manual": 3}
Frames = deque[dict[str, object]]
"""The latest frames on the wire."""


def truth(station: Station, registers: RegisterMap, frames: Frames) -> dict[str, Any]:
    """Return the real state of the station."""
    station.advance()
    results = [msgspec.to_builtins(result) for result in station.results]
    return {
        "state": station.state.name.capitalize(),
        "door": station.door,
        "board": None if station.board is None else station.board.code,
        "clamped": station.clamped,
        "emergency_stop": station.emergency_stop_pressed,
        "fault": int(station.fault),
        "mode": next(name for name, number in _MODES.items() if number == station.mode),
        "watchdog_ms": station.watchdog_ms,
        "last_command": registers.last_command,
        "tested": len(results),
        "passed": station.passed,
        "failed": len(results) - station.passed,
        "results": results,
        "frames": list(frames),
    }


def register_commands(fake: Fake, station: Station, registers: RegisterMap, frames: Frames) -> None:
    """Register the commands of the control channel."""

    def put_board(code: str, defect: str | None = None) -> None:
        board = msgspec.convert({"code": code, "defect": defect}, Board)
        station.put_board(board)

    def take_board() -> str:
        return station.take_board().code

    def fault(code: int, armed: bool = False) -> None:
        codes = [int(fault) for fault in Fault if fault is not Fault.NONE]
        station.inject(Fault(one_of("fault code", code, codes)), armed=armed)

    def mode(mode: str) -> None:
        station.mode = _MODES[one_of("mode", mode, _MODES)]

    def command(name: str) -> str:
        """Press a button on the station."""
        names = [each.name.lower() for each in Command]
        return station.command(Command[one_of("command", name.lower(), names).upper()]).name.lower()

    def power_cycle() -> None:
        station.power_cycle()
        registers.power_on()
        fake.reset_wires()

    def renew() -> None:
        station.as_delivered()
        registers.power_on()
        frames.clear()

    fake.renewable(renew)
    fake.commands(
        power_cycle=power_cycle,
        put_board=put_board,
        take_board=take_board,
        fault=fault,
        emergency_stop=lambda pressed=True: station.press_emergency_stop(pressed=bool(pressed)),
        push_door=lambda opening: station.push_door(opening=bool(opening)),
        command=command,
        mode=mode,
    )


@program("functional_tester", "Fake functional tester on Modbus TCP.")
async def main(
    fake: Fake,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    seed: int = 0,
    test_time: PositiveFloat = 1.5,
    time_scale: PositiveFloat = 1.0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        host: address to serve Modbus TCP on.
        port: port to serve Modbus TCP on; 0 takes a free one.
        seed: seed of the noise of measured values.
        test_time: duration of a test, s.
        time_scale: how many times faster than real time the station moves.
    """
    station = Station(seed=seed, test_time=test_time, time_scale=time_scale)
    registers = RegisterMap(station)
    frames = Frames(maxlen=_STORED_FRAMES)

    def trace(to_host: bool, frame: bytes) -> None:
        frames.append({"time": time.time(), "to_host": to_host, "hex": frame.hex()})

    modbus = tcp_wire(registers, host, port, trace=trace)
    register_commands(fake, station, registers, frames)
    fake.wires(modbus=modbus)
    fake.truth(lambda: truth(station, registers, frames))
    await fake.run(modbus=modbus)


if __name__ == "__main__":
    sys.exit(main())

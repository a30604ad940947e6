"""Start the fake functional tester: `python -m arcor2_fakes.functional_tester`."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import msgspec
from cyclopts import App, Parameter, validators

from arcor2_fakes.functional_tester.board import Board
from arcor2_fakes.functional_tester.modbus import ModbusPort
from arcor2_fakes.functional_tester.registers import RegisterMap
from arcor2_fakes.functional_tester.station import Command, Fault, Station
from arcor2_fakes.serving import Fake, serve

_MODES = {"produce": 1, "maintenance": 2, "manual": 3}

app = App(name="arcor2_fakes.functional_tester", help="Fake functional tester on Modbus TCP.", version_flags=[])

Positive = Annotated[float, Parameter(validator=validators.Number(gt=0))]


def truth(station: Station, registers: RegisterMap, port: ModbusPort) -> dict[str, Any]:
    """Return the real state of the station."""
    station.advance()
    results = [msgspec.to_builtins(result) for result in station.results]
    passed = sum(result.result == "pass" for result in station.results)
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
        "passed": passed,
        "failed": len(results) - passed,
        "results": results,
        "frames": list(port.frames),
    }


def register_commands(fake: Fake, station: Station, registers: RegisterMap, port: ModbusPort) -> None:
    """Register the commands of the control channel."""

    def put_board(code: str, defect: str | None = None) -> None:
        board = msgspec.convert({"code": code, "defect": defect}, Board)
        station.put_board(board)

    def take_board() -> str:
        return station.take_board().code

    def fault(code: int, armed: bool = False) -> None:
        station.inject(_fault(code), armed=armed)

    def mode(mode: str) -> None:
        if mode not in _MODES:
            raise ValueError(f"mode is one of {', '.join(_MODES)}")
        station.mode = _MODES[mode]

    def command(name: str) -> str:
        """Press a button on the station."""
        try:
            number = Command[name.upper()]
        except KeyError:
            raise ValueError(f"command is one of {', '.join(c.name.lower() for c in Command)}") from None
        return station.command(number).name.lower()

    def power_cycle() -> None:
        station.power_cycle()
        registers.power_on()
        port.wire.reset()

    async def renew() -> None:
        """Return to the state after the start, for tests that share a process."""
        station.as_delivered()
        registers.power_on()
        await port.wire.fault("heal")
        port.wire.reset()
        port.frames.clear()

    fake.commands(
        power_cycle=power_cycle,
        renew=renew,
        put_board=put_board,
        take_board=take_board,
        fault=fault,
        emergency_stop=lambda pressed=True: station.press_emergency_stop(pressed=bool(pressed)),
        push_door=lambda opening: station.push_door(opening=bool(opening)),
        command=command,
        mode=mode,
    )


def _fault(code: int) -> Fault:
    real = [int(fault) for fault in Fault if fault is not Fault.NONE]
    if code not in real:
        raise ValueError(f"fault code is one of {', '.join(map(str, real))}")
    return Fault(code)


@app.default
def main(
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    control: str = "127.0.0.1:0",
    seed: int = 0,
    test_time: Positive = 1.5,
    time_scale: Positive = 1.0,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        host: address to serve Modbus TCP on.
        port: port to serve Modbus TCP on; 0 takes a free one.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        seed: seed of the noise of measured values.
        test_time: duration of a test, s.
        time_scale: how many times faster than real time the station moves.
    """

    async def body(fake: Fake) -> None:
        station = Station(seed=seed, test_time=test_time, time_scale=time_scale)
        registers = RegisterMap(station)
        modbus = ModbusPort(host, port, station, registers)
        register_commands(fake, station, registers, modbus)
        fake.wires(modbus=modbus.wire)
        fake.truth(lambda: truth(station, registers, modbus))
        await fake.run(modbus=modbus.wire)

    return serve("functional_tester", control, body)


if __name__ == "__main__":
    sys.exit(app())

"""Start the fake controller: `python -m arcor2_fakes.ur --host 127.0.1.1`."""

from __future__ import annotations

import asyncio
import gc
import logging
import re
import sys
from collections.abc import Callable, Collection
from typing import Annotated

from cyclopts import Parameter
from cyclopts.types import PositiveFloat

from arcor2_fakes.program import program
from arcor2_fakes.serving import Fake, Wire
from arcor2_fakes.ur.controller import Controller
from arcor2_fakes.ur.dashboard import SERIAL_NUMBER, Dashboard
from arcor2_fakes.ur.kinematics import MODELS
from arcor2_fakes.ur.primary import StatePorts
from arcor2_fakes.ur.realtime import RealTimeStream
from arcor2_fakes.ur.rtde_server import RtdeServer
from arcor2_fakes.ur.script_port import ScriptPort
from arcor2_fakes.ur.states import Runtime
from arcor2_fakes.ur.supervision import register
from arcor2_fakes.ur.timer import PeriodicTimer
from arcor2_fakes.ur.urscript import ForeignProgram
from arcor2_fakes.wire import Connection, TcpWire

log = logging.getLogger("main")

_POLYSCOPE_X = 10  # has no dashboard server
_MAX_AT_ONCE = 100  # control cycles to catch up after a delay
_CHUNK = 10  # cycles to catch up before the sockets are read again, and at once while nobody observes them


def _check_version(_type: object, version: str) -> None:
    if not re.fullmatch(r"\d+\.\d+(\.\d+){0,2}", version):
        raise ValueError(f"{version!r} is not a version such as 5.25")


def _check_model(_type: object, model: str) -> None:
    if model not in MODELS:
        raise ValueError(f"{model!r} is not one of {', '.join(MODELS)}")


def _check_serial_number(_type: object, number: str) -> None:
    if not re.fullmatch(r"\d{10,12}", number):
        raise ValueError(f"{number!r} is not a serial number such as {SERIAL_NUMBER}")


class _Cycles:
    """Runs the control cycles; after a delay, several at once, but not more than `_MAX_AT_ONCE`.

    While the arm rests and no client is connected, the timer expires once in `_CHUNK` cycles, which saves most of the
    processor time.
    """

    def __init__(
        self, controller: Controller, wires: Collection[TcpWire], *streams: RtdeServer | RealTimeStream | StatePorts
    ) -> None:
        self._controller, self._wires, self._streams = controller, wires, streams
        self._owed = 0
        self.timer = PeriodicTimer(controller.period, self.tick)

    def tick(self, periods: int) -> None:
        """Run the cycles of the periods that have passed."""
        if periods > _MAX_AT_ONCE:
            log.warning("stalled for %.2f s", periods * self._controller.period)
        busy, self._owed = self._owed > 0, min(self._owed + periods, _MAX_AT_ONCE)
        if not busy:
            self._catch_up()
        self.timer.every(_CHUNK if self._rests() else 1)

    def _rests(self) -> bool:
        controller = self._controller
        still = controller.runtime is Runtime.STOPPED and controller.arm.motion is None
        return still and not any(wire.connections for wire in self._wires)

    def _catch_up(self) -> None:
        """Run some cycles. Data received during these, such as a watchdog signal, is read before the next cycles."""
        cycles = min(self._owed, _CHUNK)
        for left in range(self._owed, self._owed - cycles, -1):
            self._controller.tick(late=left > _CHUNK)
            for stream in self._streams:
                stream.tick()
        self._owed -= cycles
        if self._owed:
            asyncio.get_running_loop().call_soon(self._catch_up)


@program("ur", "Fake Universal Robots e-series controller.")
async def main(
    fake: Fake,
    *,
    host: str = "127.0.0.1",
    rtde_port: int = 30004,
    script_port: int = 30003,
    dashboard_port: int = 29999,
    primary_port: int = 30001,
    secondary_port: int = 30002,
    model: Annotated[str, Parameter(validator=_check_model)] = "ur5e",
    controller_version: Annotated[str, Parameter(validator=_check_version)] = "5.25",
    frequency: PositiveFloat = 500.0,
    time_scale: PositiveFloat = 1.0,
    powered_off: bool = False,
    serial_number: Annotated[str, Parameter(validator=_check_serial_number)] = SERIAL_NUMBER,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its addresses, and exits on SIGTERM.

    Args:
        host: Address of all ports. Each fake needs its own, because clients fix the ports.
        rtde_port: Port of RTDE.
        script_port: Real-time port: takes programs, sends the state in each control cycle.
        dashboard_port: Port of the dashboard server.
        primary_port: Port that takes programs and sends the state, with the calibration, and errors of programs.
        secondary_port: Port that takes programs and sends the state.
        model: Model of the arm: ur3e, ur5e, ur10e or ur16e.
        controller_version: Version of the software; 10.x has no dashboard server.
        frequency: Control cycles and RTDE samples per second.
        time_scale: Factor on the times of booting, power-on, brake release and unlocking.
        powered_off: Start without power on the arm.
        serial_number: Serial number of the robot.
    """
    version = (*map(int, controller_version.split(".")), 0, 0)[:4]

    controller = Controller(model, version, frequency, time_scale)
    controller.load_program = lambda name: ForeignProgram(controller, name)
    if powered_off:
        controller.power_off()
    rtde, script, dashboard = RtdeServer(controller), ScriptPort(controller), Dashboard(controller, serial_number)
    states = StatePorts(controller, MODELS[model])

    def opened(connection: Connection) -> None:
        script.opened(connection)
        states.greet(connection)

    wires = {
        "primary": TcpWire("primary", host, primary_port, opened),
        "secondary": TcpWire("secondary", host, secondary_port, opened),
        "rtde": TcpWire("rtde", host, rtde_port, rtde.opened),
        "script": TcpWire("script", host, script_port, script.opened),
    }
    states.wires = [wires["primary"], wires["secondary"]]
    stream = RealTimeStream(controller, wires["script"])
    if version[0] < _POLYSCOPE_X:
        wires["dashboard"] = TcpWire("dashboard", host, dashboard_port, dashboard.opened)
    fake.wires(**wires)
    register(fake.channel, controller, rtde, script, dashboard)

    def power_cycle() -> None:
        """Switch the controller off and on: every connection breaks, and the arm has no power."""
        fake.reset_wires()
        controller.boot()

    fake.commands(power_cycle=power_cycle, calibration=states.calibrate)
    timer = _Cycles(controller, wires.values(), rtde, stream, states).timer
    fake.at_end(timer.close)
    timer.start()
    gc.freeze()
    addresses: dict[str, Wire | Callable[[], object]] = {"host": lambda: host, "dashboard": lambda: None, **wires}
    await fake.run(**addresses)


if __name__ == "__main__":
    sys.exit(main())

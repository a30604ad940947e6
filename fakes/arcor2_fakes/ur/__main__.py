"""Runs the fake controller: ``python -m arcor2_fakes.ur --host 127.0.1.1``."""

import argparse
import asyncio
import gc
import logging
import re
import sys

from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.process import announce, run, until_told_to_end
from arcor2_fakes.ur.controller import Controller
from arcor2_fakes.ur.dashboard import Dashboard
from arcor2_fakes.ur.kinematics import MODELS
from arcor2_fakes.ur.primary import PrimaryPort
from arcor2_fakes.ur.rtde_server import RtdeServer
from arcor2_fakes.ur.script_port import ScriptPort
from arcor2_fakes.ur.supervision import register
from arcor2_fakes.ur.timer import PeriodicTimer
from arcor2_fakes.ur.urscript import ForeignProgram
from arcor2_fakes.wire import TcpWire, register_faults

log = logging.getLogger("main")

_POLYSCOPE_X = 10  # has no dashboard server
_MOST_AT_ONCE = 100  # control cycles to catch up after a delay; watchdog signals that waited count as one
_CHUNK = 10  # cycles to catch up before the sockets are read again


def _version(text: str) -> tuple[int, ...]:
    if not re.fullmatch(r"\d+\.\d+(\.\d+){0,2}", text):
        raise argparse.ArgumentTypeError(f"{text!r} is not a version such as 5.25")
    return (*map(int, text.split(".")), 0, 0)[:4]


def _address(text: str) -> tuple[str, int]:
    try:
        return parse_address(text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from e


def _positive(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError("must be above zero")
    return value


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m arcor2_fakes.ur", description="A fake UR e-series controller.")
    add = parser.add_argument
    add("--host", default="127.0.0.1", help="address of all ports; each fake needs its own, for clients fix the ports")
    add("--rtde-port", type=int, default=30004)
    add("--script-port", type=int, default=30003)
    add("--dashboard-port", type=int, default=29999)
    add("--primary-port", type=int, default=30001)
    add("--control", type=_address, default=("127.0.0.1", 0), metavar="HOST:PORT", help="control channel, port 0: free")
    add("--model", choices=MODELS, default="ur5e")
    add("--controller-version", type=_version, default="5.25", help="5.x; 10.x has no dashboard server")
    add("--frequency", type=_positive, default=500.0, help="control cycles and RTDE samples per second")
    add("--time-scale", type=_positive, default=1.0, help="factor on booting, power-on, brake release and unlock wait")
    add("--powered-off", action="store_true", help="start without power on the arm")
    return parser.parse_args()


async def _serve(options: argparse.Namespace) -> None:
    controller = Controller(options.model, options.controller_version, options.frequency, options.time_scale)
    controller.load_program = lambda name: ForeignProgram(controller, name)
    if options.powered_off:
        controller.power_off()
    rtde, script, dashboard = RtdeServer(controller), ScriptPort(controller), Dashboard(controller)
    primary = PrimaryPort(MODELS[options.model], options.controller_version)
    wires = {
        "primary": TcpWire("primary", options.host, options.primary_port, primary.opened),
        "rtde": TcpWire("rtde", options.host, options.rtde_port, rtde.opened),
        "script": TcpWire("script", options.host, options.script_port, script.opened),
    }
    if options.controller_version[0] < _POLYSCOPE_X:
        wires["dashboard"] = TcpWire("dashboard", options.host, options.dashboard_port, dashboard.opened)
    control = ControlServer(*options.control)
    register_faults(control, dict(wires))
    register(control, controller, rtde, script, dashboard)

    def power_cycle() -> None:
        """Switch the controller off and on: every connection breaks, and the arm has no power."""
        for wire in wires.values():
            wire.reset()
        controller.boot()

    control.command("power_cycle", power_cycle)

    def calibration(deltas: list[list[float]], told: bool = True) -> None:
        """Set what a calibration adds to theta, a, d and alpha; `told`: whether the primary port reports it."""
        if [len(row) for row in deltas] != [6] * 4:
            raise ValueError("four rows of six numbers")
        primary.deltas, primary.told = deltas, told

    control.command("calibration", calibration)

    loop = asyncio.get_running_loop()
    owed = 0

    def tick(periods: int) -> None:
        nonlocal owed
        if periods > _MOST_AT_ONCE:
            log.warning("held up for %.2f s", periods * controller.period)
        busy, owed = owed > 0, min(owed + periods, _MOST_AT_ONCE)
        if not busy:
            catch_up()

    def catch_up() -> None:
        """Run some cycles; data received meanwhile, such as a watchdog signal, is read before the next ones."""
        nonlocal owed
        cycles = min(owed, _CHUNK)
        for _ in range(cycles):
            controller.tick()
            rtde.tick()
        owed -= cycles
        if owed:
            loop.call_soon(catch_up)

    timer = PeriodicTimer(controller.period, tick)
    try:
        addresses = {name: await wire.listen() for name, wire in wires.items()}
        addresses["control"] = await control.start()
        timer.start()
        gc.freeze()
        announce(host=options.host, **{"dashboard": None, **addresses})
        await until_told_to_end()
    finally:
        timer.close()
        for wire in wires.values():
            wire.close()
        await control.close()


def main() -> int:
    """Run until told to end; the exit status."""
    options = _arguments()
    return run(lambda: _serve(options), "ur")


if __name__ == "__main__":
    sys.exit(main())

"""Start the fake two-arm robot: `python -m arcor2_fakes.abb_yumi`."""

from __future__ import annotations

import asyncio
import sys
from typing import Annotated, Any

import numpy as np
from cyclopts import App, Parameter, validators

from arcor2_fakes.abb_yumi.arm import Hand
from arcor2_fakes.abb_yumi.controller import TASKS, Controller
from arcor2_fakes.abb_yumi.http_port import HttpPort
from arcor2_fakes.abb_yumi.motion_server import MotionServer
from arcor2_fakes.abb_yumi.services import Services
from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.process import announce, run, until_told_to_end
from arcor2_fakes.wire import TcpWire, register_faults

_TICK = 0.004  # s

app = App(name="arcor2_fakes.abb_yumi", help="Fake ABB YuMi: RWS 1.0 and a motion server per arm.", version_flags=[])


def register_commands(control: ControlServer, controller: Controller, http: HttpPort) -> None:
    """Register the commands of the control channel."""

    def arm_of(arm: str) -> str:
        if arm not in TASKS:
            raise ValueError(f"arm is one of {', '.join(TASKS)}")
        return arm

    def place(arm: str, joints: list[float] | None = None) -> None:
        body = controller.arms[arm_of(arm)]
        if joints is not None and len(joints) != 7:
            raise ValueError("joints are seven numbers, degrees, axes 1 to 7")
        body.place(body.kinematics.home if joints is None else np.radians(joints))

    def part(arm: str, on: bool = True) -> None:
        controller.arms[arm_of(arm)].hand.part = on

    def speed_ratio(percent: int) -> None:
        if not 0 <= percent <= 100:
            raise ValueError("percent is 0 to 100")
        controller.speed_ratio = percent

    def renew() -> None:
        """Reset to the state as delivered: motors on, automatic, no sessions, both arms at home."""
        http.end_all()
        controller.stop()
        controller.foreign_program(False)
        controller.hold_mastership(False)
        controller.operation_mode, controller.control_state = "AUTO", "motoron"
        controller.speed_ratio, controller.collision = 100, "INIT"
        for listener in controller.reset_to_main:
            listener()
        for body in controller.arms.values():
            body.lead_through = False
            body.hand = Hand()
            body.place(body.kinematics.home)

    control.command("renew", renew)
    control.command("place", place)
    control.command("part", part)
    control.command("speed_ratio", speed_ratio)
    control.command("control_state", lambda state: controller.set_control_state(state))
    control.command("operation_mode", lambda mode: controller.set_operation_mode(mode))
    control.command("mastership_held", controller.hold_mastership)
    control.command("foreign_program", controller.foreign_program)
    control.command("rapid_error", controller.rapid_error)
    control.command("collide", lambda arm: controller.collide(arm_of(arm)))


async def live(controller: Controller, servers: list[MotionServer], http: HttpPort) -> None:
    """Advance the simulation."""
    loop = asyncio.get_running_loop()
    last = loop.time()
    while True:
        await asyncio.sleep(_TICK)
        now = loop.time()
        controller.advance(now - last)
        last = now
        for server in servers:
            server.tick()
        http.expire()


@app.default
def main(
    *,
    host: str = "127.0.0.1",
    rws_port: int = 8080,
    left_port: int = 6101,
    right_port: int = 6111,
    user: str = "Default User",
    password: str = "robotics",  # noqa: S107 - what ABB delivers
    control: str = "127.0.0.1:0",
    time_scale: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=100))] = 1.0,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its addresses, and exits on SIGTERM.

    Args:
        host: Address of all ports.
        rws_port: Port of Robot Web Services; a real controller uses 80.
        left_port: Port of the left arm's commands; its watch port is the next one.
        right_port: Port of the right arm's commands; its watch port is the next one.
        user: User of the digest authentication.
        password: Password of the user.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        time_scale: Speed of the simulation; 1 is real time.
    """
    try:
        control_address = parse_address(control)
    except ValueError as e:
        sys.stderr.write(f"abb_yumi: {e}\n")
        return 2

    async def body() -> None:
        controller = Controller(time_scale)
        http = HttpPort(user, password, Services(controller).handle, controller.session_ended)
        servers = {name: MotionServer(controller, name) for name in TASKS}
        servers["left"].partner, servers["right"].partner = servers["right"], servers["left"]
        wires = {"rws": TcpWire("rws", host, rws_port, http.opened)}
        for name, port in (("left", left_port), ("right", right_port)):
            server = servers[name]
            server.wires = {
                name: TcpWire(name, host, port, server.opened_commands),
                f"{name}_watch": TcpWire(f"{name}_watch", host, port + 1, server.opened_watch),
            }
            wires |= server.wires
        channel = ControlServer(*control_address)
        register_faults(channel, dict(wires))
        register_commands(channel, controller, http)

        def power_cycle() -> None:
            """Switch the controller off and on: sessions and connections end, the motors are off."""
            http.end_all()
            controller.stop()
            controller.hold_mastership(False)
            controller.set_control_state("motoroff")
            for wire in wires.values():
                wire.reset()

        channel.command("power_cycle", power_cycle)

        def truth() -> dict[str, Any]:
            return controller.truth() | {"requests": http.requests}

        channel.source("truth", truth)
        channel.command("stops", lambda: {name: list(server.stops_taken) for name, server in servers.items()})
        addresses = {name: await wire.listen() for name, wire in wires.items()}
        life = asyncio.create_task(live(controller, list(servers.values()), http))
        try:
            announce(name="abb_yumi", host=host, control=await channel.start(), **addresses)
            await until_told_to_end()
        finally:
            life.cancel()
            await asyncio.gather(life, return_exceptions=True)
            for wire in wires.values():
                wire.close()
            await channel.close()

    return run(body, "abb_yumi")


if __name__ == "__main__":
    sys.exit(app())

"""Start the fake two-arm robot: `python -m arcor2_fakes.abb_yumi`."""

from __future__ import annotations

import sys
from typing import Annotated

import numpy as np
from cyclopts import Parameter, validators

from arcor2_fakes.abb_yumi.arm import HAND_STROKE, PART_WIDTH, Hand
from arcor2_fakes.abb_yumi.controller import TASKS, Controller
from arcor2_fakes.abb_yumi.http_port import HttpPort
from arcor2_fakes.abb_yumi.motion_server import MotionServer
from arcor2_fakes.abb_yumi.services import Services
from arcor2_fakes.control import one_of, within
from arcor2_fakes.process import OwnTime
from arcor2_fakes.program import program
from arcor2_fakes.serving import Fake
from arcor2_fakes.wire import TcpWire

_TICK = 0.004  # s


def register_commands(fake: Fake, controller: Controller, http: HttpPort) -> None:
    """Register the commands of the control channel."""

    def arm_of(arm: str) -> str:
        return one_of("arm", arm, TASKS)

    def place(arm: str, joints: list[float] | None = None) -> None:
        body = controller.arms[arm_of(arm)]
        if joints is not None and len(joints) != 7:
            raise ValueError("joints are seven numbers, degrees, axes 1 to 7")
        body.place(body.kinematics.home if joints is None else np.radians(joints))

    def part(arm: str, on: bool = True, width: float = PART_WIDTH) -> None:
        if not 0.0 < width <= HAND_STROKE:
            raise ValueError(f"width must be up to {HAND_STROKE:g} m")
        controller.arms[arm_of(arm)].hand.part = width if on else 0.0

    def speed_ratio(percent: int) -> None:
        controller.speed_ratio = within("percent", percent, 0, 100)

    def renew() -> None:
        """Reset to the factory state: motors on, automatic, no sessions, both arms at home."""
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

    def power_cycle() -> None:
        """Switch the controller off and on: sessions and connections end, the motors are off."""
        http.end_all()
        controller.stop()
        controller.hold_mastership(False)
        controller.set_control_state("motoroff")
        fake.reset_wires()

    fake.commands(
        renew=renew,
        power_cycle=power_cycle,
        place=place,
        part=part,
        speed_ratio=speed_ratio,
        control_state=lambda state: controller.set_control_state(state),
        operation_mode=lambda mode: controller.set_operation_mode(mode),
        mastership_held=controller.hold_mastership,
        foreign_program=controller.foreign_program,
        rapid_error=controller.rapid_error,
        collide=lambda arm: controller.collide(arm_of(arm)),
    )


@program("abb_yumi", "Fake ABB YuMi: RWS 1.0 and a motion server per arm.")
async def main(
    fake: Fake,
    *,
    host: str = "127.0.0.1",
    rws_port: int = 8080,
    left_port: int = 6101,
    right_port: int = 6111,
    user: str = "Default User",
    password: str = "robotics",  # noqa: S107 - ABB's factory setting
    time_scale: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=100))] = 1.0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its addresses, and exits on SIGTERM.

    Args:
        host: Address of all ports.
        rws_port: Port of Robot Web Services; a real controller uses 80.
        left_port: Port of the left arm's commands; its watch port is the next one.
        right_port: Port of the right arm's commands; its watch port is the next one.
        user: User of the digest authentication.
        password: Password of the user.
        time_scale: Speed of the simulation; 1 is real time.
    """
    controller = Controller(time_scale)
    http = HttpPort(user, password, Services(controller).handle, controller.session_ended)
    own_time = OwnTime()
    servers = {name: MotionServer(controller, name, own_time) for name in TASKS}
    servers["left"].partner, servers["right"].partner = servers["right"], servers["left"]
    wires = {"rws": TcpWire("rws", host, rws_port, http.opened)}
    for name, port in (("left", left_port), ("right", right_port)):
        server = servers[name]
        server.wires = {
            name: TcpWire(name, host, port, server.opened_commands),
            f"{name}_watch": TcpWire(f"{name}_watch", host, port + 1, server.opened_watch),
        }
        wires |= server.wires

    def advance(seconds: float) -> None:
        controller.advance(seconds)
        for server in servers.values():
            server.tick()
        http.expire()

    register_commands(fake, controller, http)
    fake.commands(stops=lambda: {name: list(server.stops_taken) for name, server in servers.items()})
    fake.wires(**wires)
    fake.truth(lambda: controller.truth() | {"requests": http.requests, "sessions": http.sessions})
    fake.simulate(advance, _TICK)
    own_time.run()
    await fake.run(**wires, host=lambda: host)


if __name__ == "__main__":
    sys.exit(main())

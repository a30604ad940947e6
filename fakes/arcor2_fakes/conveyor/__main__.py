"""Start the fake conveyor: `python -m arcor2_fakes.conveyor`."""

from __future__ import annotations

import asyncio
import sys
from typing import Annotated

from cyclopts import App, Parameter, validators

from arcor2_fakes.control import ControlServer
from arcor2_fakes.conveyor.hub import Hub
from arcor2_fakes.conveyor.node import Node
from arcor2_fakes.conveyor.socketcand import Server
from arcor2_fakes.serving import Fake, serve

app = App(name="arcor2_fakes.conveyor", help="Fake conveyor: CiA 402 drive on CAN.", version_flags=[])


def register_commands(control: ControlServer, node: Node) -> None:
    """Register the commands of the control channel."""

    def emergency(code: int, stands: bool = False) -> None:
        if not isinstance(code, int) or not 1 <= code <= 0xFFFF:
            raise ValueError("code is 1 to 65535")
        node.drive.fault(code, stands=bool(stands))

    def mute(on: bool = True) -> None:
        node.silent = bool(on)

    def jam(on: bool = True) -> None:
        node.drive.jammed = bool(on)

    def cause_gone() -> None:
        node.drive.cause_stands = False

    def homing_fails(on: bool = True) -> None:
        node.drive.homing_fails = bool(on)

    def handshake_stuck(on: bool = True) -> None:
        node.drive.handshake_stuck = bool(on)

    control.command("emergency", emergency)
    control.command("mute", mute)
    control.command("follow_error", jam)
    control.command("cause_gone", cause_gone)
    control.command("homing_fails", homing_fails)
    control.command("handshake_stuck", handshake_stuck)
    control.command("power_cycle", node.power_cycle)


@app.default
def main(
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    socketcand_port: int = 0,
    control: str = "127.0.0.1:0",
    node: Annotated[int, Parameter(validator=validators.Number(gte=1, lte=126))] = 5,
    time_scale: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=20))] = 1.0,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        host: address of the CAN adapters.
        port: TCP port of the CAN adapters; 0 takes a free one.
        socketcand_port: TCP port of a socketcand server for the same bus, as can0; 0 takes a free one.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        node: CANopen node id of the drive.
        time_scale: how many times faster than real time the belt moves; heartbeats and boot-up stay in real time.
    """

    async def body(fake: Fake) -> None:
        hub = Hub(host, port)
        daemon = Server(hub, host, socketcand_port)
        drive = Node(hub, node, time_scale)
        register_commands(fake.channel, drive)
        fake.wires(can=hub.wire, socketcand=daemon.wire)
        fake.truth(drive.truth)
        fake.channel.source("motion", drive.motion)
        life = asyncio.create_task(drive.run())

        async def end() -> None:
            life.cancel()
            await asyncio.gather(life, return_exceptions=True)

        fake.at_end(end)
        await fake.run(can=hub.wire, socketcand=daemon.wire, node=lambda: node)

    return serve("conveyor", control, body)


if __name__ == "__main__":
    sys.exit(app())

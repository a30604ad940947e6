"""Start the fake conveyor: `python -m arcor2_fakes.conveyor`."""

from __future__ import annotations

import sys
from typing import Annotated

from cyclopts import Parameter, validators

from arcor2_fakes.control import within
from arcor2_fakes.conveyor.hub import Hub
from arcor2_fakes.conveyor.node import Node
from arcor2_fakes.conveyor.socketcand import Server
from arcor2_fakes.program import program
from arcor2_fakes.serving import Fake


def register_commands(fake: Fake, node: Node) -> None:
    """Register the commands of the control channel."""

    def emergency(code: int, stands: bool = False) -> None:
        node.drive.fault(within("code", code, 1, 0xFFFF), stands=bool(stands))

    def cause_gone() -> None:
        node.drive.cause_stands = False

    fake.switches(node, mute="silent")
    fake.switches(node.drive, follow_error="jammed", homing_fails="homing_fails", handshake_stuck="handshake_stuck")
    fake.commands(emergency=emergency, cause_gone=cause_gone, power_cycle=node.power_cycle)


@program("conveyor", "Fake conveyor: CiA 402 drive on CAN.")
async def main(
    fake: Fake,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    socketcand_port: int = 0,
    node: Annotated[int, Parameter(validator=validators.Number(gte=1, lte=126))] = 5,
    time_scale: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=20))] = 1.0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        host: address of the CAN adapters.
        port: TCP port of the CAN adapters; 0 takes a free one.
        socketcand_port: TCP port of a socketcand server for the same bus, as can0; 0 takes a free one.
        node: CANopen node id of the drive.
        time_scale: how many times faster than real time the belt moves; heartbeats and boot-up stay in real time.
    """
    hub = Hub(host, port)
    daemon = Server(hub, host, socketcand_port)
    drive = Node(hub, node, time_scale)
    register_commands(fake, drive)
    fake.wires(can=hub.wire, socketcand=daemon.wire)
    fake.truth(drive.truth)
    fake.channel.source("motion", drive.motion)
    fake.background(drive.run())
    await fake.run(can=hub.wire, socketcand=daemon.wire, node=lambda: node)


if __name__ == "__main__":
    sys.exit(main())

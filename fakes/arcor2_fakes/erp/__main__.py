"""Start the fake planning service: `python -m arcor2_fakes.erp`."""

from __future__ import annotations

import ssl
import sys
from pathlib import Path
from typing import Any

import msgspec

from arcor2_fakes.control import parse_address
from arcor2_fakes.erp.planning import Planning
from arcor2_fakes.erp.port import Port
from arcor2_fakes.program import program
from arcor2_fakes.serving import Fake


def truth(planning: Planning, port: Port) -> dict[str, Any]:
    """Return the real state of the service."""
    return {
        "orders": msgspec.to_builtins(list(planning.orders.values())),
        "results": list(planning.results),
        "repeated": planning.repeated,
        "taken": len(planning.taken),
        "requests": port.total,
        "connections": len(port.wire.connections),
    }


def register_commands(fake: Fake, planning: Planning, port: Port) -> None:
    """Register the commands of the control channel."""

    def add_order(order: str, product: str, quantity: int = 1) -> None:
        planning.add_order(order, product, quantity)
        fake.channel.publish("truth")

    def forbid(order: str, on: bool = True) -> None:
        (planning.forbidden.add if on else planning.forbidden.discard)(order)

    fake.commands(
        add_order=add_order,
        forbid=forbid,
        forget=planning.reset,
        lose_answers=port.lose_answers,
        mistake=port.mistake,
        fail=port.fail,
        work=port.heal,
        received=lambda: list(port.received),
        power_cycle=port.power_cycle,
    )


@program("erp", "Fake production planning service (ERP) on HTTP.")
async def main(
    fake: Fake,
    *,
    listen: str = "127.0.0.1:0",
    order: list[str] | None = None,
    token: str = "",
    store: Path | None = None,
    certificate: Path | None = None,
    key: Path | None = None,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its URL and ends on SIGTERM.

    Args:
        listen: HOST:PORT of the service; port 0 takes a free one.
        order: ID=PRODUCT:QUANTITY, an initial order; repeatable.
        token: bearer token that clients must send; empty for none.
        store: file for orders and results; by default they are stored in memory.
        certificate: PEM file; the service uses HTTPS then.
        key: PEM file of the certificate's private key.
    """
    context = None
    try:
        planning = Planning(store)
        if certificate is not None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(certificate, key)
    except (OSError, msgspec.MsgspecError) as e:
        raise ValueError(e) from e
    for text in order or ():
        number, _, what = text.partition("=")
        product, _, quantity = what.rpartition(":")
        if number not in planning.orders:
            planning.add_order(number, product, int(quantity))

    port = Port(planning, *parse_address(listen), token, context)
    port.changed = lambda: fake.channel.publish("truth")
    register_commands(fake, planning, port)
    fake.wires(http=port.wire)
    fake.truth(lambda: truth(planning, port))
    fake.at_end(planning.close)
    scheme = "http" if context is None else "https"
    await fake.run(url=lambda: f"{scheme}://{port.wire.address}")


if __name__ == "__main__":
    sys.exit(main())

"""Start the fake scale: `python -m arcor2_fakes.scale`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from cyclopts.types import PositiveFloat

from arcor2_fakes.control import one_of
from arcor2_fakes.program import program
from arcor2_fakes.scale.balance import UNITS, Balance
from arcor2_fakes.serial_line import line_at
from arcor2_fakes.serving import Fake


def truth(balance: Balance) -> dict[str, Any]:
    """Return the real state; masses in kg."""
    return {
        "load": balance.load,
        "zero": balance.zero,
        "tare": balance.tare,
        "stable": balance.stable,
        "display": balance.display,
        "keys": balance.keys,
        "received": list(balance.received),
    }


def register_commands(fake: Fake, balance: Balance) -> None:
    """Register the commands of the control channel."""

    def unit(value: str) -> None:
        balance.unit = one_of("unit", value, UNITS)

    def error(code: str) -> None:
        balance.next_error = one_of("code", code, ("ES", "ET", "EL"))

    fake.switches(balance, vibrate="vibrating", busy="busy")
    fake.commands(
        put=lambda kg: balance.put(float(kg)),
        unit=unit,
        error=error,
        press=balance.press,
        renew=balance.renew,
        power_cycle=balance.power_cycle,
    )


@program("scale", "Fake MT-SICS scale on a pty or TCP.")
async def main(
    fake: Fake,
    *,
    tcp: str | None = None,
    link: Path | None = None,
    capacity: PositiveFloat = 3.2,
    settling: PositiveFloat = 0.4,
    stability_timeout: PositiveFloat = 5.0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its port and ends on SIGTERM.

    Args:
        tcp: HOST:PORT to serve instead of a pty; port 0 takes a free one.
        link: Symbolic link to the pty; without it, one in a temporary directory.
        capacity: largest load, kg.
        settling: time until the value is stable after a change of the load, s.
        stability_timeout: time limit of S, T and Z for a stable value, s.
    """
    balance = Balance(
        lambda frame: line.send(frame), capacity=capacity, settling=settling, stability_timeout=stability_timeout
    )
    line = line_at(balance.feed, link, tcp)
    register_commands(fake, balance)
    fake.line(line, balance.drop_input)
    fake.truth(lambda: truth(balance))
    fake.at_end(balance.cancel)
    await fake.run(port=line)


if __name__ == "__main__":
    sys.exit(main())

"""Start the fake scale: `python -m arcor2_fakes.scale`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.control import parse_address
from arcor2_fakes.scale.balance import UNITS, Balance
from arcor2_fakes.serial_line import Line, PtyLine, TcpLine
from arcor2_fakes.serving import Fake, serve

app = App(name="arcor2_fakes.scale", help="Fake MT-SICS scale on a pty or TCP.", version_flags=[])
Positive = Annotated[float, Parameter(validator=validators.Number(gt=0))]


def truth(balance: Balance, line: Line) -> dict[str, Any]:
    """Return the real state; masses in kg."""
    return {
        "load": balance.load,
        "zero": balance.zero,
        "tare": balance.tare,
        "stable": balance.stable,
        "plugged": line.plugged,
        "port": line.port,
        "received": list(balance.received),
    }


def register_commands(fake: Fake, balance: Balance) -> None:
    """Register the commands of the control channel."""

    def vibrate(on: bool) -> None:
        balance.vibrating = bool(on)

    def busy(on: bool) -> None:
        balance.busy = bool(on)

    def unit(value: str) -> None:
        if value not in UNITS:
            raise ValueError(f"unit is one of {', '.join(UNITS)}")
        balance.unit = value

    def error(code: str) -> None:
        if code not in ("ES", "ET", "EL"):
            raise ValueError("code is one of ES, ET, EL")
        balance.next_error = code

    fake.commands(
        put=lambda kg: balance.put(float(kg)),
        vibrate=vibrate,
        busy=busy,
        unit=unit,
        error=error,
        renew=balance.renew,
        power_cycle=balance.power_cycle,
    )


@app.default
def main(
    *,
    tcp: str | None = None,
    link: Path | None = None,
    control: str = "127.0.0.1:0",
    capacity: Positive = 3.2,
    settling: Positive = 0.4,
    stability_timeout: Positive = 5.0,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its port and ends on SIGTERM.

    Args:
        tcp: HOST:PORT to serve instead of a pty; port 0 takes a free one.
        link: symbolic link to the pty, whose path changes when it is unplugged and plugged in.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        capacity: largest load, kg.
        settling: time until the value is stable after a change of the load, s.
        stability_timeout: time limit of S, T and Z for a stable value, s.
    """

    async def body(fake: Fake) -> None:
        balance = Balance(
            lambda frame: line.send(frame), capacity=capacity, settling=settling, stability_timeout=stability_timeout
        )
        line: Line = PtyLine(balance.feed, link) if tcp is None else TcpLine(balance.feed, *parse_address(tcp))
        register_commands(fake, balance)
        fake.line(line, balance.drop_input)
        fake.truth(lambda: truth(balance, line))
        fake.at_end(balance.cancel)
        await fake.run(port=line)

    return serve("scale", control, body, tcp)


if __name__ == "__main__":
    sys.exit(app())

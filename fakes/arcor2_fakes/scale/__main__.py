"""Starts the fake scale: `python -m arcor2_fakes.scale`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.process import announce, run, until_told_to_end
from arcor2_fakes.scale.balance import UNITS, Balance
from arcor2_fakes.serial_line import Line, PtyLine, TcpLine
from arcor2_fakes.wire import register_faults

app = App(name="arcor2_fakes.scale", help="Fake MT-SICS scale on a pty or TCP.", version_flags=[])
Positive = Annotated[float, Parameter(validator=validators.Number(gt=0))]


def truth(balance: Balance, line: Line) -> dict[str, Any]:
    """Give what is really so, whatever the line says; masses in kg."""
    return {
        "load": balance.load,
        "zero": balance.zero,
        "tare": balance.tare,
        "stable": balance.stable,
        "plugged": line.plugged,
        "port": line.port,
        "received": list(balance.received),
    }


def register_commands(control: ControlServer, balance: Balance) -> None:
    """Make what the world and a test can do to the scale known to the control channel."""

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

    control.command("put", lambda kg: balance.put(float(kg)))
    control.command("vibrate", vibrate)
    control.command("busy", busy)
    control.command("unit", unit)
    control.command("error", error)
    control.command("renew", balance.renew)
    control.command("power_cycle", balance.power_cycle)


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
        link: symbolic link to keep on the pty, whose own path changes when it is unplugged and plugged.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        capacity: greatest load, kg.
        settling: how long the value moves after the load has changed, s.
        stability_timeout: how long S, T and Z wait for a stable value, s.
    """
    try:
        control_address = parse_address(control)
        tcp_address = None if tcp is None else parse_address(tcp)
    except ValueError as e:
        sys.stderr.write(f"scale: {e}\n")
        return 2

    async def body() -> None:
        balance = Balance(
            lambda frame: line.send(frame),
            capacity=capacity,
            settling=settling,
            stability_timeout=stability_timeout,
        )
        line: Line = PtyLine(balance.feed, link) if tcp_address is None else TcpLine(balance.feed, *tcp_address)

        async def plug() -> str:
            await line.plug()
            return line.port

        async def unplug() -> None:
            await line.unplug()
            balance.drop_input()

        channel = ControlServer(*control_address)
        register_commands(channel, balance)
        register_faults(channel, {"serial": line})
        channel.command("plug", plug)
        channel.command("unplug", unplug)
        channel.source("truth", lambda: truth(balance, line))
        await line.plug()
        try:
            announce(name="scale", port=line.port, control=await channel.start())
            await until_told_to_end()
        finally:
            balance.cancel()
            await line.unplug()
            await channel.close()

    return run(body, "scale")


if __name__ == "__main__":
    sys.exit(app())

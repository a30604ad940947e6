"""Starts the fake label printer: `python -m arcor2_fakes.label_printer`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import msgspec
from cyclopts import App, Parameter, validators

from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.label_printer.printer import LabelPrinter
from arcor2_fakes.process import announce, run, until_told_to_end
from arcor2_fakes.serial_line import Line, PtyLine, TcpLine
from arcor2_fakes.wire import register_faults

app = App(name="arcor2_fakes.label_printer", help="Fake ZPL label printer on a pty or TCP.", version_flags=[])
FULL_ROLL = 10_000


def truth(printer: LabelPrinter, line: Line) -> dict[str, Any]:
    """Give what has really come out of the printer, whatever the line says."""
    return {
        "labels": msgspec.to_builtins(list(printer.labels)),
        "counter": printer.counter,
        "waiting": printer.waiting,
        "partial": printer.partial,
        "media": printer.media,
        "paused": printer.paused,
        "head_open": printer.head_open,
        "ribbon_out": printer.ribbon_out,
        "plugged": line.plugged,
        "port": line.port,
        "received": list(printer.received),
    }


def register_commands(control: ControlServer, printer: LabelPrinter) -> None:
    """Make what the world and a test can do to the printer known to the control channel."""

    def switch(name: str) -> Any:
        def apply(on: bool) -> None:
            setattr(printer, name, bool(on))
            printer.hold()
            printer.go_on()

        return apply

    def media(labels: int) -> None:
        if not 0 <= labels <= FULL_ROLL:
            raise ValueError(f"labels is 0 to {FULL_ROLL}")
        printer.media = int(labels)
        printer.hold()
        printer.go_on()

    for name in ("head_open", "ribbon_out", "hot", "mute", "forgetful"):
        control.command(name, switch(name))
    control.command("pause", lambda on=True: printer.pause(bool(on)))
    control.command("media", media)
    control.command("renew", lambda: printer.renew(FULL_ROLL))
    control.command("power_cycle", printer.power_cycle)


@app.default
def main(
    *,
    tcp: str | None = None,
    link: Path | None = None,
    control: str = "127.0.0.1:0",
    duration: Annotated[float, Parameter(validator=validators.Number(gt=0))] = 0.3,
    labels: Annotated[int, Parameter(validator=validators.Number(gte=0, lte=FULL_ROLL))] = FULL_ROLL,
    mute: bool = True,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its port and ends on SIGTERM.

    Args:
        tcp: HOST:PORT to serve instead of a pty (9100 on real printers); port 0 takes a free one.
        link: symbolic link to keep on the pty, whose own path changes when it is unplugged and plugged.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        duration: how long a label takes, s.
        labels: how many are on the roll.
        mute: answer nothing while out of media or with the head open; else tell it by the flags of ~HS.
    """
    try:
        control_address = parse_address(control)
        tcp_address = None if tcp is None else parse_address(tcp)
    except ValueError as e:
        sys.stderr.write(f"label_printer: {e}\n")
        return 2

    async def body() -> None:
        channel = ControlServer(*control_address)
        printer = LabelPrinter(
            lambda frame: line.send(frame),
            lambda: channel.publish("truth"),
            duration=duration,
            mute=mute,
            labels=labels,
        )
        line: Line = PtyLine(printer.feed, link) if tcp_address is None else TcpLine(printer.feed, *tcp_address)

        async def plug() -> str:
            await line.plug()
            return line.port

        async def unplug() -> None:
            await line.unplug()
            printer.drop_input()

        register_commands(channel, printer)
        register_faults(channel, {"data": line})
        channel.command("plug", plug)
        channel.command("unplug", unplug)
        channel.source("truth", lambda: truth(printer, line))
        await line.plug()
        try:
            announce(name="label_printer", port=line.port, control=await channel.start())
            await until_told_to_end()
        finally:
            printer.close()
            await line.unplug()
            await channel.close()

    return run(body, "label_printer")


if __name__ == "__main__":
    sys.exit(app())

"""Starts the fake barcode reader: `python -m arcor2_fakes.barcode_reader`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.barcode_reader.reader import HEALTH, Framing, Health, Reader
from arcor2_fakes.control import ControlServer, parse_address
from arcor2_fakes.process import announce, run, until_told_to_end
from arcor2_fakes.serial_line import Line, PtyLine, TcpLine
from arcor2_fakes.wire import register_faults

app = App(name="arcor2_fakes.barcode_reader", help="Fake barcode reader on a pty or TCP.", version_flags=[])


def truth(reader: Reader, line: Line) -> dict[str, Any]:
    """Give what is really so in the reader, whatever the line says."""
    return {
        "code": reader.code,
        "reading": reader.reading,
        "health": reader.health,
        "plugged": line.plugged,
        "port": line.port,
        "received": list(reader.received),
        "sent": list(reader.sent),
    }


def register_commands(control: ControlServer, reader: Reader) -> None:
    """Make what the world and a test can do to the reader known to the control channel."""

    def health(value: Health) -> None:
        if value not in HEALTH:
            raise ValueError(f"health is one of {', '.join(HEALTH)}")
        reader.set_health(value)

    def late(seconds: float) -> None:
        if not 0.0 <= seconds <= 60.0:
            raise ValueError("seconds is 0 to 60")
        reader.delay_next(seconds)

    control.command("present", lambda code: reader.present(code))
    control.command("health", health)
    control.command("late", late)


@app.default
def main(
    *,
    tcp: str | None = None,
    link: Path | None = None,
    control: str = "127.0.0.1:0",
    crlf: Annotated[bool, Parameter(negative="--cr")] = False,
    stx: bool = False,
    timeout: Annotated[float, Parameter(validator=validators.Number(gt=0))] = 1.0,
    seed: int = 0,
) -> int:
    """Start the fake; it prints one line `ready {json}` with its port and ends on SIGTERM.

    Args:
        tcp: HOST:PORT to serve instead of a pty; port 0 takes a free one.
        link: symbolic link to keep on the pty, whose own path changes when it is unplugged and plugged.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        crlf: end answers with CR LF instead of CR.
        stx: frame answers with STX and ETX.
        timeout: how long the reader tries to read, s.
        seed: decides how long each reading takes.
    """
    try:
        control_address = parse_address(control)
        tcp_address = None if tcp is None else parse_address(tcp)
    except ValueError as e:
        sys.stderr.write(f"barcode_reader: {e}\n")
        return 2

    async def body() -> None:
        reader = Reader(
            lambda frame: line.send(frame), framing=Framing(line_feed=crlf, stx=stx), seed=seed, timeout=timeout
        )
        line: Line = PtyLine(reader.feed, link) if tcp_address is None else TcpLine(reader.feed, *tcp_address)

        async def plug() -> str:
            await line.plug()
            return line.port

        async def unplug() -> None:
            await line.unplug()
            reader.drop_input()

        async def renew(crlf: bool = crlf, stx: bool = stx) -> None:
            """Be as it is when the process starts, or with another framing: for tests that share one."""
            reader.as_delivered()
            reader.framing = Framing(line_feed=crlf, stx=stx)
            await line.fault("heal")
            await line.unplug()
            await line.plug()

        channel = ControlServer(*control_address)
        channel.command("renew", renew)
        register_commands(channel, reader)

        async def power_cycle() -> None:
            """Be switched off and on: the port goes and comes, what was being read is forgotten."""
            reader.close()
            await unplug()
            await line.plug()

        register_faults(channel, {"serial": line})
        channel.command("power_cycle", power_cycle)
        channel.command("plug", plug)
        channel.command("unplug", unplug)
        channel.source("truth", lambda: truth(reader, line))
        await line.plug()
        try:
            announce(name="barcode_reader", port=line.port, control=await channel.start())
            await until_told_to_end()
        finally:
            reader.close()
            await line.unplug()
            await channel.close()

    return run(body, "barcode_reader")


if __name__ == "__main__":
    sys.exit(app())

"""Start the fake barcode reader: `python -m arcor2_fakes.barcode_reader`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, validators

from arcor2_fakes.barcode_reader.reader import HEALTH, Framing, Health, Reader
from arcor2_fakes.control import parse_address
from arcor2_fakes.serial_line import Line, PtyLine, TcpLine
from arcor2_fakes.serving import Fake, serve

app = App(name="arcor2_fakes.barcode_reader", help="Fake barcode reader on a pty or TCP.", version_flags=[])


def truth(reader: Reader, line: Line) -> dict[str, Any]:
    """Return the real state of the reader."""
    return {
        "code": reader.code,
        "reading": reader.reading,
        "health": reader.health,
        "plugged": line.plugged,
        "port": line.port,
        "received": list(reader.received),
        "sent": list(reader.sent),
    }


def register_commands(fake: Fake, reader: Reader) -> None:
    """Register the commands of the control channel."""

    def health(value: Health) -> None:
        if value not in HEALTH:
            raise ValueError(f"health is one of {', '.join(HEALTH)}")
        reader.set_health(value)

    def late(seconds: float) -> None:
        if not 0.0 <= seconds <= 60.0:
            raise ValueError("seconds is 0 to 60")
        reader.delay_next(seconds)

    fake.commands(present=lambda code: reader.present(code), health=health, late=late)


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
        link: symbolic link to the pty, whose path changes when it is unplugged and plugged in.
        control: HOST:PORT of the control channel; port 0 takes a free one.
        crlf: end answers with CR LF instead of CR.
        stx: frame answers with STX and ETX.
        timeout: time limit of a reading, s.
        seed: seed of the decoding times.
    """

    async def body(fake: Fake) -> None:
        reader = Reader(
            lambda frame: line.send(frame), framing=Framing(line_feed=crlf, stx=stx), seed=seed, timeout=timeout
        )
        line: Line = PtyLine(reader.feed, link) if tcp is None else TcpLine(reader.feed, *parse_address(tcp))

        async def renew(crlf: bool = crlf, stx: bool = stx) -> None:
            """Return to the state after the start, or with another framing, for tests that share a process."""
            reader.as_delivered()
            reader.framing = Framing(line_feed=crlf, stx=stx)
            await line.fault("heal")
            await line.unplug()
            await line.plug()

        async def power_cycle() -> None:
            """Switch off and on: the port disappears for a moment, a reading is cancelled."""
            reader.close()
            await line.unplug()
            reader.drop_input()
            await line.plug()

        register_commands(fake, reader)
        fake.commands(renew=renew, power_cycle=power_cycle)
        fake.line(line, reader.drop_input)
        fake.truth(lambda: truth(reader, line))
        fake.at_end(reader.close)
        await fake.run(port=line)

    return serve("barcode_reader", control, body, tcp)


if __name__ == "__main__":
    sys.exit(app())

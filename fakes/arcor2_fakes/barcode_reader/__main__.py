"""Start the fake barcode reader: `python -m arcor2_fakes.barcode_reader`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from cyclopts.types import PositiveFloat

from arcor2_fakes.barcode_reader.reader import HEALTH, Framing, Health, Reader
from arcor2_fakes.control import one_of, within
from arcor2_fakes.program import program
from arcor2_fakes.serial_line import line_at
from arcor2_fakes.serving import Fake


def truth(reader: Reader) -> dict[str, Any]:
    """Return the real state of the reader."""
    return {
        "code": reader.code,
        "reading": reader.reading,
        "health": reader.health,
        "received": list(reader.received),
        "sent": list(reader.sent),
    }


def register_commands(fake: Fake, reader: Reader) -> None:
    """Register the commands of the control channel."""

    def health(value: Health) -> None:
        reader.set_health(one_of("health", value, HEALTH))

    def late(seconds: float) -> None:
        reader.delay_next(within("seconds", seconds, 0, 60))

    fake.commands(present=lambda code: reader.present(code), health=health, late=late)


@program("barcode_reader", "Fake barcode reader on a pty or TCP.")
async def main(
    fake: Fake,
    *,
    tcp: str | None = None,
    link: Path | None = None,
    crlf: Annotated[bool, Parameter(negative="--cr")] = False,
    stx: bool = False,
    timeout: PositiveFloat = 1.0,
    seed: int = 0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its port and ends on SIGTERM.

    Args:
        tcp: HOST:PORT to serve instead of a pty; port 0 takes a free one.
        link: Symbolic link to the pty; without it, one in a temporary directory.
        crlf: end answers with CR LF instead of CR.
        stx: frame answers with STX and ETX.
        timeout: time limit of a reading, s.
        seed: seed of the decoding times.
    """
    reader = Reader(
        lambda frame: line.send(frame), framing=Framing(line_feed=crlf, stx=stx), seed=seed, timeout=timeout
    )
    line = line_at(reader.feed, link, tcp)

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
    fake.truth(lambda: truth(reader))
    fake.at_end(reader.close)
    await fake.run(port=line)


if __name__ == "__main__":
    sys.exit(main())

"""Start the fake label printer: `python -m arcor2_fakes.label_printer`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import msgspec
from cyclopts import Parameter, validators
from cyclopts.types import PositiveFloat

from arcor2_fakes.control import within
from arcor2_fakes.label_printer.printer import FIRMWARE, SERIAL_NUMBER, LabelPrinter
from arcor2_fakes.program import program
from arcor2_fakes.serial_line import line_at
from arcor2_fakes.serving import Fake

FULL_ROLL = 10_000


def truth(printer: LabelPrinter) -> dict[str, Any]:
    """Return the real state of the printer, and the printed labels."""
    return {
        "labels": msgspec.to_builtins(list(printer.labels)),
        "counter": printer.counter,
        "waiting": printer.waiting,
        "partial": printer.partial,
        "media": printer.media,
        "paused": printer.paused,
        "head_open": printer.head_open,
        "ribbon_out": printer.ribbon_out,
        "received": list(printer.received),
    }


def register_commands(fake: Fake, printer: LabelPrinter) -> None:
    """Register the commands of the control channel."""

    def changed() -> None:
        printer.hold()
        printer.go_on()

    def media(labels: int) -> None:
        printer.media = within("labels", int(labels), 0, FULL_ROLL)
        changed()

    fake.switches(printer, changed, **{name: name for name in ("head_open", "ribbon_out", "hot", "mute", "forgetful")})
    fake.commands(
        pause=lambda on=True: printer.pause(bool(on)),
        media=media,
        renew=lambda: printer.renew(FULL_ROLL),
        power_cycle=printer.power_cycle,
    )


@program("label_printer", "Fake ZPL label printer on a pty or TCP.")
async def main(
    fake: Fake,
    *,
    tcp: str | None = None,
    link: Path | None = None,
    duration: PositiveFloat = 0.3,
    labels: Annotated[int, Parameter(validator=validators.Number(gte=0, lte=FULL_ROLL))] = FULL_ROLL,
    mute: bool = True,
    serial_number: str = SERIAL_NUMBER,
    firmware: str = FIRMWARE,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its port and ends on SIGTERM.

    Args:
        tcp: HOST:PORT to serve instead of a pty (9100 on real printers); port 0 takes a free one.
        link: Symbolic link to the pty; without it, one in a temporary directory.
        duration: printing time of a label, s.
        labels: number of labels on the roll.
        mute: do not answer while out of media or with the head open; otherwise report it in the flags of ~HS.
        serial_number: serial number of the printer.
        firmware: version of its firmware.
    """
    printer = LabelPrinter(
        lambda frame: line.send(frame),
        lambda: fake.channel.publish("truth"),
        duration=duration,
        mute=mute,
        labels=labels,
        serial_number=serial_number,
        firmware=firmware,
    )
    line = line_at(printer.feed, link, tcp)
    register_commands(fake, printer)
    fake.line(line, printer.drop_input, "data")
    fake.truth(lambda: truth(printer))
    fake.at_end(printer.close)
    await fake.run(port=line)


if __name__ == "__main__":
    sys.exit(main())

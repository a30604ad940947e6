"""`arcor2-hw device scan`: find connected devices; each kind is searched in a process with a deadline."""

import subprocess
import sys
from typing import Annotated, Final, NamedTuple

import msgspec
from cyclopts import Parameter
from rich.table import Table

from arcor2_hw.data.discovery import Found
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.tables import console

WITHIN: Final = 15.0
"""Seconds for one kind; 127 CAN nodes that all answer take some ten."""


class Look(NamedTuple):
    """One kind that was looked for: what was found, or why nothing could be."""

    what: str
    found: list[Found]
    problem: str


def scan(
    *,
    can: Annotated[
        tuple[str, ...],
        Parameter(help="A CAN bus: slcan:PORT@BITRATE, socketcan:can0, socketcand:HOST:PORT/can0; repeatable."),
    ] = (),
    oak: Annotated[bool, Parameter(help="Look for OAK cameras, on USB and in the network.")] = True,
    json: Annotated[bool, Parameter(negative=(), help="Print what was found as JSON.")] = False,
) -> int:
    """Find serial ports, OAK cameras, and the nodes of the CAN buses that are named. Nothing is switched or moved."""
    wanted = [("serial ports", ["serial"]), *((bus, ["can", bus]) for bus in can)]
    if oak:
        wanted.append(("OAK cameras", ["oak"]))
    looks = _look(wanted)
    if json:
        sys.stdout.write(msgspec.json.encode([one for look in looks for one in look.found]).decode() + "\n")
    else:
        table = Table("kind", "address", "what it says", "serial number", box=None, pad_edge=False)
        rows = [one for look in looks for one in look.found]
        for one in rows:
            table.add_row(one.kind, one.address, one.description, one.serial)
        console().print(table if rows else "Nothing was found.")
    for look in looks:
        if look.problem:
            sys.stderr.write(f"arcor2-hw device scan: {look.what}: {look.problem}\n")
    # A library that is not installed is no failure of what was asked for; a bus that was named is.
    return ExitStatus.FAILED if any(look.problem and look.what in can for look in looks) else ExitStatus.OK


def _look(wanted: list[tuple[str, list[str]]]) -> list[Look]:
    """Look for all kinds at once."""
    command = [sys.executable, "-P", "-m", "arcor2_hw.runtime.scanning"]
    running = [
        (what, subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE))  # noqa: S603
        for what, arguments in wanted
    ]
    looks = []
    for what, process in running:
        try:
            output, errors = process.communicate(timeout=WITHIN)
            problem = ""
            if process.returncode:
                last = errors.decode(errors="replace").strip().splitlines()[-1:]
                problem = "".join(last) or f"the library ended the process with status {process.returncode}"
        except subprocess.TimeoutExpired:
            process.kill()
            output, _ = process.communicate()
            problem = f"no answer within {WITHIN:g} s"
        found = [] if problem else msgspec.json.decode(output, type=list[Found])
        looks.append(Look(what, found, problem))
    return looks

"""`arcor2-hw device scan`: find connected devices. Each kind is searched in its own process with a time limit."""

import subprocess
import sys
from typing import Annotated, Final, NamedTuple

import msgspec
from cyclopts import Parameter
from rich.table import Table

from arcor2_hw.data.discovery import Found
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.tables import console

SCAN_TIMEOUT: Final = 15.0
"""Time limit for one kind of devices, s; 127 answering CAN nodes take about 10 s."""


class Scan(NamedTuple):
    """The result of the search for one kind of devices."""

    what: str
    found: list[Found]
    problem: str


def scan(
    *,
    can: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(), help="A CAN bus: slcan:PORT@BITRATE, socketcan:can0, socketcand:HOST:PORT/can0. Repeatable."
        ),
    ] = (),
    oak: Annotated[bool, Parameter(help="Search for OAK cameras on USB and in the network.")] = True,
    json: Annotated[bool, Parameter(negative=(), help="Print the result as JSON.")] = False,
) -> int:
    """Find serial ports, OAK cameras, and the nodes of the given CAN buses. Nothing is switched or moved."""
    wanted = [("serial ports", ["serial"]), *((bus, ["can", bus]) for bus in can)]
    if oak:
        wanted.append(("OAK cameras", ["oak"]))
    scans = _scan(wanted)
    found = [one for each in scans for one in each.found]
    if json:
        sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
    else:
        table = Table("kind", "address", "description", "serial number", box=None, pad_edge=False)
        for one in found:
            table.add_row(one.kind, one.address, one.description, one.serial)
        console().print(table if found else "No devices found.")
    for each in scans:
        if each.problem:
            fail("device scan", f"{each.what}: {each.problem}", ExitStatus.FAILED)
    # Only CAN buses are requested explicitly; a missing library for the other kinds is not a failure.
    return ExitStatus.FAILED if any(each.problem and each.what in can for each in scans) else ExitStatus.OK


def _scan(wanted: list[tuple[str, list[str]]]) -> list[Scan]:
    """Search for all kinds concurrently."""
    command = [sys.executable, "-P", "-m", "arcor2_hw.runtime.scanning"]
    running = [
        (what, subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE))  # noqa: S603
        for what, arguments in wanted
    ]
    scans = []
    for what, process in running:
        try:
            output, errors = process.communicate(timeout=SCAN_TIMEOUT)
            problem = ""
            if process.returncode:
                last = errors.decode(errors="replace").strip().splitlines()[-1:]
                problem = "".join(last) or f"the library ended the process with status {process.returncode}"
        except subprocess.TimeoutExpired:
            process.kill()
            output, _ = process.communicate()
            problem = f"no answer within {SCAN_TIMEOUT:g} s"
        found = [] if problem else msgspec.json.decode(output, type=list[Found])
        scans.append(Scan(what, found, problem))
    return scans

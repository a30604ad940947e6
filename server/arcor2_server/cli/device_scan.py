"""`arcor2-hw device scan`: find connected devices. Each kind is searched in its own process with a time limit."""

import asyncio
import sys
from typing import Annotated, NamedTuple

import msgspec
from cyclopts import Parameter
from rich.table import Table

from arcor2_hw.data.discovery import Found, Search
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.tables import console
from arcor2_server.errors import RequestRefused
from arcor2_server.online.device_search import search


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
    wanted = [("serial ports", Search.SERIAL, ""), *((bus, Search.CAN, bus) for bus in can)]
    if oak:
        wanted.append(("OAK cameras", Search.OAK, ""))
    scans = asyncio.run(_scan(wanted))
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


async def _scan(wanted: list[tuple[str, Search, str]]) -> list[Scan]:
    """Search for all kinds concurrently."""

    async def one(what: str, kind: Search, bus: str) -> Scan:
        try:
            return Scan(what, await search(kind, bus), "")
        except RequestRefused as error:
            return Scan(what, [], str(error))

    return await asyncio.gather(*(one(*each) for each in wanted))

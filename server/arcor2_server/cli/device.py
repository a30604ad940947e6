"""`arcor2-hw device`: list device types, show the state of running devices, and commands for integrators."""

import sys
from typing import Any

from cyclopts import App
from rich.table import Table

from arcor2_hw.analysis import Library, installed_types
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectTypeMeta
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.cli.tables import console

app = App(name="device", help="List, find and check devices; create a driver.")

app.command(
    "arcor2_server.cli.device_new:new",
    name="new",
    help="Create a driver for a new device with a fake, a test and a page. It passes the conformance suite.",
)
app.command(
    "arcor2_server.cli.device_scan:scan",
    name="scan",
    help="Find serial ports, OAK cameras, and the nodes of CAN buses. Nothing is switched or moved.",
)
app.command(
    "arcor2_server.cli.device_cell:export",
    name="export",
    help="Write the devices of a scene of a server as a cell.yaml to standard output.",
)
app.command(
    "arcor2_server.cli.device_cell:check",
    name="check",
    help="Connect to each device of a cell.yaml and read its state. Nothing is moved, switched or written.\n\n"
    "With --real NAME, lead a person at the terminal through the first day with one real device: reading with the "
    "brakes on, limits, and the conformance cases in a safe order. Everything that moves is confirmed first. The "
    "result is a report that can be evidence for the driver.",
)


@app.command(name="list")
def list_devices() -> int:
    """List the device types that are installed on this machine. No driver is loaded."""
    installed = installed_types()
    if not installed:
        sys.stdout.write("No device types are installed. Install a driver, or upload a type to a server.\n")
        return ExitStatus.OK
    library = Library(one.file for one in installed if one.file is not None)
    table = Table("name", "type", "kind", "actions", "distribution", "description", box=None, pad_edge=False)
    unusable = False
    for one in installed:
        origin = f"{one.distribution} {one.version}".strip()
        if one.file is None:
            table.add_row("", one.name, "", "", origin, f"[red]cannot be used: {one.problem}")
            unusable = True
            continue
        analysis = library.analyse(one.name)
        unusable |= analysis.meta.disabled
        meta = analysis.meta
        table.add_row(meta.shown_name, one.name, meta.base, str(len(analysis.actions)), origin, _description(meta))
    console().print(table)
    return ExitStatus.ANALYSIS_PROBLEMS if unusable else ExitStatus.OK


def _description(meta: ObjectTypeMeta) -> str:
    if meta.disabled and not isinstance(meta.problem, Unset):
        return f"[red]cannot be used: {meta.problem}"
    return meta.description


@app.command
def status(*, server: Server = HERE) -> int:
    """Show connection, health and alarms of the online devices of a running server."""

    async def work() -> None:
        async with server.rest() as rest:
            _show(await rest.request("GET", "/api/devices", list[dict[str, Any]]))

    return run("device status", work)


def _show(devices: list[dict[str, Any]]) -> None:
    if not devices:
        sys.stdout.write("No device is online. Start a scene or run a package first.\n")
        return
    columns = sorted({key for device in devices for key in device})
    table = Table(*columns, box=None, pad_edge=False)
    for device in devices:
        table.add_row(*(_text(device.get(column)) for column in columns))
    console().print(table)


def _text(value: Any) -> str:
    if isinstance(value, list):
        return "; ".join(map(_text, value))
    if isinstance(value, dict):
        return str(value.get("text") or value)
    return "" if value is None else str(value)

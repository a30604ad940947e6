"""`arcor2-hw device`: list usable devices and the state of running ones; commands for integrators."""

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

app = App(name="device", help="Devices: which there are, how they are; bring in one of your own.")

app.command("arcor2_server.cli.device_new:new", name="new")
app.command("arcor2_server.cli.device_scan:scan", name="scan")
app.command("arcor2_server.cli.device_cell:export", name="export")
app.command("arcor2_server.cli.device_cell:check", name="check")


@app.command(name="list")
def list_devices() -> int:
    """List the device types that are installed on this machine; no driver is loaded for it."""
    installed = installed_types()
    if not installed:
        sys.stdout.write("No device types are installed: install a driver, or upload a type to a server.\n")
        return ExitStatus.OK
    library = Library(one.file for one in installed if one.file is not None)
    table = Table("type", "kind", "actions", "comes with", "description", box=None, pad_edge=False)
    broken: list[str] = []
    for one in installed:
        origin = f"{one.distribution} {one.version}".strip()
        if one.file is None:
            table.add_row(one.name, "", "", origin, f"[red]cannot be used: {one.problem}")
            broken.append(one.name)
            continue
        found = library.analyse(one.name)
        text = _described(found.meta)
        if found.meta.disabled:
            broken.append(one.name)
        table.add_row(one.name, found.meta.base, str(len(found.actions)), origin, text)
    console().print(table)
    return ExitStatus.ANALYSIS_PROBLEMS if broken else ExitStatus.OK


def _described(meta: ObjectTypeMeta) -> str:
    if meta.disabled and not isinstance(meta.problem, Unset):
        return f"[red]cannot be used: {meta.problem}"
    return meta.description


@app.command
def status(*, server: Server = HERE) -> int:
    """Show connection, health and alarms of the devices that a running server has in operation."""

    async def work() -> None:
        async with server.rest() as rest:
            _show(await rest.request("GET", "/api/devices", list[dict[str, Any]]))

    return run("device status", work)


def _show(devices: list[dict[str, Any]]) -> None:
    if not devices:
        sys.stdout.write("No device is in operation: start a scene or run a package first.\n")
        return
    columns = sorted({key for device in devices for key in device})
    table = Table(*columns, box=None, pad_edge=False)
    for device in devices:
        table.add_row(*(_shown(device.get(column)) for column in columns))
    console().print(table)


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return "; ".join(_shown(item) for item in value)
    if isinstance(value, dict):
        return str(value.get("text") or value)
    return "" if value is None else str(value)

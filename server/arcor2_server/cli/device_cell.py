"""`arcor2-hw device export | check`: write a cell.yaml from a scene, and check the devices that one names."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated, Final

import msgspec
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from arcor2_hw.data.cell import Cell, exported, read_cell, write_cell
from arcor2_hw.data.discovery import Checked
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.cli.tables import console

VIRTUAL: Final = "VirtualCollisionObject"
CHECKED_WITHIN: Final = 60.0
"""Time limit for checking all devices concurrently, s; the slowest needs about twenty to connect."""


# ------------------------------------------------------------------------------------------------ export
def export(
    *,
    scene: Annotated[str | None, Parameter(help="Name or id of the scene; may be left out when there is one.")] = None,
    server: Server = HERE,
) -> int:
    """Write the devices of a server's scene as a cell.yaml to standard output."""

    async def work() -> None:
        sys.stdout.write(write_cell(await _exported(server, scene)).decode())

    return run("device export", work)


async def _exported(server: Server, wanted: str | None) -> Cell:
    async with server.client() as client:
        scenes = await client.list_scenes()
        named = [scene for scene in scenes if wanted is None or wanted in (scene.id, scene.name)]
        if not scenes:
            raise NotFound("{url} has no scenes", url=client.url)
        if not named:
            raise NotFound("the server at {url} has no scene {wanted}", url=client.url, wanted=wanted)
        if len(named) > 1:
            raise NotFound(
                "say which scene with --scene: {named}", named=", ".join(sorted(scene.name for scene in named))
            )
        scene = await client.get_scene(named[0].id)
        types = await client.get_object_types()
        return exported(scene, {one.type for one in types if VIRTUAL in (one.type, one.base)})


# ------------------------------------------------------------------------------------------------ check
def check(
    file: Annotated[Path, Parameter(help="The cell.yaml.")],
    *,
    json: Annotated[bool, Parameter(negative=(), help="Print what was found as JSON.")] = False,
) -> int:
    """Connect and read every device of a cell.yaml, and show what was found. Nothing is moved, switched or written."""
    try:
        cell = read_cell(file)
    except (NotFound, InvalidData) as error:
        sys.stderr.write(f"arcor2-hw device check: {' '.join(str(error).split())}\n")
        return ExitStatus.NOT_FOUND if isinstance(error, NotFound) else ExitStatus.CELL_UNUSABLE
    found = checked(file, cell)
    if json:
        sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
    else:
        _show(found, console())
    unfit = [one.name for one in found if not one.fit]
    if unfit:
        sys.stderr.write(f"arcor2-hw device check: not fit for work: {', '.join(unfit)}\n")
        return ExitStatus.DEVICE_UNREACHABLE
    return ExitStatus.OK


def checked(file: Path, cell: Cell) -> list[Checked]:
    """Look at all devices in one process; if a driver ends it, at each of the others in one of its own."""
    found, _ = _look(file)
    for device in cell.devices:
        if device.name not in found:
            again, why = _look(file, device.name)
            found |= again or {device.name: Checked(device.name, device.type, problem=why)}
    return [found[device.name] for device in cell.devices]


def _look(file: Path, *names: str) -> tuple[dict[str, Checked], str]:
    """Return what one process found, and why it found no more."""
    command = [sys.executable, "-P", "-m", "arcor2_hw.runtime.checking", str(file), *names]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)  # noqa: S603 - our own words
    why = ""
    try:
        output, errors = process.communicate(timeout=CHECKED_WITHIN)
    except subprocess.TimeoutExpired:
        process.kill()
        output, errors = process.communicate()
        why = f"no answer within {CHECKED_WITHIN:g} s"
    lines = [msgspec.json.decode(line, type=Checked) for line in output.splitlines() if line.startswith(b"{")]
    if not why and process.returncode:
        last = errors.decode(errors="replace").strip().splitlines()[-1:]
        why = f"its driver ended the process with status {process.returncode}: {''.join(last)}"
    return {one.name: one for one in lines}, why


def _show(found: list[Checked], console: Console) -> None:
    table = Table(
        *("name", "type", "address", "connection", "identity", "health", "alarms", "control", "connected in"),
        box=None,
        pad_edge=False,
    )
    for one in found:
        if one.problem:
            table.add_row(one.name, one.type, one.address, f"[red]{one.connection}", f"[red]{one.problem}")
            continue
        told = () if one.identity is None else msgspec.structs.astuple(one.identity)
        table.add_row(
            one.name,
            one.type,
            one.address,
            one.connection,
            " ".join(part for part in told if part),
            one.health if one.fit else f"[red]{one.health}",
            "; ".join(alarm.text for alarm in one.alarms),
            one.control_owner or "",
            f"{one.seconds:.2f} s",
        )
    console.print(table if found else "The file names no devices.")

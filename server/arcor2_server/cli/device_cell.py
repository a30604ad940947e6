"""`arcor2-hw device export` and `check`: write a cell.yaml from a scene, and check the devices of a cell.yaml."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated, Final

import msgspec
from cyclopts import Parameter
from rich.table import Table

from arcor2_hw.data.cell import Cell, exported, read_cell, write_cell
from arcor2_hw.data.discovery import Checked
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.cli.device_first_day import first_day
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.cli.tables import console

VIRTUAL: Final = "VirtualCollisionObject"
CHECK_TIMEOUT: Final = 60.0
"""Time limit for checking all devices concurrently, s; the slowest device needs about 20 s to connect."""


# ------------------------------------------------------------------------------------------------ export
def export(
    *,
    scene: Annotated[str | None, Parameter(help="Name or id of the scene; optional if there is only one.")] = None,
    server: Server = HERE,
) -> int:
    """Write the devices of a scene of a server as a cell.yaml to standard output."""

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
                "select a scene with --scene: {named}", named=", ".join(sorted(scene.name for scene in named))
            )
        scene = await client.get_scene(named[0].id)
        types = await client.get_object_types()
        return exported(scene, {one.type for one in types if VIRTUAL in (one.type, one.base)})


# ------------------------------------------------------------------------------------------------ check
def check(
    file: Annotated[Path, Parameter(help="The cell.yaml.")],
    *,
    json: Annotated[bool, Parameter(negative=(), help="Print the result as JSON.")] = False,
    real: Annotated[
        str | None,
        Parameter(help="Lead through the first day with this real device. Everything that moves is confirmed first."),
    ] = None,
    plan: Annotated[bool, Parameter(negative=(), help="With --real, only show what would be done.")] = False,
    report: Annotated[Path | None, Parameter(help="With --real, the new folder for report and recording.")] = None,
) -> int:
    """Connect to each device of a cell.yaml and read its state. Nothing is moved, switched or written.

    With --real NAME, lead a person at the terminal through the first day with one real device.
    """
    try:
        cell = read_cell(file)
    except (NotFound, InvalidData) as error:
        status = ExitStatus.NOT_FOUND if isinstance(error, NotFound) else ExitStatus.CELL_UNUSABLE
        return fail("device check", " ".join(str(error).split()), status)
    if real is not None:
        return first_day(file, real, plan, report)
    if plan or report is not None:
        return fail("device check", "--plan and --report need --real NAME", ExitStatus.USAGE)
    found = check_devices(file, cell)
    if json:
        sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
    else:
        _show(found)
    unfit = [one.name for one in found if not one.fit]
    if unfit:
        return fail("device check", f"not ready: {', '.join(unfit)}", ExitStatus.DEVICE_UNREACHABLE)
    return ExitStatus.OK


def check_devices(file: Path, cell: Cell) -> list[Checked]:
    """Check all devices in one process.

    If a driver ends this process, check each remaining device in its own process.
    """
    found, _ = _run_check(file)
    for device in cell.devices:
        if device.name not in found:
            again, problem = _run_check(file, device.name)
            found |= again or {device.name: Checked(device.name, device.type, problem=problem)}
    return [found[device.name] for device in cell.devices]


def _run_check(file: Path, *names: str) -> tuple[dict[str, Checked], str]:
    """Return the results of one process by device, and the reason if it did not check all of them."""
    command = [sys.executable, "-P", "-m", "arcor2_hw.runtime.checking", str(file), *names]
    problem = ""
    try:
        process = subprocess.run(command, capture_output=True, timeout=CHECK_TIMEOUT, check=False)  # noqa: S603
        output = process.stdout
        if process.returncode:
            last = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
            problem = f"the driver ended the process with status {process.returncode}: {''.join(last)}"
    except subprocess.TimeoutExpired as error:
        output = error.output or b""
        problem = f"no answer within {CHECK_TIMEOUT:g} s"
    lines = [msgspec.json.decode(line, type=Checked) for line in output.splitlines() if line.startswith(b"{")]
    return {one.name: one for one in lines}, problem


def _show(found: list[Checked]) -> None:
    table = Table(
        *("name", "type", "address", "connection", "identity", "health", "alarms", "control", "connected in"),
        box=None,
        pad_edge=False,
    )
    for one in found:
        if one.problem:
            table.add_row(one.name, one.type, one.address, f"[red]{one.connection}", f"[red]{one.problem}")
            continue
        identity = () if one.identity is None else msgspec.structs.astuple(one.identity)
        table.add_row(
            one.name,
            one.type,
            one.address,
            one.connection,
            " ".join(filter(None, identity)),
            one.health if one.fit else f"[red]{one.health}",
            "; ".join(alarm.text for alarm in one.alarms),
            one.control_owner or "",
            f"{one.seconds:.2f} s",
        )
    console().print(table if found else "The file contains no devices.")

"""`arcor2-hw cell`: the cell as a machine of a line: its mode, its authority, and the jobs of its PLC."""

import getpass
from collections.abc import Awaitable, Callable
from typing import Annotated

from cyclopts import App, Parameter
from rich.markup import escape
from rich.table import Table

from arcor2_hw.client import Client
from arcor2_hw.data.base import Unset
from arcor2_hw.data.cell_state import CellAuthority, CellJob, CellMode, CellStatus
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.cli.tables import console

app = App(name="cell", help="Show and change mode and authority of the cell, and the jobs of its PLC.")

User = Annotated[str | None, Parameter(help="Your name, which is stored. The default is that of your account.")]


@app.command
def show(*, server: Server = HERE) -> int:
    """Show state, mode, authority, the connection of the PLC and its jobs."""
    return _run("show", server, Client.get_cell)


@app.command
def mode(
    mode: Annotated[CellMode, Parameter(help="Mode of the cell.")],
    /,
    *,
    user: User = None,
    server: Server = HERE,
) -> int:
    """Change the mode while no program runs."""
    return _run("mode", server, lambda client: client.set_cell_mode(mode), user or getpass.getuser())


@app.command
def authority(
    authority: Annotated[CellAuthority, Parameter(help="The client that may start programs.")],
    /,
    *,
    user: User = None,
    server: Server = HERE,
) -> int:
    """Give the authority to the hub, the PLC or nobody. A running program continues."""
    return _run("authority", server, lambda client: client.set_cell_authority(authority), user or getpass.getuser())


@app.command
def job(
    number: Annotated[int, Parameter(help="Number by which the PLC requests the job, 1 to 65535.")],
    package: Annotated[str | None, Parameter(help="Id of the package; without it, the job is removed.")] = None,
    /,
    *,
    user: User = None,
    server: Server = HERE,
) -> int:
    """Assign a job to a package, or remove it."""

    async def assign(client: Client) -> CellStatus:
        jobs = [each for each in (await client.get_cell()).jobs if each.number != number]
        if package is not None:
            jobs.append(CellJob(number, package))
        return await client.set_cell_jobs(jobs)

    return _run("job", server, assign, user or getpass.getuser())


def _run(command: str, server: Server, work: Callable[[Client], Awaitable[CellStatus]], user: str = "") -> int:
    """Run a request, as a user if it changes something, and show the cell."""

    async def connected() -> None:
        async with server.client() as client:
            if user:
                await client.register_user(user_name=user)
            _show(await work(client))

    return run(f"cell {command}", connected)


def _show(cell: CellStatus) -> None:
    print_ = console().print
    print_(f"state {cell.state}, mode {cell.mode}, authority {cell.authority}")
    if cell.opcua:
        print_("Plant systems connect by OPC UA.")
    if isinstance(cell.plc, Unset):
        print_("The server has no Modbus block for a PLC. Start it with --plc-modbus.")
    else:
        peer = "not connected" if isinstance(cell.plc.peer, Unset) else cell.plc.peer
        life = "its life counter changes" if cell.plc.alive else "its life counter does not change"
        print_(f"Modbus block at {cell.plc.listening}, PLC {peer}, {life}")
    table = Table("job", "package", box=None, pad_edge=False)
    for each in cell.jobs:
        table.add_row(str(each.number), escape(each.package_id))
    print_(table if cell.jobs else "There are no jobs.")

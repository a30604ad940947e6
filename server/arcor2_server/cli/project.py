"""`arcor2-hw project`: list, export, import, check and compare projects."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from arcor2_server.cli import export_files
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.exchange.export import Source

app = App(name="project", help="List the projects of a server; bring them out, in, check and compare them.")


@app.command(name="list")
def list_projects(*, as_json: export_files.Json = False, server: Server = HERE) -> int:
    """Show the saved projects of a server."""

    async def work() -> None:
        async with server.rest() as rest:
            export_files.show_list(await rest.projects(), "There are no projects.", as_json)

    return run("project list", work)


@app.command
def export(
    name: Annotated[str, Parameter(help="Name of the project, or its id.")],
    /,
    *,
    output: export_files.Output = None,
    force: export_files.Force = False,
    server: Server = HERE,
) -> int:
    """Write a project, as it was saved last, into one file with its scene and all it needs."""

    async def work() -> None:
        async with server.client() as client:
            export_files.write(await Source(client).project(name), output, force)

    return run("project export", work)


@app.command(name="import")
def import_project(
    file: Annotated[Path, Parameter(help="What `arcor2-hw project export` wrote, or an execution package.")],
    /,
    *,
    overwrite: export_files.Overwrite = None,
    name: Annotated[str | None, Parameter(help="Bring it in as a copy under this name.")] = None,
    dry_run: export_files.DryRun = False,
    server: Server = HERE,
) -> int:
    """Bring a project into a server, with its scene and all it needs.

    What is there already and the same is left alone. What differs is named and nothing is done, unless --overwrite
    allows it: project, scene, types (with their models), assets, or all.
    """
    return run("project import", lambda: export_files.bring_in(file, "project", server, overwrite or [], name, dry_run))


@app.command
def validate(*files: Annotated[Path, Parameter(help="Export files.")], as_json: export_files.Json = False) -> int:
    """Check export files, or execution packages, without a server. Every problem names the entry at fault."""
    return run("project validate", lambda: export_files.validate(list(files), "project", as_json))


@app.command
def diff(
    old: Annotated[str, Parameter(help="An export file, or the name or id of a project of the server.")],
    new: Annotated[str, Parameter(help="Likewise: what it is compared with.")],
    /,
    *,
    as_json: export_files.Json = False,
    server: Server = HERE,
) -> int:
    """Show what differs between two projects and what they need; the status tells whether anything does."""
    return run("project diff", lambda: export_files.compare(old, new, "project", server, Source.project, as_json))

"""`arcor2-hw scene`: list, export, import, check and compare scenes."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from arcor2_server.cli import export_files
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.exchange.export import Source

app = App(name="scene", help="List the scenes of a server; bring them out, in, check and compare them.")


@app.command(name="list")
def list_scenes(*, as_json: export_files.Json = False, server: Server = HERE) -> int:
    """Show the saved scenes of a server."""

    async def work() -> None:
        async with server.rest() as rest:
            export_files.show_list(await rest.scenes(), "There are no scenes.", as_json)

    return run("scene list", work)


@app.command
def export(
    name: Annotated[str, Parameter(help="Name of the scene, or its id.")],
    /,
    *,
    output: export_files.Output = None,
    force: export_files.Force = False,
    server: Server = HERE,
) -> int:
    """Write a scene, as it was saved last, into one file with all it needs: object types, models, meshes."""

    async def work() -> None:
        async with server.client() as client:
            export_files.write(await Source(client).scene(name), output, force)

    return run("scene export", work)


@app.command(name="import")
def import_scene(
    file: Annotated[Path, Parameter(help="What `arcor2-hw scene export` wrote, or `project export`.")],
    /,
    *,
    overwrite: export_files.Overwrite = None,
    name: Annotated[str | None, Parameter(help="Bring it in as a copy under this name.")] = None,
    dry_run: export_files.DryRun = False,
    server: Server = HERE,
) -> int:
    """Bring a scene into a server, with all it needs.

    What is there already and the same is left alone. What differs is named and nothing is done, unless --overwrite
    allows it: scene, types (with their models), assets, or all.
    """
    return run("scene import", lambda: export_files.bring_in(file, "scene", server, overwrite or [], name, dry_run))


@app.command
def validate(*files: Annotated[Path, Parameter(help="Export files.")], as_json: export_files.Json = False) -> int:
    """Check export files without a server. Every problem names the entry at fault."""
    return run("scene validate", lambda: export_files.validate(list(files), "scene", as_json))


@app.command
def diff(
    old: Annotated[str, Parameter(help="An export file, or the name or id of a scene of the server.")],
    new: Annotated[str, Parameter(help="Likewise: what it is compared with.")],
    /,
    *,
    as_json: export_files.Json = False,
    server: Server = HERE,
) -> int:
    """Show what differs between two scenes and what they need; the status tells whether anything does."""
    return run("scene diff", lambda: export_files.compare(old, new, "scene", server, Source.scene, as_json))

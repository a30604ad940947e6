"""`arcor2-hw project`: list, export, import, check, compare and dry-run projects, and exchange functions."""

import re
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import msgspec
from cyclopts import Parameter

from arcor2_hw.client import Client
from arcor2_hw.client.rest import Rest
from arcor2_hw.data.rpc import FunctionExport
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.cli import export_files
from arcor2_server.cli.document_commands import DocumentKind, document_commands
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import HERE, Failed, Server, run
from arcor2_server.documents.document import Document
from arcor2_server.documents.function_exchange import export_function
from arcor2_server.exchange.export import Exporter, find_id

app = document_commands(
    DocumentKind(
        name="project",
        saved=Rest.projects,
        export=Exporter.project,
        content="its scene, object types, models and meshes",
        sources="A file that `arcor2-hw project export` wrote, or an execution package.",
        parts="project, scene, types (with their models), assets",
        packages=", or execution packages,",
    )
)

app.command("arcor2_server.cli.dry_run:project_dry_run", name="dry-run")

USER: Final = "import of a function"
"""The user name of the command, which the history of the project shows."""


class _Point(NamedTuple):
    """An action point of the exported function, and the one of the project that replaces it."""

    exported: str
    own: str


@app.command(name="export-function")
def export(
    project: Annotated[str, Parameter(help="Name of the project, or its id.")],
    function: Annotated[str, Parameter(help="Name of the function, or its id.")],
    /,
    *,
    output: Annotated[
        Path | None, Parameter(name=["--output", "-o"], help="The file. The default is NAME.json.")
    ] = None,
    force: export_files.Force = False,
    server: Server = HERE,
) -> int:
    """Write a function of a saved project into a file, with the functions that it calls."""

    async def work() -> None:
        async with server.client() as client:
            document = await _saved(client, project)
        own = document.project
        found = () if own is None else (each.id for each in own.functions if function in (each.id, each.name))
        key = next(iter(found), None)
        if key is None:
            raise NotFound("the project {project} has no function {function}", project=project, function=function)
        exported = export_function(document, key)
        path = output or Path(re.sub(r"[^\w.-]+", "_", exported.functions[-1].name) + ".json")
        if path.exists() and not force:
            raise Failed(ExitStatus.CONFLICT, f"{path} already exists; use --force to replace it")
        path.write_bytes(msgspec.json.format(msgspec.json.encode(exported), indent=2) + b"\n")
        names = ", ".join(each.name for each in exported.functions)
        export_files.print_line(f"{path}: functions {names}; {len(exported.references)} references")

    return run("project export-function", work)


async def _saved(client: Client, project: str) -> Document:
    """Return a saved project with its scene as a document."""
    key = find_id(await client.rest.projects(), project, "project", client.url)
    stored = await client.get_project(id=key)
    return Document.of(await client.get_scene(id=stored.scene_id), stored)


@app.command(name="import-function")
def import_(
    project: Annotated[str, Parameter(help="Name of the project, or its id.")],
    file: Annotated[Path, Parameter(help="A file that `arcor2-hw project export-function` wrote.")],
    /,
    *,
    point: Annotated[
        list[str] | None,
        Parameter(negative=(), help="OLD=NEW: an exported action point, and the one of the project. Repeatable."),
    ] = None,
    dry_run: export_files.DryRun = False,
    server: Server = HERE,
) -> int:
    """Add an exported function to a project and save it. The server must have no scene or project open."""

    async def work() -> None:
        try:
            exported = msgspec.json.decode(file.read_bytes(), type=FunctionExport)
        except (OSError, msgspec.MsgspecError) as error:
            raise InvalidData("{file} cannot be read: {reason}", file=file, reason=error) from error
        points = dict(_pair(each) for each in point or ())
        async with server.client() as client:
            key = find_id(await client.rest.projects(), project, "project", client.url)
            await client.register_user(USER)
            await client.open_project(id=key)
            try:
                await client.import_function(function=exported, points=points, dry_run=dry_run)
                if not dry_run:
                    await client.save_project()
            finally:
                await client.close_project(force=True)
        names = ", ".join(each.name for each in exported.functions)
        export_files.print_line(f"{project}: {'can import' if dry_run else 'imported'} {names}")

    return run("project import-function", work)


def _pair(text: str) -> _Point:
    exported, equals, own = text.partition("=")
    if not equals or not exported or not own:
        raise Failed(ExitStatus.USAGE, f"--point needs OLD=NEW, not {text!r}")
    return _Point(exported, own)

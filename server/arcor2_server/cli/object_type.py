"""`arcor2-hw object-type`: upload object types to a running server, list, delete and compare them."""

import ast
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from arcor2_hw.analysis import Library, SourceFile, TypeAnalysis, module_name
from arcor2_hw.client import Rest
from arcor2_hw.data.base import Unset, is_valid_name
from arcor2_server.cli import export_files
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import HERE, Failed, Server, run
from arcor2_server.exchange.archive import Archive
from arcor2_server.exchange.export import Exporter

app = App(name="object-type", help="Bring object types into a server, list, check and compare them, take them out.")


def _read(file: Path) -> str:
    try:
        return file.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise Failed(ExitStatus.NOT_FOUND, f"{file} cannot be read: {error}") from error


def _class_in(source: str, file: Path, name: str | None) -> str:
    """Return the name under which a file is added.

    That is the given class, the class that the file is named after, or its only object type. A helper module, which
    declares no object type, has the name of the file.
    """
    try:
        names = [node.name for node in ast.parse(source).body if isinstance(node, ast.ClassDef)]
    except SyntaxError as error:
        raise Failed(ExitStatus.ANALYSIS_PROBLEMS, f"{file}:{error.lineno}: {error.msg}") from error
    if name is None:
        found = [each for each in names if module_name(each) == file.stem]
        if not found:
            types = [analysis for each in names if (analysis := _analysis(each, source)).is_object_type]
            found = [analysis.meta.type for analysis in types if not analysis.meta.abstract]
            if not types and is_valid_name(file.stem) and module_name(file.stem) == file.stem:
                found = [file.stem]
    else:
        found = [each for each in names if each == name]
    if len(found) != 1:
        listed = ", ".join(found or names) or "none"
        raise Failed(ExitStatus.USAGE, f"say which class of {file} is meant with --name: {listed}")
    return found[0]


def _analysis(name: str, source: str) -> TypeAnalysis:
    return Library([SourceFile(name, module_name(name), source)]).analyse(name)


async def _in_order(given: dict[str, SourceFile], rest: Rest) -> list[SourceFile]:
    """Give files each behind those it needs; Failed when one has a problem, with what the server has taken in too."""
    library = Library(given.values())
    if any(library.analyse(name).problem for name in given):
        for entry in await rest.object_types():
            if entry.id not in given:
                stored = await rest.object_type(entry.id)
                library.add(SourceFile(stored.id, module_name(stored.id), stored.source))
    ordered: dict[str, SourceFile] = {}
    for name, file in given.items():
        analysis = library.analyse(name)
        if analysis.problem is not None:
            raise Failed(ExitStatus.ANALYSIS_PROBLEMS, str(analysis.problem))
        ordered |= {each.name: given[each.name] for each in analysis.modules if each.name in given}
        ordered[name] = file
    return list(ordered.values())


@app.command
def add(
    *files: Path,
    name: Annotated[str | None, Parameter(help="The class, when a file declares several object types.")] = None,
    server: Server = HERE,
) -> int:
    """Bring in object types from Python files, new or changed. The files are read, not imported.

    Bases, mixins and other modules that they import relatively are given with them, or were brought in before.
    """

    async def work() -> None:
        if not files or (name is not None and len(files) > 1):
            raise Failed(ExitStatus.USAGE, "give the files of the object types; --name only with one file")
        given: dict[str, SourceFile] = {}
        for file in files:
            source = _read(file)
            chosen = _class_in(source, file, name)
            given[chosen] = SourceFile(chosen, module_name(chosen), source, str(file))
        async with server.client() as client:
            for one in await _in_order(given, client.rest):
                source = one.source if isinstance(one.source, str) else one.source.decode()
                await client.rest.put_object_type(one.name, source)
                export_files.say(f"{one.name} added")
            for meta in await client.get_object_types():
                if meta.type in given and not isinstance(meta.shadows, Unset):
                    export_files.say(
                        f"{meta.type} takes the place of the installed type of {meta.shadows} until you remove it"
                    )

    return run("object-type add", work)


@app.command(name="list")
def list_types(*, as_json: export_files.Json = False, server: Server = HERE) -> int:
    """Show the object types that were brought into a server."""

    async def work() -> None:
        async with server.rest() as rest:
            export_files.show_list(await rest.object_types(), "No object types were brought in.", as_json)

    return run("object-type list", work)


@app.command
def remove(name: str, /, *, server: Server = HERE) -> int:
    """Take an object type out of a server."""

    async def work() -> None:
        async with server.rest() as rest:
            await rest.delete_object_type(name)
        export_files.say(f"{name} removed")

    return run("object-type remove", work)


@app.command
def export(
    *names: Annotated[str, Parameter(help="Object types that were brought in.")],
    output: export_files.Output = None,
    force: export_files.Force = False,
    server: Server = HERE,
) -> int:
    """Write object types into one file, with their bases, mixins, models and meshes."""

    async def work() -> None:
        if not names:
            raise Failed(ExitStatus.USAGE, "give the names of the object types")
        async with server.client() as client:
            archive = await Exporter(client).object_types(names)
        path = output or Path(f"{names[0]}.zip")
        export_files.write(archive, path, force)

    return run("object-type export", work)


@app.command(name="import")
def import_types(
    file: Annotated[Path, Parameter(help="What `arcor2-hw object-type export` wrote.")],
    /,
    *,
    overwrite: export_files.Overwrite = None,
    dry_run: export_files.DryRun = False,
    server: Server = HERE,
) -> int:
    """Bring the object types of a file into a server, with their models and meshes.

    What is there already and the same is left alone. What differs is named and nothing is done, unless --overwrite
    allows it: types (with their models), assets, or all.
    """
    return run(
        "object-type import", lambda: export_files.bring_in(file, "object-type", server, overwrite or [], None, dry_run)
    )


@app.command
def validate(*files: Annotated[Path, Parameter(help="Export files.")], as_json: export_files.Json = False) -> int:
    """Check export files without a server. For a Python file there is `arcor2-hw analyse`."""
    return run("object-type validate", lambda: export_files.validate(list(files), "object-type", as_json))


async def _one(exporter: Exporter, name: str) -> Archive:
    return await exporter.object_types([name])


@app.command
def diff(
    old: Annotated[str, Parameter(help="An export file, or the name of an object type of the server.")],
    new: Annotated[str, Parameter(help="Likewise: what it is compared with.")],
    /,
    *,
    as_json: export_files.Json = False,
    server: Server = HERE,
) -> int:
    """Show what differs between two object types and what they need; the status tells whether anything does."""
    return run("object-type diff", lambda: export_files.compare(old, new, "object-type", server, _one, as_json))

"""`arcor2-hw object-type`: upload object types to a running server, list, delete and compare them."""

import ast
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from msgspec.structs import replace

from arcor2_hw.analysis import Library, SourceFile, TypeAnalysis, module_name
from arcor2_hw.data.base import Unset, is_valid_name
from arcor2_hw.parsing import parse
from arcor2_server.cli import export_files
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import HERE, Failed, Server, run
from arcor2_server.cli.uploads import plan_uploads
from arcor2_server.exchange.archive import Archive
from arcor2_server.exchange.export import Exporter

app = App(name="object-type", help="Upload, list, check, compare and delete object types.")


def _read(file: Path) -> str:
    try:
        return file.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise Failed(ExitStatus.NOT_FOUND, f"{file} cannot be read: {error}") from error


def _class_in(source: str, file: Path, name: str | None) -> str:
    """Return the name under which a file is uploaded.

    It is the given class, the class that matches the file name, or the only object type, in this order. A helper module
    without an object type has the name of the file.
    """
    try:
        names = [node.name for node in parse(source).body if isinstance(node, ast.ClassDef)]
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
        raise Failed(ExitStatus.USAGE, f"select a class of {file} with --name: {listed}")
    return found[0]


def _analysis(name: str, source: str) -> TypeAnalysis:
    return Library([SourceFile(name, module_name(name), source)]).analyse(name)


@app.command
def add(
    *files: Path,
    name: Annotated[str | None, Parameter(help="The class, if a file defines several object types.")] = None,
    server: Server = HERE,
) -> int:
    """Upload new or changed object types from Python files. The files are read, not executed.

    A module without an object type (a mixin, constants, functions) belongs to the type that imports it relatively, and
    replaces no module of the same name of other types. If several of the files import it, they share it. Upload bases
    before or together with the types that derive from them.
    """

    async def work() -> None:
        if not files or (name is not None and len(files) > 1):
            raise Failed(ExitStatus.USAGE, "specify the files of the object types; --name only with a single file")
        given: dict[str, SourceFile] = {}
        for file in files:
            source = _read(file)
            chosen = _class_in(source, file, name)
            given[chosen] = SourceFile(chosen, module_name(chosen), source, str(file))
        async with server.client() as client:
            for one in await plan_uploads(given, client.rest):
                await client.rest.put_object_type(one.name, one.source, modules=one.modules)
                export_files.print_line(str(one))
            for meta in await client.get_object_types():
                if meta.type in given and not isinstance(meta.shadows, Unset):
                    export_files.print_line(
                        f"{meta.type} replaces the installed type of {meta.shadows} until you remove it"
                    )

    return run("object-type add", work)


@app.command(name="list")
def list_types(*, as_json: export_files.Json = False, server: Server = HERE) -> int:
    """List the uploaded object types of a server."""

    async def work() -> None:
        async with server.client() as client:
            listed = await client.rest.object_types()
            if not as_json:
                shown = {meta.type: meta.shown_name for meta in await client.get_object_types()}
                listed = [replace(each, name=shown.get(each.name, each.name)) for each in listed]
        export_files.show_list(listed, "No object type was uploaded.", as_json)

    return run("object-type list", work)


@app.command
def remove(name: str, /, *, server: Server = HERE) -> int:
    """Delete an uploaded object type."""

    async def work() -> None:
        async with server.rest() as rest:
            await rest.delete_object_type(name)
        export_files.print_line(f"{name} removed")

    return run("object-type remove", work)


@app.command
def export(
    *names: Annotated[str, Parameter(help="Names of uploaded object types.")],
    output: export_files.Output = None,
    force: export_files.Force = False,
    server: Server = HERE,
) -> int:
    """Write object types to a file, with their bases, mixins, models and meshes."""

    async def work() -> None:
        if not names:
            raise Failed(ExitStatus.USAGE, "specify the names of the object types")
        async with server.client() as client:
            archive = await Exporter(client).object_types(names)
        path = output or Path(f"{names[0]}.zip")
        export_files.write(archive, path, force)

    return run("object-type export", work)


@app.command(name="import")
def import_types(
    file: Annotated[Path, Parameter(help="A file that `arcor2-hw object-type export` wrote.")],
    /,
    *,
    overwrite: export_files.Overwrite = None,
    dry_run: export_files.DryRun = False,
    server: Server = HERE,
) -> int:
    """Import object types with their models and meshes from a file.

    Existing equal items are not changed. If items differ, the command lists them and changes nothing, unless
    --overwrite allows it: types (with their models), assets, or all.
    """
    return run(
        "object-type import",
        lambda: export_files.import_file(file, "object-type", server, overwrite or [], None, dry_run),
    )


@app.command
def validate(*files: Annotated[Path, Parameter(help="Export files.")], as_json: export_files.Json = False) -> int:
    """Check export files without a server. For Python files use `arcor2-hw analyse`."""
    return run("object-type validate", lambda: export_files.validate(list(files), "object-type", as_json))


async def _one(exporter: Exporter, name: str) -> Archive:
    return await exporter.object_types([name])


@app.command
def diff(
    old: Annotated[str, Parameter(help="An export file, or the name of an object type of the server.")],
    new: Annotated[str, Parameter(help="The file or object type to compare it with.")],
    /,
    *,
    as_json: export_files.Json = False,
    server: Server = HERE,
) -> int:
    """Show the differences between two object types and their contents. The exit status is 15 if there are any."""
    return run("object-type diff", lambda: export_files.compare(old, new, "object-type", server, _one, as_json))

"""The common commands of `arcor2-hw scene` and `arcor2-hw project`."""

from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter
from msgspec import Struct

from arcor2_hw.client.rest import Listed, Rest
from arcor2_server.cli import export_files
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.exchange.archive import Archive
from arcor2_server.exchange.export import Exporter


class DocumentKind(Struct, frozen=True):
    """The differences between scenes and projects.

    Args:
        name: the kind.
        saved: returns the saved documents of a server.
        export: returns the export of a document by name or id.
        content: the content of an export in addition to the document.
        sources: the files that can be imported.
        parts: the parts that an import may overwrite.
        packages: files that can be validated in addition to export files, with a leading comma.
    """

    name: Literal["scene", "project"]
    saved: Callable[[Rest], Awaitable[list[Listed]]]
    export: Callable[[Exporter, str], Awaitable[Archive]]
    content: str
    sources: str
    parts: str
    packages: str = ""


def document_commands(kind: DocumentKind) -> App:
    """Return the commands list, export, import, validate and diff for a kind of document."""
    name = kind.name
    app = App(name=name, help=f"List, export, import, check and compare the {name}s of a server.")

    def list_documents(*, as_json: export_files.Json = False, server: Server = HERE) -> int:
        async def work() -> None:
            async with server.rest() as rest:
                export_files.show_list(await kind.saved(rest), f"There are no {name}s.", as_json)

        return run(f"{name} list", work)

    def export(
        document: Annotated[str, Parameter(help=f"Name of the {name}, or its id.")],
        /,
        *,
        output: export_files.Output = None,
        force: export_files.Force = False,
        server: Server = HERE,
    ) -> int:
        async def work() -> None:
            async with server.client() as client:
                export_files.write(await kind.export(Exporter(client), document), output, force)

        return run(f"{name} export", work)

    def import_document(
        file: Annotated[Path, Parameter(help=kind.sources)],
        /,
        *,
        overwrite: export_files.Overwrite = None,
        name: Annotated[str | None, Parameter(help="Import it as a copy under this name.")] = None,
        dry_run: export_files.DryRun = False,
        server: Server = HERE,
    ) -> int:
        return run(
            f"{kind.name} import",
            lambda: export_files.import_file(file, kind.name, server, overwrite or [], name, dry_run),
        )

    def validate(*files: Annotated[Path, Parameter(help="Export files.")], as_json: export_files.Json = False) -> int:
        return run(f"{name} validate", lambda: export_files.validate(list(files), name, as_json))

    def diff(
        old: Annotated[str, Parameter(help=f"An export file, or the name or id of a {name} of the server.")],
        new: Annotated[str, Parameter(help="The file or document to compare it with.")],
        /,
        *,
        as_json: export_files.Json = False,
        server: Server = HERE,
    ) -> int:
        return run(f"{name} diff", lambda: export_files.compare(old, new, name, server, kind.export, as_json))

    for command, called, help_text in (
        (list_documents, "list", f"Show the saved {name}s of a server."),
        (export, "export", f"Write the saved version of a {name} into one file, with {kind.content}."),
        (
            import_document,
            "import",
            f"Import a {name} into a server, with {kind.content}.\n\n"
            "Existing equal items are not changed. If items differ, the command lists them and changes nothing, unless "
            f"--overwrite allows it: {kind.parts}, or all.",
        ),
        (
            validate,
            "validate",
            f"Check export files{kind.packages} without a server. Each problem names the entry in the file.",
        ),
        (
            diff,
            "diff",
            f"Show the differences between two {name}s and their contents. The exit status is 15 if there are any.",
        ),
    ):
        app.command(command, name=called, help=help_text)
    return app

"""Export, import, validation and comparison of export files for `scene`, `project` and `object-type`."""

import asyncio
import re
import sys
from collections.abc import Awaitable, Callable, Collection
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
from cyclopts import Parameter
from msgspec.structs import replace
from rich.markup import escape
from rich.table import Table

from arcor2_hw.analysis import SourceFile, installed_types
from arcor2_hw.client.rest import Listed
from arcor2_hw.data.base import Unset
from arcor2_hw.exceptions import InvalidPackage
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.server_connection import Failed, Server, printable
from arcor2_server.cli.tables import console
from arcor2_server.exchange import archive as archives
from arcor2_server.exchange.archive import Archive, Kind
from arcor2_server.exchange.differences import Difference, describe, differences, names_of
from arcor2_server.exchange.export import Exporter
from arcor2_server.exchange.import_ import Importer, Part, renamed
from arcor2_server.exchange.validation import AvailableTypes, find_problems

Output = Annotated[Path | None, Parameter(name=["--output", "-o"], help="The file. The default is NAME.zip.")]
Force = Annotated[bool, Parameter(help="Replace an existing file.", negative=())]
Json = Annotated[bool, Parameter(name="--json", help="Print JSON.", negative=())]
Overwrite = Annotated[
    list[Part] | None, Parameter(negative=(), help="Existing items that the import may replace. Repeatable.")
]
DryRun = Annotated[bool, Parameter(help="Show what the import would do, without changes.", negative=())]

_MARKS: Final = {"added": "[green]+[/]", "removed": "[red]-[/]", "changed": "[yellow]~[/]"}
_LINES: Final = {"+": "green", "-": "red", "@": "cyan"}


def print_line(text: str) -> None:
    """Print a line."""
    console().print(escape(printable(text)), soft_wrap=True)


def print_json(value: Any) -> None:
    """Print a value as indented JSON."""
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(value), indent=2).decode() + "\n")


def installed() -> list[SourceFile]:
    """Return the sources of the installed object types."""
    return [one.file for one in installed_types() if one.file is not None]


def show_list(entries: list[Listed], nothing: str, as_json: bool) -> None:
    """Print a table of documents, or the text `nothing` if there are none."""
    if as_json:
        print_json(entries)
        return
    table = Table("name", "modified", "id", "description", box=None, pad_edge=False)
    for entry in sorted(entries, key=lambda one: one.name):
        about = "" if isinstance(entry.description, Unset) else entry.description
        table.add_row(*(escape(printable(text)) for text in (entry.name, entry.modified, entry.id, about)))
    console().print(table if entries else nothing)


# ------------------------------------------------------------------------------------------------ files
def read(path: Path, kind: Kind | None = None) -> Archive:
    """Read an export file. Error messages contain its path."""
    try:
        archive = archives.read(path)
    except InvalidPackage as error:
        raise InvalidPackage("{path}: {reason}", path=path, reason=error) from error
    if kind is None or archive.kind == kind:
        return archive
    if kind == "scene" and archive.kind == "project":
        # The export of a project contains its scene.
        scene = Archive("scene", archive.scene, types=archive.types, installed=archive.installed, assets=archive.assets)
        return replace(scene, from_package=archive.from_package)
    article = "an" if archive.kind[0] == "o" else "a"
    raise Failed(ExitStatus.USAGE, f"{path} contains {article} {archive.kind}; use arcor2-hw {archive.kind}")


def write(archive: Archive, output: Path | None, force: bool) -> None:
    """Write an export file and print its content."""
    path = output or Path(re.sub(r"[^\w.-]+", "_", archive.name).strip("._") + ".zip")
    if path.exists() and not force:
        raise Failed(ExitStatus.CONFLICT, f"{path} already exists; use --force to replace it")
    archives.write(archive, path)
    parts = [f"{archive.kind} {archive.name}"]
    if archive.project is not None and archive.scene is not None:
        parts.append(f"its scene {archive.scene.name}")
    for count, one, many in (
        (0 if archive.kind == "object-type" else len(archive.types), "object type", "object types"),
        (len(archive.assets), "asset", "assets"),
    ):
        if count:
            parts.append(f"{count} {one if count == 1 else many}")
    print_line(f"{path}: {', '.join(parts)}")
    ours = {one.name for one in installed_types() if one.distribution == "arcor2-hw"}
    if foreign := [name for name in archive.installed if name not in ours]:
        print_line(f"These object types must be installed on the other server: {', '.join(foreign)}")


# ------------------------------------------------------------------------------------------------ commands
async def import_file(
    path: Path, kind: Kind, server: Server, overwrite: Collection[Part], name: str | None, dry_run: bool
) -> None:
    """Import a file into a server."""
    archive = await asyncio.to_thread(read, path, kind)
    if name is not None:
        archive = renamed(archive, name)
    async with server.client() as client:
        importer = Importer(client, archive, overwrite)
        try:
            steps = await importer.plan(await asyncio.to_thread(installed))
        except InvalidPackage as error:
            raise InvalidPackage("{path}: {reason}", path=path, reason=error) from error
        if not dry_run:
            await importer.run()
    words = {"new": "would be new", "replaced": "would be replaced", "same": "is the same"} if dry_run else {}
    for step in steps:
        notice = f", {step.notice}" if step.notice else ""
        print_line(f"{step.kind} {step.name}: {words.get(step.verb, step.verb)}{notice}")


async def validate(paths: list[Path], kind: Kind, as_json: bool) -> ExitStatus:
    """Check files without a server. Each problem names the entry in the file."""
    if not paths:
        raise Failed(ExitStatus.USAGE, "specify the files to check")
    files = installed()
    worst = ExitStatus.OK
    reported: list[dict[str, Any]] = []
    for path in paths:
        try:
            archive = read(path, kind)
            findings = list(find_problems(archive, AvailableTypes(archive, files)))
        except InvalidPackage as error:
            entry, _, text = str(error).removeprefix(f"{path}: ").partition(": ")
            reported.append(
                {"file": str(path), "entry": entry if text else "", "text": text or entry, "level": "error"}
            )
            continue
        reported += [{"file": str(path), **msgspec.to_builtins(finding)} for finding in findings]
        if not as_json and not any(finding.level == "error" for finding in findings):
            print_line(f"{path}: {archive.kind} {archive.name} has no problems")
    if as_json:
        print_json(reported)
    for one in reported:
        line = ": ".join(part for part in (one["file"], one["entry"], one["text"]) if part)
        if one["level"] == "error":
            worst = fail(f"{kind} validate", printable(line), ExitStatus.DOCUMENT_PROBLEMS)
        elif not as_json:
            print_line(f"note: {line}")
    return worst


def _is_file(wanted: str) -> bool:
    """Return whether an argument is a file, not a name on a server."""
    return wanted.endswith(".zip") or Path(wanted).is_file()


async def compare(
    old: str, new: str, kind: Kind, server: Server, export: Callable[[Exporter, str], Awaitable[Archive]], as_json: bool
) -> ExitStatus:
    """Compare two exports, each a file or a document of the server."""

    async def side(wanted: str) -> Archive:
        if _is_file(wanted):
            return await asyncio.to_thread(read, Path(wanted), kind)
        async with server.client() as client:
            return await export(Exporter(client), wanted)

    before, after = await side(old), await side(new)
    found = differences(before, after)
    if as_json:
        print_json(found)
    else:
        names = names_of(before, after)
        for one in found:
            _show(one, names)
    if not found:
        if not as_json:
            print_line("No differences.")
        return ExitStatus.OK
    return fail(f"{kind} diff", f"{old} and {new} differ in {len(found)} places", ExitStatus.DIFFERENT)


def _show(difference: Difference, names: dict[str, str]) -> None:
    old, new = (
        ("" if value is msgspec.UNSET else describe(value, names)) for value in (difference.old, difference.new)
    )
    values = ""
    if not isinstance(difference.text, Unset):
        values = ":"
    elif difference.change == "changed":
        values = f": {old} → {new}"
    elif old or new:
        values = f" ({old or new})"
    entry = escape(printable(" › ".join(difference.path) + values))
    console().print(f"{_MARKS[difference.change]} {entry}", soft_wrap=True)
    for line in [] if isinstance(difference.text, Unset) else difference.text:
        style, shown = _LINES.get(line[:1], ""), escape(_indented(line))
        console().print(f"    [{style}]{shown}[/]" if style else f"    {shown}", soft_wrap=True)


def _indented(line: str) -> str:
    """Return a line of source code without control characters; its spaces are unchanged."""
    return "".join(each if each.isprintable() else "�" for each in line.expandtabs(4))

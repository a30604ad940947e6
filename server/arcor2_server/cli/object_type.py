"""`arcor2-hw object-type`: bring object types into a running server, list them, take them out."""

import ast
import sys
from pathlib import Path
from typing import Annotated, Any

import httpx
from cyclopts import App, Parameter
from rich.console import Console
from rich.table import Table

from arcor2_hw.analysis import Library, SourceFile, module_name
from arcor2_server.cli.package import DEFAULT_URL, Url
from arcor2_server.cli.status import ExitStatus

app = App(name="object-type", help="Bring object types into a running server, list them, take them out.")
TIMEOUT = 10.0


class Failed(Exception):
    """A command that ends with a status of its own and one line."""

    def __init__(self, status: ExitStatus, line: str) -> None:
        super().__init__(line)
        self.status = status


def _request(url: str, method: str, path: str, body: Any = None) -> Any:
    base = url.replace("ws://", "http://", 1).replace("wss://", "https://", 1)
    try:
        answer = httpx.request(method, f"{base.rstrip('/')}{path}", json=body, timeout=TIMEOUT)
    except httpx.HTTPError as error:
        raise Failed(ExitStatus.NO_SERVER, f"no server answers at {url}: {error}") from error
    if answer.is_success:
        return answer.json()
    try:
        text = answer.json()["message"]
    except (ValueError, KeyError, TypeError):
        text = f"the server answers {answer.status_code}"
    raise Failed(ExitStatus.NOT_FOUND if answer.status_code == httpx.codes.NOT_FOUND else ExitStatus.FAILED, text)


def _read(file: Path) -> str:
    try:
        return file.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise Failed(ExitStatus.NOT_FOUND, f"{file} cannot be read: {error}") from error


def _class_in(source: str, file: Path, name: str | None) -> str:
    """Choose the class of a file that is brought in: the named one, the file's namesake, or its only object type."""
    try:
        names = [node.name for node in ast.parse(source).body if isinstance(node, ast.ClassDef)]
    except SyntaxError as error:
        raise Failed(ExitStatus.ANALYSIS_PROBLEMS, f"{file}:{error.lineno}: {error.msg}") from error
    if name is None:
        found = [each for each in names if module_name(each) == file.stem]
        found = found or [each for each in names if _may_be_placed(SourceFile(each, module_name(each), source))]
    else:
        found = [each for each in names if each == name]
    if len(found) != 1:
        listed = ", ".join(found or names) or "none"
        raise Failed(ExitStatus.USAGE, f"say which class of {file} is meant with --name: {listed}")
    return found[0]


def _may_be_placed(file: SourceFile) -> bool:
    analysis = Library([file]).analyse(file.name)
    return analysis.is_object_type and not analysis.meta.abstract


def _in_order(given: dict[str, SourceFile], url: str) -> list[SourceFile]:
    """Give files each behind those it needs; Failed when one has a problem, with what the server has taken in too."""
    library = Library(given.values())
    if any(library.analyse(name).problem for name in given):
        for entry in _request(url, "GET", "/object-types"):
            if entry["id"] not in given:
                stored = _request(url, "GET", f"/object-types/{entry['id']}")
                library.add(SourceFile(stored["id"], module_name(stored["id"]), stored["source"]))
    ordered: dict[str, SourceFile] = {}
    for name, file in given.items():
        analysis = library.analyse(name)
        if analysis.problem is not None:
            raise Failed(ExitStatus.ANALYSIS_PROBLEMS, str(analysis.problem))
        ordered |= {each.name: given[each.name] for each in analysis.modules if each.name in given}
        ordered[name] = file
    return list(ordered.values())


def _run(command: str, work: Any) -> int:
    try:
        work()
    except Failed as error:
        sys.stderr.write(f"arcor2-hw object-type {command}: {error}\n")
        return error.status
    return ExitStatus.OK


@app.command
def add(
    *files: Path,
    name: Annotated[str | None, Parameter(help="The class, when a file declares several object types.")] = None,
    url: Url = DEFAULT_URL,
) -> int:
    """Bring in object types from Python files, new or changed. The files are read, not imported.

    Bases, mixins and other modules that they import relatively are given with them, or were brought in before.
    """

    def work() -> None:
        if not files or (name is not None and len(files) > 1):
            raise Failed(ExitStatus.USAGE, "give the files of the object types; --name only with one file")
        given: dict[str, SourceFile] = {}
        for file in files:
            source = _read(file)
            chosen = _class_in(source, file, name)
            given[chosen] = SourceFile(chosen, module_name(chosen), source, str(file))
        for one in _in_order(given, url):
            _request(url, "PUT", "/object-types", {"id": one.name, "name": one.name, "source": one.source})
            Console().print(f"{one.name} added")

    return _run("add", work)


@app.command(name="list")
def list_types(*, url: Url = DEFAULT_URL) -> int:
    """Show the object types that were brought into a server."""

    def work() -> None:
        entries = _request(url, "GET", "/object-types")
        table = Table("name", "modified", box=None, pad_edge=False)
        for entry in entries:
            table.add_row(entry["name"], entry.get("modified", ""))
        Console().print(table if entries else "No object types were brought in.")

    return _run("list", work)


@app.command
def remove(name: str, *, url: Url = DEFAULT_URL) -> int:
    """Take an object type out of a server."""

    def work() -> None:
        _request(url, "DELETE", f"/object-types/{name}")
        Console().print(f"{name} removed")

    return _run("remove", work)

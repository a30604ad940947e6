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
from arcor2_hw.data.base import Unset
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


def _types_in(source: str, path: Path) -> dict[str, str]:
    """Give the object types that a file declares, with the problem of each (empty: none). It is not imported."""
    try:
        names = [node.name for node in ast.parse(source).body if isinstance(node, ast.ClassDef)]
    except SyntaxError as error:
        raise Failed(ExitStatus.ANALYSIS_PROBLEMS, f"{path}:{error.lineno}: {error.msg}") from error
    found = {}
    for name in names:
        library = Library()
        library.add(SourceFile(name, module_name(name), source, str(path)))
        analysis = library.analyse(name)
        if analysis.is_object_type and not analysis.meta.abstract:
            found[name] = "" if isinstance(analysis.meta.problem, Unset) else analysis.meta.problem
    return found


def _run(command: str, work: Any) -> int:
    try:
        work()
    except Failed as error:
        sys.stderr.write(f"arcor2-hw object-type {command}: {error}\n")
        return error.status
    return ExitStatus.OK


@app.command
def add(
    file: Path,
    *,
    name: Annotated[str | None, Parameter(help="The class, when the file declares several object types.")] = None,
    url: Url = DEFAULT_URL,
) -> int:
    """Bring in an object type from a Python file, new or changed. The file is read, not imported."""

    def work() -> None:
        try:
            source = file.read_text()
        except (OSError, UnicodeDecodeError) as error:
            raise Failed(ExitStatus.NOT_FOUND, f"{file} cannot be read: {error}") from error
        found = _types_in(source, file)
        chosen = name if name is not None else next(iter(found)) if len(found) == 1 else None
        if chosen is None or chosen not in found:
            listed = ", ".join(found) or "none that may be placed in a scene"
            raise Failed(ExitStatus.USAGE, f"say which object type of {file} is meant with --name: {listed}")
        if found[chosen]:
            raise Failed(ExitStatus.ANALYSIS_PROBLEMS, found[chosen])
        _request(url, "PUT", "/object-types", {"id": chosen, "name": chosen, "source": source})
        Console().print(f"{chosen} added")

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

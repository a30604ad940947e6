"""Record the data that a version writes, for test_former_version.py: `python -m tests.compatibility.record`.

Run it once with a released version, before you change anything. It writes the data directory of a killed server, a
package, the demo's package, the server's answers, and the names that drivers import from the library.
"""

import ast
import asyncio
import gzip
import io
import json
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

import msgspec

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Position
from arcor2_server.demo.workplace import Creation, load
from tests.compatibility.answers import TYPES, answers
from tests.server.core.serving import ServerProcess

HERE = Path(__file__).parent
RECORDED = HERE / "recorded"
SOURCES = ("drivers/arcor2_drivers", "arcor2_hw/objects/stock", "docs/examples")


def imported_names(root: Path) -> dict[str, list[str]]:
    """Return the names that drivers, stock object types and examples import from the library, by module."""
    found: dict[str, set[str]] = {}
    for folder in SOURCES:
        for file in sorted((root / folder).rglob("*.py")):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] == "arcor2_hw":
                    found.setdefault(node.module, set()).update(alias.name for alias in node.names)
    return {module: sorted(names) for module, names in sorted(found.items())}


def write_archive(directory: Path, archive: Path) -> None:
    """Write a data directory into a reproducible archive; logs and keys stay outside."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as tar:
        for path in sorted(directory.rglob("*")):
            relative = path.relative_to(directory)
            if path.is_file() and relative.parts[0] not in {"logs", "cache"}:
                info = tarfile.TarInfo(relative.as_posix())
                info.size, info.mode = path.stat().st_size, path.stat().st_mode & 0o777
                tar.addfile(info, io.BytesIO(path.read_bytes()))
    archive.write_bytes(gzip.compress(packed.getvalue(), mtime=0))


def write_json(name: str, content: Any) -> None:
    """Write a recorded answer."""
    (RECORDED / name).write_text(json.dumps(content, indent=1, sort_keys=True) + "\n")


async def record(folder: Path) -> None:
    """Create the workplace through a server, edit it, kill the server."""
    server = ServerProcess(folder / "data")
    await server.start()
    async with Client(server.url, "recorder", reconnect=False) as client:
        for name in TYPES:
            source = (HERE / "object_types" / f"{name}.py").read_text()
            await client.rest.put_object_type("".join(part.title() for part in name.split("_")), source)
        creation = Creation(client, load(HERE / "former_workplace.toml"), {})
        scene = await creation.open_scene()
        project = await creation.open_project(scene, {})
        await client.rest.publish(project.id, RECORDED / "package.zip", "Fill the shelf")
        write_json("answers.json", await answers(client))
        # Edits that are not saved.
        (point,) = [point for point in project.action_points if point.name == "slot"]
        await client.call("WriteLock", rpc.WriteLockArgs(point.id))
        await client.call("RenameActionPoint", rpc.RenameActionPointArgs(point.id, "upper_slot"))
        await client.call("AddActionPoint", rpc.AddActionPointArgs("unsaved", Position(0.1, 0.2, 0.3)))
        await client.call("AddProjectParameter", rpc.AddProjectParameterArgs("unsaved_text", "string", '"kept"'))
    async with Client(server.url, "reader", reconnect=False) as client:
        event = await client.next_event("OpenProject")
        write_json("unsaved_project.json", json.loads(msgspec.json.encode(event.data.project)))
    server.process.kill()
    await server.ended()
    write_archive(folder / "data", RECORDED / "data-directory.tar.gz")


async def record_demo(folder: Path) -> None:
    """Run the demo once, and copy the package that it built."""
    command = (sys.executable, "-m", "arcor2_server.cli.main", "demo", "--fast", "--once", "--boards", "1")
    demo = await asyncio.create_subprocess_exec(*command, "--port", "0", "--data-dir", str(folder / "demo"))
    assert await demo.wait() == 0
    server = ServerProcess(folder / "demo")
    await server.start()
    async with Client(server.url, "recorder", reconnect=False) as client:
        packages = await client.call("ListPackages")
        await client.rest.download_package(packages[-1].id, RECORDED / "demo-package.zip")
    await server.stop()


def main() -> None:
    """Record everything."""
    RECORDED.mkdir(exist_ok=True)
    write_json("imported_names.json", imported_names(HERE.parents[1]))
    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(record(Path(folder)))
        asyncio.run(record_demo(Path(folder)))


if __name__ == "__main__":
    main()

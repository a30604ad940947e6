"""Data of the first version still work: its data directory, its packages, and the imports of its object types."""

import io
import json
import subprocess
import sys
import tarfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.package import PackageStateEnum
from tests.compatibility.answers import answers, without_texts
from tests.server.core.serving import running

RECORDED = Path(__file__).parent / "recorded"
IMPORT_ALL = """
import importlib, json, sys
from arcor2_hw.runtime.older import install

install()
missing = []
for module, names in json.loads(sys.argv[1]).items():
    try:
        found = importlib.import_module(module)
    except ImportError as error:
        missing.append(f"{module}: {error}")
    else:
        missing += [f"{module}.{name}" for name in names if not hasattr(found, name)]
print(json.dumps(missing))
"""


def missing_from(new: Any, old: Any, where: str = "") -> list[str]:
    """Return the places where `new` lacks or contradicts a value of `old`; additions are allowed."""
    if isinstance(old, dict) and isinstance(new, dict):
        return [
            problem for key, value in old.items() for problem in missing_from(new.get(key), value, f"{where}/{key}")
        ]
    if isinstance(old, list) and isinstance(new, list) and old and isinstance(old[0], dict):
        key = next((key for key in ("name", "type") if key in old[0]), None)
        if key is not None:
            by_name = {one[key]: one for one in new}
            return [
                problem for one in old for problem in missing_from(by_name.get(one[key]), one, f"{where}/{one[key]}")
            ]
    return [] if new == old else [f"{where}: {new!r}, formerly {old!r}"]


@pytest.fixture
async def client(tmp_path: Path) -> AsyncIterator[Client]:
    """Connect a client to a server that starts with the recorded data directory."""
    data_dir = tmp_path / "data"
    with tarfile.open(fileobj=io.BytesIO((RECORDED / "data-directory.tar.gz").read_bytes())) as tar:
        tar.extractall(data_dir, filter="data")
    async with running(data_dir) as server, Client(server.url, "recorder", reconnect=False) as client:
        yield client


async def run_to_the_end(client: Client, package_id: str) -> list[str]:
    """Run a package; return the names of its actions in the order of their ends."""
    await client.call("RunPackage", rpc.RunPackageArgs(package_id))
    names: dict[str, str] = {}
    ended: list[str] = []
    while True:
        event = await client.next_event(timeout=30)
        match event.event:
            case "PackageInfo":
                points = event.data.project.action_points
                names = {action.id: action.name for point in points for action in point.actions}
            case "ActionStateAfter":
                ended.append(names[event.data.action_id])
            case "ProjectException":
                pytest.fail(event.data.message)
            case "PackageState" if event.data.state is PackageStateEnum.STOPPED:
                return ended


ROUND = ["feed_part", "draw", "put", "full"]
ALL_ACTIONS = [*ROUND, "rest", *ROUND, "rest", *ROUND]


async def test_a_data_directory_with_unsaved_edits_opens_and_runs(client: Client) -> None:
    opened = (await client.next_event("OpenProject")).data
    unsaved = json.loads((RECORDED / "unsaved_project.json").read_text())
    assert without_texts(json.loads(msgspec.json.encode(opened.project))) == without_texts(unsaved)
    assert missing_from(await answers(client), json.loads((RECORDED / "answers.json").read_text())) == []

    await client.call("Undo")
    parameter = (await client.next_event("ProjectParameterChanged")).data
    assert (parameter.name, parameter.value) == ("unsaved_text", '"kept"')
    await client.call("SaveProject")

    await client.call("StartScene")
    while (await client.next_event("SceneState")).data.state is not SceneStateEnum.STARTED:
        pass
    await client.call("StopScene")
    while (await client.next_event("SceneState")).data.state is not SceneStateEnum.STOPPED:
        pass
    built = await client.call("BuildProject", rpc.BuildProjectArgs(opened.project.id, "built anew"))
    await client.call("CloseProject")
    assert (await run_to_the_end(client, built.package_id))[: len(ALL_ACTIONS)] == ALL_ACTIONS


async def test_a_package_runs_as_it_was_built(client: Client) -> None:
    await client.rest.upload_package("former", RECORDED / "package.zip")
    await client.call("CloseProject", rpc.CloseProjectArgs(force=True))
    assert (await run_to_the_end(client, "former"))[: len(ALL_ACTIONS)] == ALL_ACTIONS


def test_drivers_and_packages_find_every_name_that_they_import() -> None:
    names = (RECORDED / "imported_names.json").read_text()
    result = subprocess.run([sys.executable, "-c", IMPORT_ALL, names], capture_output=True, text=True, check=True)
    assert json.loads(result.stdout) == []

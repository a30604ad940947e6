"""Object types with modules of the same name work in the server, cell host, programs and packages, and after a restart.

The recorded data directory contains the type Valve and its helper module `link`. An earlier version wrote it, in which
all types shared their helper modules.
"""

import asyncio
import io
import tarfile
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from arcor2_hw.client import Client
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.project import ActionParameter, Flow
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.main import app
from tests.compatibility.test_former_version import RECORDED
from tests.server.core.serving import ServerProcess

PUMP = '''"""A pump."""

from arcor2_hw.actions import action

from .frames import FRAME
from .link import {kind}, rate
from .valve import Valve


class {name}(Valve):
    """A pump."""

    _ABSTRACT = False

    @action
    def line_rate(self, kind: {kind}, *, an: str | None = None) -> int:
        """Return the rate of the line, Hz."""
        assert kind is {kind}.FAST
        assert super().line_rate() == 10  # with the shared module `link`
        return rate() + FRAME
'''
LINK = '''"""The line of a pump."""

from arcor2_hw.actions import StrEnum


class {kind}(StrEnum):
    """Speed of the line."""

    FAST = "fast"


def rate() -> int:
    """Return the rate of the line, Hz."""
    return {rate}
'''
RATES = {"valve": 10, "pump": 200, "mixer": 3000}


def command(server: ServerProcess, *arguments: str | Path) -> int:
    """Run `arcor2-hw object-type` in this process."""
    return app(["object-type", *map(str, arguments), "--url", server.url])


def write_type(folder: Path, name: str) -> list[Path]:
    """Write a type with its own module `link`, and the module `frames`, which is the same for all types."""
    folder.mkdir()
    texts = {
        name: PUMP.format(name=name.title(), kind=f"{name.title()}Kind"),
        "link": LINK.format(kind=f"{name.title()}Kind", rate=RATES[name]),
        "frames": "FRAME = 0\n",
    }
    for module, text in texts.items():
        (folder / f"{module}.py").write_text(text)
    return [folder / f"{module}.py" for module in texts]


@pytest.fixture
async def server(tmp_path: Path) -> AsyncIterator[ServerProcess]:
    with tarfile.open(fileobj=io.BytesIO((RECORDED / "shared-module.tar.gz").read_bytes())) as tar:
        tar.extractall(tmp_path / "data", filter="data")
    server = ServerProcess(tmp_path / "data")
    await server.start()
    yield server
    await server.stop()


async def make_project(client: Client) -> tuple[str, dict[str, str]]:
    """Create a project that calls each type; return its id and the ids of the actions by object."""
    await client.new_scene("line")
    for name in RATES:
        await client.add_object_to_scene(name=name, type=name.title())
    await client.save_scene()
    (listed,) = await client.list_scenes()
    scene = await client.get_scene(listed.id)
    await client.close_scene()
    await client.new_project(scene_id=scene.id, name="rates")
    await client.add_action_point(name="here", position=Position(0.0, 0.0, 0.0))
    point = (await client.next_event("ActionPointChanged")).data.id
    actions: dict[str, str] = {}
    last = "START"
    for obj in scene.objects:
        (about,) = await client.get_actions(obj.type)
        parameters = [ActionParameter(each.name, each.type, '"fast"') for each in about.parameters]
        await client.add_action(
            action_point_id=point,
            name=f"ask_{obj.name}",
            type=f"{obj.id}/line_rate",
            parameters=parameters,
            flows=[Flow(outputs=[f"rate_{obj.name}"])],
        )
        actions[obj.name] = (await client.next_event("ActionChanged")).data.id
        await client.add_logic_item(start=last, end=actions[obj.name])
        last = actions[obj.name]
    await client.add_logic_item(start=last, end="END")
    await client.save_project()
    (project,) = await client.list_projects()
    return project.id, actions


async def rates_online(client: Client, actions: dict[str, str]) -> dict[str, int]:
    """Execute the actions of the open project online; return their results by object."""
    await client.start_scene()
    while (await client.next_event("SceneState")).data.state.value != "started":
        pass
    rates = {}
    for name, action in actions.items():
        await client.execute_action(action)
        result = (await client.next_event("ActionResult", timeout=30)).data
        assert not result.error, result.error
        (text,) = result.results
        rates[name] = int(text)
    await client.stop_scene()
    return rates


async def rates_of_package(client: Client, package: str, actions: dict[str, str]) -> dict[str, int]:
    """Run a package; return the results of its first round by object."""
    names = {action: name for name, action in actions.items()}
    rates: dict[str, int] = {}
    await client.run_package(package)
    while len(rates) < len(actions):
        event = await client.next_event(timeout=30)
        assert event.event != "ProjectException", event
        if event.event == "ActionStateAfter":
            rates[names[event.data.action_id]] = int(event.data.results[0])
    await client.stop_package()
    while (await client.next_event("PackageState", timeout=30)).data.state is not PackageStateEnum.STOPPED:
        pass
    return rates


async def test_modules_of_the_same_name_belong_to_their_types(server: ServerProcess, tmp_path: Path) -> None:
    for name in ("pump", "mixer"):
        assert await asyncio.to_thread(command, server, "add", *write_type(tmp_path / name, name)) == 0
    async with Client(server.url, "ann") as client:
        assert [one.id for one in await client.rest.object_types()] == ["Mixer", "Pump", "Valve", "link"]
        project, actions = await make_project(client)
        assert await rates_online(client, actions) == RATES
    await server.stop()

    await server.start()
    async with Client(server.url, "ann") as client:
        await client.next_event("OpenProject")
        assert await rates_online(client, actions) == RATES
        package = (await client.build_project(project_id=project, package_name="rates")).package_id
        await client.close_project()
        assert await rates_of_package(client, package, actions) == RATES

        built = tmp_path / "built.zip"
        await client.rest.download_package(package, built)
        with zipfile.ZipFile(built) as archive:
            names = {name for name in archive.namelist() if name.startswith("object_types/")}
        assert {"object_types/pump/link.py", "object_types/mixer/link.py", "object_types/link.py"} <= names

        # The package and the export restore the types with their modules.
        exported = tmp_path / "types.zip"
        assert await asyncio.to_thread(command, server, "export", "Pump", "Valve", "--output", exported) == 0
        before = {name: (await client.rest.object_type(name)).code for name in ("Pump", "Mixer", "Valve", "link")}
        await client.rest.delete_project(project)
        for name in before:
            await client.rest.delete_object_type(name)
        assert await asyncio.to_thread(command, server, "import", exported) == 0
        assert {name: (await client.rest.object_type(name)).code for name in ("Pump", "Valve", "link")} == {
            name: code for name, code in before.items() if name != "Mixer"
        }
        await client.rest.import_package(built)
        assert (await client.rest.object_type("Mixer")).code == before["Mixer"]


async def test_an_upload_without_modules_leaves_the_stored_ones(server: ServerProcess, tmp_path: Path) -> None:
    files = write_type(tmp_path / "pump", "pump")
    assert await asyncio.to_thread(command, server, "add", *files) == 0
    files[0].write_text(files[0].read_text().replace("A pump.", "The pump."))
    assert await asyncio.to_thread(command, server, "add", files[0]) == 0
    async with Client(server.url, "ann") as client:
        stored = await client.rest.object_type("Pump")
        assert sorted(stored.own_modules) == ["frames", "link"]
        await client.rest.put_object_type("Pump", stored.source)  # as a client for ARCOR2
        assert (await client.rest.object_type("Pump")).own_modules == stored.own_modules
        # The server deletes modules that the type does not import any more.
        source = stored.source.replace("from .frames import FRAME\n", "FRAME = 0\n")
        files[0].write_text(source)
        assert await asyncio.to_thread(command, server, "add", files[0]) == 0
        assert sorted((await client.rest.object_type("Pump")).own_modules) == ["link"]


async def test_a_module_of_other_types_is_not_replaced(
    server: ServerProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pump, link, frames = write_type(tmp_path / "pump", "pump")
    fast = tmp_path / "pump" / "fast.py"
    fast.write_text(pump.read_text().replace("class Pump", "class Fast"))
    # Both types would share `link` with Valve.
    assert await asyncio.to_thread(command, server, "add", pump, fast, link, frames) == ExitStatus.USAGE
    assert "would replace the module link that Valve imports" in capsys.readouterr().err
    assert await asyncio.to_thread(command, server, "add", pump, link, frames) == 0
    assert await asyncio.to_thread(command, server, "add", frames) == ExitStatus.USAGE
    assert "frames.py belongs to Pump" in capsys.readouterr().err

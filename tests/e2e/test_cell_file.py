"""Clients see connection losses, online and in a program. A cell file gives a device another address."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.base import Unset
from arcor2_hw.data.cell import Cell, CellDevice, write_cell
from arcor2_hw.data.device import Connection
from arcor2_hw.data.events import ObjectStateData
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import ActionParameter, Flow
from tests.fakes.conftest import FakeProcess
from tests.server.core.serving import running

UNUSED_PORT = "socket://127.0.0.1:9"


@pytest.fixture(scope="module")
def scale() -> Iterator[FakeProcess]:
    fake = FakeProcess("scale", "--tcp", "127.0.0.1:0")
    fake.control.do("heal")
    yield fake
    fake.end()


@pytest.fixture(autouse=True)
def healed_scale(scale: FakeProcess) -> Iterator[None]:
    yield
    scale.control.do("heal")


class Bench:
    """A server, a scene with one scale, and a project that weighs."""

    def __init__(self, client: Client, url: str) -> None:
        self.client = client
        self.url = url
        self.scale = self.weigh = self.project = ""
        self.states: list[ObjectStateData] = []
        """Events that arrived while the test waited for another one."""

    async def event(self, name: str) -> Any:
        async with asyncio.timeout(15):
            while True:
                event = await self.client.next_event()
                if event.event == name:
                    return event.data
                if event.event == "ObjectState":
                    self.states.append(event.data)

    async def create_project(self, port: str) -> None:
        call = self.client.call
        await call("NewScene", rpc.NewSceneArgs("bench"))
        settings = [Parameter("port", "string", f'"{port}"')]
        await call("AddObjectToScene", rpc.AddObjectToSceneArgs("balance", "MtSicsScale", parameters=settings))
        self.scale = (await self.client.next_event("SceneObjectChanged")).data.id
        await call("SaveScene")
        scene = (await call("ListScenes"))[0]
        await call("NewProject", rpc.NewProjectArgs(scene.id, "weighing"))
        self.project = (await self.client.next_event("OpenProject")).data.project.id
        await call("AddActionPoint", rpc.AddActionPointArgs("there", Position()))
        point = (await self.client.next_event("ActionPointChanged")).data
        stable = ActionParameter("stable", "boolean", "false")
        method = f"{self.scale}/weight"
        await call("AddAction", rpc.AddActionArgs(point.id, "weigh", method, [stable], [Flow(outputs=["kg"])]))
        self.weigh = (await self.client.next_event("ActionChanged")).data.id
        await call("AddLogicItem", rpc.AddLogicItemArgs("START", self.weigh))
        await call("AddLogicItem", rpc.AddLogicItemArgs(self.weigh, "END"))
        await call("SaveProject")
        await call("SubscribeEvents", rpc.SubscribeEventsArgs({"ObjectState"}))

    async def start(self) -> str:
        """Go online; return the reason of a failure, or an empty text."""
        await self.client.call("StartScene")
        while True:
            data = await self.event("SceneState")
            if data.state == "started":
                return ""
            if data.state == "stopped":
                return str(data.message)

    async def stop(self) -> None:
        await self.client.call("StopScene")
        while (await self.event("SceneState")).state != "stopped":
            pass

    async def state(self, *wanted: Connection) -> ObjectStateData:
        """Return the next ObjectState, which must be one of these."""
        data: ObjectStateData = self.states.pop(0) if self.states else await self.event("ObjectState")
        assert data.object_id == self.scale
        assert data.state in wanted, data
        return data

    async def execute(self) -> Any:
        await self.client.call("ExecuteAction", rpc.ExecuteActionArgs(self.weigh))
        return await self.event("ActionResult")

    async def devices(self) -> list[dict[str, Any]]:
        async with httpx.AsyncClient(timeout=60) as http:
            found: list[dict[str, Any]] = (await http.get(f"{self.url.replace('ws', 'http')}/api/devices")).json()
            return found


@contextlib.asynccontextmanager
async def bench(tmp_path: Path, port: str, *arguments: str) -> AsyncIterator[Bench]:
    async with running(tmp_path / "data", *arguments) as server, Client(server.url, "ann") as client:
        created = Bench(client, server.url)
        await created.create_project(port)
        yield created


C = Connection
UP = (C.CONNECTING, C.ONLINE)


async def test_a_device_lost_online_refuses_its_actions(tmp_path: Path, scale: FakeProcess) -> None:
    async with bench(tmp_path, scale.ready["port"]) as workbench:
        assert await workbench.start() == ""
        await workbench.state(C.CONNECTING)
        await workbench.state(C.ONLINE)
        async with Client(workbench.url, "late") as late:
            await late.call("SubscribeEvents", rpc.SubscribeEventsArgs({"ObjectState"}))
            assert (await late.next_event("ObjectState")).data.state is C.ONLINE, (
                "a client that connects late receives the state"
            )

        scale.control.do("silence")
        lost = await workbench.state(C.LOST)
        assert not isinstance(lost.reason, Unset)
        assert "balance" in lost.reason
        (status,) = await workbench.devices()
        assert (status["connection"], status["reason"]) == ("lost", lost.reason)
        refused = await workbench.execute()
        assert "balance" in refused.error
        assert "lost" in refused.error

        scale.control.do("heal")
        await workbench.state(C.BACK, C.ONLINE)  # the loss is reported only once
        assert (await workbench.execute()).results, "the scene continued, and the device is connected again"
        await workbench.stop()
        await workbench.state(C.ONLINE, C.OFFLINE)
        assert C.LOST not in [data.state for data in workbench.states]


async def test_clients_without_subscription_receive_no_object_states(tmp_path: Path, scale: FakeProcess) -> None:
    async with bench(tmp_path, scale.ready["port"]) as workbench, Client(workbench.url, "old") as old:
        assert await workbench.start() == ""
        await workbench.state(C.CONNECTING)
        await workbench.state(C.ONLINE)
        await workbench.stop()
        await workbench.state(C.OFFLINE)
        names = set()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(0.3):
                async for event in old.events():
                    names.add(event.event)
        assert "SceneState" in names
        assert "ObjectState" not in names
        with pytest.raises(RequestFailed, match=r"Moon\. Available events: .*ObjectState"):
            await old.call("SubscribeEvents", rpc.SubscribeEventsArgs({"Moon"}))


async def test_a_program_stops_and_names_the_lost_device(tmp_path: Path, scale: FakeProcess) -> None:
    async with bench(tmp_path, scale.ready["port"]) as workbench:
        call = workbench.client.call
        built = await call("BuildProject", rpc.BuildProjectArgs(workbench.project, "weighing"))
        await call("CloseProject")
        script = tmp_path / "data" / "packages" / built.package_id / "script.py"
        # The connection is lost while the program is busy with something else.
        script.write_text(
            script.read_text().replace("while True:", "import time\n    while True:\n        time.sleep(60)")
        )
        await call("RunPackage", rpc.RunPackageArgs(built.package_id))
        while (await workbench.client.next_event("PackageState")).data.state is not PackageStateEnum.RUNNING:
            pass
        scale.control.do("silence")
        states: list[Connection] = []
        reason = ""
        async with asyncio.timeout(20):
            async for event in workbench.client.events():
                if event.event == "ObjectState":
                    states.append(event.data.state)
                elif event.event == "ProjectException":
                    assert reason == "", "reported twice"
                    reason = event.data.message
                elif event.event == "PackageState" and event.data.state is PackageStateEnum.STOPPED:
                    break
        assert "balance: the program was stopped, because the connection is lost: balance at " in reason
        assert "did not answer" in reason
        assert states[-2:] == [C.LOST, C.OFFLINE]


async def test_a_project_runs_with_a_device_at_another_address(tmp_path: Path, scale: FakeProcess) -> None:
    file = tmp_path / "cell.yaml"
    devices = [
        CellDevice("balance", "MtSicsScale", {"port": scale.ready["port"]}),
        CellDevice("elsewhere", "MtSicsScale", {"port": UNUSED_PORT}),
    ]
    file.write_bytes(write_cell(Cell(devices)))
    async with bench(tmp_path, UNUSED_PORT, "--cell", str(file)) as workbench:
        assert await workbench.start() == "", "the address in the scene does not exist"
        assert (await workbench.state(*UP)).overlaid == ["port"]
        (status,) = await workbench.devices()
        assert status["overlaid"] == ["port"]
        assert (await workbench.execute()).results
        await workbench.stop()
        call = workbench.client.call
        built = await call("BuildProject", rpc.BuildProjectArgs(workbench.project, "weighing"))
        await call("CloseProject")
        await call("RunPackage", rpc.RunPackageArgs(built.package_id))
        assert (await workbench.client.next_event("ActionStateAfter")).data.action_id == workbench.weigh
        await call("StopPackage")
        while (await workbench.client.next_event("PackageState")).data.state is not PackageStateEnum.STOPPED:
            pass
    log = (tmp_path / "data.log").read_text()
    assert "cell file overrides settings" in log
    assert scale.ready["port"] in log
    assert "elsewhere" in log, "a device name that is not in the scene must be logged"


async def test_a_device_of_another_type_is_not_started(tmp_path: Path) -> None:
    file = tmp_path / "cell.yaml"
    file.write_bytes(write_cell(Cell([CellDevice("balance", "ZplPrinter", {"port": UNUSED_PORT})])))
    async with bench(tmp_path, UNUSED_PORT, "--cell", str(file)) as workbench:
        reason = await workbench.start()
        assert "balance is a MtSicsScale in the scene bench and a ZplPrinter in the cell file" in reason


@pytest.mark.parametrize(
    ("text", "status", "problem"),
    [
        (None, 9, "cell.yaml does not exist"),
        ("devices: [", 11, "cell.yaml"),
        ("devices: [{name: a, type: T, port: 1}]", 11, "port"),
        ("devices: [{name: a, type: T}, {name: a, type: T}]", 11, "several devices have the same name: a"),
    ],
)
async def test_an_invalid_cell_file_is_reported_in_one_line(
    tmp_path: Path, text: str | None, status: int, problem: str
) -> None:
    import sys

    file = tmp_path / "cell.yaml"
    if text is not None:
        file.write_text(text)
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "arcor2_server.cli.main", "serve", "--cell", str(file)),
        stderr=asyncio.subprocess.PIPE,
    )
    _, error = await process.communicate()
    assert process.returncode == status, error
    lines = error.decode().splitlines()
    assert len(lines) == 1
    assert problem in lines[0]

"""The ports of the original services, and the Execution service's own websocket."""

import asyncio
import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.asyncio.client import ClientConnection, connect

from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_server.access.tokens import TokenFile
from arcor2_server.websocket.classic_ports import SOCKET, ports_from_environment
from arcor2_server.websocket.execution_endpoint import EVENTS, REQUESTS
from tests.protocol import PROTOCOL
from tests.server.core.serving import RawConnection, ServerProcess, running, talking
from tests.server.rest.rest_client import granted
from tests.server.rest.test_rest_build_and_run import as_file, base, prepare, published

FREE_PORTS = {
    "ARCOR2_STORAGE_SERVICE_PORT": "0",
    "ARCOR2_SCENE_SERVICE_PORT": "0",
    "ARCOR2_EXECUTION_PROXY_PORT": "0",
    "ARCOR2_BUILD_URL": "http://127.0.0.1:0",
    "ARCOR2_EXECUTION_URL": "ws://127.0.0.1:0",
    "ARCOR2_CALIBRATION_URL": "http://127.0.0.1:0",
}


def test_ports_are_read_from_the_environment() -> None:
    assert ports_from_environment({}) == {
        "Storage": 10000,
        "Scene": 5013,
        "Execution": 5009,
        "Build": 5008,
        SOCKET: 6790,
        "Calibration": 5014,
    }
    given = {
        "ARCOR2_SCENE_SERVICE_PORT": "1",
        "ARCOR2_BUILD_URL": "http://build:2/",
        "ARCOR2_EXECUTION_URL": "ws://x:3",
    }
    ports = ports_from_environment(given)
    assert (ports["Scene"], ports["Build"], ports[SOCKET], ports["Storage"]) == (1, 2, 3, 10000)


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("ARCOR2_SCENE_SERVICE_PORT", "many"),
        ("ARCOR2_SCENE_SERVICE_PORT", "70000"),
        ("ARCOR2_SCENE_SERVICE_PORT", "-1"),
        ("ARCOR2_BUILD_URL", "http://build"),
        ("ARCOR2_BUILD_URL", "http://build:port"),
        ("ARCOR2_EXECUTION_URL", "ws://x:99999"),
    ],
)
def test_an_invalid_port_names_its_variable(variable: str, value: str) -> None:
    with pytest.raises(InvalidData, match=variable):
        ports_from_environment({variable: value})


def test_two_services_cannot_have_one_port() -> None:
    with pytest.raises(InvalidData, match="Execution and Scene"):
        ports_from_environment({"ARCOR2_SCENE_SERVICE_PORT": "5009"})


def ports_of(server: ServerProcess) -> dict[str, int]:
    """Read the open ports from the log."""
    entries = (json.loads(line) for line in server.log.read_text().splitlines() if line.startswith("{"))
    return {line["service"]: line["port"] for line in entries if line["event"] == "classic port"}


async def test_each_service_listens_at_its_port(tmp_path: Path) -> None:
    async with running(tmp_path / "data", "--classic-ports", **FREE_PORTS) as server:
        ports = ports_of(server)
        assert set(ports) == {"Storage", "Scene", "Execution", "Build", SOCKET, "Calibration"}
        routes = {
            "Storage": "/scenes",
            "Scene": "/system/running",
            "Execution": "/packages/state",
            "Build": "/healthz/ready",
            "Calibration": "/healthz/ready",
        }
        async with httpx.AsyncClient(timeout=60) as http:
            for service, path in routes.items():
                at = f"http://127.0.0.1:{ports[service]}"
                assert (await http.get(at + path)).status_code == 200, service
                described = granted(await http.get(at + "/swagger/api/swagger.json"))
                assert {
                    tag for one in described["paths"].values() for each in one.values() for tag in each["tags"]
                } == {service}
            everything = granted(await http.get(base(server) + "/swagger/api/swagger.json"))
            assert {"/scenes", "/collisions", "/project/publish", "/packages", "/markers/corners"} <= set(
                everything["paths"]
            )
        # A websocket at these ports behaves like ARServer's, except at the Execution service's port.
        async with talking(f"ws://127.0.0.1:{ports['Storage']}") as talker:
            await talker.granted("SystemInfo")
        async with connect(f"ws://127.0.0.1:{ports[SOCKET]}") as socket:
            executing = RawConnection(socket)
            await executing.event("PackageState")
            assert await executing.granted("Version") == {"version": "1.2.0"}


async def test_the_error_names_a_used_port(tmp_path: Path) -> None:
    blocker = await asyncio.start_server(lambda _reader, writer: writer.close(), "127.0.0.1", 0)
    port = blocker.sockets[0].getsockname()[1]
    async with blocker:
        server = ServerProcess(
            tmp_path / "data", "--classic-ports", **FREE_PORTS | {"ARCOR2_STORAGE_SERVICE_PORT": str(port)}
        )
        with pytest.raises(AssertionError, match=f"{port}.* is used by another program"):
            await server.start()
        await server.stop()


# ------------------------------------------------------------------------------------------------ the websocket
async def connected(socket: ClientConnection) -> RawConnection:
    talker = RawConnection(socket)
    state = await talker.event("PackageState")
    assert state["data"] == {"state": "undefined"}
    return talker


async def collected(talker: RawConnection, until: dict[str, Any]) -> list[str]:
    """Return the names of the events up to one with this data."""
    names = []
    async with asyncio.timeout(30):
        while True:
            message = talker.events.pop(0) if talker.events else await talker.receive()
            names.append(message["event"])
            if message.get("data", {}).items() >= until.items():
                return names


async def test_the_execution_port_serves_only_packages(tmp_path: Path) -> None:
    async with (
        running(tmp_path / "data") as server,
        httpx.AsyncClient(timeout=60, base_url=base(server)) as http,
        connect(f"{server.url}/execution") as socket,
        talking(server.url, "ann") as editor,
    ):
        execution = await connected(socket)
        assert await execution.granted("Version") == {"version": "1.2.0"}
        for name in ("SystemInfo", "RegisterUser", "ListScenes", "NewScene", "NoSuchThing"):
            assert name in await execution.refused(name)
        assert "Version" in await editor.refused("Version")
        # Events of the editor are not sent to it.
        await editor.granted("NewScene", {"name": "scene"})
        await editor.granted("CloseScene", {"force": True})
        await prepare(http)
        granted(await http.post("/packages/pkg_a", files=as_file(await published(http))))
        assert await collected(execution, {"id": "pkg_a"}) == ["PackageChanged"]
        (listed,) = await execution.granted("ListPackages")
        assert listed["id"] == "pkg_a"

        await execution.granted("RunPackage", {"id": "pkg_a", "start_paused": False})
        order = await collected(execution, {"action_id": "act_1"})
        assert order[:3] == ["PackageState", "PackageState", "PackageInfo"]
        assert order[3] == "ActionStateBefore"
        async with connect(f"{server.url}/execution") as second:
            late = RawConnection(second)
            assert (await late.event("PackageState"))["data"] == {"state": "running", "package_id": "pkg_a"}
            assert (await late.event("PackageInfo"))["data"]["package_id"] == "pkg_a"
        await execution.granted("PausePackage")
        await collected(execution, {"state": "paused"})
        await execution.granted("StepAction")
        await collected(execution, {"state": "paused"})
        await execution.granted("ResumePackage")
        await collected(execution, {"state": "running"})
        await execution.granted("StopPackage")
        names = set(await collected(execution, {"state": "stopped"}))
        await execution.granted("RenamePackage", {"package_id": "pkg_a", "new_name": "other"})
        await execution.granted("DeletePackage", {"id": "pkg_a"})
        assert await execution.granted("ListPackages") == []
        names |= {event["event"] for event in execution.events} | set(order)
        assert names <= EVENTS, "ShowMainScreen is for ARServer's clients"


def test_the_execution_websocket_follows_the_protocol() -> None:
    assert {*REQUESTS, "Version"} == set(PROTOCOL["execution_requests"])
    assert set(PROTOCOL["execution_events"]) == EVENTS


async def test_the_execution_websocket_requires_a_token(tmp_path: Path) -> None:
    _, secret = TokenFile(tmp_path / "data").add("line", Role.OPERATOR)
    async with running(tmp_path / "data") as server:
        async with connect(f"{server.url}/execution") as socket:
            talker = RawConnection(socket)
            assert "Authenticate" in await talker.refused("Version")
            await talker.granted("Authenticate", {"token": secret})
            await talker.event("PackageState")
            assert await talker.granted("ListPackages") == []
            refusal = await talker.refused("UploadPackage", {"id": "pkg_a", "data": ""})
            assert "programmer" in refusal
        async with connect(f"{server.url}/execution?token={secret}") as socket:
            await connected(socket)

"""Access to the server of the fleet, without a broker: tokens, roles, and a page that can only view."""

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosedError

from arcor2_hw.data.base import now
from arcor2_hw.data.role import Role
from arcor2_server.access.tokens import TokenFile
from arcor2_server.fleet.file import FILE, FleetFile
from arcor2_server.fleet.registry import StoredCell
from tests.ports import free_port
from tests.server.fleet.cells import state_of
from tests.server.fleet.test_results import FleetProcess
from tests.waiting import WITHIN

CARD = f"press-3:{'a' * 32}"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FleetProcess]:
    data_dir = tmp_path_factory.mktemp("fleet")
    file = FleetFile(data_dir / FILE)
    file.put_cells([StoredCell("press-3", now(), state_of())])
    file.close()
    running = FleetProcess(f"nats://127.0.0.1:{free_port()}", data_dir)
    yield running
    os.kill(running.process.pid, signal.SIGTERM)
    assert running.process.wait(WITHIN) == 0
    running.kill()


@pytest.fixture(scope="module")
def secrets(fleet: FleetProcess) -> dict[Role, str]:
    tokens = TokenFile(Path(fleet.command[fleet.command.index("--data-dir") + 1]))
    return {role: tokens.add(role.name.lower(), role)[1] for role in (Role.OPERATOR, Role.TECHNICIAN)}


def request(fleet: FleetProcess, method: str, path: str, secret: str = "", **headers: str) -> httpx.Response:
    if secret:
        headers["Authorization"] = f"Bearer {secret}"
    return httpx.request(method, f"{fleet.url}{path}", headers=headers)


@pytest.mark.parametrize(
    ("method", "path"),
    [("GET", "/api/fleet/cells"), ("GET", "/api/fleet/results"), ("DELETE", f"/api/fleet/cells/{CARD}")],
)
def test_requests_need_a_token(fleet: FleetProcess, secrets: dict[Role, str], method: str, path: str) -> None:
    assert request(fleet, method, path).status_code == 401
    assert request(fleet, method, path, "wrong").status_code == 401
    page = request(fleet, "GET", "/")
    assert page.status_code == 200
    assert "connect-src 'self'" in page.headers["content-security-policy"]


async def test_a_page_needs_a_token_and_can_only_view(fleet: FleetProcess, secrets: dict[Role, str]) -> None:
    address = fleet.url.replace("http", "ws") + "/ws"
    async with connect(address) as socket:
        with pytest.raises(ConnectionClosedError):
            await socket.recv()
        assert socket.close_code == 4401
    async with connect(f"{address}?token={secrets[Role.OPERATOR]}") as socket:
        first = json.loads(await socket.recv())
        assert [(cell["id"], cell["alive"]) for cell in first["cells"]] == [(CARD, False)]
        assert first["broker"] is False
        await socket.send(json.dumps({"request": "StopAll", "id": 1}))
        assert json.loads(await socket.recv()) == {"cells": [], "removed": [], "broker": False}


def test_results_are_selected_by_valid_arguments(fleet: FleetProcess, secrets: dict[Role, str]) -> None:
    assert request(fleet, "GET", "/api/fleet/results?cell=press-3&kind=alarm", secrets[Role.OPERATOR]).json() == []
    for query in ("kind=other", "limit=0", "limit=1001", "before=-1", "before=x"):
        refused = request(fleet, "GET", f"/api/fleet/results?{query}", secrets[Role.OPERATOR])
        assert refused.status_code == 400, query
        assert query.partition("=")[0] in refused.json()["message"]


def test_a_technician_removes_a_cell_without_a_signal(fleet: FleetProcess, secrets: dict[Role, str]) -> None:
    path = f"/api/fleet/cells/{CARD}"
    refused = request(fleet, "DELETE", path, secrets[Role.OPERATOR], **{"Arcor2-Session": "of a cell"})
    assert (refused.status_code, "role technician" in refused.json()["message"]) == (403, True)
    assert request(fleet, "DELETE", path, secrets[Role.TECHNICIAN]).status_code == 204
    again = request(fleet, "DELETE", path, secrets[Role.TECHNICIAN])
    assert (again.status_code, "is not known" in again.json()["message"]) == (404, True)

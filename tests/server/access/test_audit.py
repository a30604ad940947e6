"""Every command and every refusal by role is one entry of the audit trail, and one line in the log."""

import asyncio
import csv
import json
from pathlib import Path
from typing import Any, cast
from unittest.mock import AsyncMock

import httpx

from arcor2_hw.data.audit import AuditChange
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS, Request
from arcor2_server.access.tokens import TokenFile
from arcor2_server.audit import commands
from arcor2_server.audit.chain import AuditFile
from arcor2_server.audit.changes import record
from arcor2_server.audit.trail import ENDED_EARLY, AuditTrail
from arcor2_server.collaboration.log_ons import LogOns
from arcor2_server.settings import ServerSettings
from arcor2_server.websocket.client import Client, Wire
from arcor2_server.websocket.dispatch import Dispatcher
from arcor2_server.websocket.hub import Hub
from arcor2_server.websocket.routes import Route
from tests.server.core.serving import WITHIN, running, talking

SECRET = "swordfish-4711"


async def test_commands_and_refusals_are_noted_once(tmp_path: Path) -> None:
    tokens = TokenFile(tmp_path / "data")
    eva, ivo = (tokens.add(name, role)[1] for name, role in (("eva", Role.PROGRAMMER), ("ivo", Role.OPERATOR)))
    async with running(tmp_path / "data") as server:
        async with talking(server.url, "ivo", additional_headers={"Authorization": f"Bearer {ivo}"}) as talker:
            await talker.refused("SaveScene")
        headers = {"Authorization": f"Bearer {eva}"}
        async with talking(server.url, "ann", additional_headers=headers) as talker:
            await talker.granted("NewScene", {"name": "hall"})
            given = {"name": "arms", "type": "YuMi", "pose": {"position": {}, "orientation": {}}}
            given["parameters"] = [
                {"name": "host", "type": "string", "value": '"127.0.0.9"'},
                {"name": "password", "type": "string", "value": f'"{SECRET}"'},
            ]
            await talker.granted("AddObjectToScene", given)
            await talker.refused("AddObjectToScene", given)  # the name is taken
            await talker.request("RenameScene", {"id": "x", "new_name": "y"}, dry_run=True)
            await talker.granted("ListScenes")
            await talker.granted("GetObjectTypes")
        async with httpx.AsyncClient(timeout=60, base_url=server.url.replace("ws", "http")) as http:
            assert (await http.delete("/scenes/none", headers=headers)).status_code == 404
            assert (await http.get("/scenes", headers=headers)).status_code == 200
            forbidden = await http.delete("/scenes/other", headers={"Authorization": f"Bearer {ivo}"})
            assert forbidden.status_code == 403
            checked = (await http.get("/api/audit/check", headers=headers)).json()
            assert checked["problem"] == ""
            async with asyncio.timeout(WITHIN):  # entries are written a little later
                while len(found := (await http.get("/api/audit", params={"text": "arms"}, headers=headers)).json()) < 2:
                    await asyncio.sleep(0.01)
            exported = (await http.get("/api/audit/export", headers=headers)).text
            assert (await http.get("/api/audit", headers={"Authorization": f"Bearer {ivo}"})).status_code == 403
    printed = (tmp_path / "data.log").read_text()
    lines: list[dict[str, Any]] = [json.loads(line) for line in printed.splitlines() if line.startswith("{")]
    fields = ("outcome", "request", "target", "user", "role", "address")
    assert [tuple(line[name] for name in fields) for line in lines if line["event"] == "command"] == [
        ("forbidden", "SaveScene", "", "ivo", "operator", "127.0.0.1"),
        ("done", "NewScene", "hall", "ann", "programmer", "127.0.0.1"),
        ("done", "AddObjectToScene", "arms", "ann", "programmer", "127.0.0.1"),
        ("refused", "AddObjectToScene", "arms", "ann", "programmer", "127.0.0.1"),
        ("refused", "DELETE /scenes/{scene_id}", "none", "eva", "programmer", "127.0.0.1"),
        ("forbidden", "DELETE /scenes/other", "", "ivo", "operator", "127.0.0.1"),
        ("forbidden", "GET /api/audit", "", "ivo", "operator", "127.0.0.1"),
    ]
    refused, added = found
    assert (refused["outcome"], "another name" in refused["reason"], refused["changes"]) == ("refused", True, [])
    (change,) = added["changes"]
    assert (change["kind"], change["before"], change["after"]["name"]) == ("object", None, "arms")
    rows = list(csv.DictReader(exported.splitlines()))
    assert [row["request"] for row in rows[:3]] == ["SaveScene", "NewScene", "AddObjectToScene"]
    file = AuditFile(tmp_path / "data" / "audit.sqlite")
    assert [entry.request for entry in file.all()][-1] == "GET /api/audit"
    assert file.check().problem == ""
    stored = file.path.read_bytes() + (tmp_path / "data" / "audit.sqlite.head").read_bytes()
    for text in (printed, exported, stored.decode(errors="replace")):
        assert SECRET not in text
        assert eva not in text


async def test_a_cancelled_request_leaves_its_changes_in_the_trail(tmp_path: Path) -> None:
    audit, wire, started = AuditTrail(tmp_path / "audit.sqlite", str), cast("Wire", AsyncMock()), asyncio.Event()
    client = Client(wire, ServerSettings(data_dir=tmp_path))
    client.ceiling = Role.TECHNICIAN

    async def save(*_: Any) -> None:
        record([AuditChange("scene", "s1", "old", "new")])
        started.set()
        await asyncio.Event().wait()

    dispatcher = Dispatcher(Hub(), audit, cast("LogOns", None))
    route = Route(RPCS["SaveScene"], save, None, None, None)
    handling = asyncio.create_task(dispatcher.handle(client, Request(1, "SaveScene"), route))
    await started.wait()
    handling.cancel()
    await asyncio.wait({handling})
    entry = audit._waiting.get_nowait()
    assert entry is not None
    assert (entry.request, entry.outcome.value, entry.reason) == ("SaveScene", "refused", ENDED_EARLY)
    assert [change.after for change in entry.changes] == ["new"]


def test_requests_excluded_from_the_audit_trail_exist() -> None:
    """Otherwise a renamed request would silently be excluded or included."""
    assert {*RPCS, "Version"} >= commands.READING | commands.CLIENT_STATE
    assert {name for name, rpc in RPCS.items() if rpc.dry_run and not commands.is_command(rpc)} == set()

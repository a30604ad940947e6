"""Every command and every refusal by role is one line in the audit log."""

import json
from pathlib import Path
from typing import Any

import httpx

from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from arcor2_server.access.tokens import TokenFile
from arcor2_server.log import audit
from tests.server.core.serving import running, talking

SECRET = "swordfish-4711"


async def test_commands_and_refusals_are_logged_once(tmp_path: Path) -> None:
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
    ]
    assert SECRET not in printed
    assert eva not in printed


def test_requests_excluded_from_the_audit_log_exist() -> None:
    """Otherwise a renamed request would silently be excluded or logged."""
    assert {*RPCS, "Version"} >= audit.READING | audit.CLIENT_STATE
    assert {name for name, rpc in RPCS.items() if rpc.dry_run and not audit.is_command(rpc)} == set()

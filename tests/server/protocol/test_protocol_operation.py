"""What the requests about operation answer in every state of the server, and which role each needs."""

from pathlib import Path
from typing import Any

from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from tests.server.protocol.stage import Actor, open_stage, refused
from tests.server.protocol.test_protocol_states import enter, outcome

HOLD = {"robot_id": "nobody", "hold": 1, "sent_ms": 1.0, "valid_ms": 100}
ASKED: dict[str, dict[str, Any] | None] = {
    "JogRobot": HOLD | {"linear": {"x": 0.1}},
    "HoldHandTeaching": HOLD,
    "StreamRobot": {"robot_id": "nobody", "what": "joints"},
    "StartSceneKeepGoing": None,
    "RetryObject": {"object_id": "nobody"},
    "AcknowledgeStop": {"object_id": "nobody"},
}
ROLES = {
    "JogRobot": Role.STANDARD_USER,
    "HoldHandTeaching": Role.STANDARD_USER,
    "StreamRobot": Role.OPERATOR,
    "StartSceneKeepGoing": Role.STANDARD_USER,
    "RetryObject": Role.STANDARD_USER,
    "AcknowledgeStop": Role.OPERATOR,
}
CLOSED, OFFLINE, ONLINE = "needs an open scene", "needs other scene state", "other"
EXPECTED = {
    "no_scene": dict.fromkeys(ASKED, f"refused: {CLOSED}"),
    "scene_offline": dict.fromkeys(ASKED, f"refused: {OFFLINE}") | {"StartSceneKeepGoing": "ok"},
    "scene_online": dict.fromkeys(ASKED, f"refused: {ONLINE}") | {"StartSceneKeepGoing": f"refused: {OFFLINE}"},
}
EXPECTED |= {"project_offline": EXPECTED["scene_offline"], "project_online": EXPECTED["scene_online"]}
"""What is asked names nothing that there is: where it would be granted otherwise, it is refused for that alone."""
ANONYMOUS = {"JogRobot", "HoldHandTeaching", "AcknowledgeStop"}
"""They need a registered user, whose name they carry."""


async def answer(person: Actor, name: str) -> str:
    message: dict[str, Any] = {"id": 1, "request": name, "dry_run": RPCS[name].dry_run}
    if (args := ASKED[name]) is not None:
        message["args"] = args
    return outcome(await person.send(message))


async def test_every_request_in_every_state(tmp_path: Path) -> None:
    async with open_stage(tmp_path, lock_retries=1, lock_retry_wait=0.01) as stage:
        alice, stranger = await stage.person("alice"), await stage.person()
        for state, rows in EXPECTED.items():
            await enter(stage, alice, state)
            for name, expected in rows.items():
                assert await answer(alice, name) == expected, f"{name} in {state}"
                theirs = await answer(stranger, name)
                if name in ANONYMOUS:
                    assert theirs == "refused: needs a registered user", f"{name} of a stranger in {state}"
                else:
                    assert theirs == expected, f"{name} of a stranger in {state}"
                assert alice.events() == [], f"{name} in {state}"


async def test_the_role_that_is_stated_is_asked_for(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        operator = await stage.person("olga")
        (client,) = stage.services.hub.clients
        client.role = Role.OPERATOR
        for name, role in ROLES.items():
            assert RPCS[name].role is role
            text = await refused(operator, name, **(ASKED[name] or {}))
            assert ("needs the role standard_user" in text) is (role is Role.STANDARD_USER), f"{name}: {text}"

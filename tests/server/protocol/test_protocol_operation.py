"""Answers of operating requests in every server state, and the role that each needs."""

import itertools
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from tests.server.protocol.in_process_server import Actor, open_stage, refused, until, until_event
from tests.server.protocol.test_protocol_states import enter, outcome
from tests.server.protocol.test_protocol_temporary import project
from tests.server.session.session_server import Refused

HOLD = {"robot_id": "nobody", "hold": 1, "sent_ms": 1.0, "valid_ms": 100}
REQUESTS: dict[str, dict[str, Any] | None] = {
    "JogRobot": HOLD | {"linear": {"x": 0.1}},
    "HoldHandTeaching": HOLD,
    "StreamRobot": {"robot_id": "nobody", "what": "joints"},
    "StreamObservations": {"object_id": "nobody"},
    "StartSceneKeepGoing": None,
    "RetryObject": {"object_id": "nobody"},
    "AcknowledgeStop": {"object_id": "nobody"},
    "StopAll": None,
}
ROLES = {
    "JogRobot": Role.STANDARD_USER,
    "HoldHandTeaching": Role.STANDARD_USER,
    "StreamRobot": Role.OPERATOR,
    "StreamObservations": Role.OPERATOR,
    "StartSceneKeepGoing": Role.STANDARD_USER,
    "RetryObject": Role.STANDARD_USER,
    "AcknowledgeStop": Role.OPERATOR,
    "StopAll": Role.OPERATOR,
}
CLOSED, OFFLINE, ONLINE = "needs an open scene", "needs other scene state", "other"
EXPECTED = {
    "no_scene": dict.fromkeys(REQUESTS, f"refused: {CLOSED}"),
    "scene_offline": dict.fromkeys(REQUESTS, f"refused: {OFFLINE}") | {"StartSceneKeepGoing": "ok"},
    "scene_online": dict.fromkeys(REQUESTS, f"refused: {ONLINE}") | {"StartSceneKeepGoing": f"refused: {OFFLINE}"},
}
for row in EXPECTED.values():
    row["StopAll"] = "ok"
EXPECTED |= {"project_offline": EXPECTED["scene_offline"], "project_online": EXPECTED["scene_online"]}
"""Requests that the state permits. They are refused only because their arguments name nothing that exists."""
ANONYMOUS = {"JogRobot", "HoldHandTeaching", "AcknowledgeStop"}
"""Requests that need a registered user, because they carry the user's name."""


async def answer(person: Actor, name: str) -> str:
    message: dict[str, Any] = {"id": 1, "request": name, "dry_run": RPCS[name].dry_run}
    if (args := REQUESTS[name]) is not None:
        message["args"] = args
    return outcome(await person.send(message))


async def test_every_request_is_answered_according_to_the_state(tmp_path: Path) -> None:
    async with open_stage(tmp_path, lock_retries=1, lock_retry_wait=0.01) as stage:
        alice, stranger = await stage.person("alice"), await stage.person()
        for state, rows in EXPECTED.items():
            await enter(stage, alice, state)
            for name, expected in rows.items():
                assert await answer(alice, name) == expected, f"{name} in {state}"
                anonymous_answer = await answer(stranger, name)
                if name in ANONYMOUS:
                    assert anonymous_answer == "refused: needs a registered user", f"{name} of a stranger in {state}"
                else:
                    assert anonymous_answer == expected, f"{name} of a stranger in {state}"
                assert alice.events() == [], f"{name} in {state}"


async def test_the_declared_role_is_required(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        operator = await stage.person("olga")
        (client,) = stage.services.hub.clients
        client.ceiling = Role.OPERATOR
        for name, role in ROLES.items():
            assert RPCS[name].role is role
            if name == "StopAll":  # allowed in every state
                assert await answer(operator, name) == "ok"
                continue
            text = await refused(operator, name, **(REQUESTS[name] or {}))
            assert ("needs the role standard user" in text) is (role is Role.STANDARD_USER), f"{name}: {text}"


def joints(person: Actor) -> list[dict[str, Any]]:
    return [message["data"] for message in person.waiting if message.get("event") == "RobotJoints"]


async def test_a_robot_is_streamed_while_a_program_runs(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm") as stage:
        alice, viewer, other = await stage.person("alice"), await stage.person(), await stage.person()
        await project(stage, alice, arm="Arm")
        arm, clock = stage.ids["arm"], stage.ids["time"]
        stream: dict[str, Any] = {"robot_id": arm, "what": "joints"}
        assert "offline" in await refused(viewer, "StreamRobot", **stream)
        await alice.ask("TemporaryPackage")
        with pytest.raises(Refused, match="not connected yet"):
            await viewer.ask("StreamRobot", **stream)
        with pytest.raises(Refused, match="not connected yet"):
            await viewer.ask("StreamObservations", object_id=arm)
        await until_event(viewer, "ActionStateBefore")
        await viewer.ask("StreamObservations", object_id=clock, rate=5)
        await until_event(viewer, "ObjectObservations", object_id=clock)
        assert not [message for message in other.waiting if message.get("event") == "ObjectObservations"]
        await viewer.ask("StreamObservations", object_id=clock, send=False)

        await viewer.ask("StreamRobot", **stream, rate=30)
        viewer.take(), other.take()
        await until(lambda: len(joints(viewer)) >= 20 and len(joints(other)) >= 2)
        seen, usual = joints(viewer), joints(other)
        assert all("time_ms" in data for data in seen), "the client also gets the ordinary events"
        steps = [after["time_ms"] - before["time_ms"] for before, after in itertools.pairwise(seen)]
        assert sum(steps) >= (len(steps) - 2) * 33.3, "faster than requested"
        assert min(steps) <= 60.0, "as slow as the ordinary events"
        assert all("time_ms" not in data for data in usual)
        await viewer.ask("StreamRobot", **stream, send=False)
        viewer.take()
        await until(lambda: len(joints(viewer)) > 1)
        assert "time_ms" not in joints(viewer)[-1]
        for args, words in (
            (stream | {"send": False}, "not subscribed to"),
            (stream | {"rate": 31}, "1 to 30 Hz"),
            (stream | {"robot_id": clock}, "not a robot"),
            (stream | {"robot_id": "nobody"}, "nobody"),
        ):
            with pytest.raises(Refused, match=words):
                await viewer.ask("StreamRobot", **args)

        # The stream ends with the program. A client subscribes again for the next one.
        await viewer.ask("StreamRobot", **stream, rate=30)
        await alice.ask("StopPackage")
        await until_event(viewer, "OpenProject")
        assert stage.services.execution._host.streams._rates == {}
        viewer.take()
        await alice.ask("TemporaryPackage")
        await until_event(viewer, "ActionStateBefore")
        viewer.take()
        await until(lambda: len(joints(viewer)) > 1)
        assert all("time_ms" not in data for data in joints(viewer))
        await alice.ask("StopPackage")
        await until_event(alice, "OpenProject")

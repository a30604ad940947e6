"""Dry runs of the open project: requests, events, and the effect of an edit on a result."""

import itertools
from pathlib import Path
from typing import Any

import msgspec

from arcor2_hw.data.geometry import Pose
from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused, until
from tests.server.protocol.test_protocol_reachability import move, point


async def action(
    person: Actor, stage: Stage, name: str, point_id: str, robot: str, orientation: str, move_type: str
) -> str:
    parameters = [
        {"name": "pose", "type": "pose", "value": msgspec.json.encode(orientation).decode()},
        {"name": "move_type", "type": "string_enum", "value": msgspec.json.encode(move_type).decode()},
        {"name": "speed", "type": "double", "value": "0.5"},
        {"name": "acceleration", "type": "double", "value": "1.0"},
    ]
    await person.ask(
        "AddAction", action_point_id=point_id, name=name, type=f"{robot}/move", parameters=parameters, flows=[{}]
    )
    points = stage.services.session.require_project().action_points
    return next(each.id for one in points for each in one.actions if each.name == name)


async def connect(person: Actor, *chain: str) -> None:
    for start, end in itertools.pairwise(chain):
        await person.ask("AddLogicItem", start=start, end=end)


def states(person: Actor, number: int) -> list[str]:
    events = [message["data"] for message in person.waiting if message.get("event") == "DryRunChanged"]
    return [data["state"] for data in events if data["number"] == number]


async def finished(person: Actor, **args: Any) -> dict[str, Any]:
    """Start a dry run, and return its result."""
    head = await person.ask("StartDryRun", **args)
    await until(lambda: states(person, head["number"])[-1:] == ["finished"])
    answer: dict[str, Any] = await person.ask("GetDryRun")
    assert answer["dry_run"]["number"] == head["number"]
    return answer


async def test_a_dry_run_predicts_the_open_project_until_it_is_edited(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        assert "is open" in await refused(alice, "StartDryRun")
        assert "no such dry run" in await refused(alice, "GetDryRun")
        assert "No dry run is running" in await refused(alice, "CancelDryRun")
        await alice.ask("NewScene", name="scene")
        robot = await stage.add(alice, "ur", "UR5e", Pose(), host="127.0.0.99")
        await alice.ask("SaveScene")
        await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="project")
        assert "no first action" in await refused(alice, "StartDryRun")
        first_point, first = await point(alice, stage, "first", 0.4, 0.2, 0.3)
        second_point, second = await point(alice, stage, "second", 0.4, -0.2, 0.3)
        go = await action(alice, stage, "go", first_point, robot, first, "joint")
        back = await action(alice, stage, "back", second_point, robot, second, "linear")
        await connect(alice, "START", go, back, "END")

        await bob.ask("SubscribeEvents", events=["DryRunChanged"])
        head = await bob.ask("StartDryRun")
        assert "already" in await refused(alice, "StartDryRun")
        await until(lambda: states(bob, head["number"]) == ["running", "finished"])
        assert not any(message.get("event") == "DryRunChanged" for message in alice.waiting)
        answer = await alice.ask("GetDryRun")
        assert (answer["dry_run"]["state"], answer["outdated"]) == ("finished", False)
        assert answer["dry_run"]["started_by"] == "bob"
        assert answer["dry_run"]["revision"] == stage.services.session.revision
        prediction = answer["prediction"]
        assert [span["name"] for span in prediction["trace"]["spans"]] == ["go", "back"]
        assert [each["source"] for each in prediction["durations"]] == ["planned", "planned"]
        # The defaults of the settings are 1.0 m/s and 1.2 m/s²: 0.4 m take 0.8 + 0.417 s.
        assert 1.2 < prediction["trace"]["spans"][1]["duration"] < 1.3
        assert prediction["summary"]["devices"][0]["name"] == "ur"
        assert "problem" not in prediction

        # An edit makes the result outdated, and a new one states the problem.
        await move(alice, second_point, 3.0, 0.0, 0.3)
        assert (await alice.ask("GetDryRun"))["outdated"] is True
        answer = await finished(bob)
        problem = answer["prediction"]["problem"]
        assert (problem["action_id"], problem["name"]) == (back, "back")
        assert problem["pose"]["position"]["x"] == 3.0
        assert "reaches at most" in problem["reason"]
        assert "key" not in problem
        stored = [each["number"] for each in answer["stored"]]
        assert stored == [head["number"] + 1, head["number"]]
        earlier = await bob.ask("GetDryRun", number=head["number"])
        assert (earlier["outdated"], "problem" in earlier["prediction"]) == (True, False)

        assert "does not execute" in await refused(alice, "StartDryRun", from_action="act_nothing")
        assert "no branch" in await refused(alice, "StartDryRun", branches={go: "END"})
        only = await finished(bob, from_action=back)
        assert [span["name"] for span in only["prediction"]["trace"]["spans"]] == ["back"]

        cancelled = await bob.ask("StartDryRun")
        await alice.ask("CancelDryRun")
        await until(lambda: states(bob, cancelled["number"]) == ["running", "cancelled"])
        assert stage.faults == []

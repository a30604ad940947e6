"""Projects with former names of actions and parameters, or from ARCOR2, open and run."""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.project import Action, Project
from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused, until_event

FLOW = {"type": "default", "outputs": ["number"]}


def calls(project: Project) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return method and parameters of each action."""
    actions = [action for point in project.action_points for action in point.actions]
    return [(one.type.partition("/")[2], [(p.name, p.value) for p in one.parameters]) for one in actions]


async def open_project(stage: Stage, alice: Actor) -> str:
    """Open a project on a scene with a source of random numbers; return its action point."""
    await stage.place(alice, rnd="RandomActions")
    await alice.ask("SaveScene")
    await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="drawing")
    await alice.ask("AddActionPoint", name="ap", position={"x": 0, "y": 0, "z": 0})
    return stage.services.session.require_project().action_points[0].id


async def add(stage: Stage, alice: Actor, point: str, name: str, method: str, **given: Any) -> str:
    kinds = {int: "integer", float: "double"}
    parameters = [{"name": k, "type": kinds[type(v)], "value": str(v)} for k, v in given.items()]
    kind = f"{stage.ids['rnd']}/{method}"
    action: dict[str, Any] = {"action_point_id": point, "name": name, "type": kind, "parameters": parameters}
    await alice.ask("AddAction", **action, flows=[FLOW | {"outputs": [f"of_{name}"]}])
    return stage.services.session.require_project().action_points[0].actions[-1].id


CURRENT_CALLS = [
    ("random_int", [("range_min", "3"), ("range_max", "3")]),
    ("random_double", [("range_min", "0.5"), ("range_max", "0.5")]),
]


@pytest.mark.parametrize(
    ("whole", "low", "high"),
    [("random_integer", "minimum", "maximum"), ("random_int", "range_min", "range_max")],
    ids=["former", "ARCOR2"],
)
async def test_a_saved_project_opens_builds_and_runs(tmp_path: Path, whole: str, low: str, high: str) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        session, storage = stage.services.session, stage.services.storage
        point = await open_project(stage, alice)
        # Requests may also use the former names.
        draw = await add(stage, alice, point, "draw", whole, **{low: 3, high: 3})
        await add(stage, alice, point, "part", "random_double", **{low: 0.5, high: 0.5})
        assert calls(session.require_project()) == CURRENT_CALLS
        await alice.ask("AddLogicItem", start="START", end=draw)
        await alice.ask("AddLogicItem", start=draw, end="END")
        await alice.ask("SaveProject")
        await alice.ask("CloseProject")
        (listed,) = await storage.projects()
        saved = await storage.project(listed.id)

        # As saved before the names changed.
        def before(action: Action, method: str) -> Action:
            pairs = zip(action.parameters, (low, high), strict=True)
            parameters = [msgspec.structs.replace(each, name=name) for each, name in pairs]
            kind = f"{action.type.partition('/')[0]}/{method}"
            return msgspec.structs.replace(action, type=kind, parameters=parameters)

        first, second = saved.action_points[0].actions
        older = [before(first, whole), before(second, "random_double")]
        points = [msgspec.structs.replace(saved.action_points[0], actions=older)]
        await storage.put_project(msgspec.structs.replace(saved, action_points=points))

        (entry,) = await alice.ask("ListProjects")
        assert "problems" not in entry
        package = (await alice.ask("BuildProject", project_id=saved.id, package_name="p"))["package_id"]
        script = stage.services.settings.packages_dir / package / "script.py"
        call = 'rnd.random_int(3, 3, an="draw")'
        assert call in script.read_text()
        # A script written by a user may still call the action by its former name.
        script.write_text(script.read_text().replace(call, f'rnd.{whole}({low}=3, {high}=3, an="draw")'))
        await alice.ask("RunPackage", id=package)
        assert (await until_event(alice, "ActionStateAfter"))["results"] == ["3"]
        await alice.ask("StopPackage")
        await until_event(alice, "PackageState", state="stopped")
        alice.take()
        await alice.ask("OpenProject", id=saved.id)
        event = await until_event(alice, "OpenProject")
        assert calls(msgspec.convert(event["project"], Project)) == CURRENT_CALLS
        assert not session.has_changes
        await stage.start(alice)
        await alice.ask("ExecuteAction", action_id=draw)
        assert (await until_event(alice, "ActionResult"))["results"] == ["3"]
        twice = [{"name": name, "type": "integer", "value": "3"} for name in ("minimum", "range_min")]
        await alice.lock(draw)
        assert "given twice" in await refused(alice, "UpdateAction", action_id=draw, parameters=twice)

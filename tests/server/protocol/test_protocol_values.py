"""Parameter values offered by a live object, and settings overridden by a project."""

import json
from pathlib import Path
from typing import Any

from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused, until_event


def parent(name: str, value: Any) -> dict[str, str]:
    return {"id": name, "value": value if isinstance(value, str) else json.dumps(value)}


async def test_a_live_object_offers_values(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Chooser") as stage:
        alice, stranger, bob = await stage.person("alice"), await stage.person(), await stage.person("bob")
        request: dict[str, Any] = {"id": "x", "param_id": "shelf"}
        assert "No scene is open" in await refused(stranger, "ActionParamValues", **request)
        await stage.place(alice, chooser="Chooser")
        request["id"] = chooser = stage.ids["chooser"]
        assert "not logged in" in await refused(stranger, "ActionParamValues", **request)
        assert "offline" in await refused(alice, "ActionParamValues", **request)
        (meta,) = [m for m in await alice.ask("GetActions", type="Chooser") if m["name"] == "take"]
        dynamic = {p["name"]: set(p.get("dynamic_value_parents", ())) for p in meta["parameters"] if p["dynamic_value"]}
        assert dynamic == {"shelf": set(), "item": {"shelf", "count"}}
        await stage.start(alice)

        assert sorted(await alice.ask("ActionParamValues", **request)) == ["lower", "upper"]
        both = [parent("shelf", "lower"), parent("count", 2)]
        items: dict[str, Any] = {"id": chooser, "param_id": "item"}
        for parents in (both, both[::-1], [parent("shelf", '"lower"'), both[1]]):
            assert sorted(await alice.ask("ActionParamValues", **items, parent_params=parents)) == [
                "lower 0",
                "lower 1",
            ]
        for parents in ([], both[:1], [*both, parent("an", "x")], [both[0], both[0]]):
            assert "count, shelf" in await refused(alice, "ActionParamValues", **items, parent_params=parents)
        unneeded = await refused(alice, "ActionParamValues", **request, parent_params=both[:1])
        assert "no other parameter" in unneeded
        assert "no values" in await refused(alice, "ActionParamValues", id=chooser, param_id="count")
        assert "not of the type integer" in await refused(
            alice, "ActionParamValues", **items, parent_params=[both[0], parent("count", "two")]
        )
        wrong = [parent("shelf", "middle"), both[1]]
        assert "there is no shelf middle" in await refused(alice, "ActionParamValues", **items, parent_params=wrong)
        await bob.lock(chooser)
        assert "lock" in await refused(alice, "ActionParamValues", **request)
        assert await bob.ask("ActionParamValues", **request), "the holder of the write lock gets no values"


# ------------------------------------------------------------------------------------------------ overrides
async def project_that_greets(stage: Stage, alice: Actor) -> str:
    """Create and save a project whose only action returns the settings. Return the action's id."""
    await stage.place(alice, chooser="Chooser")
    await alice.ask("SaveScene")
    scene = stage.services.session.require_scene()
    await alice.ask("NewProject", scene_id=scene.id, name="project")
    await alice.ask("AddActionPoint", name="ap", position={"x": 0, "y": 0, "z": 0})
    point = stage.services.session.require_project().action_points[0].id
    flows = [{"type": "default", "outputs": ["said"]}]
    kind = f"{stage.ids['chooser']}/greet"
    await alice.ask("AddAction", action_point_id=point, name="hi", type=kind, parameters=[], flows=flows)
    (action,) = stage.services.session.require_project().action_points[0].actions
    await alice.ask("AddLogicItem", start="START", end=action.id)
    await alice.ask("AddLogicItem", start=action.id, end="END")
    alice.take()
    return action.id


async def test_overrides_apply_online_and_in_the_package(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Chooser") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        override = {"name": "greeting", "type": "string", "value": '"ahoy"'}
        level = {"name": "level", "type": "integer", "value": "7"}
        assert "No scene is open" in await refused(alice, "AddOverride", id="x", override=override)
        action = await project_that_greets(stage, alice)
        chooser = stage.ids["chooser"]
        assert "lock" in await refused(alice, "AddOverride", id=chooser, override=override)
        await alice.lock(chooser)
        assert "no setting" in await refused(alice, "AddOverride", id=chooser, override=override | {"name": "size"})
        wrong_type = {"name": "greeting", "type": "integer", "value": "1"}
        await refused(alice, "AddOverride", id=chooser, override=wrong_type)
        await refused(alice, "AddOverride", id="obj_none", override=override)
        for name in ("UpdateOverride", "DeleteOverride"):
            assert "not overridden" in await refused(alice, name, id=chooser, override=override)

        async def change_override(request: str, change: str, given: dict[str, str]) -> None:
            bob.take()
            await alice.ask(request, dry_run=True, id=chooser, override=given)
            assert bob.events() == []
            await alice.ask(request, id=chooser, override=given)
            (event,) = bob.events()
            assert event == {
                "event": "OverrideUpdated", "change_type": change, "parent_id": chooser, "data": given,
            }  # fmt: skip

        await change_override("AddOverride", "add", override)
        await change_override("AddOverride", "add", level)
        assert "already" in await refused(alice, "AddOverride", id=chooser, override=override)
        # Changing one override leaves the others alone. The original gave every override the new value.
        await change_override("UpdateOverride", "update", override | {"value": '"moin"'})
        await alice.ask("WriteUnlock", object_id=chooser)
        overridden = stage.services.session.require_project().object_overrides
        assert [(p.name, p.value) for p in overridden[0].parameters] == [("greeting", '"moin"'), ("level", "7")]

        await stage.start(alice)
        await alice.ask("ExecuteAction", action_id=action)
        assert (await until_event(alice, "ActionResult"))["results"] == ['"moin 7"']
        await stage.stop(alice)

        await alice.ask("SaveProject")
        alice.take()
        await alice.ask("TemporaryPackage", start_paused=False)
        assert (await until_event(alice, "ActionStateAfter"))["results"] == ['"moin 7"'], "the package overrides it too"
        await alice.ask("StopPackage")
        await until_event(alice, "OpenProject")

        await alice.lock(chooser)
        await change_override("DeleteOverride", "remove", override | {"value": '"moin"'})
        await alice.ask("WriteUnlock", object_id=chooser)
        await stage.start(alice)
        await alice.ask("ExecuteAction", action_id=action)
        assert (await until_event(alice, "ActionResult"))["results"] == ['"hello 7"']

"""An uploaded object type takes the place of an installed one of the same name until it is deleted."""

from pathlib import Path
from typing import Any

from arcor2_hw.data.object_type import ObjectTypeSource
from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused, until_event

LOGIC = """
from arcor2.data.common import ActionMetadata
from arcor2_object_types.abstract import Generic


class LogicActions(Generic):
    _ABSTRACT = False
    display_name = "Inverted logic"

    def logical_not(self, value: bool, *, an: None | str = None) -> bool:
        return value

    logical_not.__action__ = ActionMetadata()
"""


async def upload(stage: Stage, name: str, source: str) -> None:
    """Upload an object type as the REST service does."""
    await stage.services.storage.put_object_type(ObjectTypeSource(name, source))
    await stage.services.type_notifications.uploaded()


async def project(stage: Stage, alice: Actor) -> str:
    """Save a project that inverts a value in an endless loop, and has one action outside of it; return its id."""
    await stage.place(alice, logic="LogicActions")
    await alice.ask("SaveScene")
    await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="inverting")
    await alice.ask("AddActionPoint", name="ap", position={"x": 0, "y": 0, "z": 0})
    point = stage.services.session.require_project().action_points[0].id

    async def add(name: str, method: str, *parameters: str) -> str:
        given = [{"name": each, "type": "boolean", "value": "true"} for each in parameters]
        await alice.ask(
            "AddAction",
            action_point_id=point,
            name=name,
            type=f"{stage.ids['logic']}/{method}",
            parameters=given,
            flows=[{"type": "default", "outputs": []}],
        )
        return stage.services.session.require_project().action_points[0].actions[-1].id

    action = await add("invert", "logical_not", "value")
    await add("unused", "logical_and", "first", "second")
    await alice.ask("AddLogicItem", start="START", end=action)
    await alice.ask("AddLogicItem", start=action, end="END")
    await alice.ask("SaveProject")
    saved = stage.services.session.require_project().id
    await alice.ask("CloseProject")
    return saved


async def problems(alice: Actor, project_id: str) -> list[str]:
    (listed,) = (each for each in await alice.ask("ListProjects") if each["id"] == project_id)
    found: list[str] = listed.get("problems", [])
    return found


async def run(alice: Actor, package: str) -> list[str]:
    """Run a package and return the results of its first action."""
    alice.take()
    await alice.ask("RunPackage", id=package)
    results: list[str] = (await until_event(alice, "ActionStateAfter"))["results"]
    return results


async def stop(alice: Actor) -> None:
    await alice.ask("StopPackage")
    await until_event(alice, "PackageState", state="stopped")


async def test_documents_use_the_type_that_shadows_an_installed_one(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        project_id = await project(stage, alice)
        build: dict[str, Any] = {"project_id": project_id, "package_name": "p"}
        released = (await alice.ask("BuildProject", **build))["package_id"]

        await upload(stage, "LogicActions", LOGIC)
        alice.take()
        found = await problems(alice, project_id)
        # Clients are notified before the answer that depends on it.
        (event, *_) = alice.events()
        assert (event["event"], event["change_type"]) == ("ChangedObjectTypes", "update")
        (meta,) = event["data"]
        assert (meta["type"], meta["built_in"]) == ("LogicActions", False)
        assert meta["shadows"].startswith("arcor2-hw ")
        assert found == ["unused: The object type Inverted logic has no action 'logical_and'."]
        assert "logical_and" in await refused(alice, "OpenProject", id=project_id)

        # A released package runs the code that it was built with. A new package runs the uploaded code.
        assert await run(alice, released) == ["false"]
        await stop(alice)
        rebuilt = (await alice.ask("BuildProject", **build))["package_id"]
        assert await run(alice, rebuilt) == ["true"]

        # Deleting the upload restores the installed type. The running program is not affected.
        (refusal,) = await deleted(alice, "LogicActions")
        assert refusal["error"].startswith("The object type Inverted logic is used in the scenes")
        await stage.services.storage.delete_object_type("LogicActions")
        await stage.services.type_notifications.uploaded()
        assert await problems(alice, project_id) == []
        events = [event for event in alice.events() if event["event"] == "ChangedObjectTypes"]
        assert [(event["change_type"], event["data"][0]["built_in"]) for event in events] == [("update", True)]
        assert (await until_event(alice, "ActionStateAfter"))["results"] == ["true"]
        await stop(alice)
        await alice.ask("OpenProject", id=project_id)


async def test_deleting_the_shadow_restores_the_installed_type(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        installed = {meta["type"]: meta for meta in await alice.ask("GetObjectTypes")}
        assert "cannot be deleted" in (await deleted(alice, "LogicActions"))[0]["error"]
        await upload(stage, "LogicActions", LOGIC)
        await alice.ask("ListScenes")
        alice.take()
        assert await deleted(alice, "LogicActions") == []
        removed, added, answer = alice.take()
        assert (removed["change_type"], added["change_type"], answer["result"]) == ("remove", "add", True)
        assert [meta["type"] for meta in removed["data"]] == ["LogicActions"]
        assert added["data"] == [installed["LogicActions"]]


async def deleted(alice: Actor, *names: str) -> list[dict[str, str]]:
    """Try to delete object types; return the refused ones with the reasons."""
    answer = await alice.send({"id": 1, "request": "DeleteObjectTypes", "args": list(names)})
    found: list[dict[str, str]] = answer.get("data", [])
    return found

"""Every edit of a project as a request, and a client that follows their events."""

from typing import Any

import pytest

from arcor2_hw.data.events import SceneStateEnum
from tests.server.document_copy import DocumentCopy
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.work import ORIGIN, URL, Work

TURNED = {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}


def server_content(server: SessionServer) -> dict[str, Any]:
    return DocumentCopy.of(server.session.scene, server.session.project).content()


class Watcher:
    """A client that receives only the ordinary events and must have the same state as the server."""

    def __init__(self, server: SessionServer, person: Person) -> None:
        self.server, self.person = server, person
        self.copy = DocumentCopy.of(server.session.scene, server.session.project)
        person.take()

    def apply_events(self) -> list[str]:
        names = []
        for event in self.person.events():
            names.append("/".join(filter(None, (event["event"], event.get("change_type")))))
            self.copy.apply(event)
        assert self.copy.content() == server_content(self.server)
        return names


async def rich_project(work: Work) -> dict[str, str]:
    """Create two objects with points, orientations, joints, actions, logic, a parameter and an override."""
    ask, server = work.person.ask, work.person.server
    await work.project()
    ids = {"robot": work.object("robot"), "base": await work.add_point("base", work.object("scale"))}
    ids["below"] = await work.add_point("below", ids["base"])
    ids["free"] = await work.add_point("free")
    ids["ori"] = await work.add_orientation(ids["below"])
    server.cell.state = SceneStateEnum.STARTED
    await work.person.lock(ids["below"])
    await ask(
        "AddActionPointJointsUsingRobot",
        action_point_id=ids["below"],
        robot_id=ids["robot"],
        name="j",
        end_effector_id="default",
    )
    await ask("WriteUnlock", object_id=ids["below"])
    server.cell.state = SceneStateEnum.STOPPED
    ids["joints"] = str(server.session.document.named("joints", "j", ids["below"]))
    ids["one"] = await work.add_action(ids["free"], "one")
    ids["dice"] = await work.add_action(
        ids["free"], "dice", "rnd/random_bool", {"name": "probability", "type": "double", "value": "0.5"},
        flows=[{"type": "default", "outputs": ["face"]}],
    )  # fmt: skip
    await ask("AddLogicItem", start="START", end=ids["dice"])
    condition = {"what": f"{ids['dice']}/default/0", "value": "true"}
    await ask("AddLogicItem", start=ids["dice"], end=ids["one"], condition=condition)
    ids["step"] = server.session.document.outgoing(ids["dice"])[0].id
    await ask("AddProjectParameter", name="speed", type="integer", value="1")
    ids["speed"] = str(server.session.document.named("parameter", "speed"))
    await work.person.lock(ids["robot"])
    await ask("AddOverride", id=ids["robot"], override=URL)
    await ask("WriteUnlock", object_id=ids["robot"])
    work.person.take()
    return ids


Edit = tuple[str, dict[str, Any], str, bool]
"""A request, its arguments ("@x" is replaced with an id), the id to lock for it, and whether to lock its tree."""

EDITS: dict[str, Edit] = {
    "AddActionPoint": ("AddActionPoint", {"name": "new", "position": ORIGIN, "parent": "@below"}, "", False),
    "RenameActionPoint": ("RenameActionPoint", {"action_point_id": "@base", "new_name": "other"}, "@base", False),
    "UpdateActionPointPosition": (
        "UpdateActionPointPosition",
        {"action_point_id": "@base", "new_position": {"x": 1.0, "y": 2.0, "z": 3.0}},
        "@base",
        True,
    ),
    "UpdateActionPointParent": (
        "UpdateActionPointParent",
        {"action_point_id": "@base", "new_parent_id": "@free"},
        "@base",
        False,
    ),
    "CopyActionPoint": ("CopyActionPoint", {"id": "@base"}, "", False),
    "RemoveActionPoint": ("RemoveActionPoint", {"id": "@below"}, "", False),
    "AddActionPointOrientation": (
        "AddActionPointOrientation",
        {"action_point_id": "@free", "orientation": TURNED, "name": "o"},
        "@free",
        False,
    ),
    "UpdateActionPointOrientation": (
        "UpdateActionPointOrientation",
        {"orientation_id": "@ori", "orientation": TURNED},
        "@ori",
        False,
    ),
    "RenameActionPointOrientation": (
        "RenameActionPointOrientation",
        {"orientation_id": "@ori", "new_name": "other"},
        "@ori",
        False,
    ),
    "RemoveActionPointOrientation": ("RemoveActionPointOrientation", {"orientation_id": "@ori"}, "", False),
    "UpdateActionPointJoints": (
        "UpdateActionPointJoints",
        {"joints_id": "@joints", "joints": [{"name": "j1", "value": 1.0}, {"name": "j2", "value": 2.0}]},
        "@below",
        False,
    ),
    "RenameActionPointJoints": (
        "RenameActionPointJoints",
        {"joints_id": "@joints", "new_name": "other"},
        "@below",
        False,
    ),
    "RemoveActionPointJoints": ("RemoveActionPointJoints", {"joints_id": "@joints"}, "@below", False),
    "UpdateAction": (
        "UpdateAction",
        {"action_id": "@one", "parameters": [{"name": "seconds", "type": "double", "value": "2.5"}]},
        "@one",
        False,
    ),
    "RenameAction": ("RenameAction", {"action_id": "@one", "new_name": "other"}, "@one", False),
    "AddLogicItem": ("AddLogicItem", {"start": "@one", "end": "END"}, "", False),
    "RemoveLogicItem": ("RemoveLogicItem", {"logic_item_id": "@step"}, "", False),
    "UpdateLogicItem": ("UpdateLogicItem", {"logic_item_id": "@step", "start": "@dice", "end": "END"}, "", False),
    "UpdateProjectHasLogic": ("UpdateProjectHasLogic", {"project_id": "@project", "new_has_logic": False}, "", False),
    "UpdateProjectDescription": (
        "UpdateProjectDescription",
        {"project_id": "@project", "new_description": "other"},
        "",
        False,
    ),
    "RenameProject": ("RenameProject", {"project_id": "@project", "new_name": "other"}, "@project", False),
    "AddProjectParameter": ("AddProjectParameter", {"name": "x", "type": "double", "value": "0.5"}, "", False),
    "UpdateProjectParameter": ("UpdateProjectParameter", {"id": "@speed", "name": "v", "value": "7"}, "@speed", False),
    "RemoveProjectParameter": ("RemoveProjectParameter", {"id": "@speed"}, "", False),
    "UpdateOverride": ("UpdateOverride", {"id": "@robot", "override": URL | {"value": '"x"'}}, "@robot", False),
    "DeleteOverride": ("DeleteOverride", {"id": "@robot", "override": URL}, "@robot", False),
}


def filled(value: Any, ids: dict[str, str]) -> Any:
    if isinstance(value, str) and value.startswith("@"):
        return ids[value[1:]]
    if isinstance(value, dict):
        return {key: filled(inner, ids) for key, inner in value.items()}
    return value


async def apply_edit(person: Person, edit: Edit, ids: dict[str, str]) -> None:
    request, args, lock, tree = edit
    if lock:
        await person.lock(filled(lock, ids), tree=tree)
    await person.ask(request, **filled(args, ids))
    if lock and person.server.services.locks.write_locked_by("alice"):
        await person.ask("WriteUnlock", object_id=filled(lock, ids))


async def refused(person: Person, request: str = "Undo", **args: Any) -> str:
    session = person.server.session
    before, revision = session.project, session.revision
    person.take()
    with pytest.raises(Refused) as error:
        await person.ask(request, **args)
    assert person.events() == []
    assert (session.project, session.revision) == (before, revision)
    return str(error.value)

"""Lists of saved documents: only changed documents are checked for problems again."""

from collections.abc import Sequence
from typing import Any

import pytest

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene, SceneObject
from tests.server.session.session_server import Person, SessionServer
from tests.server.session.work import Work


class Reads:
    """Counts which documents are read from the storage."""

    def __init__(self, server: SessionServer, monkeypatch: pytest.MonkeyPatch) -> None:
        self.read: list[str] = []
        for name in ("scenes_with_ids", "projects_with_ids"):
            monkeypatch.setattr(server.services.storage, name, self._counting(getattr(server.services.storage, name)))

    def _counting(self, read: Any) -> Any:
        async def counted(keys: Sequence[str]) -> Any:
            self.read += [key.partition("_")[0] for key in keys]
            return await read(keys)

        return counted

    def taken(self) -> list[str]:
        taken, self.read = self.read, []
        return taken


async def test_only_changed_documents_are_checked_again(
    server: SessionServer, alice: Person, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = Work(alice)
    project = await work.project("p")
    scene = server.session.require_scene().id
    await work.add_action(work.point("p"), "act")
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    for number in range(3):
        await alice.ask("CopyProject", source_id=project, target_name=f"copy {number}")
    reads = Reads(server, monkeypatch)
    listed = await alice.ask("ListProjects")
    assert [entry.get("problems") for entry in listed] == [None] * 4
    assert reads.taken().count("pro") == 4
    assert await alice.ask("ListProjects") == listed
    assert reads.taken() == []
    await alice.ask("UpdateProjectDescription", project_id=project, new_description="other")
    reads.taken()
    assert [entry["description"] for entry in await alice.ask("ListProjects")] == ["", "", "", "other"]
    assert reads.taken() == ["pro", "scn"]
    # A changed scene concerns all its projects.
    await alice.ask("OpenScene", id=scene)
    await alice.ask("RemoveFromScene", id=work.object("time"), force=True)
    await server.services.storage.put_scene(server.session.require_scene())
    reads.taken()
    assert all(entry["problems"] for entry in await alice.ask("ListProjects"))
    assert reads.taken().count("pro") == 4
    await alice.ask("CloseScene", force=True)
    # So does a removed type.
    del server.types._metas["WeighingMachine"]
    server.types.revision += 1
    assert "WeighingMachine" in (await alice.ask("ListScenes"))[0]["problems"][0]
    assert all("WeighingMachine" in str(entry["problems"]) for entry in await alice.ask("ListProjects"))
    await alice.ask("DeleteProject", id=project)
    assert len(await alice.ask("ListProjects")) == 3
    assert len(server.services.saved_problems._stored.projects) == 3  # nothing is stored for the deleted one


async def test_problems_can_be_translated_by_clients_that_ask_for_codes(server: SessionServer, alice: Person) -> None:
    lamp = SceneObject("lamp", "NoSuchType", id="obj_lamp")
    scale = SceneObject("scale", "WeighingMachine", Pose(), [Parameter("bogus", "string", '""')], "obj_scale")
    await server.services.storage.put_scene(Scene("bad", id="scn_bad", objects=[lamp, scale]))
    await server.services.storage.put_project(Project("job", "scn_bad", id="pro_bad"))
    for request in ("ListScenes", "ListProjects"):
        (plain,) = await alice.ask(request)
        (translatable,) = await alice.ask(request, codes=True)
        assert "problem_messages" not in plain
        messages = translatable.pop("problem_messages")
        assert translatable == plain
        assert [each["text"] for each in messages] == plain["problems"]
        assert messages[:2] == [
            {
                "text": "lamp: the object type NoSuchType does not exist.",
                "key": "{name}: the object type {type} does not exist.",
                "values": {"name": "lamp", "type": "NoSuchType"},
            },
            {
                "text": "scale: WeighingMachine has no setting bogus.",
                "key": "{name}: {type} has no setting {setting}.",
                "values": {"name": "scale", "type": "WeighingMachine", "setting": "bogus"},
            },
        ]
        # Both answers are cached, one for each kind of client.
        assert await alice.ask(request) == [plain]
        assert (await alice.ask(request, codes=True))[0]["problem_messages"] == messages


async def test_a_refusal_with_several_problems_can_be_translated(server: SessionServer, alice: Person) -> None:
    objects = [SceneObject(name, "NoSuchType", id=f"obj_{name}") for name in ("lamp", "scale")]
    await server.services.storage.put_scene(Scene("bad", id="scn_bad", objects=objects))
    request = {"id": 1, "request": "OpenScene", "args": {"id": "scn_bad"}, "codes": True}
    answer = await alice.send(request)
    assert answer["key"] == "{name} cannot be opened. {problems}"
    problems = answer["values"]["problems"]
    assert [each["values"]["name"] for each in problems["values"].values()] == ["lamp", "scale"]
    assert answer["messages"] == [f"bad cannot be opened. {problems['text']}"]

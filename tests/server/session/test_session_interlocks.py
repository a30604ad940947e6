"""Interlocks are part of the scene: they are checked, stored, undone, and protect the objects that they use."""

from typing import Any

import pytest
from msgspec.structs import replace

from arcor2_hw.data.object_type import ObservationMeta
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.work import POSE, Work

pytestmark = pytest.mark.asyncio

BOX = {"type": "Box", "box": {"id": "inside", "size_x": 0.1, "size_y": 0.1, "size_z": 0.1}}


@pytest.fixture
async def work(server: SessionServer, alice: Person) -> Work:
    types = server.types
    observations = [
        ObservationMeta("open", "boolean"),
        ObservationMeta("weight", "double", unit="kg"),
        ObservationMeta("input", "boolean", of_point=True),
        ObservationMeta("mode", "string_enum", members=['"auto"', '"manual"']),
    ]
    types._metas["WeighingMachine"] = replace(types.meta("WeighingMachine"), observations=observations)
    found = Work(alice)
    await found.scene()
    await alice.ask("AddVirtualCollisionObjectToScene", name="inside", pose=POSE, model=BOX)
    await alice.ask("SubscribeEvents", events=["InterlockChanged"])
    alice.take()
    return found


def zone(work: Work, **fields: Any) -> dict[str, Any]:
    need = {"object_id": work.object("scale"), "observation": "open"}
    return {"name": "Door", "on": "zone", "object_id": work.object("inside"), "needs": [need]} | fields


async def test_interlocks_are_edits_of_the_scene(work: Work, alice: Person) -> None:
    answer = await alice.ask("PutInterlock", interlock=zone(work))
    key = answer["id"]
    assert alice.names() == ["InterlockChanged/add"]
    assert work.session.scene_changed
    await alice.ask("PutInterlock", interlock=zone(work, id=key, during=True, **{"else": "hold"}))
    [found] = (await alice.ask("ListInterlocks"))["interlocks"]
    assert (found["id"], found["during"], found["else"]) == (key, True, "hold")
    await alice.ask("Undo")
    assert not work.session.document.interlock(key).during
    await alice.ask("SaveScene")
    await alice.ask("DeleteInterlock", id=key)
    assert alice.names()[-1] == "InterlockChanged/remove"
    await alice.ask("Undo")
    await alice.ask("SaveScene")
    stored = await work.services.storage.scene(work.session.require_scene().id)
    assert [one.name for one in stored.interlocks or ()] == ["Door"]


async def test_a_retract_path_ends_outside_of_the_zone(work: Work, alice: Person) -> None:
    start, end = {"x": 0.0, "y": 0.0, "z": 0.0}, {"x": 0.0, "y": 0.06, "z": 0.0}
    with pytest.raises(Refused, match="Door: the retract path must end outside of inside"):
        await alice.ask("PutInterlock", interlock=zone(work, retract=[end, start]))
    key = (await alice.ask("PutInterlock", interlock=zone(work, retract=[start, end])))["id"]
    assert work.session.document.interlock(key).retract[1].y == 0.06
    action = zone(work, id=key, on="action", object_id=work.object("scale"), retract=[end])
    with pytest.raises(Refused, match="only an interlock of a zone"):
        await alice.ask("PutInterlock", interlock=action)


async def test_an_object_of_an_interlock_cannot_be_removed(work: Work, alice: Person) -> None:
    await alice.ask("PutInterlock", interlock=zone(work))
    for name in ("scale", "inside"):
        with pytest.raises(Refused, match=f"{name} is used by the interlock Door. Delete it first."):
            await alice.ask("RemoveFromScene", id=work.object(name), force=True)
    await alice.ask("RemoveFromScene", id=work.object("time"))


@pytest.mark.parametrize(
    ("fields", "need", "reason"),
    [
        ({"name": " "}, {}, "needs a name"),
        ({"object_id": "obj_x"}, {}, "does not exist"),
        ({"object_id": "rnd"}, {}, "rnd cannot be a zone. Use a box, a cylinder or a sphere."),
        ({"on": "action", "object_id": "rnd", "needs": []}, {}, "add at least one condition"),
        ({"on": "action", "object_id": "rnd", "actions": ["fly"]}, {}, "has no action 'fly'"),
        ({}, {"observation": "closed"}, "has no observation closed"),
        ({}, {"observation": "weight", "value": "true"}, "weight"),
        ({}, {"observation": "weight", "value": "1.0"}, "use a range"),
        ({}, {"observation": "input"}, "needs the name of a point"),
        ({}, {"point": "DI1"}, "has no points"),
        ({}, {"observation": "mode", "value": '"fast"'}, "is not a value of mode"),
        ({"within": 4000.0}, {}, "within"),
    ],
)
async def test_invalid_interlocks_are_refused(
    work: Work, alice: Person, fields: dict[str, Any], need: dict[str, Any], reason: str
) -> None:
    sent = zone(work, **fields)
    sent["needs"] = [each | need for each in sent["needs"]]
    if sent["object_id"] == "rnd":
        sent["object_id"] = work.object("rnd")
    with pytest.raises(Refused, match=reason):
        await alice.ask("PutInterlock", interlock=sent)
    assert not work.session.document.interlocks()


async def test_names_are_unique_and_ranges_are_accepted(work: Work, alice: Person) -> None:
    ranged = {"object_id": work.object("scale"), "observation": "weight", "operator": "[)", "value": "0", "upper": "2"}
    await alice.ask("PutInterlock", interlock=zone(work, needs=[ranged]))
    with pytest.raises(Refused, match="There is already an interlock called Door"):
        await alice.ask("PutInterlock", interlock=zone(work))

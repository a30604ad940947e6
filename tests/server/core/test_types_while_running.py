"""Object types that are added, changed and removed at run time: events, and the types a scene uses."""

from typing import Any

import httpx

from tests.server.core.serving import RawConnection, ServerProcess, talking

SHELF = '''
from typing import Optional

from arcor2 import DynamicParamTuple
from arcor2.data.common import ActionMetadata
from arcor2_object_types.abstract import CollisionObject

from .labels import Labels


class Shelf(Labels, CollisionObject):
    """Holds things."""

    _ABSTRACT = False

    def boards(self) -> set[str]:
        return {f"{self.label}{number}" for number in range(2)}

    def take(self, board: str, height: float, *, an: Optional[str] = None) -> None:
        """Takes.

        :param height: how high above it [m]
        """

    take.__action__ = ActionMetadata()
    DYNAMIC_PARAMS = {"board": DynamicParamTuple("boards", set())}
'''
LABELS = "class Labels:\n    label = 'low'\n"
MESH = {"id": "Shelf", "assetId": "shelf.stl"}


async def following(client: RawConnection) -> dict[str, Any]:
    """Return the next event."""
    return client.events.pop(0) if client.events else await client.receive(30)


async def type_change(client: RawConnection, *kinds: str) -> dict[str, Any]:
    """Return the next change of an object type of one of these kinds. Drop other events."""
    while True:
        event = await following(client)
        if event.get("event") == "ChangedObjectTypes":
            assert event["change_type"] in kinds, event
            (meta,) = event["data"]
            found: dict[str, Any] = meta
            return found


async def scene_is(client: RawConnection, state: str) -> None:
    while True:
        event = await following(client)
        if event.get("event") == "SceneState" and event["data"]["state"] in (state, "stopped"):
            assert event["data"]["state"] == state, event
            return


async def test_a_type_is_added_changed_and_removed(server: ServerProcess) -> None:
    base = server.url.replace("ws://", "http://")
    async with talking(server.url, "ann") as ann, httpx.AsyncClient(timeout=60, base_url=base, trust_env=False) as http:

        async def put(route: str, body: dict[str, Any]) -> None:
            answer = await http.put(route, json=body)
            assert answer.status_code == 200, answer.text

        async def put_type(name: str, source: str, **more: Any) -> None:
            await put("/object-types", {"id": name, "name": name, "source": source} | more)

        async def boards() -> set[str]:
            return set(await ann.granted("ActionParamValues", {"id": shelf, "param_id": "board", "parent_params": []}))

        await put("/models/mesh", MESH)
        await put_type("Shelf", SHELF, model={"id": "Shelf", "type": "Mesh"})
        meta = await type_change(ann, "add")
        assert meta["disabled"]
        assert "labels" in meta["problem"]
        await put_type("Labels", LABELS)
        meta = await type_change(ann, "update")
        assert meta["disabled"]
        assert "shelf.stl" in meta["problem"]
        answer = await http.post("/assets?id=shelf.stl", files={"assetData": ("shelf.stl", b"solid")})
        assert answer.status_code == 200, answer.text
        meta = await type_change(ann, "update")
        assert (meta["disabled"], "problem" in meta, meta["category"]) == (False, False, "Collision objects")
        actions = {action["name"]: action for action in await ann.granted("GetActions", {"type": "Shelf"})}
        board, height = actions["take"]["parameters"]
        assert board["dynamic_value"] is True
        assert height["extra"] == '{"unit":"m"}'

        await ann.granted("NewScene", {"name": "Store"})
        pose = {"position": {"x": 1, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
        await ann.granted("AddObjectToScene", {"name": "shelf", "type": "Shelf", "pose": pose})
        while (event := await following(ann)).get("event") != "SceneObjectChanged":
            pass
        shelf = event["data"]["id"]
        await ann.granted("StartScene")
        await scene_is(ann, "started")
        assert await boards() == {"low0", "low1"}
        # The running object uses the type as read at the start; the next start uses the current one.
        await put_type("Labels", LABELS.replace("low", "top"))
        assert await boards() == {"low0", "low1"}
        await ann.granted("StopScene")
        await scene_is(ann, "stopped")
        await ann.granted("StartScene")
        await scene_is(ann, "started")
        assert await boards() == {"top0", "top1"}
        await ann.granted("StopScene")
        await scene_is(ann, "stopped")

        await http.delete("/assets/shelf.stl")
        assert "shelf.stl" in (await type_change(ann, "update"))["problem"]
        await ann.granted("CloseScene", {"force": True})
        await http.delete("/object-types/Shelf")
        assert (await type_change(ann, "remove"))["type"] == "Shelf"
        await ann.refused("GetActions", {"type": "Shelf"})
        await http.delete("/object-types/Labels")


COUNTER = '''
from typing import Optional

from arcor2.data.common import ActionMetadata, StrEnum
from arcor2.exceptions import Arcor2Exception
from arcor2_object_types.abstract import Generic


class Way(StrEnum):
    UP: str = "up"
    DOWN: str = "down"


class Counter(Generic):
    """Counts."""

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str) -> None:
        super().__init__(obj_id, name)
        self.value = 0

    def count(self, way: Way, by: int = 1, *, an: Optional[str] = None) -> int:
        self.value += by if way == Way.UP else -by
        if self.value > 4:
            raise Arcor2Exception("It is full.")
        return self.value

    count.__action__ = ActionMetadata()
'''


async def test_a_program_with_an_older_type_is_built_and_run(server: ServerProcess) -> None:
    async with (
        talking(server.url, "ann") as ann,
        httpx.AsyncClient(timeout=60, base_url=server.url.replace("ws://", "http://"), trust_env=False) as http,
    ):

        async def event(name: str) -> Any:
            while (found := await following(ann))["event"] != name:
                pass
            return found["data"]

        await http.put("/object-types", json={"id": "Counter", "name": "Counter", "source": COUNTER})
        await type_change(ann, "add")
        await ann.granted("NewScene", {"name": "Counting"})
        scene = (await event("OpenScene"))["scene"]["id"]
        await ann.granted("AddObjectToScene", {"name": "counter", "type": "Counter"})
        counter = (await event("SceneObjectChanged"))["id"]
        await ann.granted("SaveScene")
        await ann.granted("CloseScene", {"force": False})
        await ann.granted("NewProject", {"scene_id": scene, "name": "Count", "has_logic": True})
        project = (await event("OpenProject"))["project"]["id"]
        await ann.granted("AddActionPoint", {"name": "ap", "position": {"x": 0, "y": 0, "z": 0}})
        point = (await event("ActionPointChanged"))["id"]
        parameters = [
            {"name": "way", "type": "string_enum", "value": '"up"'},
            {"name": "by", "type": "integer", "value": "2"},
        ]
        action = {"action_point_id": point, "name": "count", "type": f"{counter}/count", "parameters": parameters}
        await ann.granted("AddAction", action | {"flows": [{"type": "default", "outputs": []}]})
        count = (await event("ActionChanged"))["id"]
        await ann.granted("AddLogicItem", {"start": "START", "end": count})
        await ann.granted("AddLogicItem", {"start": count, "end": "END"})
        await ann.granted("SaveProject")
        await ann.granted("CloseProject", {"force": False})
        package = (await ann.granted("BuildProject", {"project_id": project, "package_name": "counting"}))["package_id"]
        await ann.granted("RunPackage", {"id": package})
        results = [(await event("ActionStateAfter"))["results"] for _ in range(2)]
        assert results == [["2"], ["4"]]
        exception = await event("ProjectException")
        assert (exception["type"], exception["handled"]) == ("Arcor2Error", True)
        assert exception["message"].endswith("It is full.")

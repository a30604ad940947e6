"""Websocket clients are notified of REST changes: types before scenes that use them, lists as saved."""

import httpx

from tests.server.core.serving import ServerProcess, talking
from tests.server.rest.rest_client import granted
from tests.server.rest.test_rest_build_and_run import base
from tests.server.rest.test_rest_storage import lamp, scene


async def test_clients_are_notified_of_types_before_the_scene_opens(server: ServerProcess) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=base(server)) as http, talking(server.url, "ann") as ann:
        for name in ("LampA", "LampB"):
            granted(await http.put("/object-types", json=lamp(name)))
        await ann.granted("NewScene", {"name": "scene"})
        received: list[str] = []
        # On a busy computer the uploads may be published in two events.
        while "OpenScene" not in [event["event"] for event in ann.events]:
            ann.events.append(await ann.receive())
        while ann.events[0]["event"] == "ChangedObjectTypes":
            event = ann.events.pop(0)
            assert event["change_type"] == "add"
            received += [meta["type"] for meta in event["data"]]
        assert sorted(received) == ["LampA", "LampB"]
        await ann.event("OpenScene")
        await ann.event("SceneState")
        await ann.nothing_more()
        await ann.granted("AddObjectToScene", {"name": "lamp", "type": "LampA", "pose": {}, "parameters": []})
        await ann.event("SceneObjectChanged")
        await ann.granted("CloseScene", {"force": True})


async def test_lists_show_stored_documents_and_their_problems(server: ServerProcess) -> None:
    async with httpx.AsyncClient(timeout=60, base_url=base(server)) as http, talking(server.url, "bob") as bob:
        granted(await http.put("/object-types", json=lamp("LampC")))
        granted(await http.put("/scenes", json=scene("scn_c", "LampC")))
        listed = {one["id"]: one for one in await bob.granted("ListScenes")}
        assert "problems" in listed["scn_c"], "its object has no pose"
        body = scene("scn_c", "LampC")
        body["objects"][0]["pose"] = {}
        stamp = granted(await http.put("/scenes", json=body))
        listed = {one["id"]: one for one in await bob.granted("ListScenes")}
        assert "problems" not in listed["scn_c"]
        assert listed["scn_c"]["modified"] == stamp
        granted(await http.delete("/object-types/LampC"))
        listed = {one["id"]: one for one in await bob.granted("ListScenes")}
        assert "LampC" in listed["scn_c"]["problems"][0]
        assert (await bob.granted("GetScene", {"id": "scn_c"}))["modified"] == stamp
        granted(await http.delete("/scenes/scn_c"))
        assert "scn_c" not in {one["id"] for one in await bob.granted("ListScenes")}

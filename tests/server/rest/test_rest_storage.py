"""The Storage service over REST: documents round trip in camelCase, and invalid ones are refused."""

import asyncio
from typing import Any

import httpx
import msgspec
import pytest

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_server.app import Server
from arcor2_server.object_types import notifications
from arcor2_server.rest.field_names import camelized, snaked
from tests.server.build import workplace
from tests.server.core.serving import until
from tests.server.rest.rest_client import granted, refused

pytestmark = pytest.mark.asyncio(loop_scope="module")

POSE = {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


def scene(key: str, *types: str) -> dict[str, Any]:
    objects = [{"name": f"object_{n}", "type": name, "id": f"obj_{n}"} for n, name in enumerate(types)]
    return {"id": key, "name": key, "description": "text", "objects": objects}


def project(key: str, of: str) -> dict[str, Any]:
    return {"id": key, "name": key, "sceneId": of, "hasLogic": False}


def camel(document: Scene | Project) -> Any:
    return camelized(msgspec.to_builtins(document))


# ------------------------------------------------------------------------------------------------ names
async def test_names_are_converted_to_camel_case_and_back() -> None:
    value = {"size_x": [{"object_id": {"pt1": 1, "is_valid": None}}]}
    assert camelized(value) == {"sizeX": [{"objectId": {"pt1": 1, "isValid": None}}]}
    assert snaked(camelized(value)) == snaked(value) == value


# ------------------------------------------------------------------------------------------------ scenes
async def test_a_scene_is_stored_and_deleted(http: httpx.AsyncClient) -> None:
    stamp = granted(await http.put("/scenes", json=scene("scn_a", "FlowActions")))
    stored = granted(await http.get("/scenes/scn_a"))
    assert (stored["modified"], stored["created"]) == (stamp, stamp)
    assert stored["objects"] == [{"name": "object_0", "type": "FlowActions", "parameters": [], "id": "obj_0"}]
    stored["intModified"] = stamp
    later = granted(await http.put("/scenes", json=stored))
    again = granted(await http.get("/scenes/scn_a"))
    assert (again["created"], again["modified"]) == (stamp, later)
    assert later > stamp
    assert "intModified" not in again
    (listed,) = [one for one in granted(await http.get("/scenes")) if one["id"] == "scn_a"]
    assert listed == {"id": "scn_a", "name": "scn_a", "created": stamp, "modified": later, "description": "text"}
    granted(await http.delete("/scenes/scn_a"))
    refused(await http.get("/scenes/scn_a"), 404, "NotFound", "scn_a")
    refused(await http.delete("/scenes/scn_a"), 404, "NotFound")


async def test_a_scene_needs_known_types(http: httpx.AsyncClient) -> None:
    refused(await http.put("/scenes", json=scene("scn_b", "NoSuchType")), 404, "NotFound", "NoSuchType")
    refused(await http.get("/scenes/scn_b"), 404, "NotFound")


async def test_a_large_project_round_trips(http: httpx.AsyncClient) -> None:
    whole = msgspec.structs.replace(workplace.scene(), objects=[])
    granted(await http.put("/scenes", json=camel(whole)))
    granted(await http.put("/projects", json=camel(workplace.project())))
    # Clients generated from the original's OpenAPI send snake_case, which is accepted too.
    stored = granted(await http.get(f"/projects/{workplace.project().id}"))
    granted(await http.put("/projects", json=msgspec.to_builtins(workplace.project())))
    again = granted(await http.get(f"/projects/{workplace.project().id}"))
    for document in (stored, again):
        back = msgspec.convert(snaked(document), Project)
        untimed = msgspec.structs.replace(back, created=msgspec.UNSET, modified=msgspec.UNSET)
        assert untimed == msgspec.structs.replace(
            workplace.project(), created=msgspec.UNSET, modified=msgspec.UNSET, int_modified=msgspec.UNSET
        )


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"[]",
        b"null",
        b'{"name": "x"}',
        b'{"name": null, "id": "scn_x"}',
        b'{"name": "x", "id": "a/b"}',
        b'{"name": "x", "id": ".."}',
        b'{"name": "x", "id": "scn_x", "objects": {}}',
        b'{"name": "\\ud800", "id": "scn_x"}',
        b'{"name": "x", "id": "scn_x", "modified": "yesterday"}',
        b'{"name": "x", "id": "scn_x", "objects": ' + b"[" * 100_000,
        b"\xff",
    ],
)
async def test_invalid_scenes_are_refused(http: httpx.AsyncClient, body: bytes) -> None:
    refused(await http.put("/scenes", content=body), 400, "Argument")
    refused(await http.get("/scenes/scn_x"), 404, "NotFound")


async def test_the_refusal_names_a_text_that_is_too_long(http: httpx.AsyncClient) -> None:
    body = scene("long") | {"name": "x" * 201}
    refused(await http.put("/scenes", json=body), 400, "Argument", "name has 201 characters", "at most 200")


async def test_wrong_media_types_and_oversized_bodies_are_refused(http: httpx.AsyncClient) -> None:
    xml = {"Content-Type": "application/xml"}
    refused(await http.put("/scenes", content=b"<scene/>", headers=xml), 415, "Argument", "application/xml")
    refused(await http.post("/assets", json={}), 415, "Argument", "multipart")
    refused(await http.put("/scenes", content=b" " * (16 * 1024 * 1024 + 1)), 413, "Argument")


async def test_unknown_routes_are_refused(http: httpx.AsyncClient) -> None:
    refused(await http.get("/nowhere"), 404, "NotFound")
    answer = await http.post("/scenes", json={})
    refused(answer, 405, "Argument")
    assert "PUT" in answer.headers["allow"]


# ------------------------------------------------------------------------------------------------ projects
async def test_error_exits_survive_a_client_that_does_not_know_them(http: httpx.AsyncClient) -> None:
    granted(await http.put("/scenes", json=scene("scn_e", "FlowActions")))
    action = {"id": "act_1", "name": "end", "type": "obj_0/end"}
    known = {"id": "lit_1", "start": "act_1", "end": "END"}
    point = {"id": "acp_1", "name": "point", "position": POSE["position"]}
    sent = project("pro_e", "scn_e") | {"actionPoints": [point | {"actions": [action]}], "logic": [known]}
    extended = sent | {
        "actionPoints": [point | {"actions": [action | {"errorOutput": "problem"}]}],
        "logic": [known, known | {"id": "lit_2", "errorKinds": ["refused"]}],
    }
    granted(await http.put("/projects", json=extended))
    stored = granted(await http.get("/projects/pro_e"))
    assert [item.get("errorKinds") for item in stored["logic"]] == [None, ["refused"]]
    without = sent | {"logic": [known, known | {"id": "lit_2"}], "description": "theirs"}
    granted(await http.put("/projects", json=without))
    again = granted(await http.get("/projects/pro_e"))
    assert again == stored | {"description": "theirs", "modified": again["modified"]}
    granted(await http.put("/projects", json=sent))  # the client removed the item
    assert [item["id"] for item in granted(await http.get("/projects/pro_e"))["logic"]] == ["lit_1"]
    granted(await http.put("/projects?exact=true", json=sent))
    [stored_point] = granted(await http.get("/projects/pro_e"))["actionPoints"]
    assert "errorOutput" not in stored_point["actions"][0]
    granted(await http.delete("/projects/pro_e"))


async def test_interlocks_survive_a_client_that_does_not_know_them(http: httpx.AsyncClient) -> None:
    sent = scene("scn_i", "FunctionalTester", "FlowActions")
    tester, other = sent["objects"]
    need = {"objectId": tester["id"], "observation": "door_open"}
    interlock = {"id": "ilk_1", "name": "Door", "on": "action", "objectId": other["id"], "needs": [need]}
    granted(await http.put("/scenes", json=sent | {"interlocks": [interlock]}))
    granted(await http.put("/scenes", json=sent | {"description": "theirs"}))
    [stored] = granted(await http.get("/scenes/scn_i"))["interlocks"]
    assert (stored["name"], stored["needs"][0]["observation"]) == ("Door", "door_open")
    refused(await http.put("/scenes", json=sent | {"objects": [other]}), 400, "Argument")
    wrong = interlock | {"needs": [need | {"observation": "window_open"}]}
    refused(await http.put("/scenes", json=sent | {"interlocks": [wrong]}), 400, "Argument")
    granted(await http.put("/scenes?exact=true", json=sent))
    assert "interlocks" not in granted(await http.get("/scenes/scn_i"))


async def test_nodes_survive_a_client_that_does_not_know_them(http: httpx.AsyncClient) -> None:
    sent = scene("scn_n", "FlowActions")
    [flow] = sent["objects"]
    granted(await http.put("/scenes", json=sent | {"objects": [flow | {"node": "press"}]}))
    granted(await http.put("/scenes", json=sent | {"description": "theirs"}))
    assert granted(await http.get("/scenes/scn_n"))["objects"][0]["node"] == "press"
    granted(await http.put("/scenes", json=sent | {"objects": [flow | {"node": ""}]}))
    assert "node" not in granted(await http.get("/scenes/scn_n"))["objects"][0]
    refused(await http.put("/scenes", json=sent | {"objects": [flow | {"node": "*"}]}), 400, "Argument")


async def test_comparisons_survive_a_client_that_does_not_know_them(http: httpx.AsyncClient) -> None:
    granted(await http.put("/scenes", json=scene("scn_w", "FlowActions")))
    point = {"id": "acp_1", "name": "point", "position": POSE["position"]}
    action = {"id": "act_1", "name": "end", "type": "obj_0/end"}
    known = {"id": "lit_1", "start": "act_1", "end": "END"}
    when = {"match": "all", "comparisons": [{"what": "pco_1", "operator": ">=", "value": "3"}]}
    sent = project("pro_w", "scn_w") | {"actionPoints": [point | {"actions": [action]}], "logic": [known]}
    granted(await http.put("/projects", json=sent | {"logic": [known | {"when": when}]}))
    granted(await http.put("/projects", json=sent))
    assert granted(await http.get("/projects/pro_w"))["logic"] == [known | {"when": when}]
    condition = {"what": "act_1/default/0", "value": "true"}
    granted(await http.put("/projects", json=sent | {"logic": [known | {"condition": condition}]}))
    assert granted(await http.get("/projects/pro_w"))["logic"] == [known | {"condition": condition}]
    parameter = {"id": "pco_1", "name": "last", "type": "integer", "value": "0"}
    granted(await http.put("/projects", json=sent | {"parameters": [parameter | {"variable": True}]}))
    granted(await http.put("/projects", json=sent | {"parameters": [parameter]}))
    assert granted(await http.get("/projects/pro_w"))["parameters"] == [parameter | {"variable": True}]
    retried = point | {"actions": [action | {"retry": {"count": 2, "pause": 0.5}}]}
    granted(await http.put("/projects", json=sent | {"actionPoints": [retried]}))
    granted(await http.put("/projects", json=sent))
    [stored] = granted(await http.get("/projects/pro_w"))["actionPoints"]
    assert stored["actions"][0]["retry"] == {"count": 2, "pause": 0.5}
    granted(await http.delete("/projects/pro_w"))


async def test_a_project_is_stored_and_deleted_with_its_parts(http: httpx.AsyncClient) -> None:
    granted(await http.put("/scenes", json=scene("scn_p")))
    refused(await http.put("/projects", json=project("pro_a", "scn_nowhere")), 404, "NotFound", "scn_nowhere")
    stamp = granted(await http.put("/projects", json=project("pro_a", "scn_p")))
    assert granted(await http.get("/projects/pro_a"))["modified"] == stamp
    assert [one["modified"] for one in granted(await http.get("/projects")) if one["id"] == "pro_a"] == [stamp]

    for path in ("/projects/pro_a", "/projects/none"):
        refused(await http.get(f"{path}/sources"), 404, "NotFound")
    granted(await http.put("/projects/sources", json={"id": "pro_a", "script": "print('ß')\n"}))
    assert granted(await http.get("/projects/pro_a/sources")) == {"id": "pro_a", "script": "print('ß')\n"}
    refused(await http.put("/projects/sources", json={"id": "none", "script": ""}), 404, "NotFound")

    parameters = [{"name": "speed", "type": "double", "value": "0.5", "id": "pco_1", "displayName": "Speed"}]
    overrides = [{"id": "obj_1", "parameters": [{"name": "port", "type": "string", "value": '"x"'}]}]
    for path, value in (("parameters", parameters), ("object-parameters", overrides)):
        assert granted(await http.get(f"/projects/pro_a/{path}")) == []
        granted(await http.put(f"/projects/pro_a/{path}", json=value))
        assert granted(await http.get(f"/projects/pro_a/{path}")) == value
        refused(await http.get(f"/projects/none/{path}"), 404, "NotFound")
        refused(await http.put(f"/projects/none/{path}", json=value), 404, "NotFound")
        refused(await http.put(f"/projects/pro_a/{path}", json={}), 400, "Argument")
    assert granted(await http.get("/projects/pro_a"))["parameters"] == [], "they are not stored inside the document"

    query = {"project_id": "pro_a", "new_project_name": "copy", "newDescription": "mine", "newProjectId": "pro_b"}
    copy = granted(await http.put("/projects/clone", params=query))
    assert (copy["id"], copy["name"], copy["description"], copy["sceneId"]) == ("pro_b", "copy", "mine", "scn_p")
    assert granted(await http.get("/projects/pro_b/parameters")) == parameters
    assert granted(await http.get("/projects/pro_b/object-parameters")) == overrides
    assert granted(await http.get("/projects/pro_b/sources"))["script"] == "print('ß')\n"
    refused(await http.put("/projects/clone", params=query), 409, "Conflict", "pro_b")
    refused(await http.put("/projects/clone", params=query | {"project_id": "none"}), 404, "NotFound")
    refused(await http.put("/projects/clone", params={"project_id": "pro_a"}), 400, "Argument", "new_project_name")
    made = granted(await http.put("/projects/clone", params={"project_id": "pro_a", "new_project_name": "third"}))
    assert made["id"].startswith("pro_")

    granted(await http.delete("/projects/pro_a"))
    for path in ("", "/sources", "/parameters", "/object-parameters"):
        refused(await http.get(f"/projects/pro_a{path}"), 404, "NotFound")
    granted(await http.put("/projects", json=project("pro_a", "scn_p")))
    assert granted(await http.get("/projects/pro_a/parameters")) == [], "the parameters are deleted with their project"


# ------------------------------------------------------------------------------------------------ models
MODELS: list[tuple[str, dict[str, Any]]] = [
    ("box", {"sizeX": 1.0, "sizeY": 2.0, "sizeZ": 3.0}),
    ("cylinder", {"radius": 1.0, "height": 2.0}),
    ("sphere", {"radius": 1.5}),
    ("mesh", {"assetId": "chair", "focusPoints": [POSE]}),
]


@pytest.mark.parametrize(("kind", "sizes"), MODELS)
async def test_a_model_is_stored_and_deleted(http: httpx.AsyncClient, kind: str, sizes: dict[str, Any]) -> None:
    body = {"id": f"a_{kind}"} | sizes
    granted(await http.put(f"/models/{kind}", json=body))
    for name in (kind, kind.capitalize()):
        assert granted(await http.get(f"/models/a_{kind}/{name}")) == body
    assert {"id": f"a_{kind}", "type": kind.capitalize()} in granted(await http.get("/models"))
    assert (body in granted(await http.get("/models/meshes"))) == (kind == "mesh")
    other = "box" if kind != "box" else "sphere"
    refused(await http.get(f"/models/a_{kind}/{other}"), 404, "NotFound", other)
    refused(await http.get(f"/models/a_{kind}/pyramid"), 400, "Argument", "pyramid")
    # One model per id: a model of another kind replaces it.
    replacement = {"id": f"a_{kind}"} | dict(MODELS)[other]
    granted(await http.put(f"/models/{other}", json=replacement))
    refused(await http.get(f"/models/a_{kind}/{kind}"), 404, "NotFound")
    assert granted(await http.get(f"/models/a_{kind}/{other}")) == replacement
    granted(await http.delete(f"/models/a_{kind}"))
    refused(await http.delete(f"/models/a_{kind}"), 404, "NotFound")
    refused(await http.get(f"/models/a_{kind}/{other}"), 404, "NotFound")


async def test_a_model_without_a_size_is_refused(http: httpx.AsyncClient) -> None:
    refused(await http.put("/models/sphere", json={"id": "ball", "radius": 0}), 400, "Argument", "radius")
    refused(await http.put("/models/box", json={"id": "crate", "sizeX": 1.0, "sizeY": 1.0}), 400, "Argument", "sizeZ")


# ------------------------------------------------------------------------------------------------ object types
LAMP = """
from arcor2_hw.objects import CollisionObject


class {name}(CollisionObject):
    \"\"\"Gives light.\"\"\"

    _ABSTRACT = False
"""


def lamp(name: str, **more: Any) -> dict[str, Any]:
    return {"id": name, "name": name, "source": LAMP.format(name=name)} | more


async def test_an_object_type_is_stored_and_deleted(http: httpx.AsyncClient, services: Server) -> None:
    with_model = lamp("Lamp", description="text", model={"id": "Lamp", "type": "Sphere"})
    refused(await http.put("/object-types", json=with_model), 404, "NotFound", "Lamp")
    granted(await http.put("/models/sphere", json={"id": "Lamp", "radius": 0.2}))
    refused(await http.put("/object-types", json=lamp("Lamp", model={"id": "Lamp", "type": "Box"})), 400, "Argument")
    stamp = granted(await http.put("/object-types", json=with_model))
    assert granted(await http.get("/object-types/Lamp")) == with_model | {"created": stamp, "modified": stamp}
    assert services.types.meta("Lamp").description == "Gives light."
    assert services.types.meta("Lamp").object_model.sphere.radius == 0.2  # type: ignore[union-attr]
    assert "Lamp" in [one["id"] for one in granted(await http.get("/object-types"))]
    # A stored scene may use it, and it can still be deleted: the lists then name the problem.
    granted(await http.put("/scenes", json=scene("scn_lamp", "Lamp")))
    granted(await http.delete("/object-types/Lamp"))
    assert not services.types.known("Lamp")
    refused(await http.get("/object-types/Lamp"), 404, "NotFound")
    refused(await http.delete("/object-types/Lamp"), 404, "NotFound")


async def test_a_module_without_type_is_accepted(http: httpx.AsyncClient, services: Server) -> None:
    mixin = {"id": "Colours", "name": "Colours", "source": "class Colours:\n    RED = 1\n"}
    granted(await http.put("/object-types", json=mixin))
    assert granted(await http.get("/object-types/Colours"))["source"] == mixin["source"]
    assert not services.types.known("Colours")
    granted(await http.delete("/object-types/Colours"))


async def test_an_installed_type_may_be_shadowed_but_not_deleted(http: httpx.AsyncClient, services: Server) -> None:
    granted(await http.put("/object-types", json=lamp("FlowActions")))
    assert services.types.is_uploaded("FlowActions")
    granted(await http.delete("/object-types/FlowActions"))
    assert services.types.meta("FlowActions").built_in
    refused(await http.delete("/object-types/FlowActions"), 400, "Argument", "arcor2-hw", "cannot be deleted")


@pytest.mark.parametrize("name", ["Generic", "not a name", "class", "", "a" * 300 + "!"])
async def test_reserved_names_cannot_be_uploaded(http: httpx.AsyncClient, name: str) -> None:
    refused(await http.put("/object-types", json=lamp(name)), 400, "Argument")


async def test_installed_types_cannot_be_deleted_and_sources_are_limited(http: httpx.AsyncClient) -> None:
    refused(await http.delete("/object-types/FlowActions"), 400, "Argument", "Program flow")
    huge = lamp("Huge") | {"source": "#" * (1024 * 1024 + 1)}
    refused(await http.put("/object-types", json=huge), 413, "Argument", "Huge")
    refused(await http.put("/object-types", json=lamp("One") | {"name": "Other"}), 400, "Argument")


async def test_a_series_of_uploads_is_announced_once(
    http: httpx.AsyncClient, services: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    announced: list[tuple[str, list[str]]] = []

    def record(event: Any) -> None:
        announced.append((str(event.change_type), [meta.type for meta in event.data]))

    async def upload_series(*bodies: dict[str, Any]) -> None:
        """Send all requests, none of which may be announced at once, and wait until they are announced."""
        before = len(announced)
        monkeypatch.setattr(notifications, "QUIET_PERIOD", 600)
        for body in bodies:
            granted(await http.put("/object-types", json=body))
        assert len(announced) == before
        monkeypatch.setattr(notifications, "QUIET_PERIOD", 0.01)
        granted(await http.put("/object-types", json=bodies[-1]))
        await until(lambda: len(announced) > before)

    await services.type_notifications.close()
    await services.types.refresh()
    monkeypatch.setattr(services.hub, "broadcast", record)
    # A type that is uploaded twice is announced once.
    await upload_series(lamp("LampA"), lamp("LampB"), lamp("LampC"), lamp("LampB"))
    assert announced == [("add", ["LampA", "LampB", "LampC"])]

    monkeypatch.setattr(notifications, "QUIET_PERIOD", 600)
    granted(await http.delete("/object-types/LampC"))
    granted(await http.put("/object-types", json=lamp("LampD")))
    granted(await http.delete("/object-types/LampD"))
    granted(await http.put("/models/sphere", json={"id": "LampA", "radius": 1}))
    await upload_series(lamp("LampA", model={"id": "LampA", "type": "Sphere"}))
    assert announced[1:] == [("remove", ["LampC"]), ("update", ["LampA"])], "LampD was added and deleted: no change"

    # Requests that open a scene or list types announce the changes first: nothing is left for the timer.
    monkeypatch.setattr(notifications, "QUIET_PERIOD", 0.05)
    granted(await http.put("/object-types", json=lamp("LampE")))
    changes = await services.types.refresh()
    assert [meta.type for meta in changes.added] == ["LampE"]
    await asyncio.sleep(0.3)
    assert len(announced) == 3


# ------------------------------------------------------------------------------------------------ assets
async def test_an_asset_is_stored_and_deleted(http: httpx.AsyncClient) -> None:
    content = bytes(range(256)) * 20_000
    file = {"assetData": ("../ärm.stl", content, "model/stl")}
    info = granted(await http.post("/assets", params={"id": "chair", "description": "a chair"}, files=file))
    assert (info["id"], info["fileName"], info["description"]) == ("chair", "../ärm.stl", "a chair")
    assert set(info) == {"id", "fileName", "description", "created", "modified"}
    assert granted(await http.get("/assets/info")) == [info]
    assert granted(await http.get("/assets/chair/exists")) is True
    answer = await http.get("/assets/chair/data")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/octet-stream")
    assert answer.content == content
    assert answer.headers["content-length"] == str(len(content))
    assert answer.headers["content-disposition"] == "attachment; filename*=UTF-8''..%2F%C3%A4rm.stl"

    refused(await http.post("/assets", params={"id": "chair"}, files=file), 409, "Conflict", "chair")
    # The file name may be missing, and text content is not changed.
    newer = granted(await http.post("/assets?id=chair&upsert=true", files={"assetData": (None, b"solid")}))
    assert newer["created"] == info["created"]
    assert newer["modified"] > info["modified"]
    assert (await http.get("/assets/chair/data")).content == b"solid"
    made = granted(await http.post("/assets", files=file))
    assert len(granted(await http.get("/assets/info"))) == 2
    granted(await http.delete(f"/assets/{made['id']}"))
    granted(await http.delete("/assets/chair"))
    assert granted(await http.get("/assets/chair/exists")) is False
    for refusal in (await http.delete("/assets/chair"), await http.get("/assets/chair/data")):
        refused(refusal, 404, "NotFound", "chair")


async def test_invalid_assets_are_refused(http: httpx.AsyncClient) -> None:
    refused(await http.post("/assets", files={"other": ("x", b"x")}), 400, "Argument", "assetData")
    refused(await http.post("/assets", files={"assetData": (None, b"\xff\xfe")}), 400, "Argument", "name")
    refused(await http.post("/assets?id=a%2Fb", files={"assetData": ("x", b"x")}), 400, "Argument")
    refused(await http.post("/assets?upsert=perhaps", files={"assetData": ("x", b"x")}), 400, "Argument", "upsert")
    broken = {"Content-Type": "multipart/form-data; boundary=here"}
    for body in (b"", b"--here", b"--here\r\nContent-Disposition: form-data\r\n\r\nx", b"nothing of the kind"):
        refused(await http.post("/assets", content=body, headers=broken), 400, "Argument")
    refused(await http.post("/assets", content=b"", headers={"Content-Type": "multipart/form-data"}), 400, "Argument")
    assert granted(await http.get("/assets/info")) == []

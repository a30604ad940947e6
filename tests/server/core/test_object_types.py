"""The registry of object types on a storage, and its events."""

import ast
import re
import shutil
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from msgspec import UNSET

from arcor2_hw.analysis import Library, worker
from arcor2_hw.client import Client
from arcor2_hw.data.object_type import Box, Mesh, ObjectModel, ObjectTypeSource, Sphere
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.object_types.catalog import KnownTypes
from arcor2_server.object_types.changes import Changes
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import AssetStore, Storage
from tests.server.core.serving import ServerProcess, running, talking

LAMP = '''
"""A lamp."""
from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class Lamp(Generic):
    """Gives light.

    More of it.
    """

    _ABSTRACT = False

    @action
    def switch(self, brightness: float, *, an: str | None = None) -> None:
        """Switch.

        :param brightness: how bright
        """
        assert 0.0 <= brightness <= 1.0
'''
RED = """
from .lamp import Lamp
from .colours import Colours


class RedLamp(Colours, Lamp):
    _ABSTRACT = False
"""
COLOURS = """
class Colours:
    pass
"""


HUGE = (
    "from arcor2_hw.actions import action\nfrom arcor2_hw.objects import Generic\n\n\nclass Huge(Generic):\n"
    "    _ABSTRACT = False\n"
    + "".join(f"    @action\n    def act_{n}(self, *, an: str | None = None) -> None: ...\n" for n in range(1000))
)


@pytest.fixture
async def storage(tmp_path: Path) -> AsyncIterator[Storage]:
    opened = await Storage.open(ServerSettings(data_dir=tmp_path))
    yield opened
    await opened.close()


@pytest.fixture
async def assets(tmp_path: Path) -> AssetStore:
    return await AssetStore.open(tmp_path / "assets")


@pytest.fixture
async def types(storage: Storage, assets: AssetStore) -> ObjectTypes:
    registry = ObjectTypes(KnownTypes(), storage, assets)
    await registry.load()
    return registry


async def put_lamps(storage: Storage) -> None:
    for name, source in (("Lamp", LAMP), ("RedLamp", RED), ("Colours", COLOURS)):
        await storage.put_object_type(ObjectTypeSource(name, source))


async def test_built_in_and_installed_types_are_known(types: ObjectTypes) -> None:
    assert all(meta.built_in for meta in types.metas()), "nothing is uploaded yet"
    assert set(types.names()) > {
        "Camera",
        "CollisionObject",
        "Generic",
        "GenericWithPose",
        "MultiArmRobot",
        "Robot",
        "VirtualCollisionObject",
    }
    assert types.names() == sorted(types.names())
    assert types.derives_from("MultiArmRobot", "GenericWithPose")
    assert types.bases("MultiArmRobot") == ["Robot", "GenericWithPose", "Generic"]
    assert types.type_code("FlowActions").entry_point.endswith(":FlowActions")
    for look in (types.meta, types.actions, types.bases, types.type_code, types.robot_meta):
        with pytest.raises(NotFound, match="Nothing"):
            look("Nothing")
    with pytest.raises(NotFound):
        types.robot_meta("Generic")
    with pytest.raises(NotFound, match="no_such_action"):
        types.action("FlowActions", "no_such_action")


async def test_uploaded_type(types: ObjectTypes, storage: Storage) -> None:
    meta = await types.add(ObjectTypeSource("Lamp", LAMP))
    assert (meta.type, meta.base, meta.description) == ("Lamp", "Generic", "Gives light.")
    assert (meta.built_in, meta.abstract, meta.disabled) == (False, False, False)
    assert meta.modified == (await storage.object_type("Lamp")).modified
    (switch,) = types.actions("Lamp")
    assert switch.name == "switch"
    assert switch.parameters[0].extra == '{"minimum":0.0,"maximum":1.0}'
    assert types.action("Lamp", "switch") == switch
    assert types.is_uploaded("Lamp")
    assert not types.is_uploaded("FlowActions")
    removed = await types.remove("Lamp")
    assert removed == meta
    assert not types.known("Lamp")
    with pytest.raises(NotFound):
        await types.remove("Lamp")


async def test_refusals_name_types_as_users_know_them(types: ObjectTypes) -> None:
    for look_up, refusal in (
        (lambda: types.action("OakD", "fly"), "The object type Luxonis OAK-D has no action 'fly'."),
        (lambda: types.robot_meta("OakD"), "The object type Luxonis OAK-D is not a robot."),
    ):
        with pytest.raises(NotFound) as caught:
            look_up()
        assert str(caught.value) == refusal
    assert types.shown_name("Unknown") == "Unknown"


async def test_base_classes_cannot_be_replaced_or_deleted(types: ObjectTypes, storage: Storage) -> None:
    source = ObjectTypeSource("Generic", "class Generic: ...")
    with pytest.raises(InvalidData, match="Generic"):
        await types.add(source)
    with pytest.raises(InvalidData, match="Generic"):
        await types.remove("Generic")
    # A source that is written directly to the storage does not change it either.
    before = types.meta("Generic")
    await storage.put_object_type(source)
    assert not await types.refresh()
    assert types.meta("Generic") == before


async def test_an_upload_shadows_an_installed_type_until_it_is_deleted(types: ObjectTypes, storage: Storage) -> None:
    installed, code = types.meta("UR5e"), types.type_code("UR5e")
    others = {name: types.actions(name) for name in ("UR3e", "UR10e")}
    assert installed.built_in
    with pytest.raises(
        InvalidData, match=r"^The object type Universal Robots UR5e belongs to arcor2-hw .* cannot be deleted"
    ):
        await types.remove("UR5e")

    source = LAMP.replace("class Lamp", "class UR5e")
    uploaded = await types.add(ObjectTypeSource("UR5e", source))
    assert (uploaded.built_in, uploaded.base, uploaded.description) == (False, "Generic", "Gives light.")
    assert re.fullmatch(r"arcor2-hw \d.*", str(uploaded.shadows))
    assert [action.name for action in types.actions("UR5e")] == ["switch"]
    assert types.type_code("UR5e").source == source
    assert [(one.name, one.source) for one in types.sources_for(["UR5e"])] == [("UR5e", source)]
    assert [robot for robot in types.robot_metas() if robot.type == "UR5e"] == []
    assert [file.source for file in types.files() if file.name == "UR5e"][-1] == source
    # Other installed types of the same module are unchanged.
    assert {name: types.actions(name) for name in others} == others
    assert not any(types.meta(name).disabled for name in others)
    assert not await types.refresh(), "the caller of add notifies the clients"

    assert await types.remove("UR5e") == uploaded
    assert (types.meta("UR5e"), types.type_code("UR5e")) == (installed, code)
    assert not await types.refresh()

    # A source written directly to the storage is announced to clients as an update, and so is its removal.
    await storage.put_object_type(ObjectTypeSource("UR5e", source))
    changes = await types.refresh()
    assert ([meta.type for meta in changes.updated], changes.added, changes.removed) == (["UR5e"], [], [])
    await storage.delete_object_type("UR5e")
    changes = await types.refresh()
    assert (changes.updated, changes.added, changes.removed) == ([installed], [], [])


async def test_an_upload_shadows_after_a_restart(types: ObjectTypes, storage: Storage, assets: AssetStore) -> None:
    shadow = await types.add(ObjectTypeSource("FlowActions", LAMP.replace("class Lamp", "class FlowActions")))
    again = ObjectTypes(KnownTypes(), storage, assets)
    await again.load()
    assert again.meta("FlowActions") == shadow


async def test_changes_in_storage_are_noticed_once(types: ObjectTypes, storage: Storage) -> None:
    assert await types.refresh() == Changes()
    revision = types.revision
    await put_lamps(storage)
    assert not types.known("Lamp")
    changes = await types.refresh()
    # A mixin is not a type for clients.
    assert [meta.type for meta in changes.added] == ["Lamp", "RedLamp"]
    assert (changes.removed, changes.updated) == ([], [])
    assert types.revision > revision
    assert not await types.refresh()
    assert types.bases("RedLamp") == ["Lamp", "Generic"]

    # A changed base class also changes the types that derive from it.
    await storage.put_object_type(
        ObjectTypeSource("Lamp", LAMP.replace("Gives light.", "Glows.").replace("0.0", "0.1"))
    )
    changes = await types.refresh()
    assert [meta.type for meta in changes.updated] == ["Lamp"]
    assert types.action("RedLamp", "switch").parameters[0].extra == '{"minimum":0.1,"maximum":1.0}'

    await storage.delete_object_type("Lamp")
    changes = await types.refresh()
    assert [meta.type for meta in changes.removed] == ["Lamp"]
    (red,) = changes.updated
    assert red.disabled
    assert "lamp" in str(red.problem)


async def test_other_changes_wait_for_the_next_refresh(types: ObjectTypes, storage: Storage) -> None:
    await put_lamps(storage)
    await types.add(ObjectTypeSource("Other", LAMP.replace("Lamp", "Other")))
    changes = await types.refresh()
    assert [meta.type for meta in changes.added] == ["Lamp", "RedLamp"], "the caller of add announces Other"


async def test_model_belongs_to_its_type(types: ObjectTypes, storage: Storage) -> None:
    source = "from arcor2_hw.objects import CollisionObject\n\n\nclass Crate(CollisionObject):\n    _ABSTRACT = False\n"
    box = ObjectModel.of(Box("Crate", 1, 2, 3))
    meta = await types.add(ObjectTypeSource("Crate", source, model=box))
    assert meta.object_model == box
    assert meta.has_pose
    await storage.put_model(Sphere("Crate", 0.5))
    changes = await types.refresh()
    assert changes.updated[0].object_model == ObjectModel.of(Sphere("Crate", 0.5))


CRATE = "from arcor2_hw.objects import CollisionObject\n\n\nclass Crate(CollisionObject):\n    _ABSTRACT = False\n"


async def content() -> AsyncIterator[bytes]:
    yield b"mesh"


async def test_a_type_without_its_collision_model_is_disabled(types: ObjectTypes, storage: Storage) -> None:
    await types.add(ObjectTypeSource("Crate", CRATE, model=ObjectModel.of(Box("Crate", 1, 2, 3))))
    await storage.delete_model("Crate")
    (crate,) = (await types.refresh()).updated
    assert (crate.disabled, crate.problem) == (True, "its collision model Crate is missing")
    await storage.put_model(Box("Crate", 1, 2, 3))
    (crate,) = (await types.refresh()).updated
    assert (crate.disabled, crate.problem) == (False, UNSET)


async def test_a_type_is_disabled_until_its_mesh_is_uploaded(types: ObjectTypes, assets: AssetStore) -> None:
    mesh = ObjectModel.of(Mesh("Crate", "crate.stl"))
    crate = await types.add(ObjectTypeSource("Crate", CRATE, model=mesh))
    assert crate.disabled
    assert "crate.stl" in str(crate.problem)
    revision = types.revision
    await assets.put(content(), "other.stl")
    assert not await types.refresh()
    await assets.put(content(), "crate.stl")
    assert not types.up_to_date
    (crate,) = (await types.refresh()).updated
    assert (crate.disabled, crate.object_model) == (False, mesh)
    assert types.revision > revision
    await assets.delete("crate.stl")
    (crate,) = (await types.refresh()).updated
    assert crate.disabled


ARM = """
from arcor2_hw.objects import Robot


class Arm(Robot):
    _ABSTRACT = False
    urdf_package_name = "arm.zip"

    def get_end_effectors_ids(self): return set()
    def get_end_effector_pose(self, end_effector): ...
    def robot_joints(self, include_gripper=False): return []
    def grippers(self): return set()
    def suctions(self): return set()
"""


async def test_a_robot_description_is_named_only_while_it_exists(types: ObjectTypes, assets: AssetStore) -> None:
    await types.add(ObjectTypeSource("Arm", ARM))
    assert types.robot_meta("Arm").urdf_package_filename is UNSET
    await assets.put(content(), "arm.zip")
    await types.refresh()
    assert types.robot_meta("Arm").urdf_package_filename == "arm.zip"
    with_model = [robot.type for robot in types.robot_metas() if robot.urdf_package_filename is not UNSET]
    assert with_model == ["Arm", "DobotMagician", "TwoAxisRobot", "UR10e", "UR3e", "UR5e"]
    await assets.delete("arm.zip")
    await types.refresh()
    assert types.robot_meta("Arm").urdf_package_filename is UNSET


async def test_inheritance_over_uploaded_and_installed_types(types: ObjectTypes, storage: Storage) -> None:
    """An uploaded type may derive from an installed one, and from another uploaded one."""
    entry = types.type_code("BarcodeReader").entry_point
    module, _, name = entry.partition(":")
    base = f"from {module} import {name}\n\n\nclass DoorReader({name}):\n    _ABSTRACT = False\n"
    door = await types.add(ObjectTypeSource("DoorReader", base))
    mixed = """
from .door_reader import DoorReader
from .loud import Loud


class LoudReader(Loud, DoorReader):
    pass
"""
    loud = """
from arcor2.data.common import ActionMetadata


class Loud:
    def beep(self, *, an: str | None = None) -> None:
        '''Beep.'''

    beep.__action__ = ActionMetadata()
"""
    await types.add(ObjectTypeSource("LoudReader", mixed))
    assert types.meta("LoudReader").disabled, "its mixin does not exist yet"
    await storage.put_object_type(ObjectTypeSource("Loud", loud))
    assert [meta.type for meta in (await types.refresh()).updated] == ["LoudReader"]
    reader = types.meta("LoudReader")
    assert (door.disabled, door.base, door.abstract) == (False, "BarcodeReader", False)
    assert (reader.disabled, reader.base, reader.settings) == (
        False,
        "DoorReader",
        types.meta("BarcodeReader").settings,
    )
    assert types.bases("LoudReader")[:2] == ["DoorReader", "BarcodeReader"]
    origins = {action.name: action.origins for action in types.actions("LoudReader")}
    assert origins.pop("beep") is UNSET
    assert origins
    assert set(origins.values()) == {"BarcodeReader"}
    assert [code.name for code in types.type_codes(["LoudReader"])] == ["DoorReader", "Loud", "LoudReader"]


async def test_a_source_error_disables_the_type_and_names_the_line(types: ObjectTypes) -> None:
    meta = await types.add(ObjectTypeSource("Broken", "class Broken(\n"))
    assert meta.disabled
    assert re.search(r"broken\.py:\d+", str(meta.problem))
    assert types.actions("Broken") == []


async def test_dependencies_of_a_type_come_first(types: ObjectTypes, storage: Storage) -> None:
    await put_lamps(storage)
    await types.refresh()
    codes = types.type_codes(["RedLamp", "FlowActions", "RedLamp"])
    assert sorted(code.name for code in codes) == ["Colours", "FlowActions", "Lamp", "RedLamp"]
    names = [code.name for code in codes]
    assert names.index("RedLamp") > max(names.index("Lamp"), names.index("Colours"))
    by_name = {code.name: code for code in codes}
    assert (by_name["RedLamp"].module, by_name["RedLamp"].source) == ("red_lamp", RED)
    assert by_name["FlowActions"].source == ""
    packed = {one.name: one for one in types.sources_for(["RedLamp", "FlowActions", "Generic"])}
    assert set(packed) == {"Lamp", "Colours", "RedLamp", "FlowActions"}
    flow = packed["FlowActions"]
    assert flow.module == "flow_actions"
    assert flow.folder is not None
    assert (flow.folder / "flow_actions.py").is_file()
    assert flow.distribution == "arcor2-hw"
    assert flow.version


async def test_uploaded_types_survive_a_restart(types: ObjectTypes, storage: Storage, assets: AssetStore) -> None:
    await types.add(ObjectTypeSource("Lamp", LAMP))
    again = ObjectTypes(KnownTypes(), storage, assets)
    await again.load()
    assert again.metas() == types.metas()
    assert await again.refresh() == Changes(), "types that exist at the start are not announced"


# ------------------------------------------------------------------------------------------------ on the wire
SPHERE = {"type": "Sphere", "sphere": {"id": "Ball", "radius": 0.1}}


async def test_new_types_are_announced_and_clear_the_cache(server: ServerProcess) -> None:
    async with talking(server.url, "ann") as ann, talking(server.url) as bob:
        before = await ann.granted("GetObjectTypes")
        assert await ann.granted("GetObjectTypes") == before
        new = {"type": "Ball", "base": "CollisionObject", "description": "It's round.", "object_model": SPHERE}
        assert (await ann.request("NewObjectType", new, dry_run=True))["result"]
        assert await ann.granted("GetObjectTypes") == before
        await ann.granted("NewObjectType", new)
        event = await bob.event("ChangedObjectTypes")
        assert event == await ann.event("ChangedObjectTypes")
        assert event["change_type"] == "add"
        (ball,) = event["data"]
        assert (ball["type"], ball["base"], ball["has_pose"]) == ("Ball", "CollisionObject", True)
        assert (ball["object_model"], ball["description"]) == (SPHERE, "It's round.")
        after = await ann.granted("GetObjectTypes")
        assert [one for one in after if one not in before] == [ball]
        assert await bob.granted("GetObjectTypes") == after
        assert {one["name"] for one in await bob.granted("GetActions", {"type": "Ball"})} >= {"set_enabled"}

        await ann.granted("NewObjectType", {"type": "Twin", "base": "Ball", "object_model": twin(SPHERE)})
        refusal = await ann.request("DeleteObjectTypes", ["Ball", "Generic", "Nothing"])
        assert refusal["result"] is False
        assert {one["id"] for one in refusal["data"]} == {"Ball", "Generic", "Nothing"}
        assert "Twin" in next(one["error"] for one in refusal["data"] if one["id"] == "Ball")
        # Without names, the request deletes every type that can be deleted.
        await ann.granted("DeleteObjectTypes")
        removed = [event for event in ann.events if event.get("change_type") == "remove"]
        assert [event["data"][0]["type"] for event in removed] == ["Twin", "Ball"]
        assert await ann.granted("GetObjectTypes") == before
        await ann.refused("GetActions", {"type": "Ball"})


def twin(model: dict[str, object]) -> dict[str, object]:
    return {"type": "Sphere", "sphere": {"id": "Twin", "radius": 0.1}}


@pytest.mark.parametrize(
    "new",
    [
        {"type": "Generic", "base": "Generic"},
        {"type": "FlowActions", "base": "Generic"},
        {"type": "not valid", "base": "Generic"},
        {"type": "class", "base": "Generic"},
        {"type": "Thing", "base": "NoSuchBase"},
        {"type": "Thing", "base": ""},
        {"type": "Thing", "base": "Robot"},
        {"type": "Thing", "base": "CollisionObject"},
        {"type": "Ball", "base": "Generic", "object_model": SPHERE},
        {"type": "Thing", "base": "CollisionObject", "object_model": SPHERE},
        {"type": "Thing", "base": "CollisionObject", "object_model": {"type": "None"}},
        {"type": "Ball", "base": "CollisionObject", "object_model": {"type": "Sphere"}},
        {
            "type": "Ball",
            "base": "CollisionObject",
            "object_model": {"type": "Mesh", "mesh": {"id": "Ball", "asset_id": "not_there.stl"}},
        },
    ],
)
async def test_an_invalid_new_type_is_refused(server: ServerProcess, new: dict[str, object]) -> None:
    async with talking(server.url, "ann") as ann:
        before = await ann.granted("GetObjectTypes")
        await ann.refused("NewObjectType", new)
        assert await ann.granted("GetObjectTypes") == before
        await ann.nothing_more()


UNREADABLE = """
from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class Unreadable(Generic):
    def __init__(self, obj_id: str, name: str, settings) -> None: ...

    @action
    def run(self, *, an: str | None = None): ...
"""


async def test_problems_contain_translation_data_if_codes_are_requested(server: ServerProcess) -> None:
    async with talking(server.url, "ann") as ann, Client(server.url) as client:
        await client.rest.put_object_type("Unreadable", UNREADABLE)
        # Events contain the key and values for all clients.
        (event,) = (await ann.event("ChangedObjectTypes"))["data"]
        plain = next(one for one in await ann.granted("GetObjectTypes") if one["type"] == "Unreadable")
        answer = await ann.request("GetObjectTypes", codes=True)
        full = next(one for one in answer["data"] if one["type"] == "Unreadable")
        assert event == full
        assert (full["disabled"], full["problem"]) == (plain["disabled"], plain["problem"])
        assert (full.pop("key"), full.pop("values")) == (
            "{path}:{line}: {problem}",
            {
                "path": "object_types/unreadable.py",
                "line": "7",
                "problem": {
                    "text": "Unreadable: settings is not annotated",
                    "key": "{cls}: settings is not annotated",
                    "values": {"cls": "Unreadable"},
                },
            },
        )
        assert full == plain

        arguments = {"type": "Unreadable"}
        (plain_action,) = await ann.granted("GetActions", arguments)
        (action,) = (await ann.request("GetActions", arguments, codes=True))["data"]
        assert action.pop("values")["problem"]["key"] == "{action}: the return annotation is missing"
        assert action.pop("key") == "{path}:{line}: {problem}"
        assert action == plain_action
        assert action["problem"].endswith("run: the return annotation is missing")

        refusal = await ann.request("NewObjectType", {"type": "Heir", "base": "Unreadable"}, codes=True)
        assert refusal["values"]["problem"]["key"] == "{path}:{line}: {problem}"
        await ann.granted("DeleteObjectTypes", ["Unreadable"])


async def test_lists_follow_saved_documents(tmp_path: Path) -> None:
    async with running(tmp_path / "data") as server, talking(server.url, "ann") as ann:
        assert await ann.granted("ListScenes") == []
        await ann.granted("NewScene", {"name": "Cell", "description": "small"})
        assert await ann.granted("ListScenes") == []
        await ann.granted("SaveScene")
        (listed,) = await ann.granted("ListScenes")
        assert (listed["name"], listed["description"]) == ("Cell", "small")
        assert "problems" not in listed
        stored = await ann.granted("GetScene", {"id": listed["id"]})
        assert (stored["created"], stored["modified"]) == (listed["created"], listed["modified"])
        await ann.granted("NewObjectType", {"type": "Thing", "base": "Generic"})
        assert await ann.granted("ObjectTypeUsage", {"id": "Thing"}) == []
        await ann.granted("AddObjectToScene", {"name": "thing", "type": "Thing"})
        await ann.granted("SaveScene")
        assert await ann.granted("ObjectTypeUsage", {"id": "Thing"}) == [listed["id"]]
        assert (await ann.request("DeleteObjectTypes", ["Thing"]))["data"][0]["id"] == "Thing"
        await ann.refused("GetScene", {"id": "scn_nothing"})
        await ann.refused("GetProject", {"id": "pro_nothing"})
        assert await ann.granted("ListProjects") == []


def test_defaults_are_not_shared() -> None:
    assert Changes().added is not Changes().added
    assert not Changes()
    assert ObjectTypeSource("x", "").model is UNSET


# ------------------------------------------------------------------------------------------------ huge sources
@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Record the lengths of the sources that this process parses."""
    lengths: list[int] = []
    parse = ast.parse

    def noted(source: str | bytes, *args: Any, **kwargs: Any) -> Any:
        lengths.append(len(source))
        return parse(source, *args, **kwargs)

    monkeypatch.setattr(ast, "parse", noted)
    return lengths


async def test_a_huge_source_is_parsed_by_another_process(
    types: ObjectTypes, storage: Storage, parsed: list[int]
) -> None:
    assert len(HUGE) > worker.SEPARATE_PROCESS_SIZE
    meta = await types.add(ObjectTypeSource("Huge", HUGE))
    assert not meta.disabled
    assert len(types.actions("Huge")) == 1000
    await put_lamps(storage)
    await types.update()
    assert "Lamp" in types.names()
    assert len(types.type_code("Huge").source) == len(HUGE)
    assert not [length for length in parsed if length > worker.SEPARATE_PROCESS_SIZE]


async def test_a_huge_source_that_takes_too_long_is_disabled(
    storage: Storage, assets: AssetStore, tmp_path: Path, parsed: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = tmp_path / "analysis"
    types = ObjectTypes(KnownTypes(), storage, assets, stored)
    await types.load()
    before = stored.read_bytes()
    monkeypatch.setattr(worker, "TIME_LIMIT", 0.0)
    meta = await types.add(ObjectTypeSource("Huge", HUGE))
    assert meta.disabled
    assert "not analysed within 0 s. Split the source" in str(meta.problem)
    await put_lamps(storage)
    await types.update()
    assert not types.meta("Lamp").disabled
    assert stored.read_bytes() == before, "a failed analysis is repeated at the next start"
    assert not [length for length in parsed if length > worker.SEPARATE_PROCESS_SIZE]


async def test_a_failed_analysis_process_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    with pytest.raises(InvalidData, match="failed"):
        await worker.analyse(Library())

"""Import of packages: scene, project and types are restored, conflicts named, malicious files refused."""

import asyncio
import io
import json
import stat
import struct
import zipfile
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.geometry import Position
from arcor2_hw.data.object_type import Box, Mesh, Model3dType, ObjectModel, ObjectTypeSource
from arcor2_hw.data.project import END, START, ActionPoint, Project
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import Conflict, InvalidPackage, InvalidProject, NotFound, StorageError
from arcor2_server.build import imported, package
from arcor2_server.build.importing import ImportOptions
from arcor2_server.build.reading import NotUnderstood
from arcor2_server.object_types.catalog import PackageType
from tests.server.build import hub, workplace
from tests.server.build.conftest import make_code

MODELS = {"table": ObjectModel(Model3dType.BOX, box=Box("table", 1.0, 1.0, 0.02))}
DEFAULTS = ImportOptions()
ALL = ImportOptions(True, True, True, True, True)


def project_without_joints() -> Project:
    """Return the workplace's project without joints, because only robots have joints and its arm is not one."""
    points = []
    for point in workplace.project().action_points:
        actions = []
        for one in point.actions:
            if one.type.endswith("/move_joints"):
                given = ("position", "position", '"acp_feeder"'), ("height", "double", "0.1")
                one = workplace.action(one.name, "obj_robot/drop", *given)
            actions.append(one)
        points.append(replace(point, actions=actions, robot_joints=[]))
    return replace(workplace.project(), action_points=points)


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the workplace's package as another server publishes it."""
    directory = tmp_path_factory.mktemp("publisher")

    async def published() -> bytes:
        with pytest.MonkeyPatch.context() as patch:
            async with hub.opened(directory / "data", make_code(directory), patch, MODELS) as publisher:
                await publisher.storage.put_scene(workplace.scene())
                await publisher.storage.put_project(project_without_joints())
                return bytes(await publisher.build.publish("pro_1"))

    return asyncio.run(published())


@pytest.fixture
async def importer(code: list[PackageType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Any]:
    """Return the services of a server that has the drivers installed and nothing saved."""
    async with hub.opened(tmp_path / "importer", [one for one in code if not one.source], monkeypatch) as services:
        yield services


def files_in(packed: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        return {entry.filename: archive.read(entry) for entry in archive.infolist()}


def changed(packed: bytes, **contents: bytes | None) -> bytes:
    """Return the package with replaced files; None removes a file. `__` in a name stands for a slash."""
    files: dict[str, bytes] = files_in(packed)
    for name, content in contents.items():
        path = name.replace("__", "/").replace("_py", ".py").replace("_json", ".json")
        if content is None:
            del files[path]
        else:
            files[path] = content
    return package.to_zip(files)


def untimed(document: Any) -> Any:
    return replace(document, created=msgspec.UNSET, modified=msgspec.UNSET)


# ------------------------------------------------------------------------------------------------ complete imports
async def test_a_package_is_imported_completely(importer: Any, packed: bytes) -> None:
    ids = await importer.package_import.import_package(packed, DEFAULTS)
    assert (ids.scene_id, ids.project_id) == ("scn_1", "pro_1")
    assert msgspec.to_builtins(ids) == {"sceneId": "scn_1", "projectId": "pro_1"}
    assert untimed(await importer.storage.scene("scn_1")) == workplace.scene()
    assert untimed(await importer.storage.project("pro_1")) == project_without_joints()
    stored = {one.id: one for one in await importer.storage.object_types()}
    assert {name: one.source for name, one in stored.items()} == {"Arm": workplace.ARM, "table": workplace.TABLE}
    assert stored["table"].model == MODELS["table"]
    # The imported project can be built at once, and results in the same program.
    again = files_in(await importer.build.publish("pro_1"))
    assert again["script.py"] == files_in(packed)["script.py"]
    async with asyncio.timeout(30):
        while not importer.hub.events:
            await asyncio.sleep(0.05)
    assert [event.event for event in importer.hub.events] == ["ChangedObjectTypes"]
    assert {meta.type for meta in importer.hub.events[0].data} == {"Arm", "table"}


async def test_a_helper_module_without_a_class_is_imported(importer: Any, packed: bytes) -> None:
    arm = f"from .sort_tools import FASTEST\n{workplace.ARM}"
    helper = b"import math\n\nFASTEST = math.inf\n"
    given = changed(packed, object_types__arm_py=arm.encode(), object_types__sort_tools_py=helper)
    await importer.package_import.import_package(given, DEFAULTS)
    assert (await importer.storage.object_type("sort_tools")).source == helper.decode()
    await importer.types.refresh()
    assert not importer.types.known("sort_tools")  # not a type whose objects can be added to a scene
    assert not importer.types.meta("Arm").disabled
    built = files_in(await importer.build.publish("pro_1"))
    assert built["object_types/sort_tools.py"] == helper

    # The module keeps the name of the object type on the server.
    await importer.storage.delete_object_type("sort_tools")
    await importer.storage.put_object_type(ObjectTypeSource("SortTools", helper.decode()))
    revision = importer.storage.revision
    await importer.package_import.import_package(given, DEFAULTS)
    assert importer.storage.revision == revision


async def test_a_package_file_is_imported(importer: Any, packed: bytes, tmp_path: Path) -> None:
    path = tmp_path / "package.zip"
    path.write_bytes(packed)
    assert (await importer.package_import.import_package(path, DEFAULTS)).project_id == "pro_1"
    with pytest.raises(StorageError, match="cannot be read"):
        await importer.package_import.import_package(tmp_path / "none.zip", DEFAULTS)


async def test_importing_twice_changes_nothing(importer: Any, packed: bytes) -> None:
    await importer.package_import.import_package(packed, DEFAULTS)
    revision, before = importer.storage.revision, await importer.storage.project("pro_1")
    await importer.package_import.import_package(packed, DEFAULTS)
    assert importer.storage.revision == revision
    assert await importer.storage.project("pro_1") == before


async def test_a_failed_import_leaves_no_documents(
    importer: Any, packed: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def full(project: Project) -> Project:
        assert [one.name for one in await importer.storage.scenes()], (
            "the scene was written earlier in the same transaction"
        )
        raise StorageError("The disk is full.")

    monkeypatch.setattr(importer.storage, "put_project", full)
    with pytest.raises(StorageError, match="disk is full"):
        await importer.package_import.import_package(packed, DEFAULTS)
    storage = importer.storage
    assert [await storage.scenes(), await storage.projects(), await storage.object_types(), await storage.models()] == [
        [] for _ in range(4)
    ]
    monkeypatch.undo()
    assert (await importer.package_import.import_package(packed, DEFAULTS)).project_id == "pro_1"
    assert len(await storage.object_types()) > 0
    assert [one.id for one in await storage.projects()] == ["pro_1"]


async def test_camel_case_documents_are_read(importer: Any, packed: bytes) -> None:
    project = json.loads(files_in(packed)["data/project.json"])
    renamed = {"sceneId": project.pop("scene_id"), "hasLogic": project.pop("has_logic", True), **project}
    renamed["actionPoints"] = renamed.pop("action_points")
    for point in renamed["actionPoints"]:
        point["robotJoints"] = point.pop("robot_joints", [])
    await importer.package_import.import_package(
        changed(packed, data__project_json=json.dumps(renamed).encode()), DEFAULTS
    )
    assert untimed(await importer.storage.project("pro_1")) == project_without_joints()


async def test_a_handwritten_script_is_imported(importer: Any, packed: bytes) -> None:
    project = replace(project_without_joints(), has_logic=False, logic=[])
    by_hand = changed(packed, data__project_json=msgspec.json.encode(project), script_py=b"print('by hand')\n")
    await importer.package_import.import_package(by_hand, DEFAULTS)
    assert await importer.storage.project_source("pro_1") == "print('by hand')\n"
    other = changed(by_hand, script_py=b"print('other')\n")
    with pytest.raises(Conflict, match="overwriteProjectSources"):
        await importer.package_import.import_package(other, ImportOptions(overwrite_project=True))
    await importer.package_import.import_package(other, ImportOptions(overwrite_project_sources=True))
    assert await importer.storage.project_source("pro_1") == "print('other')\n"
    with pytest.raises(InvalidProject, match="line 2"):
        await importer.package_import.import_package(changed(by_hand, script_py=b"a = 1\nb = (\n"), ALL)


# ------------------------------------------------------------------------------------------------ from the script
FROM_SCRIPT = replace(ALL, update_project_from_script=True)


async def test_an_edited_script_becomes_the_project(importer: Any, packed: bytes) -> None:
    await importer.package_import.import_package(packed, DEFAULTS)
    source = files_in(packed)["script.py"].decode()
    line = '        robot.pick(aps.feeder.poses.default, grip=Grip.FIRM, an="pick")\n'
    assert line in source
    new = line + '        robot.drop(aps.good.position, 0.25, an="lay down")\n'
    await importer.package_import.import_package(
        changed(packed, script_py=source.replace(line, new).encode()), FROM_SCRIPT
    )
    project = await importer.storage.project("pro_1")
    actions = {action.name: action for point in project.action_points for action in point.actions}
    assert {name for name in actions if name not in workplace_actions()} == {"lay down"}
    assert all(actions[name].id == key for name, key in workplace_actions().items())
    # Arguments that a call omits have their default values in the project.
    assert {one.name: one.value for one in actions["pick"].parameters} == {
        "pose": '"ori_feeder"',
        "speed": "1.0",
        "grip": '"firm"',
    }
    again = files_in(await importer.build.publish("pro_1"))["script.py"].decode()
    assert again.count('an="lay down"') == 1
    assert again.index('an="pick"') < again.index('an="lay down"') < again.index('an="known?"')


def workplace_actions() -> dict[str, str]:
    return {action.name: action.id for point in project_without_joints().action_points for action in point.actions}


async def test_an_edited_script_that_cannot_be_read_changes_nothing(importer: Any, packed: bytes) -> None:
    source = files_in(packed)["script.py"].replace(b"    while True:\n", b"    while True:\n        print(1)\n")
    with pytest.raises(NotUnderstood, match=r"line \d+: print"):
        await importer.package_import.import_package(changed(packed, script_py=source), FROM_SCRIPT)
    assert importer.storage.revision == 0


async def test_a_handwritten_script_has_no_logic(importer: Any, packed: bytes) -> None:
    project = msgspec.json.encode(replace(project_without_joints(), has_logic=False, logic=[]))
    with pytest.raises(InvalidProject, match="has no logic"):
        await importer.package_import.import_package(changed(packed, data__project_json=project), FROM_SCRIPT)


# ------------------------------------------------------------------------------------------------ conflicts
def _other_scene(services: Any) -> Any:
    return services.storage.put_scene(replace(workplace.scene(), description="other"))


def _other_project(services: Any) -> Any:
    return services.storage.put_project(replace(project_without_joints(), description="other"))


def _other_type(services: Any) -> Any:
    return services.storage.put_object_type(ObjectTypeSource("Arm", workplace.ARM + "\n# other\n", "kept text"))


def _other_model(services: Any) -> Any:
    model = ObjectModel(Model3dType.BOX, box=Box("table", 2.0, 1.0, 0.02))
    return services.storage.put_object_type(ObjectTypeSource("table", workplace.TABLE, model=model))


@pytest.mark.parametrize(
    ("change", "option", "named"),
    [
        (_other_scene, "overwrite_scene", r"The scene workplace .*overwriteScene "),
        (_other_project, "overwrite_project", r"The project Sort boards .*overwriteProject "),
        (_other_type, "overwrite_object_types", r"The object type Arm .*overwriteObjectTypes "),
        (_other_model, "overwrite_collision_models", r"The collision model of table .*overwriteCollisionModels "),
    ],
)
async def test_a_conflict_is_named_and_overwritten_only_on_request(
    importer: Any, packed: bytes, change: Callable[[Any], Any], option: str, named: str
) -> None:
    await importer.package_import.import_package(packed, DEFAULTS)
    await change(importer)
    revision = importer.storage.revision
    others = replace(ALL, **{option: False})
    with pytest.raises(Conflict, match=named):
        await importer.package_import.import_package(packed, others)
    assert importer.storage.revision == revision
    await importer.package_import.import_package(packed, ImportOptions(**{option: True}))
    assert importer.storage.revision > revision
    assert untimed(await importer.storage.scene("scn_1")) == workplace.scene()
    assert untimed(await importer.storage.project("pro_1")) == project_without_joints()
    stored = {one.id: one for one in await importer.storage.object_types()}
    assert (stored["Arm"].source, stored["table"].model) == (workplace.ARM, MODELS["table"])
    if change is _other_type:
        assert stored["Arm"].description == "kept text"


async def test_one_error_names_all_conflicts(importer: Any, packed: bytes) -> None:
    await importer.package_import.import_package(packed, DEFAULTS)
    for change in (_other_scene, _other_project, _other_type, _other_model):
        await change(importer)
    with pytest.raises(Conflict) as caught:
        await importer.package_import.import_package(packed, DEFAULTS)
    for conflict in ("scene workplace", "project Sort boards", "type Arm", "model of table"):
        assert conflict in str(caught.value)


async def test_a_used_name_is_a_conflict(importer: Any, packed: bytes) -> None:
    await importer.storage.put_scene(replace(workplace.scene(), id="scn_other"))
    with pytest.raises(Conflict, match="Another scene has the name workplace"):
        await importer.package_import.import_package(packed, ALL)


@pytest.mark.parametrize("kind", ["scene", "project"])
async def test_an_open_document_is_not_replaced(importer: Any, packed: bytes, kind: str) -> None:
    await importer.package_import.import_package(packed, DEFAULTS)
    importer.session.scene = workplace.scene()
    importer.session.project = project_without_joints() if kind == "project" else None
    await importer.package_import.import_package(packed, DEFAULTS)  # nothing differs
    await (_other_scene(importer) if kind == "scene" else _other_project(importer))
    with pytest.raises(Conflict, match=f"The {kind} .* is open"):
        await importer.package_import.import_package(packed, ALL)


async def test_a_type_of_the_package_shadows_an_installed_one(importer: Any, packed: bytes) -> None:
    await importer.package_import.import_package(packed, DEFAULTS)
    before = files_in(await importer.build.publish("pro_1"))
    module = importer.types.type_code("AcmeReader").entry_point.partition(":")[0]
    source = f"from {module} import AcmeReader as Installed\n\n\nclass AcmeReader(Installed):\n    pass\n"
    await importer.package_import.import_package(
        changed(packed, object_types__acme_reader_py=source.encode()), DEFAULTS
    )
    await importer.types.refresh()
    meta = importer.types.meta("AcmeReader")
    assert (meta.built_in, meta.disabled) == (False, False)
    assert "acme" in str(meta.shadows)
    after = files_in(await importer.build.publish("pro_1"))
    assert after["object_types/acme_reader.py"] == source.encode()
    assert before["object_types/acme_reader.py"] != source.encode()

    # Base classes are unchanged.
    generic = b"from arcor2_hw.objects import Robot\n\n\nclass Generic(Robot):\n    pass\n"
    with pytest.raises(InvalidPackage, match="Generic is built in"):
        await importer.package_import.import_package(changed(packed, object_types__generic_py=generic), ALL)


# ------------------------------------------------------------------------------------------------ refusals
async def test_the_error_names_a_driver_that_is_not_installed(
    packed: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with hub.opened(tmp_path / "bare", [], monkeypatch) as bare:
        with pytest.raises(NotFound, match="AcmeReader"):
            await bare.package_import.import_package(packed, ALL)
        assert bare.storage.revision == 0


async def test_the_error_names_a_type_whose_file_lacks_its_class(importer: Any, packed: bytes) -> None:
    with pytest.raises(NotFound, match="The object type Arm is neither in the package nor on this server"):
        await importer.package_import.import_package(
            changed(packed, object_types__arm_py=b"class Leg:\n    pass\n"), ALL
        )
    assert importer.storage.revision == 0


async def test_a_mesh_needs_its_asset(importer: Any, packed: bytes) -> None:
    mesh = ObjectModel(Model3dType.MESH, mesh=Mesh("table", "table.stl"))
    other = changed(packed, data__models__table_json=msgspec.json.encode(mesh))
    with pytest.raises(NotFound, match=r"table\.stl"):
        await importer.package_import.import_package(other, ALL)

    async def content() -> AsyncIterator[bytes]:
        yield b"solid"

    await importer.assets.put(content(), "table.stl")
    await importer.package_import.import_package(other, ALL)


def _project(**fields: Any) -> bytes:
    return msgspec.json.encode(replace(project_without_joints(), **fields))


def _renamed_action() -> bytes:
    first, *others = project_without_joints().action_points
    actions = [replace(one, type="obj_robot/fly") if one.name == "pick" else one for one in first.actions]
    return _project(action_points=[replace(first, actions=actions), *others])


@pytest.mark.parametrize(
    ("contents", "text"),
    [
        ({"script_py": None}, "no script.py"),
        ({"data__scene_json": None}, "no data/scene.json"),
        ({"data__project_json": b"{"}, "data/project.json of the package is damaged"),
        ({"data__project_json": b"[" * 200_000}, "data/project.json of the package is damaged"),
        ({"data__project_json": _project(id="")}, "invalid id"),
        ({"data__project_json": _project(scene_id="scn_2")}, "another scene"),
        ({"data__project_json": _renamed_action()}, "fly"),
        (
            {"data__project_json": _project(logic=[workplace.step(START, "pick"), workplace.step("gone", END)])},
            "act_gone",
        ),
        ({"object_types__arm_py": b"class Arm(:\n"}, "object_types/arm.py of the package is not valid Python"),
        ({"object_types__0arm_py": b"class Leg:\n    pass\n"}, "object_types/0arm.py of the package has no class"),
        ({"object_types__arm_py": b"\xff"}, "is not UTF-8 text"),
        (
            {"object_types__arm_py": b"from .nothing import Base\n\n\nclass Arm(Base):\n    pass\n"},
            "The object type Arm of the package cannot be used",
        ),
        ({"data__models__table_json": b'{"type": "Box"}'}, "data/models/table.json of the package is damaged"),
        (
            {"data__models__table_json": b'{"type":"Sphere","sphere":{"id":"Arm","radius":1.0}}'},
            "is the model of Arm, not of table",
        ),
        ({"data__models__chair_json": b"{}"}, "does not belong to any"),
    ],
)
async def test_an_invalid_package_is_refused_completely(
    importer: Any, packed: bytes, contents: dict[str, bytes | None], text: str
) -> None:
    with pytest.raises(InvalidPackage) as caught:
        await importer.package_import.import_package(changed(packed, **contents), ALL)
    assert text in str(caught.value)
    assert importer.storage.revision == 0
    assert importer.hub.events == []


def _zip(*entries: tuple[str, bytes, int]) -> bytes:
    with io.BytesIO() as buffer:
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content, mode in entries:
                entry = zipfile.ZipInfo(name)
                entry.external_attr = mode << 16
                entry.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(entry, content)
        return buffer.getvalue()


FILE, LINK = stat.S_IFREG | 0o644, stat.S_IFLNK | 0o777


@pytest.mark.parametrize(
    "malicious",
    [
        b"",
        b"no zip",
        _zip(("../script.py", b"", FILE)),
        _zip(("/script.py", b"", FILE)),
        _zip(("data\\scene.json", b"", FILE)),
        _zip(("C:/script.py", b"", FILE)),
        _zip(("data/scene.json", b"/etc/passwd", LINK)),
        _zip(("object_types/../../x.py", b"", FILE)),
        _zip(*((f"f{n}", b"", FILE) for n in range(10_001))),
    ],
    ids=["empty", "text", "up", "root", "backslash", "drive", "link", "inner-up", "many"],
)
async def test_a_malicious_zip_is_refused(importer: Any, malicious: bytes) -> None:
    with pytest.raises(InvalidPackage):
        await importer.package_import.import_package(malicious, ALL)
    assert importer.storage.revision == 0


async def test_a_zip_bomb_is_refused_during_reading(importer: Any) -> None:
    bomb = _zip(("script.py", bytes(package.MAX_READ + 1), FILE))
    assert len(bomb) < 100_000
    with pytest.raises(InvalidPackage, match="larger than"):
        await importer.package_import.import_package(bomb, ALL)
    # A small size stated in the archive does not help: the size of the unpacked file counts.
    at = bomb.index(b"PK\x01\x02")
    understated = bomb[: at + 24] + struct.pack("<I", 10) + bomb[at + 28 :]
    with pytest.raises(InvalidPackage):
        await importer.package_import.import_package(understated, ALL)


@pytest.mark.filterwarnings("ignore:Duplicate name")
async def test_a_duplicate_file_is_refused(importer: Any) -> None:
    with pytest.raises(InvalidPackage, match="twice"):
        await importer.package_import.import_package(_zip(("script.py", b"", FILE), ("./script.py", b"", FILE)), ALL)


async def test_a_damaged_zip_is_refused(importer: Any, packed: bytes) -> None:
    whole, accepted, refused = imported.read(packed), [], 0
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        end = archive.start_dir  # no checksum covers the directory that follows
    for cut in range(100, end - 16, end // 40):
        torn = packed[:cut] + bytes(16) + packed[cut + 16 :]
        try:
            await importer.package_import.import_package(torn, ALL)
        except (InvalidPackage, InvalidProject, NotFound):
            refused += 1
        else:
            accepted.append(cut)
            assert imported.read(torn) == whole, cut  # the damage is in a file that is not imported
    assert refused >= 10, accepted


# ------------------------------------------------------------------------------------------------ bases, helper modules
HELPER = '''"""Sums."""


class Sums:
    """Sums."""

    @staticmethod
    def total(values: list[int]) -> int:
        return sum(values)
'''
MIXIN = '''"""Counting."""


class Counting:
    """Counts."""

    def counted(self) -> int:
        return 1
'''
BASE = '''"""A base."""

from arcor2_hw.objects import Generic


class AbstractTool(Generic):
    """A base."""
'''
TOOL = '''"""A tool."""

from arcor2_hw.actions import action

from .abstract_tool import AbstractTool
from .counting import Counting


class Tool(Counting, AbstractTool):
    """A tool."""

    _ABSTRACT = False

    @action
    def use(self, *, an: str | None = None) -> int:
        """Use."""
        return self.counted()
'''


async def test_bases_mixins_and_modules_are_packed_and_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources = {"AbstractTool": BASE, "Counting": MIXIN, "Sums": HELPER, "Tool": TOOL}
    scene = Scene("s", id="scn_t", objects=[SceneObject("tool", "Tool", id="obj_tool")])
    points = [ActionPoint("p", Position(), id="acp_t", actions=[workplace.action("use", "obj_tool/use")])]
    logic = [workplace.step(START, "use"), workplace.step("use", END)]
    project = Project("p", "scn_t", id="pro_t", action_points=points, logic=logic, project_objects_ids=["Sums"])
    async with hub.opened(tmp_path / "a", [], monkeypatch) as publisher:
        for name, source in sources.items():
            await publisher.storage.put_object_type(ObjectTypeSource(name, source))
        await publisher.types.refresh()
        await publisher.storage.put_scene(scene)
        await publisher.storage.put_project(project)
        published = await publisher.build.publish("pro_t", "Tools")
    files = files_in(published)
    modules = {name for name in files if name.startswith("object_types/")}
    assert modules == {
        "object_types/__init__.py",
        "object_types/abstract_tool.py",
        "object_types/counting.py",
        "object_types/sums.py",
        "object_types/tool.py",
    }
    assert json.loads(files["package.json"])["name"] == "Tools"
    async with hub.opened(tmp_path / "b", [], monkeypatch) as other:
        await other.package_import.import_package(published, DEFAULTS)
        assert {one.id: one.source for one in await other.storage.object_types()} == sources
        assert files_in(await other.build.publish("pro_t", "Tools"))["script.py"] == files["script.py"]
        # The error names an extra module that does not exist.
        await other.storage.put_project(replace(project, project_objects_ids=["Gone"]))
        with pytest.raises(NotFound, match="Gone"):
            await other.build.publish("pro_t")


async def test_stored_types_mark_keyword_only_parameters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = "def use(self, part: int, *, force: float = 0.5, an: str | None = None) -> int:"
    source = TOOL.replace("def use(self, *, an: str | None = None) -> int:", given)
    assert source != TOOL
    parameters = (("part", "integer", "1"), ("force", "double", "0.25"))
    use = workplace.action("use", "obj_tool/use", *parameters)
    project = Project(
        "p",
        "scn_t",
        id="pro_t",
        action_points=[ActionPoint("p", Position(), id="acp_t", actions=[use])],
        logic=[workplace.step(START, "use"), workplace.step("use", END)],
    )
    async with hub.opened(tmp_path / "a", [], monkeypatch) as publisher:
        for name, text in {"AbstractTool": BASE, "Counting": MIXIN, "Tool": source}.items():
            await publisher.storage.put_object_type(ObjectTypeSource(name, text))
        await publisher.types.refresh()
        await publisher.storage.put_scene(Scene("s", id="scn_t", objects=[SceneObject("tool", "Tool", id="obj_tool")]))
        await publisher.storage.put_project(project)
        published = await publisher.build.publish("pro_t")
    assert 'tool.use(1, force=0.25, an="use")' in files_in(published)["script.py"].decode()
    async with hub.opened(tmp_path / "b", [], monkeypatch) as other:
        await other.package_import.import_package(published, FROM_SCRIPT)
        assert untimed(await other.storage.project("pro_t")) == project

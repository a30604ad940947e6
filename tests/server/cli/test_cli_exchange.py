"""`arcor2-hw scene | project | object-type`: export, import into another server, check and compare."""

import asyncio
import contextlib
import json
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.analysis import module_name
from arcor2_hw.client import Client, RequestFailed, ResourceNotFound, Rest
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, Mesh, ObjectModel
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import ActionParameter, Flow, ProjectParameter
from arcor2_hw.data.role import Role
from arcor2_server.access.tokens import TokenFile
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.main import app
from tests.runtime.older_sources import SOURCES
from tests.server.cli.in_process import Ran, run_app
from tests.server.core.serving import ServerProcess

CRATE = '''"""A crate with a mesh."""

from arcor2_hw.actions import action
from arcor2_hw.objects import CollisionObject


class Crate(CollisionObject):
    """A crate."""

    _ABSTRACT = False

    @action
    def open_lid(self, angle: float, *, an: str | None = None) -> bool:
        """Open the lid."""
        assert 0.0 <= angle <= 2.0
        return angle > 1.0
'''
MESH = b"solid crate" + bytes(range(256)) * 400
SCRIPT = "def main() -> None:\n    print('by hand')\n"


class Servers(NamedTuple):
    """Two servers: documents from the first are imported into the second."""

    first: str
    second: str
    loop: asyncio.Runner
    directory: Path

    def ask(self, url: str, work: Callable[[Client], Any]) -> Any:
        async def connected() -> Any:
            async with Client(url) as client:
                return await work(client)

        return self.loop.run(connected())


@pytest.fixture(scope="module")
def servers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Servers]:
    directory: Path = tmp_path_factory.mktemp("exchange")
    first, second = ServerProcess(directory / "first"), ServerProcess(directory / "second")
    with asyncio.Runner() as loop:
        loop.run(_start(first, second))
        made = Servers(first.url, second.url, loop, directory)
        try:
            loop.run(_fill(first.url))
            yield made
        finally:
            loop.run(_stop(first, second))


async def _start(*servers: ServerProcess) -> None:
    await asyncio.gather(*(server.start() for server in servers))


async def _stop(*servers: ServerProcess) -> None:
    await asyncio.gather(*(server.stop() for server in servers))


async def _fill(url: str) -> None:
    """Create a scene with a mesh, a virtual box and dependent types, and projects with logic and with a script."""
    async with Client(url, "author") as author:
        rest = author.rest
        for name in ("KinematicsMixin", "AbstractArm", "ArmM1"):
            await rest.put_object_type(name, SOURCES[name])
        await rest.upload_asset("crate_mesh", MESH, file_name="crate.stl")
        await rest.put_model(Mesh("Crate", "crate_mesh"))
        await rest.put_object_type("Crate", CRATE, Mesh("Crate", "crate_mesh"))
        await author.new_scene("bench", description="to be exported")
        await author.add_object_to_scene(name="crate", type="Crate", pose=Pose())
        await author.add_object_to_scene(name="time", type="TimeActions")
        arm = [Parameter("url", "string", '"http://127.0.0.1:1"')]
        await author.add_object_to_scene(name="arm", type="ArmM1", pose=Pose(), parameters=arm)
        wall = ObjectModel.of(Box("Wall", 1.0, 0.1, 1.0))
        await author.add_virtual_collision_object_to_scene(name="Wall", pose=Pose(), model=wall)
        await author.save_scene()
        scene = await author.get_scene((await author.list_scenes())[0].id)
        ids = {obj.name: obj.id for obj in scene.objects}
        await author.new_project(scene_id=scene.id, name="open it")
        await author.add_project_parameter(name="angle", type="double", value="1.5")
        parameter = (await author.next_event("ProjectParameterChanged")).data
        await author.add_action_point(name="lid", position=Position(0.1, 0.2, 0.3))
        point = (await author.next_event("ActionPointChanged")).data
        await author.write_lock(point.id)
        await author.add_action_point_orientation(action_point_id=point.id, orientation=Orientation(), name="down")
        await author.write_unlock(point.id)
        await author.add_action(
            action_point_id=point.id,
            name="open_the_lid",
            type=f"{ids['crate']}/open_lid",
            parameters=[ActionParameter("angle", "project_parameter", json.dumps(parameter.id))],
            flows=[Flow(outputs=["opened"])],
        )
        first = (await author.next_event("ActionChanged")).data
        await author.add_action(
            action_point_id=point.id,
            name="wait",
            type=f"{ids['time']}/sleep",
            parameters=[ActionParameter("seconds", "double", "0.1")],
            flows=[Flow()],
        )
        second = (await author.next_event("ActionChanged")).data
        for start, end in (("START", first.id), (first.id, second.id), (second.id, "END")):
            await author.add_logic_item(start=start, end=end)
        await author.save_project()
        project = (await author.list_projects())[0]
        await author.close_project()
        await rest.put_kept_parameters(project.id, [ProjectParameter("beside", "integer", "3", id="prm_beside")])
        await author.new_project(scene_id=scene.id, name="by hand", has_logic=False)
        await author.save_project()
        by_hand = next(one for one in await author.list_projects() if one.name == "by hand")
        await author.close_project()
        await rest.put_project_script(by_hand.id, SCRIPT)


@pytest.fixture
def cli(servers: Servers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """Run the command line in this process, in a temporary directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ARCOR2_HW_TOKEN", raising=False)

    def run(*words: str, at: str = "") -> Ran:
        ran = run_app(capsys, *words, *(("--url", at) if at else ()))
        assert ran.status == 0 or ran.err.startswith(f"arcor2-hw {words[0]} {words[1]}: "), ran.err
        return ran

    return run


def _named(items: list[dict[str, Any]], name: str) -> dict[str, Any]:
    return next(item for item in items if item["name"] == name)


def repacked(source: Path, target: Path, change: Callable[[dict[str, bytes]], None]) -> Path:
    """Write a changed copy of an export."""
    with zipfile.ZipFile(source) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    change(files)
    with zipfile.ZipFile(target, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return target


def changed(path: str, change: Callable[[Any], None]) -> Callable[[dict[str, bytes]], None]:
    """Change one JSON document of an export."""

    def work(files: dict[str, bytes]) -> None:
        document = json.loads(files[path])
        change(document)
        files[path] = json.dumps(document).encode()

    return work


def test_an_exported_project_is_imported_and_builds_on_an_empty_server(cli: Any, servers: Servers) -> None:
    listed = cli("project", "list", at=servers.first)
    assert [line.split("  ")[0] for line in listed.out.splitlines()[1:]] == ["by hand", "open it"]
    done = cli("project", "export", "open it", at=servers.first)
    assert done == (0, "open_it.zip: project open it, its scene bench, 5 object types, 1 asset\n", "")
    with zipfile.ZipFile("open_it.zip") as archive:
        assert {name for name in archive.namelist() if name.startswith("object_types/")} == {
            f"object_types/{module_name(name)}.py"
            for name in ("ArmM1", "AbstractArm", "KinematicsMixin", "Crate", "Wall")
        }
    # The same content results in the same file, and no file is overwritten by accident.
    first = Path("open_it.zip").read_bytes()
    again = cli("project", "export", "open it", at=servers.first)
    assert (again.status, "--force" in again.err) == (ExitStatus.CONFLICT, True)
    assert cli("project", "export", "open it", "--force", at=servers.first).status == 0
    assert Path("open_it.zip").read_bytes() == first
    assert cli("project", "validate", "open_it.zip") == (0, "open_it.zip: project open it has no problems\n", "")

    dry = cli("project", "import", "open_it.zip", "--dry-run", at=servers.second)
    assert dry.status == 0
    assert "project open it: would be new" in dry.out
    assert cli("project", "list", at=servers.second).out == "There are no projects.\n"
    assert "scene bench: new" in cli("project", "import", "open_it.zip", at=servers.second).out
    both = [servers.ask(url, _project_content) for url in (servers.first, servers.second)]
    assert both[1] == both[0]

    async def build(client: Client) -> str:
        await client.register_user("ann")
        built = await client.build_project(project_id=(await client.list_projects())[0].id, package_name="moved")
        return built.package_id

    assert servers.ask(servers.second, build).startswith("pkg_")
    # The second import changes nothing, and there is no difference.
    once_more = cli("project", "import", "open_it.zip", at=servers.second)
    assert {line.partition(": ")[2] for line in once_more.out.splitlines()} == {"same"}
    same = cli("project", "diff", "open_it.zip", "open it", at=servers.second)
    assert same == (0, "No differences.\n", "")


async def _project_content(client: Client) -> Any:
    """Return everything that belongs to the project, except for the times."""
    rest = client.rest
    listed = {one.name: one.id for one in await rest.projects()}
    project = await rest.project(listed["open it"])
    scene = await rest.scene(project.scene_id)
    untimed = [replace(one, created=UNSET, modified=UNSET, int_modified=UNSET) for one in (project, scene)]
    types = {one.id: (await rest.object_type(one.id)).source for one in await rest.object_types()}
    models = [await rest.model(name) for name in await rest.models()]
    disabled = [meta.type for meta in await client.get_object_types() if meta.disabled]
    parameters = await rest.kept_parameters(project.id)
    return untimed, types, sorted(models, key=lambda model: model.id), disabled, parameters


def test_differences_are_named_and_replaced_only_on_request(cli: Any, servers: Servers) -> None:
    assert cli("project", "export", "open it", "-o", "out.zip", at=servers.first).status == 0
    cli("project", "import", "out.zip", "--overwrite", "all", at=servers.second)

    def alter(files: dict[str, bytes]) -> None:
        changed("data/scene.json", lambda scene: scene["objects"][0]["pose"]["position"].update(x=9.0))(files)
        changed("data/project.json", lambda project: _named(project["parameters"], "angle").update(value="0.5"))(files)
        files["object_types/crate.py"] += b"\n# changed\n"
        files["assets/0001"] += b"more"

    repacked(Path("out.zip"), Path("other.zip"), alter)
    refused = cli("project", "import", "other.zip", at=servers.second)
    assert refused.status == ExitStatus.CONFLICT
    for document in ("The asset crate_mesh", "The object type Crate", "The scene bench", "The project open it"):
        assert f"{document} exists and differs" in refused.err
    partly = cli("project", "import", "other.zip", "--overwrite", "types", "--overwrite", "assets", at=servers.second)
    assert (partly.status, "The object type" in partly.err, "The scene bench" in partly.err) == (17, False, True)
    compared = cli("project", "diff", "open it", "other.zip", at=servers.second)
    assert compared.status == ExitStatus.DIFFERENT
    lines = compared.out.splitlines()
    assert "~ scene › objects › crate › pose › position: (0, 0, 0) → (9, 0, 0)" in lines
    assert "~ project › parameters › angle › value: 1.5 → 0.5" in lines
    assert "    +# changed" in lines
    assert any(line.startswith("~ assets › crate_mesh: ") for line in lines)
    assert "4 places" in compared.err
    found = json.loads(cli("project", "diff", "open it", "other.zip", "--json", at=servers.second).out)
    assert {
        "change": "changed",
        "path": ["project", "parameters", "angle", "value"],
        "old": "1.5",
        "new": "0.5",
    } in found

    done = cli("project", "import", "other.zip", "--overwrite", "all", at=servers.second)
    assert done.out.count(": replaced") == 4
    assert cli("project", "diff", "other.zip", "open it", at=servers.second).status == 0
    cli("project", "import", "out.zip", "--overwrite", "all", at=servers.second)

    # A document that another user has open is not changed.
    ann = Client(servers.second, "ann")

    async def open_it() -> None:
        await ann.open()
        listed = {one.name: one.id for one in await ann.list_projects()}
        await ann.open_project(listed["open it"])

    async def leave() -> None:
        await ann.close_project()
        await ann.close()

    servers.loop.run(open_it())
    refused = cli("project", "import", "other.zip", "--overwrite", "all", at=servers.second)
    servers.loop.run(leave())
    assert refused.status == ExitStatus.CONFLICT
    assert "The scene bench is open on the server. Close it first." in refused.err
    assert "The project open it is open on the server. Close it first." in refused.err


async def _all_content(client: Client, directory: Path) -> Any:
    assets = {}
    for asset in await client.rest.assets():
        await client.rest.download_asset(asset.id, directory / "asset")
        assets[asset.id] = (directory / "asset").read_bytes(), asset.file_name
    scripts = {}
    for one in await client.rest.projects():
        with contextlib.suppress(ResourceNotFound):
            scripts[one.name] = await client.rest.project_script(one.id)
    return await _project_content(client), assets, scripts, sorted(one.name for one in await client.rest.scenes())


def test_a_failed_import_is_reverted(
    cli: Any, servers: Servers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cli("project", "export", "open it", "-o", "out.zip", at=servers.first).status == 0
    assert cli("project", "import", "out.zip", "--overwrite", "all", at=servers.second).status == 0

    def alter(files: dict[str, bytes]) -> None:
        changed("data/scene.json", lambda scene: scene["objects"][0]["pose"]["position"].update(x=9.0))(files)
        changed("data/project.json", lambda project: _named(project["parameters"], "angle").update(value="0.5"))(files)
        files["data/models/wall.json"] = files["data/models/wall.json"].replace(b"0.1", b"0.2")
        files["object_types/crate.py"] += b"\n# changed\n"
        files["assets/0001"] += b"more"

    repacked(Path("out.zip"), Path("other.zip"), alter)
    content = lambda: servers.ask(servers.second, lambda client: _all_content(client, tmp_path))  # noqa: E731
    before, full = content(), RequestFailed("PUT", ["The disk is full."])
    real = Rest.put_kept_overrides

    async def fails(rest: Rest, key: str, overrides: Any) -> None:
        """Fail in the last step of an import."""
        monkeypatch.setattr(Rest, "put_kept_overrides", real)
        async with Client(servers.second) as client:
            names = {one.name for one in await client.rest.projects()}
            assert "copy" in names or await _all_content(client, tmp_path) != before, "all other steps are done by now"
        raise full

    monkeypatch.setattr(Rest, "put_kept_overrides", fails)
    failed = cli("project", "import", "other.zip", "--overwrite", "all", at=servers.second)
    assert failed.status == ExitStatus.FAILED
    taken = "asset crate_mesh, object type Crate, object type Wall, scene bench, project open it"
    assert f"The disk is full. Undone: {taken}." in failed.err
    assert content() == before

    # New documents are removed again.
    monkeypatch.setattr(Rest, "put_kept_overrides", fails)
    failed = cli("project", "import", "out.zip", "--name", "copy", at=servers.second)
    assert "Undone: project copy." in failed.err
    assert content() == before

    # Changes that cannot be undone are named.
    async def put_once(rest: Rest, scene: Any) -> None:
        monkeypatch.setattr(Rest, "put_scene", fail_again)
        await put_scene(rest, scene)

    async def fail_again(rest: Rest, scene: Any) -> None:
        raise full

    put_scene = Rest.put_scene
    monkeypatch.setattr(Rest, "put_kept_overrides", fails)
    monkeypatch.setattr(Rest, "put_scene", put_once)
    failed = cli("project", "import", "other.zip", "--overwrite", "all", at=servers.second)
    assert "Undone: asset crate_mesh, object type Crate, object type Wall, project open it." in failed.err
    assert "Could not be undone: scene bench. Import the file again to replace it." in failed.err
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    assert cli("project", "import", "out.zip", "--overwrite", "all", at=servers.second).status == 0
    assert content() == before


def test_a_copy_gets_its_own_name_and_id(cli: Any, servers: Servers) -> None:
    assert cli("scene", "export", "bench", at=servers.first).out.startswith("bench.zip: scene bench, ")
    cli("scene", "import", "bench.zip", "--overwrite", "all", at=servers.second)
    assert cli("scene", "import", "bench.zip", "--name", "bench two", at=servers.second).status == 0
    listed = {one["name"]: one["id"] for one in json.loads(cli("scene", "list", "--json", at=servers.second).out)}
    # The file of a project contains its scene, too.
    cli("project", "export", "open it", at=servers.first)
    assert cli("scene", "diff", "open_it.zip", "bench.zip") == (0, "No differences.\n", "")
    assert listed.keys() >= {"bench", "bench two"}
    assert listed["bench"] != listed["bench two"]
    taken = cli("scene", "import", "bench.zip", "--name", "bench two", at=servers.second)
    assert (taken.status, "--name" in taken.err) == (ExitStatus.CONFLICT, True)
    differing = cli("scene", "diff", "bench", "bench two", at=servers.second)
    assert [line.split(":")[0] for line in differing.out.splitlines()] == ["~ scene › name", "~ scene › id"]


def test_projects_with_handwritten_scripts_and_packages_are_imported(cli: Any, servers: Servers) -> None:
    assert cli("project", "export", "by hand", at=servers.first).status == 0
    assert cli("project", "import", "by_hand.zip", "--overwrite", "all", at=servers.second).status == 0

    async def publish(client: Client) -> str:
        listed = {one.name: one.id for one in await client.rest.projects()}
        await client.rest.publish(listed["by hand"], servers.directory / "package.zip")
        return await client.rest.project_script(listed["by hand"])

    assert servers.ask(servers.second, publish) == SCRIPT
    package = str(servers.directory / "package.zip")
    checked = cli("project", "validate", package)
    assert (checked.status, "note: " in checked.out and "'crate_mesh', which is missing" in checked.out) == (0, True)
    assert "project by hand: same" in cli("project", "import", package, at=servers.second).out
    other = cli("project", "diff", package, "open it", at=servers.second)
    assert (other.status, "- script" in other.out, "+ project › logic › open_the_lid → wait" in other.out) == (
        15,
        True,
        True,
    )


def test_object_types_are_exported_with_their_dependencies(cli: Any, servers: Servers) -> None:
    done = cli("object-type", "export", "ArmM1", at=servers.first)
    assert done.out == "ArmM1.zip: object-type AbstractArm\n" or done.out.startswith("ArmM1.zip: ")
    with zipfile.ZipFile("ArmM1.zip") as archive:
        assert sum(name.startswith("object_types/") for name in archive.namelist()) == 3
    assert cli("object-type", "validate", "ArmM1.zip").status == 0
    cli("object-type", "import", "ArmM1.zip", "--overwrite", "all", at=servers.second)
    assert "ArmM1: same" in cli("object-type", "import", "ArmM1.zip", at=servers.second).out
    assert cli("object-type", "diff", "ArmM1.zip", "ArmM1", at=servers.second).status == 0
    repacked(
        Path("ArmM1.zip"),
        Path("renamed.zip"),
        lambda files: files.update(
            {"object_types/arm_m1.py": files["object_types/arm_m1.py"].replace(b"arm-m1", b"m2")}
        ),
    )
    source = cli("object-type", "diff", "ArmM1.zip", "renamed.zip")
    assert (source.status, "~ object types › ArmM1 › source:" in source.out) == (ExitStatus.DIFFERENT, True)

    def remove_base(files: dict[str, bytes]) -> None:
        del files["object_types/abstract_arm.py"]
        changed("export.json", lambda head: head["types"].pop("object_types/abstract_arm.py"))(files)

    incomplete = repacked(Path("ArmM1.zip"), Path("incomplete.zip"), remove_base)
    broken = cli("object-type", "validate", str(incomplete))
    assert broken.status == ExitStatus.DOCUMENT_PROBLEMS
    assert "object_types/ArmM1: " in broken.err
    assert "abstract_arm" in broken.err
    listed = cli("object-type", "list", "--json", at=servers.second)
    assert "ArmM1" in [one["name"] for one in json.loads(listed.out)]
    wrong_kind = cli("scene", "import", "ArmM1.zip", at=servers.second)
    assert (wrong_kind.status, "arcor2-hw object-type" in wrong_kind.err) == (ExitStatus.USAGE, True)
    assert cli("object-type", "export", "UR5e", at=servers.first).status == ExitStatus.NOT_FOUND
    assert cli("object-type", "export", at=servers.first).status == ExitStatus.USAGE


BROKEN: dict[str, tuple[str, Callable[[Any], None], str]] = {
    "a text instead of a number": (
        "data/scene.json",
        lambda scene: scene["objects"][0]["pose"]["position"].update(x="far"),
        "data/scene.json: Expected `float`, got `str` - at `$.objects[0].pose.position.x`",
    ),
    "a type that does not exist": (
        "data/scene.json",
        lambda scene: scene["objects"][0].update(type="Barrel"),
        "data/scene.json: objects[0] (crate): crate: the object type Barrel does not exist",
    ),
    "a missing setting": (
        "data/scene.json",
        lambda scene: scene["objects"][2].update(parameters=[]),
        "data/scene.json: objects[2] (arm): arm: the setting url is missing",
    ),
    "an action of a missing object": (
        "data/project.json",
        lambda project: project["action_points"][0]["actions"][1].update(type="obj_1/sleep"),
        "data/project.json: action_points[0].actions[1] (wait): ",
    ),
    "a missing parameter": (
        "data/project.json",
        lambda project: project["action_points"][0]["actions"][0].update(parameters=[]),
        "data/project.json: action_points[0].actions[0] (open_the_lid): open_the_lid: the parameter angle is missing",
    ),
    "a point that is its own ancestor": (
        "data/project.json",
        lambda project: project["action_points"][0].update(parent=project["action_points"][0]["id"]),
        "data/project.json: action_points[0] (lid): The action point lid is its own ancestor",
    ),
    "a connection to a missing action": (
        "data/project.json",
        lambda project: project["logic"][1].update(end="act_gone"),
        "data/project.json: logic[1]: The connection leads from or to action act_gone",
    ),
    "two items with one id": (
        "data/project.json",
        lambda project: project["logic"][1].update(id=project["logic"][0]["id"]),
        "2 entries have the id",
    ),
    "another scene": (
        "data/project.json",
        lambda project: project.update(scene_id="scn_other"),
        "data/project.json: scene_id: The project open it belongs to another scene than bench",
    ),
    "an invalid id": (
        "data/scene.json",
        lambda scene: scene.update(id="a/b"),
        "data/scene.json: 'a/b' is not a valid id",
    ),
    "a later format": (
        "export.json",
        lambda head: head.update(format=2),
        "export.json: format 2 is not supported",
    ),
    "a missing asset": (
        "export.json",
        lambda head: head.update(assets=[]),
        "data/models of Crate: The mesh needs the asset 'crate_mesh', which is missing",
    ),
    "an asset from outside": (
        "export.json",
        lambda head: head["assets"][0].update(file="../secret"),
        "export.json: the asset 'crate_mesh' should be in '../secret', which is missing",
    ),
    "a source from outside": (
        "export.json",
        lambda head: head["types"].update({"data/scene.json": "Crate"}),
        "export.json: 'data/scene.json' is not the file of an object type 'Crate'",
    ),
    "a model of another type": (
        "data/models/crate.json",
        lambda model: model["mesh"].update(id="Wall"),
        "data/models/crate.json: it is the model of 'Wall', not of Crate",
    ),
}


@pytest.fixture(scope="module")
def exported(servers: Servers) -> Path:
    path = servers.directory / "exported.zip"
    if not path.exists():
        assert app(["project", "export", "open it", "-o", str(path), "--url", servers.first]) == 0
    return path


@pytest.mark.parametrize("case", BROKEN)
def test_the_error_names_an_invalid_entry_and_nothing_is_imported(
    cli: Any, exported: Path, servers: Servers, case: str
) -> None:
    path, change, expected = BROKEN[case]
    repacked(exported, Path("broken.zip"), changed(path, change))
    checked = cli("project", "validate", "broken.zip")
    assert checked.status == ExitStatus.DOCUMENT_PROBLEMS
    assert expected in checked.err
    (first, *_) = json.loads(cli("project", "validate", "--json", "broken.zip").out)
    assert (first["file"], first["level"]) == ("broken.zip", "error")
    assert first["entry"] or "id " in first["text"]
    if case not in ("a missing asset",):  # it may be on the server
        imported = cli("project", "import", "broken.zip", "--overwrite", "all", at=servers.second)
        assert imported.status == ExitStatus.DOCUMENT_PROBLEMS


def _bomb(archive: zipfile.ZipFile) -> None:
    archive.writestr("assets/0099", b"\0" * (3 << 20), zipfile.ZIP_DEFLATED)


def _link(archive: zipfile.ZipFile) -> None:
    entry = zipfile.ZipInfo("assets/0002")
    entry.external_attr = 0o120777 << 16
    archive.writestr(entry, "/etc/passwd")


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        (lambda archive: archive.writestr("../evil.py", "x"), "outside of it"),
        (lambda archive: archive.writestr("/evil.py", "x"), "outside of it"),
        (_link, "not a file"),
        (lambda archive: archive.writestr("object_types/extra.py", "x = 1"), "belongs to no object type"),
        (_bomb, "larger than"),
    ],
)
def test_a_malicious_export_is_refused(
    cli: Any, exported: Path, spoil: Any, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arcor2_server.exchange.archive.MAX_SIZE", 2 << 20)
    Path("evil.zip").write_bytes(exported.read_bytes())
    with zipfile.ZipFile("evil.zip", "a") as archive:
        spoil(archive)
    checked = cli("project", "validate", "evil.zip")
    assert (checked.status, expected in checked.err) == (ExitStatus.DOCUMENT_PROBLEMS, True), checked.err
    assert {path.name for path in Path().iterdir()} == {"evil.zip"}


def test_texts_of_an_export_cannot_send_terminal_sequences(cli: Any, exported: Path) -> None:
    evil = "\x1b]0;owned\x07 [red]lid[/] \x9b2J"

    def spoil(files: dict[str, bytes]) -> None:
        changed("data/scene.json", lambda scene: scene.update(name=evil, description=evil))(files)
        changed("data/project.json", lambda project: project["action_points"][0].update(name=evil))(files)
        files["object_types/crate.py"] += f"\n# {evil}\n".encode()

    repacked(exported, Path("evil.zip"), spoil)
    for ran in (cli("project", "validate", "evil.zip"), cli("project", "diff", str(exported), "evil.zip")):
        assert ran.status != 0
        assert not {"\x1b", "\x07", "\x9b"} & {*ran.out, *ran.err}
        assert "[red]lid[/]" in ran.out + ran.err
    repacked(exported, Path("half.zip"), changed("data/scene.json", lambda scene: scene.update(name="\ud800")))
    half = cli("project", "validate", "half.zip")
    assert (half.status, "data/scene.json: " in half.err) == (ExitStatus.DOCUMENT_PROBLEMS, True)


def test_failures_have_an_exit_status(cli: Any, servers: Servers, exported: Path, tmp_path: Path) -> None:
    Path("none.zip").write_text("no zip")
    half = Path("half.zip")
    half.write_bytes(exported.read_bytes()[:2000])
    for words, status, expected in (
        (("scene", "list", "--url", "ws://127.0.0.1:9"), ExitStatus.NO_SERVER, "127.0.0.1:9"),
        (("scene", "export", "nowhere", "--url", servers.first), ExitStatus.NOT_FOUND, "has no scene nowhere"),
        (("project", "import", "missing.zip", "--url", servers.first), ExitStatus.NOT_FOUND, "missing.zip"),
        (("project", "validate", "none.zip"), ExitStatus.DOCUMENT_PROBLEMS, "none.zip"),
        (("project", "validate", "half.zip"), ExitStatus.DOCUMENT_PROBLEMS, "not a valid zip archive"),
        (("project", "validate"), ExitStatus.USAGE, "specify the files"),
        (("scene", "list", "--ca", "none.zip", "--url", servers.first), ExitStatus.CERTIFICATE_UNUSABLE, "none.zip"),
        (("scene", "export", "bench", "-o", "no/where.zip", "--url", servers.first), ExitStatus.FAILED, "written"),
    ):
        ran = cli(*words)
        assert (ran.status, expected in ran.err, ran.err.count("\n")) == (status, True, 1), ran.err


def test_an_unfinished_program_is_valid_with_a_note(cli: Any, exported: Path) -> None:
    repacked(exported, Path("unfinished.zip"), changed("data/project.json", lambda project: project["logic"].pop()))
    checked = cli("project", "validate", "unfinished.zip")
    assert checked.status == 0
    assert "note: unfinished.zip: data/project.json: logic: The project cannot be built yet: " in checked.out


def test_tokens_and_trusted_certificates_are_used(
    cli: Any, servers: Servers, exported: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = servers.directory / "guarded"
    data.mkdir()
    _, secret = TokenFile(data).add("reader", Role.OPERATOR)
    server = ServerProcess(data, "--self-signed")
    servers.loop.run(server.start())
    try:
        strange = cli("scene", "list", at=server.url)
        assert (strange.status, "certificate verify failed" in strange.err) == (ExitStatus.NO_SERVER, True)
        ca = ("--ca", str(data / "certificate.pem"))
        assert cli("scene", "list", *ca, at=server.url).status == ExitStatus.NOT_PERMITTED
        assert cli("scene", "list", *ca, "--token", "wrong", at=server.url).status == ExitStatus.NOT_PERMITTED
        assert cli("package", "list", *ca, "--token", "wrong", at=server.url).status == ExitStatus.NOT_PERMITTED
        assert cli("scene", "list", *ca, "--token", secret, at=server.url).status == 0
        monkeypatch.setenv("ARCOR2_HW_TOKEN", secret)
        monkeypatch.setenv("ARCOR2_HW_URL", server.url)
        assert cli("scene", "list", *ca).status == 0
        assert cli("package", "list", *ca).status == 0
        imported = cli("project", "import", str(exported), *ca)
        assert (imported.status, "technician" in imported.err or "programmer" in imported.err) == (18, True)
    finally:
        servers.loop.run(server.stop())


def test_a_function_is_exported_and_imported_into_another_project(cli: Any, servers: Servers) -> None:
    async def prepare(client: Client) -> str:
        await client.register_user("author")
        source = next(one for one in await client.list_projects() if one.name == "open it")
        await client.copy_project(source_id=source.id, target_name="with function")
        await client.new_project(scene_id=source.scene_id, name="other")
        await client.save_project()
        await client.close_project()
        copied = next(one for one in await client.list_projects() if one.name == "with function")
        await client.open_project(copied.id)
        actions = [action.id for action in (await client.get_project(copied.id)).all_actions()]
        await client.make_function(name="open_and_wait", action_ids=actions)
        await client.save_project()
        await client.close_project()
        return copied.id

    async def functions(client: Client) -> list[str]:
        other = next(one for one in await client.list_projects() if one.name == "other")
        return [function.name for function in (await client.get_project(other.id)).functions]

    async def remove(client: Client) -> None:
        await client.register_user("author")
        for one in await client.list_projects():
            if one.name in ("with function", "other"):
                await client.delete_project(one.id)

    servers.ask(servers.first, prepare)
    exporting = ("project", "export-function", "with function")
    assert "has no function nothing" in cli(*exporting, "nothing", at=servers.first).err
    assert cli(*exporting, "open_and_wait", at=servers.first).out == (
        "open_and_wait.json: functions open_and_wait; 2 references\n"
    )
    assert "already exists" in cli(*exporting, "open_and_wait", at=servers.first).err
    importing = ("project", "import-function", "other", "open_and_wait.json")
    assert cli(*importing, "--dry-run", at=servers.first).out == "other: can import open_and_wait\n"
    assert servers.ask(servers.first, functions) == []
    assert "--point needs OLD=NEW" in cli(*importing, "--point", "lid", at=servers.first).err
    assert cli(*importing, at=servers.first).out == "other: imported open_and_wait\n"
    assert cli(*importing, at=servers.first).status == 0
    assert servers.ask(servers.first, functions) == ["open_and_wait", "open_and_wait_2"]
    servers.ask(servers.first, remove)

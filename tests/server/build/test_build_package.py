"""Content of packages: they run by themselves, and type checkers and zip tools accept them."""

import asyncio
import contextlib
import io
import itertools
import json
import os
import subprocess
import sys
import types
import zipfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_hw.analysis import Enumeration
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from arcor2_hw.data.project import END, START, Project
from arcor2_hw.data.project_index import ProjectIndex, global_pose
from arcor2_hw.data.rpc import BuildProjectArgs, BuildProjectData
from arcor2_hw.exceptions import InvalidPackage, InvalidProject, NotFound, StorageError
from arcor2_server.build import package
from arcor2_server.build.service import BuildInput, BuildService, files_of
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.catalog import PackageType
from arcor2_server.rpc.build import BuildRequests
from arcor2_server.rpc.registry import Context
from arcor2_server.storage import Storage, package_versions
from tests.server.build import hub, workplace
from tests.server.build.conftest import STOCK, Mypy

MODELS = {"table": ObjectModel(Model3dType.BOX, box=Box("table", 1.0, 1.0, 0.02))}


@pytest.fixture
def inputs(code: list[PackageType]) -> BuildInput:
    built = "2026-11-21T06:43:11.414039+00:00"
    return BuildInput(
        "Boards",
        workplace.scene(),
        workplace.project(),
        code,
        workplace.FACTS,
        dict(MODELS),
        built,
        {"AcmeReader": [Enumeration("acme_devices.acme_reader.codes", "Mode", {1: "ONCE", 2: "TWICE"})]},
    )


# ------------------------------------------------------------------------------------------------ content
def test_the_script_and_its_points_equal_the_golden_files(inputs: BuildInput) -> None:
    files = files_of(inputs)
    for name, golden in (("script.py", "workplace_script.txt"), ("action_points.py", "workplace_points.txt")):
        assert files[name].decode() == Path(__file__).with_name(golden).read_text()


def test_a_package_contains_everything_it_needs(inputs: BuildInput) -> None:
    files = files_of(inputs)
    assert set(files) == {
        "script.py",
        "action_points.py",
        "package.json",
        "versions.json",
        "data/scene.json",
        "data/project.json",
        "data/models/table.json",
        "object_types/__init__.py",
        "object_types/arm.py",
        "object_types/table.py",
        "object_types/acme_reader.py",
        "object_types/flow_actions.py",
        *(f"object_types/acme_reader_driver/{name}" for name in workplace.DRIVER if "pycache" not in name),
        *(f"object_types/stock/{file.name}" for file in STOCK.glob("*.py")),
    }
    assert json.loads(files["package.json"]) == {"name": "Boards", "built": inputs.built}
    assert msgspec.json.decode(files["data/project.json"], type=Project) == inputs.project
    assert b"null" not in files["data/scene.json"]
    assert files["object_types/__init__.py"] == b""
    recorded = json.loads(files["versions.json"])
    assert recorded["distributions"] == {"msgspec": msgspec.__version__}


def test_a_zip_is_reproducible_and_complete(inputs: BuildInput) -> None:
    files = files_of(inputs)
    shuffled = dict(sorted(files.items(), key=lambda entry: hash(entry[0])))
    packed = package.to_zip(files)
    assert package.to_zip(shuffled) == packed
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        assert archive.testzip() is None
        assert {entry.filename: archive.read(entry) for entry in archive.infolist()} == files


@pytest.mark.parametrize("path", ["../evil.py", "/etc/passwd", "a/../../b", "a\\..\\b", ""])
def test_no_file_is_written_outside_the_package(path: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidPackage):
        package.to_zip({path: b""})
    with pytest.raises(InvalidPackage):
        package.write({path: b""}, tmp_path / "packages" / "pkg_1")
    assert not any((tmp_path / "packages").iterdir())


@pytest.mark.parametrize("module", ["../evil", "", "a.b", "a/b", "ä"])
def test_invalid_module_names_are_refused(module: str, inputs: BuildInput) -> None:
    inputs.types.append(PackageType("Bad", module, "x = 1"))
    with pytest.raises(InvalidProject, match="Bad"):
        files_of(inputs)


@pytest.mark.parametrize(
    "line",
    ["from acme_devices.acme_reader import codes", "import acme_devices.other", "from acme_devices import other"],
)
def test_a_driver_that_imports_server_code_is_refused(line: str, driver: PackageType, inputs: BuildInput) -> None:
    assert driver.folder is not None
    (driver.folder / "codes.py").write_text(f"def late():\n    {line}\n")
    with pytest.raises(InvalidProject, match=r"AcmeReader: codes\.py imports acme_devices"):
        files_of(inputs)
    (driver.folder / "codes.py").write_text("from ..other import FIRST\n")
    with pytest.raises(InvalidProject, match=r"AcmeReader: codes\.py imports from outside"):
        files_of(inputs)


def test_links_out_of_a_driver_folder_are_not_followed(driver: PackageType, inputs: BuildInput, tmp_path: Path) -> None:
    assert driver.folder is not None
    (tmp_path / "secret").write_text("secret")
    (driver.folder / "innocent.txt").symlink_to(tmp_path / "secret")
    assert not [name for name in files_of(inputs) if name.endswith("innocent.txt")]


def test_two_drivers_may_have_folders_with_the_same_name(
    driver: PackageType, inputs: BuildInput, tmp_path: Path
) -> None:
    other = tmp_path / "other" / "acme_reader"
    other.mkdir(parents=True)
    (other / "__init__.py").write_text("class Other: ...\n")
    inputs.types.append(PackageType("Other", "other", "", "acme_reader:Other", other, "other", "1"))
    files = files_of(inputs)
    assert b"from .acme_reader_2 import Other as Other" in files["object_types/other.py"]
    assert files["object_types/acme_reader_2/__init__.py"] == b"class Other: ...\n"


@pytest.mark.parametrize("above", ["acme_devices", "acme_reader"])
def test_a_module_may_have_the_name_of_its_folder(inputs: BuildInput, tmp_path: Path, above: str) -> None:
    folder = tmp_path / "like" / above / "acme_reader"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "acme_reader.py").write_text("class Like: ...\n")
    entry = f"{above}.acme_reader.acme_reader:Like"
    inputs.types.append(PackageType("Like", "like", "", entry, folder, "like", "1"))
    files = files_of(inputs)
    assert b"from .acme_reader_2.acme_reader import Like as Like" in files["object_types/like.py"]


# ------------------------------------------------------------------------------------------------ running
@pytest.fixture
def directory(inputs: BuildInput, tmp_path: Path) -> Path:
    target = tmp_path / "packages" / "pkg_1"
    package.write(files_of(inputs), target)
    return target


def test_a_package_runs_on_its_own_code(directory: Path, driver: PackageType) -> None:
    assert driver.folder is not None
    (driver.folder / "codes.py").write_text("FIRST = 100\n")  # the server was upgraded after the build
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=directory,
        env={**os.environ, "PYTHONPATH": str(driver.folder.parents[1]), "ARCOR2_STREAMING_PERIOD": "0"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
    )
    events = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    assert not [event for event in events if event["event"] == "ProjectException"], done.stdout + done.stderr
    names = {a.id: a.name for point in workplace.project().action_points for a in point.actions}
    ran = [names[event["data"]["action_id"]] for event in events if event["event"] == "ActionStateBefore"]
    cycle = ["boards left?", "scan code", "above feeder", "pick", "known?"]
    assert ran == [*cycle, "into good box", "back", *cycle, "throw away", "back", "boards left?", "finish"]
    results = [e["data"]["results"][0] for e in events if e["event"] == "ActionStateAfter" and "results" in e["data"]]
    assert f"{directory}/object_types/acme_reader_driver/reader.py" in results[1]
    used = [e["data"] for e in events if e["event"] == "ActionStateBefore" and e["data"]["action_id"].endswith("box")]
    project = workplace.project()
    good = global_pose(ProjectIndex(workplace.scene(), project), project.action_points[1])
    assert json.loads(used[0]["parameters"][0]) == json.loads(msgspec.json.encode(good))
    assert used[0]["action_point_ids"] == ["acp_good"]


def test_a_type_checker_accepts_a_package(directory: Path, mypy: Mypy) -> None:
    (directory / "wrong.py").write_text(
        "from action_points import ActionPoints\n\n\ndef use(aps: ActionPoints) -> None:\n    aps.good.poses.nope\n"
    )
    found = mypy(directory)
    assert [line.split(":")[0] for line in found] == ["wrong.py"], found
    assert '"GoodPoses" has no attribute "nope"' in found[0]


def test_the_check_lists_different_versions(directory: Path) -> None:
    assert package_versions.check_versions(directory) == []
    file = directory / "versions.json"
    built = json.loads(file.read_bytes())
    built["distributions"] = {"msgspec": "0.1", "no-such-distribution": "3"}
    built["python"] = "3.9.1"
    file.write_text(json.dumps(built))
    assert [
        line.partition(" with ")[2].partition(",")[0] for line in package_versions.check_versions(directory)[1:]
    ] == [
        "msgspec 0.1",
        "no-such-distribution 3",
    ]
    assert "Python 3.9.1" in package_versions.check_versions(directory)[0]
    file.write_text("{")
    assert "cannot be read" in package_versions.check_versions(directory)[0]
    file.unlink()
    assert package_versions.check_versions(directory) == []


def test_single_compiled_modules_have_a_distribution() -> None:
    assert package_versions.present({"rtde_control", "pymodbus", "json"}).distributions.keys() == {
        "ur-rtde",
        "pymodbus",
    }


def test_our_modules_in_older_sources_are_not_a_foreign_dependency(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(package_versions, "_distributions", lambda: {"arcor2": "pymodbus", "arcor2_web": "pymodbus"})
    assert package_versions.present({"arcor2", "arcor2_web", "arcor2_object_types"}).distributions == {}


def test_a_failed_write_leaves_no_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sync = os.fsync
    outcomes = iter((None, OSError(28, "No space left on device")))

    def full(descriptor: int) -> None:
        if (error := next(outcomes)) is not None:
            raise error
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match="No space left"):
        package.write({"a": b"", "b": b"", "script.py": b""}, tmp_path / "pkg_1")
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------ service
@pytest.fixture
async def service(
    code: list[PackageType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[tuple[BuildService, Storage]]:
    """Return a Build service on a real storage and registry."""
    async with hub.opened(tmp_path / "data", code, monkeypatch, MODELS) as services:
        await services.storage.put_scene(workplace.scene())
        yield services.build, services.storage


async def test_a_build_is_listed_among_the_packages(service: tuple[BuildService, Storage], tmp_path: Path) -> None:
    build, storage = service
    await storage.put_project(workplace.project())
    package_id = await build.build("pro_1", "Boards")
    directory = tmp_path / "data" / "packages" / package_id
    assert package_id.startswith("pkg_")
    assert [entry.name for entry in directory.parent.iterdir()] == [package_id]
    assert json.loads((directory / "package.json").read_bytes())["name"] == "Boards"
    model = msgspec.json.decode((directory / "data" / "models" / "table.json").read_bytes(), type=ObjectModel)
    assert model == MODELS["table"]
    reader = (directory / "object_types" / "acme_reader.py").read_text()
    assert "from .acme_reader_driver.codes import Mode as Mode" in reader
    assert (directory / "script.py").read_text() == Path(__file__).with_name("workplace_script.txt").read_text()
    with zipfile.ZipFile(io.BytesIO(await build.publish("pro_1"))) as archive:
        assert archive.read("action_points.py") == (directory / "action_points.py").read_bytes()
        assert json.loads(archive.read("package.json"))["name"] == "Sort boards"


async def test_a_build_does_not_block_the_event_loop(service: tuple[BuildService, Storage]) -> None:
    build, storage = service
    project = workplace.project()
    long = [workplace.action(f"a{n}", "obj_flow/finish") for n in range(1500)]
    names = [START, *(one.name for one in long), END]
    logic = [workplace.step(start, end) for start, end in itertools.pairwise(names)]
    [point, *_] = project.action_points
    points = [msgspec.structs.replace(point, actions=long)]
    await storage.put_project(msgspec.structs.replace(project, action_points=points, logic=logic))
    inputs = await build.collect("pro_1")
    turns = 0

    async def turn() -> None:
        nonlocal turns
        while True:
            await asyncio.sleep(0)
            turns += 1

    turning = asyncio.create_task(turn())
    publishing = asyncio.create_task(asyncio.to_thread(files_of, inputs))
    await asyncio.wait_for(build.publish("pro_1"), 60)
    await publishing
    turning.cancel()
    # If the build ran in the event loop, the loop would iterate only a few times during the build.
    assert turns > 100


async def test_a_project_without_logic_is_built_from_its_handwritten_script(
    service: tuple[BuildService, Storage], tmp_path: Path
) -> None:
    build, storage = service
    await storage.put_project(msgspec.structs.replace(workplace.project(), has_logic=False, logic=[]))
    inputs = await build.collect("pro_1")
    empty = files_of(inputs)["script.py"].decode()
    assert "while" not in empty
    assert "reader: AcmeReader" in empty
    await storage.put_project_source("pro_1", "print(1)\n")
    assert files_of(await build.collect("pro_1"))["script.py"] == b"print(1)\n"
    await storage.put_project_source("pro_1", "fine = 1\ndef broken(:\n")
    with pytest.raises(InvalidProject, match="line 2"):
        await build.build("pro_1", "x")
    assert not (tmp_path / "data" / "packages").exists()


async def test_the_error_names_a_missing_project_or_object(service: tuple[BuildService, Storage]) -> None:
    build, storage = service
    with pytest.raises(NotFound, match="pro_none"):
        await build.build("pro_none", "x")
    scene = workplace.scene()
    await storage.put_scene(msgspec.structs.replace(scene, objects=[*scene.objects[1:]]))
    await storage.put_project(workplace.project())
    with pytest.raises(InvalidProject, match="obj_robot"):
        await build.build("pro_1", "x")


async def test_the_request_builds_under_the_lock_of_the_project() -> None:
    seen: list[str] = []

    class Locks:
        @contextlib.asynccontextmanager
        async def auto(self, user: str, *ids: str) -> AsyncIterator[None]:
            seen.append(f"locked {user} {ids}")
            yield
            seen.append("unlocked")

    class Build:
        async def build(self, project_id: str, name: str) -> str:
            seen.append(f"build {project_id} {name}")
            return "pkg_1"

    class Execution:
        async def added(self, package_id: str) -> None:
            seen.append(f"added {package_id}")

    class Tasks:
        @contextlib.contextmanager
        def running(self, kind: TaskKind, title: str, user: str) -> Iterator[None]:
            seen.append(f"{kind.value} '{title}' of {user}")
            yield
            seen.append("finished")

    fakes: Any = (Locks(), Execution(), Build(), Tasks())
    requests = BuildRequests(*fakes)
    client: Any = types.SimpleNamespace(user="ann", name="ann")
    args = BuildProjectArgs("pro_1", "Boards")
    assert await requests.build_project(Context(client), args) == BuildProjectData("pkg_1")
    task = f"{TaskKind.BUILD.value} 'Building the package Boards' of ann"
    assert seen == ["locked ann ('pro_1',)", task, "build pro_1 Boards", "finished", "unlocked", "added pkg_1"]
    client.user = None
    with pytest.raises(RequestRefused):
        await requests.build_project(Context(client), args)

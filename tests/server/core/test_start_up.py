"""The server neither imports unneeded modules at its start nor parses known sources."""

import ast
import json
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

import pytest

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_server.app import running_server
from arcor2_server.documents import saved_problems
from arcor2_server.files import write_private
from arcor2_server.settings import ServerSettings

MODULES = 1281
"""Budget of imported modules. Each costs about 0.6 ms of every start; imports take four fifths of it."""
NOT_NEEDED = {
    "alembic",
    "cryptography",
    "hypothesis",
    "mako",
    "PIL",
    "pydantic",
    "pygments",
    "pytest",
    "rich",
    "schemathesis",
    "transforms3d",
}
"""Installed packages that a start must not import."""
START = """
import asyncio, json, sys
from pathlib import Path
import arcor2_server.cli.main, arcor2_server.cli.serve
from arcor2_server.app import create_app, running_server
from arcor2_server.settings import ServerSettings
async def start():
    async with running_server(ServerSettings(data_dir=Path(sys.argv[1]))) as services:
        create_app(services)
        print(json.dumps(sorted(sys.modules)))
asyncio.run(start())
"""


async def test_a_start_imports_only_needed_modules(tmp_path: Path) -> None:
    async with running_server(ServerSettings(data_dir=tmp_path)):
        pass  # creates the database, which takes more imports than opening it
    started = subprocess.run(
        [sys.executable, "-c", START, str(tmp_path)], stdout=subprocess.PIPE, check=True, timeout=60
    )
    imported = json.loads(started.stdout.splitlines()[-1])
    assert not NOT_NEEDED & {name.partition(".")[0] for name in imported}
    assert len(imported) <= MODULES


async def test_a_second_start_parses_no_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = ServerSettings(data_dir=tmp_path)
    async with running_server(settings) as first:
        known = first.types.metas()
    monkeypatch.setattr(ast, "parse", None)
    async with running_server(settings) as second:
        assert second.types.metas() == known
        assert second.types.actions("TimeActions")


async def test_a_damaged_analysis_is_repeated(tmp_path: Path) -> None:
    settings = ServerSettings(data_dir=tmp_path)
    async with running_server(settings) as first:
        known = first.types.metas()
    intact = settings.analysis_file.read_bytes()
    settings.analysis_file.write_bytes(intact[: len(intact) // 3])
    async with running_server(settings) as second:
        assert second.types.metas() == known
    assert settings.analysis_file.read_bytes() == intact


async def test_the_newest_problems_are_stored_after_a_slow_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = ServerSettings(data_dir=tmp_path)
    overtaken = threading.Event()
    sizes: list[int] = []

    def write(path: Path, content: bytes) -> None:
        sizes.append(len(content))
        if len(sizes) == 1:
            overtaken.wait(0.5)
        write_private(path, content)
        overtaken.set()

    async with running_server(settings) as server:
        monkeypatch.setattr(saved_problems, "write_private", write)
        for number in range(2):
            await server.storage.put_scene(Scene(f"scene {number}", id=f"scn_{number}"))
            await server.saved_problems.of_scenes(await server.storage.scenes())
    assert settings.problems_file.stat().st_size == max(sizes)


async def test_a_second_start_checks_no_saved_document(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = ServerSettings(data_dir=tmp_path)
    async with running_server(settings) as first:
        await first.storage.put_scene(Scene("good", id="scn_good"))
        lamp = SceneObject("lamp", "NoSuchType", id="obj_lamp")
        await first.storage.put_scene(Scene("bad", id="scn_bad", objects=[lamp]))
        await first.storage.put_project(Project("project", "scn_bad", id="pro_bad"))
        scenes, projects = await first.storage.scenes(), await first.storage.projects()
        of_scenes = await first.saved_problems.of_scenes(scenes)
        of_projects = await first.saved_problems.of_projects(projects, scenes)
        assert of_scenes["scn_good"] == []
        assert "NoSuchType" in of_scenes["scn_bad"][0].text
        assert of_projects["pro_bad"] == of_scenes["scn_bad"]
    async with running_server(settings) as second:
        read: list[str] = []
        original = second.storage.scenes_with_ids

        async def counted(keys: Sequence[str]) -> list[Scene]:
            read.extend(keys)
            return await original(keys)

        monkeypatch.setattr(second.storage, "scenes_with_ids", counted)
        assert await second.saved_problems.of_scenes(scenes) == of_scenes
        assert await second.saved_problems.of_projects(projects, scenes) == of_projects
        assert read == []
        await second.storage.put_scene(Scene("bad", id="scn_bad"))
        scenes = await second.storage.scenes()
        assert (await second.saved_problems.of_scenes(scenes))["scn_bad"] == []
        assert (await second.saved_problems.of_projects(projects, scenes))["pro_bad"] == []
        assert read == ["scn_bad", "scn_bad"]
    settings.problems_file.write_bytes(b"damaged")
    async with running_server(settings) as third:
        assert (await third.saved_problems.of_scenes(scenes))["scn_bad"] == []

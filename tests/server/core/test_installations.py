"""A driver that pip installs into a running server's environment can be used without a restart."""

import asyncio
import shutil
import sys
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from arcor2_hw.client import Client
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.object_type import ObjectTypeMeta
from tests.server.core.serving import ServerProcess, running

WITHIN = 30.0
LAMP = """
from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class AcmeLamp(Generic):
    '''A lamp.'''

    _ABSTRACT = False
    display_name = "ACME lamp"

    @action
    def light(self, *, an: str | None = None) -> int:
        '''Switch on; return the brightness, lx.'''
        return 70
"""
FILES = {
    "acme_lamp/__init__.py": "",
    "acme_lamp/lamp.py": LAMP,
    "acme_lamp-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: acme-lamp\nVersion: 1.0\n",
    "acme_lamp-1.0.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    "acme_lamp-1.0.dist-info/entry_points.txt": "[arcor2_hw.object_types]\nAcmeLamp = acme_lamp.lamp:AcmeLamp\n",
}


async def install(wheel: Path, target: Path) -> None:
    """Install a driver as a user does, from a local wheel."""
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in FILES.items():
            archive.writestr(name, text)
        archive.writestr("acme_lamp-1.0.dist-info/RECORD", "".join(f"{name},,\n" for name in FILES))
    options = ("--quiet", "--no-index", "--no-deps", "--disable-pip-version-check", "--target", str(target))
    pip = await asyncio.create_subprocess_exec(sys.executable, "-m", "pip", "install", *options, str(wheel))
    assert await pip.wait() == 0


@pytest.fixture
def packages(tmp_path: Path) -> Path:
    folder = tmp_path / "packages"
    folder.mkdir()
    return folder


@pytest.fixture
async def server(tmp_path: Path, packages: Path) -> AsyncIterator[ServerProcess]:
    async with running(tmp_path / "data", PYTHONPATH=str(packages)) as server:
        yield server


async def changed(client: Client, kind: ChangeType) -> dict[str, ObjectTypeMeta]:
    """Return the types of the next ChangedObjectTypes event, which must be of this kind."""
    event = await client.next_event("ChangedObjectTypes", timeout=WITHIN)
    assert event.change_type is kind
    return {meta.type: meta for meta in event.data}


async def test_a_driver_works_as_soon_as_it_is_installed(server: ServerProcess, packages: Path, tmp_path: Path) -> None:
    async with Client(server.url, "ann") as client:
        assert "AcmeLamp" not in {meta.type for meta in await client.get_object_types()}
        await install(tmp_path / "acme_lamp-1.0-py3-none-any.whl", packages)
        meta = (await changed(client, ChangeType.ADD))["AcmeLamp"]
        assert (meta.built_in, meta.disabled, meta.display_name) == (True, False, "ACME lamp")

        await client.new_scene("shop")
        await client.add_object_to_scene(name="lamp", type="AcmeLamp")
        await client.start_scene()
        while (await client.next_event("SceneState", timeout=WITHIN)).data.state.value != "started":
            pass
        await client.stop_scene()
        await client.close_scene(force=True)

        shutil.rmtree(packages / "acme_lamp-1.0.dist-info")
        assert set(await changed(client, ChangeType.REMOVE)) == {"AcmeLamp"}


async def test_a_broken_installation_is_named_and_harms_no_other_type(
    server: ServerProcess, packages: Path, tmp_path: Path
) -> None:
    async with Client(server.url, "ann") as client:
        before = {meta.type for meta in await client.get_object_types()}
        for name, points in (
            ("bad_points", b"[arcor2_hw.object_types]\nBadType = !!\n"),
            ("not_text", b"\xff\xfe\x00"),
            ("no_module", b"[arcor2_hw.object_types]\nGone = no_such_package.gone:Gone\n"),
        ):
            (packages / f"{name}-1.0.dist-info").mkdir()
            (packages / f"{name}-1.0.dist-info" / "entry_points.txt").write_bytes(points)
        found = await changed(client, ChangeType.ADD)
        problems = {name: meta.problem for name, meta in found.items()}
        assert set(problems) == {"BadType", "NotText", "Gone"}
        assert all(meta.disabled and meta.problem is not UNSET for meta in found.values())
        assert "the entry point BadType is invalid" in str(problems["BadType"])
        assert "distribution not_text cannot be read" in str(problems["NotText"])
        assert "no_such_package.gone" in str(problems["Gone"])
        assert before < {meta.type for meta in await client.get_object_types()}
    # A server that starts with these installations names the problems, too.
    await server.stop()
    await server.start()
    async with Client(server.url, "ann") as client:
        metas = {meta.type: meta for meta in await client.get_object_types()}
        assert metas["NotText"].disabled
        await install(tmp_path / "acme_lamp-1.0-py3-none-any.whl", packages)
        assert not (await changed(client, ChangeType.ADD))["AcmeLamp"].disabled

"""Packages on disk and in a cell host, as clients see them."""

import asyncio
import base64
import io
import os
import signal
import stat
import zipfile
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import Action, ActionPoint, Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidPackage, NotFound
from arcor2_server.errors import RequestRefused
from arcor2_server.storage import packages as packages_module
from arcor2_server.storage.packages import Packages
from tests.runtime.conftest import Package, scene_object
from tests.server.core.serving import until

from .conftest import PATIENCE, Recorder, Server, serving

LAMP = """
class Lamp(Generic):
    _ABSTRACT = False
    @action
    def blink(self, times: int, *, an: str | None = None) -> int:
        return times
    @action
    def wait(self, *, an: str | None = None) -> None:
        time.sleep(300)
    @action
    def hold_all(self, after: float, *, an: str | None = None) -> None:
        time.sleep(after)
        ctypes.PyDLL(None).sleep(300)
"""
OBJ = "obj_lamp"
NAMES = ("a", "b", "c")
PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    modified="2026-01-02T00:00:00+00:00",
    action_points=[
        ActionPoint("p", Position(), id="acp_1", actions=[Action(n, f"{OBJ}/blink", f"act_{n}") for n in NAMES])
    ],
)


def write(server: Server, body: str, package_id: str = "pkg_1") -> Path:
    directory = server.services.settings.packages_dir / package_id
    lines = f'lamp = res.objects["{OBJ}"]\n' + body
    return Package(directory).write({"Lamp": LAMP}, [scene_object("lamp", "Lamp")], PROJECT, lines)


def states(events: list[dict[str, Any]]) -> list[str]:
    return [e["data"].get("state", e["event"]) if "data" in e else e["event"] for e in events]


async def until_stopped(server: Server, client: Recorder | None = None) -> list[str]:
    """Wait for the end of the run, and return the received states and other events in order."""
    client = client or server.client
    await until(lambda: client.got and client.got[-1]["event"] == "ShowMainScreen")
    return states(client.got)


@serving()
async def test_clients_see_each_state_of_a_run(server: Server) -> None:
    write(server, 'for n in ("a", "b"): lamp.blink(2, an=n)')
    await server.ask("RunPackage", {"id": "pkg_1"})
    action = ["ActionStateBefore", "ActionStateAfter"]
    assert await until_stopped(server) == [
        "started",
        "response RunPackage",
        "running",
        "PackageInfo",
        *action * 2,
        "stopped",
        "ShowMainScreen",
    ]
    assert server.client.got[0]["data"] == {"state": "started", "package_id": "pkg_1"}
    assert server.client.got[5]["data"] == {"action_id": "act_a", "results": ["2"]}
    assert server.client.got[-1]["data"] == {"what": "PackagesList", "highlight": "pkg_1"}
    async with asyncio.timeout(PATIENCE):  # the run is stored concurrently
        while not isinstance((await server.ask("ListPackages"))[0].package_meta.executed, str):
            await asyncio.sleep(0.02)
    [summary] = await server.ask("ListPackages")
    assert (summary.id, summary.package_meta.name, summary.project_meta.name) == ("pkg_1", "demo", "project")
    server.client.got.clear()
    await server.ask("RunPackage", {"id": "pkg_1"})  # it can run again
    assert (await until_stopped(server))[-2:] == ["stopped", "ShowMainScreen"]


@serving()
async def test_each_run_state_allows_its_requests(server: Server) -> None:
    write(server, 'for n in ("a", "b"): lamp.blink(2, an=n)\nlamp.wait(an="c")')
    idle = ("StopPackage", "PausePackage", "ResumePackage", "StepAction")
    for name in idle:
        with pytest.raises(RequestRefused):
            await server.ask(name)
    assert server.services.execution.greeting() == []
    await server.ask("RunPackage", {"id": "pkg_1", "start_paused": True})
    await server.client.state("paused", "PackageState")
    execution = server.services.execution
    assert execution.running
    for name, args in (("RunPackage", {"id": "pkg_1"}), ("PausePackage", None), ("DeletePackage", {"id": "pkg_1"})):
        with pytest.raises(RequestRefused):
            await server.ask(name, args)
    assert [e.event for e in execution.greeting()] == ["PackageState", "PackageInfo", "ActionStateBefore"]
    assert msgspec.to_builtins(execution.greeting()[0].data)["state"] == "paused"
    server.client.got.clear()
    await server.ask("StepAction")
    await server.client.state("paused", "PackageState")
    await server.ask("ResumePackage")
    await server.client.event("ActionStateBefore", lambda data: data["action_id"] == "act_c")
    server.client.got.clear()
    await server.ask("StopPackage")
    assert await until_stopped(server) == ["stopping", "response StopPackage", "stopped", "ShowMainScreen"]
    assert execution.greeting() == []


@serving()
async def test_a_killed_host_ends_the_run(server: Server) -> None:
    write(server, 'lamp.wait(an="a")')
    await server.ask("RunPackage", {"id": "pkg_1"})
    await server.client.event("ActionStateBefore")
    host = server.services.execution._host.host
    assert host is not None
    os.kill(host.pid, signal.SIGKILL)
    lost = await server.client.event("ProjectException")
    await server.client.state("stopped", "PackageState")
    assert "SIGKILL" in lost["message"]
    assert not lost["handled"]


@serving()
async def test_a_program_that_holds_the_interpreter_is_killed(server: Server) -> None:
    server.services.execution.stop_within = 0.3
    write(server, 'lamp.hold_all(0.2, an="a")')  # the event is sent first
    await server.ask("RunPackage", {"id": "pkg_1"})
    await server.client.event("ActionStateBefore")
    await asyncio.sleep(0.3)
    await server.ask("StopPackage")
    await server.client.state("stopped", "PackageState")
    assert all(event["event"] != "ProjectException" for event in server.client.got)


@serving()
async def test_a_program_that_hangs_during_its_start_can_be_stopped(server: Server) -> None:
    server.services.execution.stop_within = 0.1
    write(server, "")
    script = server.services.settings.packages_dir / "pkg_1" / "script.py"
    script.write_text("import ctypes\nctypes.PyDLL(None).sleep(300)")
    await server.ask("RunPackage", {"id": "pkg_1"})
    with pytest.raises(RequestRefused):
        await server.ask("StopPackage")
    await until(lambda: not server.services.execution.board.answering)
    await server.ask("StopPackage")
    await server.client.state("stopped", "PackageState")


@serving()
async def test_a_script_error_is_reported(server: Server) -> None:
    write(server, "print('x' * 200_000)\nraise KeyError('gone')")
    await server.ask("RunPackage", {"id": "pkg_1"})
    exception = await server.client.event("ProjectException")
    assert (exception["type"], exception["handled"]) == ("KeyError", False)
    await server.client.state("stopped", "PackageState")
    error = server.services.execution.program.error
    assert error is not None
    assert error.type == "KeyError"


@serving()
async def test_a_run_and_an_online_scene_exclude_each_other(server: Server) -> None:
    server.types.add("Lamp", LAMP)
    await server.open(Scene("scene", id="scn_1", objects=[scene_object("lamp", "Lamp")]))
    write(server, 'lamp.wait(an="a")')
    await server.start()
    with pytest.raises(RequestRefused, match="online"):
        await server.ask("RunPackage", {"id": "pkg_1"})
    await server.ask("StopScene")
    await server.client.state("stopped")
    await server.ask("RunPackage", {"id": "pkg_1"})
    with pytest.raises(RequestRefused, match="program"):
        await server.ask("StartScene")
    await server.client.event("ActionStateBefore")
    await server.ask("StopPackage")
    await server.client.state("stopped", "PackageState")


@serving()
async def test_running_an_invalid_package_is_refused(server: Server) -> None:
    for package_id, error in (
        ("pkg_none", NotFound),
        ("../pkg", InvalidPackage),
        ("", InvalidPackage),
        (".", InvalidPackage),
    ):
        with pytest.raises(error):
            await server.ask("RunPackage", {"id": package_id})
    assert not server.services.execution.busy
    assert server.client.got == []


# ---------------------------------------------------------------------------------------------------- on disk
def zipped(files: dict[str, bytes], mode: int = 0) -> str:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (mode or (stat.S_IFREG | 0o644)) << 16
            archive.writestr(entry, content)
    return base64.b64encode(buffer.getvalue()).decode()


SCRIPT = {"script.py": b"pass\n"}


@serving()
async def test_packages_are_uploaded_renamed_and_deleted(server: Server) -> None:
    meta = b'{"name": "first", "built": "2026-01-01T00:00:00+00:00"}'
    upload = {"id": "pkg_u", "data": zipped(SCRIPT | {"package.json": meta, "old.txt": b""})}
    await server.ask("UploadPackage", upload)
    changed = server.client.got[-1]
    assert (changed["event"], changed["change_type"], changed["data"]["id"]) == ("PackageChanged", "add", "pkg_u")
    assert "project_meta" not in changed["data"]
    await server.ask("UploadPackage", {"id": "pkg_u", "data": zipped(SCRIPT)})
    directory = server.services.settings.packages_dir
    assert [p.name for p in (directory / "pkg_u").iterdir()] == ["script.py"]
    assert [p.name for p in directory.iterdir()] == ["pkg_u"]
    await server.ask("RenamePackage", {"package_id": "pkg_u", "new_name": "second"})
    assert server.client.got[-1]["change_type"] == "update"
    assert server.client.got[-1]["data"]["package_meta"]["name"] == "second"
    await server.ask("DeletePackage", {"id": "pkg_u"})
    assert server.client.got[-1]["change_type"] == "remove"
    assert await server.ask("ListPackages") == []
    assert list(directory.iterdir()) == []
    for name, args in (("DeletePackage", {"id": "pkg_u"}), ("RenamePackage", {"package_id": "pkg_u", "new_name": "x"})):
        with pytest.raises(NotFound):
            await server.ask(name, args)


@pytest.mark.parametrize(
    "data",
    [
        "no base64!",
        base64.b64encode(b"no zip").decode(),
        zipped({"other.py": b""}),
        zipped(SCRIPT | {"../outside": b"x"}),
        zipped(SCRIPT | {"a/../../outside": b"x"}),
        zipped(SCRIPT | {"/outside": b"x"}),
        zipped(SCRIPT | {"..\\outside": b"x"}),
        zipped({"script.py": b"/etc/passwd"}, stat.S_IFLNK | 0o777),
        zipped({"script.py": b"a", "script.py/inner": b"b"}),
        base64.b64encode(base64.b64decode(zipped(SCRIPT))[:40]).decode(),
    ],
)
def test_a_refused_upload_changes_nothing(tmp_path: Path, data: str) -> None:
    root = tmp_path / "packages"
    packages = Packages(root)
    packages.upload("pkg_1", zipped(SCRIPT))
    with pytest.raises(InvalidPackage):
        packages.upload("pkg_1", data)
    assert sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*")) == [
        "packages",
        "packages/pkg_1",
        "packages/pkg_1/script.py",
    ]


def test_a_zip_bomb_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packages_module, "MAX_SIZE", 3_000_000)
    packages = Packages(tmp_path)
    packages.upload("pkg_1", zipped(SCRIPT | {"big": bytes(2_900_000)}))
    with pytest.raises(InvalidPackage, match="3000000"):
        packages.upload("pkg_1", zipped(SCRIPT | {"big": bytes(2_000_000), "bigger": bytes(2_000_000)}))
    monkeypatch.setattr(packages_module, "MAX_FILES", 3)
    with pytest.raises(InvalidPackage):
        packages.upload("pkg_1", zipped(SCRIPT | {str(n): b"" for n in range(3)}))


@pytest.mark.parametrize("package_id", ["", ".", "..", "../x", "a/b", "/x", ".hidden", "a\0b", "x" * 200, "a\n"])
def test_package_ids_are_not_used_as_paths(tmp_path: Path, package_id: str) -> None:
    (tmp_path / "script.py").write_text("")
    for act in (Packages(tmp_path / "packages").directory, Packages(tmp_path / "packages").delete):
        with pytest.raises(InvalidPackage):
            act(package_id)

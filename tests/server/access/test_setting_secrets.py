"""Secret settings reach the device, and are never sent to clients or stored in documents."""

import asyncio
import contextlib
import hashlib
import io
import stat
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import msgspec
import pytest
from websockets.asyncio.client import connect

from arcor2_hw.client import Client
from arcor2_hw.client.errors import BadRequest
from arcor2_hw.data import rpc
from arcor2_hw.data.base import Unset
from arcor2_hw.data.cell import Cell, CellDevice, overlay
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Flow, Project
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.data.secret import HIDDEN, ObjectSecrets, is_reference
from arcor2_hw.exceptions import AddressChanged, InvalidData
from arcor2_server.app import running_server
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.secret_store import Secret
from arcor2_server.storage.setting_secrets import SettingSecrets
from tests.server.core.serving import ServerProcess, running

CODE, OTHER, UNSAVED = "swordfish-4711", "halibut-0815", "haddock-42"
CLEAR = ("clear-password-7", "clear-override-8", "clear-unsaved-9")
"""The passwords in `clear_secrets.zip`: of the saved scene and the package, of overrides, of the open scene."""

VAULT = '''
"""A device with a secret."""
import dataclasses
import hashlib

from arcor2_hw.actions import action
from arcor2_hw.exceptions import NotConnected
from arcor2_hw.objects import Generic, Settings


@dataclasses.dataclass
class VaultSettings(Settings):
    digest: str
    host: str = "plc1"
    code: str = dataclasses.field(default="", repr=False, metadata={"secret": True})


class Vault(Generic):
    """A vault that opens for the right code."""

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: VaultSettings) -> None:
        super().__init__(obj_id, name, settings)
        if hashlib.sha256(settings.code.encode()).hexdigest() != settings.digest:
            raise NotConnected("the code is wrong")

    @action
    def ring(self, *, an: str | None = None) -> None:
        """Ring."""
'''


def setting(name: str, value: str) -> Parameter:
    return Parameter(name, "string", msgspec.json.encode(value).decode())


def digest(code: str) -> Parameter:
    """Return the digest by which the vault's settings identify the correct code."""
    return setting("digest", hashlib.sha256(code.encode()).hexdigest())


def leaks(directory: Path, *secrets: str, except_in: str = "secrets.json") -> list[str]:
    """Return the files that contain one of the secrets."""
    return [
        str(path.relative_to(directory))
        for path in directory.rglob("*")
        if path.is_file() and path.name != except_in and any(each.encode() in path.read_bytes() for each in secrets)
    ]


def open_to_others(directory: Path) -> list[str]:
    """Return the paths that other users than the owner may read, including the directory itself."""
    found = [path for path in (directory, *directory.iterdir()) if path.stat().st_mode & 0o077]
    return [f"{path.name} {stat.S_IMODE(path.stat().st_mode):o}" for path in found]


@contextlib.asynccontextmanager
async def listening(server: ServerProcess) -> AsyncIterator[list[str]]:
    """Collect every message that is sent to another client."""
    received: list[str] = []
    async with connect(server.url) as socket:
        yield received
        with contextlib.suppress(TimeoutError):
            while True:
                received.append(str(await asyncio.wait_for(socket.recv(), 0.2)))


async def test_a_secret_is_sent_only_to_the_device(tmp_path: Path) -> None:
    data = tmp_path / "data"
    async with (
        running(data) as server,
        listening(server) as received,
        Client(server.url, "ann") as client,
        httpx.AsyncClient(timeout=60, base_url=server.url.replace("ws", "http")) as http,
    ):
        call = client.call
        uploaded = await http.put("/object-types", json={"id": "Vault", "name": "Vault", "source": VAULT})
        assert uploaded.status_code == 200, uploaded.text
        (vault,) = [meta for meta in await call("GetObjectTypes") if meta.type == "Vault"]
        assert {each.name: each.secret for each in vault.settings} == {
            "digest": msgspec.UNSET,
            "host": msgspec.UNSET,
            "code": True,
        }

        await call("NewScene", rpc.NewSceneArgs("bank"))
        given = [digest(OTHER), setting("code", CODE)]
        await call("AddObjectToScene", rpc.AddObjectToSceneArgs("vault", "Vault", parameters=given))
        obj = (await client.next_event("SceneObjectChanged")).data
        reference = msgspec.json.decode(obj.parameters[1].value)
        assert is_reference(reference)
        # The secret does not change if a client sends the received reference, or `***`.
        await call("WriteLock", rpc.WriteLockArgs(obj.id))
        for unchanged in (reference, HIDDEN):
            again = [digest(CODE), setting("code", unchanged)]
            await call("UpdateObjectParameters", rpc.UpdateObjectParametersArgs(obj.id, again))
            updated = (await client.next_event("SceneObjectChanged")).data
            assert msgspec.json.decode(updated.parameters[1].value) == reference
        await call("WriteUnlock", rpc.WriteUnlockArgs(obj.id))
        await call("SaveScene")
        await call("StartScene")
        assert await state(client) == "started"
        await call("StopScene")
        assert await state(client) == "stopped"

        # The same holds for REST.
        scene = (await call("ListScenes"))[0]
        stored = (await http.get(f"/scenes/{scene.id}")).json()
        assert stored["objects"][0]["parameters"][1]["value"] == f'"{reference}"'
        await call("CloseScene")
        stored["objects"][0]["parameters"][1]["value"] = f'"{HIDDEN}"'
        assert (await http.put("/scenes", json=stored)).status_code == 200
        stored = (await http.get(f"/scenes/{scene.id}")).json()
        assert stored["objects"][0]["parameters"][1]["value"] == f'"{reference}"'

        # An override in a project, and a package, which gets the secret from the server.
        await call("NewProject", rpc.NewProjectArgs(scene.id, "ringing"))
        project = (await client.next_event("OpenProject")).data.project
        await call("WriteLock", rpc.WriteLockArgs(obj.id))
        await call("AddOverride", rpc.AddOverrideArgs(obj.id, digest(OTHER)))
        await call("AddOverride", rpc.AddOverrideArgs(obj.id, setting("code", UNSAVED)))
        await call("UpdateOverride", rpc.UpdateOverrideArgs(obj.id, setting("code", OTHER)))
        await call("Undo")
        await call("Redo")
        await call("WriteUnlock", rpc.WriteUnlockArgs(obj.id))
        await call("AddActionPoint", rpc.AddActionPointArgs("there", Position()))
        point = (await client.next_event("ActionPointChanged")).data
        await call("AddAction", rpc.AddActionArgs(point.id, "ring", f"{obj.id}/ring", [], [Flow()]))
        ring = (await client.next_event("ActionChanged")).data.id
        await call("AddLogicItem", rpc.AddLogicItemArgs("START", ring))
        await call("AddLogicItem", rpc.AddLogicItemArgs(ring, "END"))
        await call("SaveProject")
        assert (await http.put(f"/projects/{project.id}/object-parameters", json=overridden(obj.id))).status_code == 200
        answers = [
            (await http.get(path)).text
            for path in (f"/projects/{project.id}", f"/projects/{project.id}/object-parameters", "/api/devices")
        ]
        built = await call("BuildProject", rpc.BuildProjectArgs(project.id, "ringing"))
        await call("CloseProject")
        package = (await http.get(f"/packages/{built.package_id}")).content
        await call("RunPackage", rpc.RunPackageArgs(built.package_id))
        assert (await client.next_event("ActionStateAfter")).data.action_id == ring
        await call("StopPackage")
        while (await client.next_event("PackageState")).data.state is not PackageStateEnum.STOPPED:
            pass

        # The server removes a secret in clear text from an uploaded package.
        files = {"executionPackage": clear(package)}
        assert (await http.post(f"/packages/{built.package_id}", files=files)).is_success
        package = (await http.get(f"/packages/{built.package_id}")).content
        diagnosis = (await http.get("/api/diagnosis")).content
    with zipfile.ZipFile(io.BytesIO(package)) as files:
        assert reference.encode() not in files.read("data/scene.json")
        assert HIDDEN.encode() in files.read("data/scene.json")
        answers += [files.read(name).decode(errors="replace") for name in files.namelist()]
    with zipfile.ZipFile(io.BytesIO(diagnosis)) as files:
        answers += [files.read(name).decode(errors="replace") for name in files.namelist()]
    answers += received
    assert len(received) > 20
    for secret in (CODE, OTHER, UNSAVED):
        assert [answer for answer in answers if secret in answer] == []
    assert leaks(tmp_path, CODE, OTHER, UNSAVED) == []
    assert CODE in (data / "secrets.json").read_text()
    assert open_to_others(data) == []


async def state(client: Client) -> str:
    while True:
        found = (await client.next_event("SceneState")).data
        if found.state in ("started", "stopped"):
            return str(found.state)


def overridden(object_id: str) -> list[dict[str, Any]]:
    return [{"id": object_id, "parameters": [{"name": "code", "type": "string", "value": f'"{OTHER}"'}]}]


def clear(package: bytes) -> bytes:
    """Replace a secret in a package with its clear text."""
    target = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(package)) as files, zipfile.ZipFile(target, "w") as changed:
        for name in files.namelist():
            content = files.read(name)
            if name == "data/scene.json":
                scene = msgspec.json.decode(content)
                scene["objects"][0]["parameters"][1]["value"] = f'"{CODE}"'
                content = msgspec.json.encode(scene)
            changed.writestr(name, content)
    return target.getvalue()


async def test_data_with_secrets_in_clear_is_migrated(tmp_path: Path) -> None:
    """Version 0.1 wrote the directory, with secrets in clear, and was killed while a scene was open."""
    with zipfile.ZipFile(Path(__file__).parent / "clear_secrets.zip") as files:
        files.extractall(tmp_path)
    for path in tmp_path.iterdir():
        path.chmod(0o755 if path.is_dir() else 0o644)
    tmp_path.chmod(0o755)
    assert leaks(tmp_path, *CLEAR)
    references = []
    for _ in range(2):
        async with running_server(ServerSettings(data_dir=tmp_path)) as services:
            store = services.secrets.store
            scene = services.session.require_scene()
            (opened,) = [each for obj in scene.objects for each in obj.parameters if each.name == "password"]
            saved = await services.storage.scene(scene.id)
            (stored,) = [each for obj in saved.objects for each in obj.parameters if each.name == "password"]
            (project,) = [await services.storage.project(bare.id) for bare in await services.storage.projects()]
            (override,) = project.object_overrides[0].parameters
            found = [store.find(msgspec.json.decode(each.value)) for each in (opened, stored, override)]
            assert [None if each is None else each.value for each in found] == [CLEAR[2], CLEAR[0], CLEAR[1]]
            (directory,) = (tmp_path / "packages").iterdir()
            (packaged,) = services.secrets.values_for_package(directory).values()
            assert packaged == ObjectSecrets({"password": CLEAR[1]})
            references.append((opened, stored, override))
            assert services.session.has_changes
            # Undo returns to the saved password: it is one secret, not two.
            await services.session.commit(
                "ann", [change.inverse() for edit in reversed(services.session.history) for change in edit.changes]
            )
            assert not services.session.has_changes
            await services.session.commit(
                "ann", [change.inverse() for change in list(services.session.history)[-1].changes]
            )
        assert leaks(tmp_path, *CLEAR) == []
        private = ("documents", "journal", "secrets", "packages", tmp_path.name)
        assert [each for each in open_to_others(tmp_path) if each.startswith(private)] == []
    assert references[0] == references[1]


async def test_a_secret_reference_is_resolved_only_for_its_setting(tmp_path: Path) -> None:
    async with running_server(ServerSettings(data_dir=tmp_path)) as services:
        secrets = services.secrets
        (first,) = secrets.hide("YuMi", [setting("password", CODE)])
        (second,) = secrets.hide("YuMi", [setting("password", CODE)])
        assert first != second  # references do not reveal equal passwords
        assert secrets.hide("YuMi", [setting("password", CODE)], [first]) == [first]
        assert secrets.hide("YuMi", [first]) == [first]
        assert secrets.hide("YuMi", [setting("password", HIDDEN)], [first]) == [first]
        assert secrets.hide("YuMi", [setting("password", HIDDEN)]) == []  # the driver's default
        assert secrets.hide("YuMi", [setting("password", "")], [first]) == [setting("password", "")]
        assert secrets.hide("YuMi", [setting("host", CODE)]) == [setting("host", CODE)]
        (unknown,) = secrets.hide("Unknown", [setting("api_key", CODE)])
        assert is_reference(msgspec.json.decode(unknown.value))
        # A secret cannot be sent to another device.
        with pytest.raises(InvalidData, match="another setting"):
            secrets.hide("Other", [msgspec.structs.replace(first, name="api_key")])
        # A reference from another server is stored and reveals nothing.
        away = setting("password", HIDDEN + "0123456789abcdef")
        assert secrets.hide("YuMi", [away]) == [away]
        assert secrets.values_for(scene_with(setting("host", "yumi1"), away)) == {}


def scene_with(*parameters: Parameter) -> Scene:
    return Scene("bank", id="scn_1", objects=[SceneObject("yumi", "YuMi", Pose(), list(parameters), "obj_1")])


AGAIN = "Enter the code of 'vault' again: its host changed from plc1 to evil."


async def test_a_secret_is_not_sent_to_another_host(tmp_path: Path) -> None:
    async with (
        running(tmp_path / "data") as server,
        Client(server.url, "ann") as client,
        httpx.AsyncClient(timeout=60, base_url=server.url.replace("ws", "http")) as http,
    ):
        call = client.call
        await http.put("/object-types", json={"id": "Vault", "name": "Vault", "source": VAULT})
        await call("NewScene", rpc.NewSceneArgs("bank"))
        given = [digest(CODE), setting("code", CODE)]  # for the default host
        await call("AddObjectToScene", rpc.AddObjectToSceneArgs("vault", "Vault", parameters=given))
        obj = (await client.next_event("SceneObjectChanged")).data
        code = obj.parameters[1]
        await call("WriteLock", rpc.WriteLockArgs(obj.id))
        for unchanged in (code, setting("code", HIDDEN)):
            moved = [digest(CODE), setting("host", "evil"), unchanged]
            with pytest.raises(BadRequest, match=AGAIN) as refused:
                await call("UpdateObjectParameters", rpc.UpdateObjectParametersArgs(obj.id, moved))
            assert refused.value.reason == AddressChanged.code
        with pytest.raises(BadRequest, match=AGAIN.replace("vault", "thief")):
            await call("AddObjectToScene", rpc.AddObjectToSceneArgs("thief", "Vault", parameters=[*moved[:2], code]))
        # After the code is entered again, the host may change. Undo restores the previous host and code.
        moved = [digest(CODE), setting("host", "plc2"), setting("code", CODE)]
        await call("UpdateObjectParameters", rpc.UpdateObjectParametersArgs(obj.id, moved))
        entered = (await client.next_event("SceneObjectChanged")).data.parameters
        assert is_reference(msgspec.json.decode(entered[2].value))
        assert entered[2] != code
        await call("Undo")
        await call("WriteUnlock", rpc.WriteUnlockArgs(obj.id))
        await call("SaveScene")
        scene = (await call("ListScenes"))[0]
        stored = (await http.get(f"/scenes/{scene.id}")).json()
        assert stored["objects"][0]["parameters"] == msgspec.to_builtins(obj.parameters)
        await call("CloseScene")
        stored["objects"][0]["parameters"].append(msgspec.to_builtins(setting("host", "evil")))
        answer = await http.put("/scenes", json=stored)
        assert answer.is_client_error
        assert AGAIN in answer.text

        # Overrides are entered one after the other. A mismatch is refused when the scene starts.
        await call("NewProject", rpc.NewProjectArgs(scene.id, "ringing"))
        await call("WriteLock", rpc.WriteLockArgs(obj.id))
        await call("AddOverride", rpc.AddOverrideArgs(obj.id, setting("host", "evil")))
        await call("WriteUnlock", rpc.WriteUnlockArgs(obj.id))
        await call("StartScene")
        while not (found := (await client.next_event("SceneState")).data).message:
            assert found.state != "started"
        assert AGAIN in found.message
        if found.state != "stopped":
            assert await state(client) == "stopped"
        await call("WriteLock", rpc.WriteLockArgs(obj.id))
        await call("AddOverride", rpc.AddOverrideArgs(obj.id, setting("code", CODE)))
        await call("WriteUnlock", rpc.WriteUnlockArgs(obj.id))
        await call("StartScene")
        assert await state(client) == "started"
        await call("StopScene")


async def test_the_cell_host_gets_only_the_secrets_it_needs(tmp_path: Path) -> None:
    settings = ServerSettings(data_dir=tmp_path)
    async with running_server(settings) as services:
        secrets = services.secrets
        host = setting("host", "yumi1")
        (_, password) = secrets.hide("YuMi", [host, setting("password", CODE)])
        found = {"obj_1": ObjectSecrets({"password": CODE})}
        moved = "Enter the password of 'yumi' again: its host changed from yumi1 to {}."
        assert secrets.values_for(scene_with(host, password)) == found
        assert secrets.values_for(scene_with(setting("host", "YuMi1"), password)) == found
        withheld = secrets.values_for(scene_with(setting("host", "evil"), password))
        assert withheld["obj_1"].values == {}
        assert str(withheld["obj_1"].problem) == moved.format("evil")
        over = [SceneObjectOverride("obj_1", [setting("host", "evil")])]
        assert secrets.values_for(scene_with(host, password), over) == withheld
        package = tmp_path / "package"
        (package / "data").mkdir(parents=True)
        (package / "data" / "scene.json").write_bytes(msgspec.json.encode(scene_with(host, password)))
        for package_overrides, expected in (([], found), (over, withheld)):
            project = Project("ringing", "scn_1", id="pro_1", object_overrides=package_overrides)
            (package / "data" / "project.json").write_bytes(msgspec.json.encode(project))
            assert secrets.values_for_package(package) == expected
        # The cell file changes the device's address. A password entered afterwards is for the new address.
        cell = Cell([CellDevice("yumi", "YuMi", {"host": "yumi2"})])
        cell_secrets = SettingSecrets(services.types, secrets.store, cell)
        overrides = overlay(cell, scene_with(host, password))
        assert cell_secrets.values_for(scene_with(host, password), overrides)["obj_1"].problem.text == moved.format(
            "yumi2"
        )
        (_, again) = cell_secrets.hide("YuMi", [host, setting("password", CODE)], [host, password], name="yumi")
        assert cell_secrets.values_for(scene_with(host, again), overrides) == found
        # A secret reaches only the setting for which it was entered, and only if the object's id is unique.
        assert secrets.values_for(scene_with(host, msgspec.structs.replace(password, name="user"))) == {}
        duplicates = scene_with(setting("host", "evil")).objects + scene_with(host, password).objects
        assert secrets.values_for(Scene("bank", id="scn_1", objects=duplicates)) == {}
        # A secret without an address belongs to the first address with which it is used.
        (unbound,) = [setting("password", secrets.store.add(Secret("YuMi", "password", OTHER)))]
        with pytest.raises(AddressChanged, match=moved.format("evil")):
            secrets.hide("YuMi", [setting("host", "evil"), unbound], [host, unbound], name="yumi", check=True)
        assert secrets.values_for(scene_with(host, unbound)) == {"obj_1": ObjectSecrets({"password": OTHER})}


async def test_a_secret_default_is_not_sent(tmp_path: Path) -> None:
    async with running_server(ServerSettings(data_dir=tmp_path)) as services:
        (password,) = [each for each in services.types.meta("YuMi").settings if each.name == "password"]
        assert isinstance(password, ParameterMeta)
        assert not isinstance(password.default_value, Unset)
        assert (password.secret, msgspec.json.decode(password.default_value)) == (True, HIDDEN)

"""The client of the REST API: saved documents, assets and packages."""

import os
import re
import ssl
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self, TypeVar
from urllib.parse import quote

import httpx
import msgspec
from msgspec import UNSET

from arcor2_hw.client.errors import STATUSES, RequestFailed
from arcor2_hw.data.base import Data, Timestamp, Unset
from arcor2_hw.data.object_type import Model3dType, Models, ObjectTypeSource
from arcor2_hw.data.project import Project, ProjectParameter
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.data.scene import Scene, SceneObjectOverride
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, InvalidData

T = TypeVar("T")
TOKEN_VARIABLE: Final = "ARCOR2_HW_TOKEN"  # noqa: S105 - the name of a variable, not a token
_HUMP: Final = re.compile(r"(?<=[a-z0-9])([A-Z])")
_MODELS: Final = {kind.__name__.lower(): kind for kind in Models.__args__}


class Listed(Data, frozen=True):
    """One entry of a list of documents."""

    id: str
    name: str
    created: Timestamp
    modified: Timestamp
    description: str | Unset = UNSET


class Asset(Data, frozen=True):
    """Metadata of an asset: a mesh, or a robot model."""

    id: str
    created: Timestamp
    modified: Timestamp
    file_name: str | Unset = UNSET
    description: str | Unset = UNSET


class ModelName(Data, frozen=True):
    """Name and kind of a collision model."""

    id: str
    type: Model3dType


class ImportedIds(Data, frozen=True):
    """Ids of the imported content of a package."""

    scene_id: str
    project_id: str


class _Type(Data, frozen=True):
    id: str
    name: str
    source: str
    description: str | Unset = UNSET
    model: ModelName | Unset = UNSET
    created: Timestamp | Unset = UNSET
    modified: Timestamp | Unset = UNSET
    modules: dict[str, str] | Unset = UNSET


class _Sources(Data, frozen=True):
    id: str
    script: str


@lru_cache(maxsize=4096)
def _snake(name: str) -> str:
    return _HUMP.sub(r"_\1", name).lower()


def _snaked(value: Any) -> Any:
    if isinstance(value, dict):
        return {_snake(key): _snaked(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_snaked(item) for item in value]
    return value


def _part(key: str) -> str:
    """Encode an id for a path."""
    return quote(key, safe="")


class Rest:
    """A client of the REST API. Use it as `async with Rest(url) as rest`, or as `client.rest`.

    Arguments are as those of Client. No request is repeated automatically.

    Raises:
        RequestFailed: The server refused a request, with a subclass for each kind of reason.
        ConnectionLost: The server does not answer.
        DeviceTimeout: The server did not answer in time.
        InvalidData: An answer is invalid.
    """

    def __init__(
        self, url: str, *, token: str | None = None, tls: ssl.SSLContext | None = None, timeout: float = 30.0
    ) -> None:
        token = token or os.environ.get(TOKEN_VARIABLE) or None
        self._url = url.replace("ws://", "http://", 1).replace("wss://", "https://", 1).rstrip("/")
        self._http = httpx.AsyncClient(
            base_url=self._url,
            headers={} if token is None else {"Authorization": f"Bearer {token}"},
            # Loading certificates takes 30 ms and is not needed for http.
            verify=self._url.startswith("https:") if tls is None else tls,
            timeout=timeout,
        )

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    # ------------------------------------------------------------------------------------------------ requests
    async def request(self, method: str, path: str, kind: type[T] | Any = Any, *, body: Any = UNSET, **more: Any) -> T:
        """Send a request and return the JSON answer as `kind`; `body` is sent as JSON, `more` is passed to httpx."""
        if body is not UNSET:
            more["content"] = msgspec.json.encode(body)
            more["headers"] = {"Content-Type": "application/json"}
        answer = await self._send(method, path, **more)
        try:
            return msgspec.convert(_snaked(msgspec.json.decode(answer.content)), kind)
        except msgspec.MsgspecError as error:
            raise InvalidData("The answer of {url}{path} is invalid.", str(error), url=self._url, path=path) from error

    async def _send(self, method: str, path: str, **more: Any) -> httpx.Response:
        try:
            answer = await self._http.request(method, path, **more)
        except httpx.TimeoutException as error:
            raise DeviceTimeout(
                "{url} did not answer {method} {path} in time.", str(error), url=self._url, method=method, path=path
            ) from error
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            raise ConnectionLost(
                "The server at {url} does not answer: {reason}", str(error), url=self._url, reason=error
            ) from error
        if not answer.is_success:
            raise _refusal(f"{method} {path}", answer.status_code, answer.content)
        return answer

    async def _file(self, path: str, target: Path, **more: Any) -> None:
        """Save an answer to a file, which is created only when it is complete."""
        partial = target.with_name(f".{target.name}.part")
        try:
            async with self._http.stream("GET", path, **more) as answer:
                if not answer.is_success:
                    raise _refusal(f"GET {path}", answer.status_code, await answer.aread())
                with partial.open("wb") as file:
                    async for chunk in answer.aiter_bytes():
                        file.write(chunk)
            partial.replace(target)
        except httpx.TimeoutException as error:
            raise DeviceTimeout("{url} did not send {path} in time.", str(error), url=self._url, path=path) from error
        except httpx.HTTPError as error:
            raise ConnectionLost(
                "{url} sent only a part of {path}: {reason}", str(error), url=self._url, path=path, reason=error
            ) from error
        finally:
            partial.unlink(missing_ok=True)

    # ------------------------------------------------------------------------------------------------ scenes
    async def scenes(self) -> list[Listed]:
        """List the saved scenes."""
        return await self.request("GET", "/scenes", list[Listed])

    async def scene(self, key: str) -> Scene:
        """Return a saved scene."""
        return await self.request("GET", f"/scenes/{_part(key)}", Scene)

    async def put_scene(self, scene: Scene) -> None:
        """Save a new or changed scene."""
        await self.request("PUT", "/scenes", body=scene)

    async def delete_scene(self, key: str) -> None:
        """Delete a saved scene."""
        await self.request("DELETE", f"/scenes/{_part(key)}")

    # ------------------------------------------------------------------------------------------------ projects
    async def projects(self) -> list[Listed]:
        """List the saved projects."""
        return await self.request("GET", "/projects", list[Listed])

    async def project(self, key: str) -> Project:
        """Return a saved project."""
        return await self.request("GET", f"/projects/{_part(key)}", Project)

    async def put_project(self, project: Project) -> None:
        """Save a new or changed project exactly as it is. Its scene has to be saved before."""
        await self.request("PUT", "/projects", body=project, params={"exact": "true"})

    async def delete_project(self, key: str) -> None:
        """Delete a saved project and its script."""
        await self.request("DELETE", f"/projects/{_part(key)}")

    async def project_script(self, key: str) -> str:
        """Return the handwritten script of a project.

        Raises:
            ResourceNotFound: The project has none.
        """
        return (await self.request("GET", f"/projects/{_part(key)}/sources", _Sources)).script

    async def put_project_script(self, key: str, script: str) -> None:
        """Save the script of a project."""
        await self.request("PUT", "/projects/sources", body=_Sources(key, script))

    async def kept_parameters(self, key: str) -> list[ProjectParameter]:
        """Return the parameters stored separately from a project; others are part of the project."""
        return await self.request("GET", f"/projects/{_part(key)}/parameters", list[ProjectParameter])

    async def put_kept_parameters(self, key: str, parameters: list[ProjectParameter]) -> None:
        """Store parameters separately from a project."""
        await self.request("PUT", f"/projects/{_part(key)}/parameters", body=parameters)

    async def kept_overrides(self, key: str) -> list[SceneObjectOverride]:
        """Return the overrides of objects' settings stored separately from a project."""
        return await self.request("GET", f"/projects/{_part(key)}/object-parameters", list[SceneObjectOverride])

    async def put_kept_overrides(self, key: str, overrides: list[SceneObjectOverride]) -> None:
        """Store overrides separately from a project."""
        await self.request("PUT", f"/projects/{_part(key)}/object-parameters", body=overrides)

    # ------------------------------------------------------------------------------------------------ object types
    async def object_types(self) -> list[Listed]:
        """List the uploaded object types, without installed ones."""
        return await self.request("GET", "/object-types", list[Listed])

    async def object_type(self, name: str) -> ObjectTypeSource:
        """Return an uploaded object type, without its model."""
        one: _Type = await self.request("GET", f"/object-types/{_part(name)}", _Type)
        return ObjectTypeSource(one.id, one.source, one.description, UNSET, one.created, one.modified, one.modules)

    async def put_object_type(
        self, name: str, source: str, model: Models | None = None, modules: dict[str, str] | Unset = UNSET
    ) -> None:
        """Upload a new or changed object type. Its model has to be saved before.

        Args:
            name: Name of the class.
            source: Source of the module that declares the class.
            model: Its collision model.
            modules: Sources of the modules that belong to this type only, by name. UNSET leaves the stored ones.
        """
        named = UNSET if model is None else ModelName(name, model.type())
        await self.request("PUT", "/object-types", body=_Type(name, name, source, model=named, modules=modules))

    async def delete_object_type(self, name: str) -> None:
        """Delete an object type."""
        await self.request("DELETE", f"/object-types/{_part(name)}")

    async def models(self) -> list[ModelName]:
        """List the collision models; each has the name of its object type."""
        return await self.request("GET", "/models", list[ModelName])

    async def model(self, name: ModelName) -> Models:
        """Return a collision model."""
        kind = name.type.value.lower()
        given: Models = await self.request("GET", f"/models/{_part(name.id)}/{kind}", _MODELS[kind])
        return given

    async def put_model(self, model: Models) -> None:
        """Save a collision model, replacing one of the same id."""
        await self.request("PUT", f"/models/{model.type().value.lower()}", body=model)

    async def delete_model(self, name: str) -> None:
        """Delete a collision model."""
        await self.request("DELETE", f"/models/{_part(name)}")

    # ------------------------------------------------------------------------------------------------ assets
    async def assets(self) -> list[Asset]:
        """List the assets."""
        return await self.request("GET", "/assets/info", list[Asset])

    async def download_asset(self, key: str, target: Path) -> None:
        """Save the content of an asset to a file."""
        await self._file(f"/assets/{_part(key)}/data", target)

    async def upload_asset(
        self, key: str, content: Path | bytes, *, file_name: str = "", replace: bool = False
    ) -> Asset:
        """Upload an asset, streamed from a file if it is a path; an existing one is replaced only with `replace`."""
        name = file_name or (content.name if isinstance(content, Path) else key)
        query = {"id": key, "upsert": str(replace).lower()}
        asset: Asset = await self._upload("POST", "/assets", "assetData", name, content, query, Asset)
        return asset

    async def delete_asset(self, key: str) -> None:
        """Delete an asset."""
        await self.request("DELETE", f"/assets/{_part(key)}")

    # ------------------------------------------------------------------------------------------------ diagnosis
    async def diagnosis(self, target: Path) -> None:
        """Save a diagnosis archive to a file: open documents, types, devices and the end of the log; no secrets."""
        await self._file("/api/diagnosis", target)

    # ------------------------------------------------------------------------------------------------ runs
    async def run_trace(self, number: int) -> RunTrace:
        """Return the executed actions of a run by device."""
        return await self.request("GET", f"/api/runs/{number}/trace", RunTrace)

    async def chrome_trace(self, number: int, target: Path) -> None:
        """Save the executed actions of a run to a file that chrome://tracing and Perfetto open."""
        await self._file(f"/api/runs/{number}/chrome-trace", target)

    # ------------------------------------------------------------------------------------------------ packages
    async def publish(self, project_id: str, target: Path, package_name: str = "") -> None:
        """Build a saved project and save its package to a file."""
        named = {"packageName": package_name} if package_name else {}
        await self._file("/project/publish", target, params={"projectId": project_id} | named)

    async def import_package(self, content: Path | bytes, **overwrite: bool) -> ImportedIds:
        """Save the scene, project and object types of a package.

        Args:
            content: The package.
            **overwrite: overwrite_scene, overwrite_project, overwrite_object_types, overwrite_project_sources,
                overwrite_collision_models, update_project_from_script.

        Raises:
            StateConflict: Saved items differ; the message names all of them.
        """
        query = {name: str(value).lower() for name, value in overwrite.items()}
        ids: ImportedIds = await self._upload(
            "PUT", "/project/import", "executionPackage", "package.zip", content, query, ImportedIds
        )
        return ids

    async def download_package(self, package_id: str, target: Path) -> None:
        """Save a package to a file."""
        await self._file(f"/packages/{_part(package_id)}", target)

    async def upload_package(self, package_id: str, content: Path | bytes) -> None:
        """Upload a package, replacing one of the same id."""
        await self._upload(
            "POST", f"/packages/{_part(package_id)}", "executionPackage", "package.zip", content, {}, Any
        )

    async def _upload(
        self, method: str, path: str, part: str, name: str, content: Path | bytes, query: dict[str, str], kind: Any
    ) -> Any:
        if isinstance(content, bytes):
            return await self.request(method, path, kind, params=query, files={part: (name, content)})
        with content.open("rb") as file:
            return await self.request(method, path, kind, params=query, files={part: (name, file)})


def _refusal(request: str, status: int, content: bytes) -> RequestFailed:
    try:
        text = str(msgspec.json.decode(content, type=dict[str, Any])["message"])
    except (msgspec.MsgspecError, KeyError):
        text = f"{request} was answered with status {status}."
    return STATUSES.get(status, RequestFailed)(request, [text], reason=str(status))

"""Tables of the REST APIs next to the documents: project parameters, tokens and breakpoints."""

from collections.abc import Iterable
from typing import Any, Literal

import msgspec
from sqlalchemy import delete, select

from arcor2_hw.data.base import Data
from arcor2_hw.data.project import ProjectParameter
from arcor2_hw.data.scene import SceneObjectOverride
from arcor2_server.storage.models import BreakpointsRow, ExecutionTokenRow, ProjectRow, ProjectTablesRow
from arcor2_server.storage.setting_secrets import objects_of
from arcor2_server.storage.store import Storage


class ExecutionToken(Data, frozen=True):
    """One token of the Execution service's table."""

    id: str
    name: str
    access: bool = False


class ProjectTables:
    """The tables. All methods may raise StorageError, and NotFound for an unknown project or token."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage

    # ------------------------------------------------------------------------------------------------ projects
    async def parameters(self, project_id: str) -> list[ProjectParameter]:
        """Return the parameters stored next to a project."""
        return msgspec.json.decode(await self._read(project_id, "parameters"), type=list[ProjectParameter])

    async def put_parameters(self, project_id: str, parameters: list[ProjectParameter]) -> None:
        """Replace the parameters stored next to a project."""
        await self._write(project_id, "parameters", parameters)

    async def object_parameters(self, project_id: str) -> list[SceneObjectOverride]:
        """Return the overrides of objects stored next to a project."""
        return msgspec.json.decode(await self._read(project_id, "object_parameters"), type=list[SceneObjectOverride])

    async def put_object_parameters(self, project_id: str, overrides: list[SceneObjectOverride]) -> None:
        """Replace the overrides of objects stored next to a project."""
        if (secrets := self._storage.secrets) is not None and overrides:
            scene = await self._storage.scene((await self._storage.project(project_id)).scene_id)
            before = await self.object_parameters(project_id)
            overrides = secrets.hide_in_overrides(overrides, objects_of(scene), before)
            await secrets.store.flush()
        await self._write(project_id, "object_parameters", overrides)

    async def _read(self, project_id: str, what: Literal["parameters", "object_parameters"]) -> bytes:
        async with self._storage.reading() as session:
            await Storage.one(session, ProjectRow, project_id, "project")
            row = await session.get(ProjectTablesRow, project_id)
            content: bytes = b"[]" if row is None else getattr(row, what)
        return content

    async def _write(self, project_id: str, what: Literal["parameters", "object_parameters"], value: Any) -> None:
        async with self._storage.writing() as session:
            await Storage.one(session, ProjectRow, project_id, "project")
            row = await session.get(ProjectTablesRow, project_id)
            if row is None:
                row = ProjectTablesRow(id=project_id, parameters=b"[]", object_parameters=b"[]")
                session.add(row)
            setattr(row, what, msgspec.json.encode(value))

    # ------------------------------------------------------------------------------------------------ tokens
    async def tokens(self) -> list[ExecutionToken]:
        """Return the table of tokens."""
        async with self._storage.reading() as session:
            rows = await session.scalars(select(ExecutionTokenRow).order_by(ExecutionTokenRow.name))
            return [ExecutionToken(row.id, row.name, row.access) for row in rows]

    async def token(self, key: str) -> ExecutionToken:
        """Return one token."""
        async with self._storage.reading() as session:
            row = await Storage.one(session, ExecutionTokenRow, key, "token")
            return ExecutionToken(row.id, row.name, row.access)

    async def put_token(self, token: ExecutionToken) -> None:
        """Store a token."""
        async with self._storage.writing() as session:
            await self._storage.upsert(session, ExecutionTokenRow(**msgspec.structs.asdict(token)))

    async def delete_token(self, key: str) -> None:
        """Delete a token."""
        async with self._storage.writing() as session:
            await session.delete(await Storage.one(session, ExecutionTokenRow, key, "token"))

    # ------------------------------------------------------------------------------ lists of breakpoints
    async def breakpoints(self, package_id: str) -> list[str]:
        """Return the breakpoints of a package."""
        async with self._storage.reading() as session:
            row = await session.get(BreakpointsRow, package_id)
            return [] if row is None else msgspec.json.decode(row.ids, type=list[str])

    async def put_breakpoints(self, package_id: str, ids: Iterable[str]) -> None:
        """Replace the breakpoints of a package."""
        async with self._storage.writing() as session:
            await self._storage.upsert(
                session, BreakpointsRow(package_id=package_id, ids=msgspec.json.encode(list(dict.fromkeys(ids))))
            )

    async def delete_breakpoints(self, package_id: str) -> None:
        """Delete the breakpoints of a deleted package."""
        async with self._storage.writing() as session:
            await session.execute(delete(BreakpointsRow).where(BreakpointsRow.package_id == package_id))

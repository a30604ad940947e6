"""Reading and writing saved documents; what a method wrote is on disk when it returns."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from contextvars import ContextVar
from typing import Any, Final, Self

import msgspec
from msgspec import UNSET
from sqlalchemy import delete, event, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.ext.asyncio import AsyncEngine, AsyncSession, async_sessionmaker, create_async_engine

from arcor2_hw.data.base import Data, now
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Model3dType, Models, ObjectModel, ObjectTypeSource, Sphere
from arcor2_hw.data.project import BareProject, Project
from arcor2_hw.data.scene import BareScene, Scene
from arcor2_hw.exceptions import NotFound, StorageError
from arcor2_server.documents.setting_secrets import SettingSecrets
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.models import ModelRow, ObjectTypeRow, ProjectRow, ProjectSourceRow, SceneRow
from arcor2_server.storage.schema import bring_up_to_date
from arcor2_server.storage.sqlite import check_opens, prepare, purge

_together: ContextVar[AsyncSession | None] = ContextVar("together", default=None)
"""The session of the transaction that the present task is in."""
_PER_QUERY: Final = 100
"""Documents read by one query; each may have some hundred kilobytes."""
_encode = msgspec.json.Encoder().encode
_decode_scene = msgspec.json.Decoder(Scene).decode
_decode_project = msgspec.json.Decoder(Project).decode
_MODEL_DECODERS: Final = {kind.__name__: msgspec.json.Decoder(kind).decode for kind in (Box, Cylinder, Sphere, Mesh)}


class DocumentId(Data, frozen=True):
    """What a stored id names: `kind` is scene, project or object_type."""

    id: str
    kind: str


class Storage:
    """The Project service's data. All methods may raise StorageError, which names the database.

    `revision` grows with every write; `types_revision` with every write to object types and models.
    """

    def __init__(self, engine: AsyncEngine, place: str) -> None:
        self.revision = 0
        self.types_revision = 0
        self.on_deleted: list[Callable[[str], Awaitable[None]]] = []
        """Called with the id of a scene or project that was deleted."""
        self.secrets: SettingSecrets | None = None
        """Takes secrets out of what is saved."""
        self._engine = engine
        self._place = place
        self._sessions = async_sessionmaker(engine, expire_on_commit=False)

    @classmethod
    async def open(cls, settings: ServerSettings) -> Self:
        """Open, or create, the database. StorageError when it is damaged, not writable or of a newer version."""
        place = settings.database_url.rpartition("@")[2] or str(settings.documents_database)
        if settings.database_url:
            engine = create_async_engine(settings.database_url)
        else:
            check_opens(settings.documents_database)
            # One connection: SQLite writes one at a time anyway, and each connection costs a thread.
            engine = create_async_engine(
                f"sqlite+aiosqlite:///{settings.documents_database}", pool_size=1, max_overflow=0
            )
            event.listen(engine.sync_engine, "connect", prepare)
        try:
            await bring_up_to_date(engine, place)
        except BaseException:
            await engine.dispose()
            raise
        return cls(engine, place)

    async def purge(self) -> None:
        """Overwrite what was replaced or deleted, in the file of SQLite. StorageError."""
        try:
            await purge(self._engine)
        except SQLAlchemyError as error:
            raise self._failed("write", error) from error

    async def close(self) -> None:
        """Close the database."""
        await self._engine.dispose()

    # ------------------------------------------------------------------------------------------------ scenes
    async def scenes(self) -> list[BareScene]:
        """Give all saved scenes without their objects, by name."""
        columns = (SceneRow.name, SceneRow.description, SceneRow.created, SceneRow.modified, SceneRow.id)
        async with self.reading() as session:
            rows = await session.execute(select(*columns).order_by(SceneRow.name))
            return [BareScene(**row) for row in rows.mappings()]

    async def scenes_with_ids(self, keys: Sequence[str]) -> list[Scene]:
        """Return the saved scenes with these ids, in no particular order; ids without a scene are left out."""
        return await self._with_ids(SceneRow, keys, _decode_scene)

    async def scene(self, key: str) -> Scene:
        """Give a saved scene; NotFound."""
        async with self.reading() as session:
            scene: Scene = self._decoded(_decode_scene, await self.one(session, SceneRow, key, "scene"))
        return scene

    async def put_scene(self, scene: Scene) -> Scene:
        """Save; gives the scene as saved: `created` kept or set, `modified` set, `int_modified` gone."""
        stamp = now()
        async with self.writing() as session:
            row = await session.get(SceneRow, scene.id)
            saved = msgspec.structs.replace(
                scene, created=row.created if row else stamp, modified=stamp, int_modified=UNSET
            )
            if self.secrets is not None:
                before = None if row is None else self._decoded(_decode_scene, row)
                saved = await self.secrets.take_from_scene(saved, before)
            await session.merge(
                SceneRow(
                    id=saved.id,
                    name=saved.name,
                    description=saved.description,
                    created=saved.created,
                    modified=saved.modified,
                    document=_encode(saved),
                )
            )
        return saved

    async def delete_scene(self, key: str) -> None:
        """Delete; NotFound."""
        async with self.writing() as session:
            await session.delete(await self.one(session, SceneRow, key, "scene"))
        for tell in self.on_deleted:
            await tell(key)

    # ------------------------------------------------------------------------------------------------ projects
    async def projects(self) -> list[BareProject]:
        """Give all saved projects without their content, by name."""
        columns = (
            ProjectRow.name,
            ProjectRow.scene_id,
            ProjectRow.description,
            ProjectRow.has_logic,
            ProjectRow.created,
            ProjectRow.modified,
            ProjectRow.id,
        )
        async with self.reading() as session:
            rows = await session.execute(select(*columns).order_by(ProjectRow.name))
            return [BareProject(**row) for row in rows.mappings()]

    async def projects_with_ids(self, keys: Sequence[str]) -> list[Project]:
        """Return the saved projects with these ids, in no particular order; ids without a project are left out."""
        return await self._with_ids(ProjectRow, keys, _decode_project)

    async def project(self, key: str) -> Project:
        """Give a saved project; NotFound."""
        async with self.reading() as session:
            project: Project = self._decoded(_decode_project, await self.one(session, ProjectRow, key, "project"))
        return project

    async def put_project(self, project: Project) -> Project:
        """Save; gives the project as saved (like put_scene). NotFound when its scene is not saved."""
        stamp = now()
        async with self.writing() as session:
            scene = await self.one(session, SceneRow, project.scene_id, "scene")
            row = await session.get(ProjectRow, project.id)
            saved = msgspec.structs.replace(
                project, created=row.created if row else stamp, modified=stamp, int_modified=UNSET
            )
            if self.secrets is not None and saved.object_overrides:
                before = None if row is None else self._decoded(_decode_project, row)
                saved = await self.secrets.take_from_project(saved, self._decoded(_decode_scene, scene), before)
            await session.merge(
                ProjectRow(
                    id=saved.id,
                    scene_id=saved.scene_id,
                    name=saved.name,
                    description=saved.description,
                    has_logic=saved.has_logic,
                    created=saved.created,
                    modified=saved.modified,
                    document=_encode(saved),
                )
            )
        return saved

    async def delete_project(self, key: str) -> None:
        """Delete, with its source; NotFound."""
        async with self.writing() as session:
            row = await self.one(session, ProjectRow, key, "project")
            await session.execute(delete(ProjectSourceRow).where(ProjectSourceRow.id == key))
            await session.delete(row)
        for tell in self.on_deleted:
            await tell(key)

    async def projects_with_scene(self, scene_id: str) -> list[str]:
        """Give the ids of the saved projects of a scene."""
        async with self.reading() as session:
            return list(await session.scalars(select(ProjectRow.id).where(ProjectRow.scene_id == scene_id)))

    async def project_source(self, key: str) -> str:
        """Give the script of a project without logic; NotFound."""
        async with self.reading() as session:
            script: str = (await self.one(session, ProjectSourceRow, key, "source of project")).script
        return script

    async def put_project_source(self, key: str, script: str) -> None:
        """Save the script of a project; NotFound when there is no such project."""
        async with self.writing() as session:
            await self.one(session, ProjectRow, key, "project")
            await session.merge(ProjectSourceRow(id=key, script=script))

    # ------------------------------------------------------------------------------------------------ object types
    async def object_type_stamps(self) -> dict[str, str]:
        """Give the ids of all uploaded object types with when each was modified."""
        async with self.reading() as session:
            rows = await session.execute(select(ObjectTypeRow.id, ObjectTypeRow.modified))
            return {key: modified for key, modified in rows}  # noqa: C416 - rows are no tuples to mypy

    async def object_types(self) -> list[ObjectTypeSource]:
        """Give all uploaded object types with their models."""
        async with self.reading() as session:
            rows = list(await session.scalars(select(ObjectTypeRow).order_by(ObjectTypeRow.id)))
            models = {row.id: row for row in await session.scalars(select(ModelRow))}
        return [self._object_type(row, models.get(row.id)) for row in rows]

    async def object_type(self, key: str) -> ObjectTypeSource:
        """Give an uploaded object type; NotFound."""
        async with self.reading() as session:
            row = await self.one(session, ObjectTypeRow, key, "object type")
            return self._object_type(row, await session.get(ModelRow, key))

    async def types_without_model(self) -> set[str]:
        """Give the ids of uploaded object types whose collision model is gone."""
        wanted = select(ObjectTypeRow.id).where(ObjectTypeRow.model_kind.is_not(None))
        async with self.reading() as session:
            return set(await session.scalars(wanted.where(ObjectTypeRow.id.not_in(select(ModelRow.id)))))

    async def put_object_type(self, object_type: ObjectTypeSource) -> ObjectTypeSource:
        """Save, with its model when it has one; gives it as saved (like put_scene)."""
        stamp = now()
        async with self.writing() as session:
            row = await session.get(ObjectTypeRow, object_type.id)
            saved = msgspec.structs.replace(object_type, created=row.created if row else stamp, modified=stamp)
            model = None
            if not isinstance(saved.model, msgspec.UnsetType) and saved.model.type is not Model3dType.NONE:
                model = saved.model.model()
                await session.merge(_model_row(model))
            await session.merge(
                ObjectTypeRow(
                    id=saved.id,
                    description=None if isinstance(saved.description, msgspec.UnsetType) else saved.description,
                    source=saved.source,
                    model_kind=None if model is None else model.type().value,
                    created=saved.created,
                    modified=saved.modified,
                )
            )
        self.types_revision += 1
        return saved

    async def delete_object_type(self, key: str) -> None:
        """Delete, with its model; NotFound."""
        async with self.writing() as session:
            await session.delete(await self.one(session, ObjectTypeRow, key, "object type"))
            await session.execute(delete(ModelRow).where(ModelRow.id == key))
        self.types_revision += 1

    # ------------------------------------------------------------------------------------------------ models
    async def models(self) -> list[Models]:
        """Give all collision models."""
        async with self.reading() as session:
            return [self._model(row) for row in await session.scalars(select(ModelRow).order_by(ModelRow.id))]

    async def model(self, key: str) -> Models:
        """Give a collision model; NotFound."""
        async with self.reading() as session:
            return self._model(await self.one(session, ModelRow, key, "model"))

    async def put_model(self, model: Models) -> None:
        """Save a collision model in place of one with that id, of whatever kind."""
        async with self.writing() as session:
            await session.merge(_model_row(model))
            if (row := await session.get(ObjectTypeRow, model.id)) is not None and row.model_kind is not None:
                row.model_kind = model.type().value
                row.modified = now()
        self.types_revision += 1

    async def delete_model(self, key: str) -> None:
        """Delete; NotFound."""
        async with self.writing() as session:
            await session.delete(await self.one(session, ModelRow, key, "model"))
        self.types_revision += 1

    # ------------------------------------------------------------------------------------------------ look-ups
    async def scene_named(self, name: str) -> str | None:
        """Give the id of a scene of that name."""
        async with self.reading() as session:
            return await session.scalar(select(SceneRow.id).where(SceneRow.name == name).limit(1))

    async def project_named(self, name: str) -> str | None:
        """Give the id of a project of that name."""
        async with self.reading() as session:
            return await session.scalar(select(ProjectRow.id).where(ProjectRow.name == name).limit(1))

    async def name_taken(self, name: str) -> bool:
        """Tell whether a scene or a project has that name."""
        return await self.scene_named(name) is not None or await self.project_named(name) is not None

    async def identify(self, key: str) -> DocumentId | None:
        """Tell what a stored id names, None when nothing."""
        async with self.reading() as session:
            for kind, column in (
                ("scene", SceneRow.id),
                ("project", ProjectRow.id),
                ("object_type", ObjectTypeRow.id),
            ):
                if await session.scalar(select(column).where(column == key)) is not None:
                    return DocumentId(key, kind)
        return None

    # ------------------------------------------------------------------------------------------------ inside
    @asynccontextmanager
    async def together(self) -> AsyncIterator[None]:
        """Make one transaction of all that is written inside by the present task: all of it is kept, or nothing.

        StorageError for what the database says of it as a whole.
        """
        before = self.types_revision
        async with self.writing() as session:
            token = _together.set(session)
            try:
                yield
            finally:
                _together.reset(token)
        if self.types_revision != before:
            self.types_revision += 1  # only now they are there for others

    @asynccontextmanager
    async def reading(self) -> AsyncIterator[AsyncSession]:
        """Give a session to read with; StorageError for whatever the database says."""
        try:
            if (session := _together.get()) is not None:
                yield session
                return
            async with self._sessions() as session:
                yield session
        except SQLAlchemyError as error:
            raise self._failed("read", error) from error

    @asynccontextmanager
    async def writing(self, *, documents: bool = True) -> AsyncIterator[AsyncSession]:
        """Give a session in a transaction, which is on disk when it is left; StorageError as above.

        `documents`: `revision` grows, since answers that are made from documents may be others now.
        """
        try:
            if (session := _together.get()) is not None:
                yield session
                await session.flush()
                return
            async with self._sessions() as session, session.begin():
                yield session
        except SQLAlchemyError as error:
            raise self._failed("write", error) from error
        if documents:
            self.revision += 1

    def _failed(self, what: str, error: SQLAlchemyError) -> StorageError:
        cause = getattr(error, "orig", None) or error
        return StorageError(f"cannot {what} the database {self._place}: {cause}", detail=str(error))

    @staticmethod
    async def one(session: AsyncSession, table: type[Any], key: str, what: str) -> Any:
        """Give the row of that key; NotFound says `what` there is not."""
        if (row := await session.get(table, key)) is None:
            raise NotFound(f"There is no {what} {key!r}.")
        return row

    async def _with_ids(self, table: type[Any], keys: Sequence[str], decode: Any) -> list[Any]:
        """Return the decoded documents with these ids, decoded off the event loop, some at a time."""
        found: list[Any] = []
        for begin in range(0, len(keys), _PER_QUERY):
            wanted = select(table.id, table.document).where(table.id.in_(keys[begin : begin + _PER_QUERY]))
            async with self.reading() as session:
                rows = list(await session.execute(wanted))
            found += await asyncio.to_thread(self._decode_all, decode, rows)
        return found

    def _decode_all(self, decode: Any, rows: Sequence[Any]) -> list[Any]:
        return [self._decoded(decode, row) for row in rows]

    def _decoded(self, decode: Any, row: Any) -> Any:
        try:
            return decode(row.document)
        except msgspec.DecodeError as error:
            raise StorageError(f"the document {row.id!r} in the database {self._place} is damaged: {error}") from error

    def _model(self, row: ModelRow) -> Models:
        if row.kind not in _MODEL_DECODERS:
            raise StorageError(f"the model {row.id!r} in the database {self._place} has the unknown kind {row.kind!r}")
        model: Models = self._decoded(_MODEL_DECODERS[row.kind], row)
        return model

    def _object_type(self, row: ObjectTypeRow, model: ModelRow | None) -> ObjectTypeSource:
        return ObjectTypeSource(
            id=row.id,
            source=row.source,
            description=UNSET if row.description is None else row.description,
            model=UNSET if row.model_kind is None or model is None else ObjectModel.of(self._model(model)),
            created=row.created,
            modified=row.modified,
        )


def _model_row(model: Models) -> ModelRow:
    return ModelRow(id=model.id, kind=model.type().value, document=_encode(model))

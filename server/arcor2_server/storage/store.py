"""Saved scenes, projects, object types and models. Written data is on disk when a method returns."""

from collections.abc import Awaitable, Callable, Sequence
from typing import Final, Self

import msgspec
from msgspec import UNSET
from sqlalchemy import delete, select

from arcor2_hw.data.base import Data, now
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Model3dType, Models, ObjectModel, ObjectTypeSource, Sphere
from arcor2_hw.data.project import BareProject, Project
from arcor2_hw.data.scene import BareScene, Scene
from arcor2_hw.exceptions import StorageError
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.database import Database, Engines, open_engines
from arcor2_server.storage.models import ModelRow, ObjectTypeRow, ProjectRow, ProjectSourceRow, SceneRow
from arcor2_server.storage.setting_secrets import SettingSecrets

_encode = msgspec.json.Encoder().encode
_decode_scene = msgspec.json.Decoder(Scene).decode
_decode_project = msgspec.json.Decoder(Project).decode
_SCENE_COLUMNS: Final = [name for name in BareScene.__struct_fields__ if name != "int_modified"]
_PROJECT_COLUMNS: Final = [name for name in BareProject.__struct_fields__ if name != "int_modified"]
_decode_modules = msgspec.json.Decoder(dict[str, str]).decode
_MODEL_DECODERS: Final = {kind.__name__: msgspec.json.Decoder(kind).decode for kind in (Box, Cylinder, Sphere, Mesh)}


class DocumentId(Data, frozen=True):
    """The kind of a stored id: scene, project or object_type."""

    id: str
    kind: str


class Storage(Database):
    """The data of the Project service. All methods may raise StorageError, which names the database.

    Args:
        engines: the connections of the database.
        secrets: moves secrets out of documents before they are saved; None: documents are saved unchanged.
    """

    def __init__(self, engines: Engines, secrets: SettingSecrets | None = None) -> None:
        super().__init__(engines)
        self.secrets = secrets
        self.on_deleted: list[Callable[[str], Awaitable[None]]] = []
        """Called with the id of a deleted scene or project."""

    @classmethod
    async def open(
        cls, settings: ServerSettings, secrets: SettingSecrets | None = None, *, exclusive: bool = True
    ) -> Self:
        """Open or create the database; the arguments and errors are those of `open_engines`."""
        return cls(await open_engines(settings, exclusive=exclusive), secrets)

    # ------------------------------------------------------------------------------------------------ scenes
    async def scenes(self) -> list[BareScene]:
        """Return all saved scenes without their objects, by name."""
        columns = [getattr(SceneRow, name) for name in _SCENE_COLUMNS]
        async with self.reading() as session:
            rows = await session.execute(select(*columns).order_by(SceneRow.name))
            return [BareScene(**row) for row in rows.mappings()]

    async def scenes_with_ids(self, keys: Sequence[str]) -> list[Scene]:
        """Return the saved scenes with these ids in any order, without ids that do not exist."""
        return await self.with_ids(SceneRow, keys, _decode_scene)

    async def scene(self, key: str) -> Scene:
        """Return a saved scene. Raise NotFound if there is none."""
        async with self.reading() as session:
            scene: Scene = self.decoded(_decode_scene, await self.one(session, SceneRow, key, "scene"))
        return scene

    async def put_scene(self, scene: Scene) -> Scene:
        """Save a scene; return it with the new `created` and `modified`, without `int_modified`."""
        stamp = now()
        async with self.writing() as session:
            row = await session.get(SceneRow, scene.id)
            saved = msgspec.structs.replace(
                scene, created=row.created if row else stamp, modified=stamp, int_modified=UNSET
            )
            if self.secrets is not None:
                before = None if row is None else self.decoded(_decode_scene, row)
                saved = await self.secrets.extract_from_scene(saved, before)
            columns = {name: getattr(saved, name) for name in _SCENE_COLUMNS}
            await self.upsert(session, SceneRow(document=_encode(saved), **columns))
        return saved

    async def delete_scene(self, key: str) -> None:
        """Delete a scene. Raise NotFound if there is none."""
        async with self.writing() as session:
            await session.delete(await self.one(session, SceneRow, key, "scene"))
        for notify in self.on_deleted:
            await notify(key)

    # ------------------------------------------------------------------------------------------------ projects
    async def projects(self) -> list[BareProject]:
        """Return all saved projects without their content, by name."""
        columns = [getattr(ProjectRow, name) for name in _PROJECT_COLUMNS]
        async with self.reading() as session:
            rows = await session.execute(select(*columns).order_by(ProjectRow.name))
            return [BareProject(**row) for row in rows.mappings()]

    async def projects_with_ids(self, keys: Sequence[str]) -> list[Project]:
        """Return the saved projects with these ids in any order, without ids that do not exist."""
        return await self.with_ids(ProjectRow, keys, _decode_project)

    async def project(self, key: str) -> Project:
        """Return a saved project. Raise NotFound if there is none."""
        async with self.reading() as session:
            project: Project = self.decoded(_decode_project, await self.one(session, ProjectRow, key, "project"))
        return project

    async def put_project(self, project: Project) -> Project:
        """Save a project; return it as `put_scene` does. Raise NotFound if its scene is not saved."""
        stamp = now()
        async with self.writing() as session:
            scene = await self.one(session, SceneRow, project.scene_id, "scene")
            row = await session.get(ProjectRow, project.id)
            saved = msgspec.structs.replace(
                project, created=row.created if row else stamp, modified=stamp, int_modified=UNSET
            )
            if self.secrets is not None and saved.object_overrides:
                before = None if row is None else self.decoded(_decode_project, row)
                saved = await self.secrets.extract_from_project(saved, self.decoded(_decode_scene, scene), before)
            columns = {name: getattr(saved, name) for name in _PROJECT_COLUMNS}
            await self.upsert(session, ProjectRow(document=_encode(saved), **columns))
        return saved

    async def delete_project(self, key: str) -> None:
        """Delete a project with its source. Raise NotFound if there is none."""
        async with self.writing() as session:
            row = await self.one(session, ProjectRow, key, "project")
            await session.execute(delete(ProjectSourceRow).where(ProjectSourceRow.id == key))
            await session.delete(row)
        for notify in self.on_deleted:
            await notify(key)

    async def projects_with_scene(self, scene_id: str) -> list[str]:
        """Return the ids of the saved projects of a scene."""
        async with self.reading() as session:
            return list(await session.scalars(select(ProjectRow.id).where(ProjectRow.scene_id == scene_id)))

    async def project_source(self, key: str) -> str:
        """Return the script of a project without logic. Raise NotFound if there is none."""
        async with self.reading() as session:
            script: str = (await self.one(session, ProjectSourceRow, key, "source of project")).script
        return script

    async def put_project_source(self, key: str, script: str) -> None:
        """Save the script of a project. Raise NotFound if there is no such project."""
        async with self.writing() as session:
            await self.one(session, ProjectRow, key, "project")
            await self.upsert(session, ProjectSourceRow(id=key, script=script))

    # ------------------------------------------------------------------------------------------------ object types
    async def object_types(self) -> list[ObjectTypeSource]:
        """Return all uploaded object types with their models."""
        async with self.reading() as session:
            rows = list(await session.scalars(select(ObjectTypeRow).order_by(ObjectTypeRow.id)))
            models = {row.id: row for row in await session.scalars(select(ModelRow))}
        return [self._object_type(row, models.get(row.id)) for row in rows]

    async def object_type(self, key: str) -> ObjectTypeSource:
        """Return an uploaded object type. Raise NotFound if there is none."""
        async with self.reading() as session:
            row = await self.one(session, ObjectTypeRow, key, "object type")
            return self._object_type(row, await session.get(ModelRow, key))

    async def types_without_model(self) -> set[str]:
        """Return the ids of uploaded object types whose collision model is missing."""
        wanted = select(ObjectTypeRow.id).where(ObjectTypeRow.model_kind.is_not(None))
        async with self.reading() as session:
            return set(await session.scalars(wanted.where(ObjectTypeRow.id.not_in(select(ModelRow.id)))))

    async def put_object_type(self, object_type: ObjectTypeSource) -> ObjectTypeSource:
        """Save an object type with its model; return it as `put_scene` does."""
        stamp = now()
        async with self.writing() as session:
            row = await session.get(ObjectTypeRow, object_type.id)
            saved = msgspec.structs.replace(object_type, created=row.created if row else stamp, modified=stamp)
            modules = row.modules if row else None
            if not isinstance(saved.modules, msgspec.UnsetType):
                modules = _encode(saved.modules) if saved.modules else None
            model = None
            if not isinstance(saved.model, msgspec.UnsetType) and saved.model.type is not Model3dType.NONE:
                model = saved.model.model()
                await self.upsert(session, _model_row(model))
            await self.upsert(
                session,
                ObjectTypeRow(
                    id=saved.id,
                    description=None if isinstance(saved.description, msgspec.UnsetType) else saved.description,
                    source=saved.source,
                    model_kind=None if model is None else model.type().value,
                    created=saved.created,
                    modified=saved.modified,
                    modules=modules,
                ),
            )
        self.types_revision += 1
        return saved

    async def delete_object_type(self, key: str) -> None:
        """Delete an object type with its model. Raise NotFound if there is none."""
        async with self.writing() as session:
            await session.delete(await self.one(session, ObjectTypeRow, key, "object type"))
            await session.execute(delete(ModelRow).where(ModelRow.id == key))
        self.types_revision += 1

    # ------------------------------------------------------------------------------------------------ models
    async def models(self) -> list[Models]:
        """Return all collision models."""
        async with self.reading() as session:
            return [self._model(row) for row in await session.scalars(select(ModelRow).order_by(ModelRow.id))]

    async def model(self, key: str) -> Models:
        """Return a collision model. Raise NotFound if there is none."""
        async with self.reading() as session:
            return self._model(await self.one(session, ModelRow, key, "model"))

    async def put_model(self, model: Models) -> None:
        """Create or replace a collision model."""
        async with self.writing() as session:
            await self.upsert(session, _model_row(model))
            if (row := await session.get(ObjectTypeRow, model.id)) is not None and row.model_kind is not None:
                row.model_kind = model.type().value
                row.modified = now()
        self.types_revision += 1

    async def delete_model(self, key: str) -> None:
        """Delete a collision model. Raise NotFound if there is none."""
        async with self.writing() as session:
            await session.delete(await self.one(session, ModelRow, key, "model"))
        self.types_revision += 1

    # ------------------------------------------------------------------------------------------------ look-ups
    async def scene_named(self, name: str) -> str | None:
        """Return the id of a scene of that name."""
        async with self.reading() as session:
            return await session.scalar(select(SceneRow.id).where(SceneRow.name == name).limit(1))

    async def project_named(self, name: str) -> str | None:
        """Return the id of a project of that name."""
        async with self.reading() as session:
            return await session.scalar(select(ProjectRow.id).where(ProjectRow.name == name).limit(1))

    async def name_taken(self, name: str) -> bool:
        """Return whether a scene or a project has that name."""
        return await self.scene_named(name) is not None or await self.project_named(name) is not None

    async def name_of(self, key: str) -> str | None:
        """Return the name of a saved scene or project; the id of an object type; None if the id is unknown."""
        async with self.reading() as session:
            for column, name in (
                (SceneRow.id, SceneRow.name),
                (ProjectRow.id, ProjectRow.name),
                (ObjectTypeRow.id, ObjectTypeRow.id),
            ):
                if (found := await session.scalar(select(name).where(column == key))) is not None:
                    return found
        return None

    async def identify(self, key: str) -> DocumentId | None:
        """Return the kind of a stored id, None if it is unknown."""
        async with self.reading() as session:
            for kind, column in (
                ("scene", SceneRow.id),
                ("project", ProjectRow.id),
                ("object_type", ObjectTypeRow.id),
            ):
                if await session.scalar(select(column).where(column == key)) is not None:
                    return DocumentId(key, kind)
        return None

    def _model(self, row: ModelRow) -> Models:
        if row.kind not in _MODEL_DECODERS:
            raise StorageError(
                "the model {id!r} in the database {place} has the unknown kind {type!r}",
                id=row.id,
                place=self.place,
                type=row.kind,
            )
        model: Models = self.decoded(_MODEL_DECODERS[row.kind], row)
        return model

    def _object_type(self, row: ObjectTypeRow, model: ModelRow | None) -> ObjectTypeSource:
        return ObjectTypeSource(
            id=row.id,
            source=row.source,
            description=UNSET if row.description is None else row.description,
            model=UNSET if row.model_kind is None or model is None else ObjectModel.of(self._model(model)),
            created=row.created,
            modified=row.modified,
            modules=UNSET if row.modules is None else self.decoded(_decode_modules, row, "modules"),
        )


def _model_row(model: Models) -> ModelRow:
    return ModelRow(id=model.id, kind=model.type().value, document=_encode(model))

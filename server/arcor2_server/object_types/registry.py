"""The registry of object types: built-in, installed and uploaded ones, analysed without importing them."""

import asyncio
import hashlib
from pathlib import Path
from typing import Protocol

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.analysis import BUILT_IN, SourceFile, TypeAnalysis, installed_types, snapshot, worker
from arcor2_hw.analysis.installed import find_new_distributions
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.object_type import ObjectTypeMeta, ObjectTypeSource
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message
from arcor2_server.files import write_private
from arcor2_server.object_types.catalog import AnalysisResults, KnownTypes, TypeCatalog
from arcor2_server.object_types.changes import Changes, PendingChanges
from arcor2_server.object_types.robot_packages import robot_packages

log = structlog.get_logger(__name__)


class SourceStore(Protocol):
    """Stores the sources of uploaded object types."""

    @property
    def types_revision(self) -> int:
        """Number that grows with each change of a source."""

    async def object_types(self) -> list[ObjectTypeSource]:
        """Return all sources."""

    async def types_without_model(self) -> set[str]:
        """Return the object types that have no collision model."""

    async def put_object_type(self, object_type: ObjectTypeSource) -> object:
        """Store a source."""

    async def delete_object_type(self, key: str) -> None:
        """Delete a source."""


class ModelStore(Protocol):
    """Stores meshes and robot models."""

    @property
    def revision(self) -> int:
        """Number that grows with each change of an asset."""

    def exists(self, key: str) -> bool:
        """Return whether an asset exists."""

    async def offer(self, key: str, content: bytes, description: str) -> object:
        """Offer the model of an installed driver as an asset."""


class ObjectTypes(TypeCatalog):
    """The registry of object types.

    `revision` grows with every change. A type is disabled if its source cannot be analysed, or if its collision model
    or mesh is missing. A robot's model is listed only if the asset exists.
    """

    def __init__(
        self, known: KnownTypes, storage: SourceStore, assets: ModelStore, stored_analysis: Path | None = None
    ) -> None:
        super().__init__(known)
        self.revision = 0
        self._stored_analysis = stored_analysis
        self._storage = storage
        self._assets = assets
        self._read_at: tuple[int, int] | None = None
        self._pending = PendingChanges()
        self._reading = asyncio.Lock()

    # ------------------------------------------------------------------------------------------------ reading
    async def load(self) -> None:
        """Read built-in, installed and uploaded types."""
        async with self._reading:
            await asyncio.to_thread(self._read_installed)
            await self._offer_models()
            await self._read_uploaded()

    @property
    def up_to_date(self) -> bool:
        """Whether clients were notified of all object types in the storage."""
        return self._stored_revision == self._read_at and not self._pending.changes

    @property
    def _stored_revision(self) -> tuple[int, int]:
        return self._storage.types_revision, self._assets.revision

    async def refresh(self) -> Changes:
        """Read object types that were written to the storage; return changes of which clients were not notified."""
        if self.up_to_date:
            return self._pending.changes
        await self.update()
        return self._pending.take()

    async def update(self) -> None:
        """Read object types that were written to the storage. The next `refresh` returns the changes."""
        async with self._reading:
            if self._stored_revision != self._read_at:
                await self._read_uploaded()

    async def rescan(self) -> bool:
        """Read the installed types again; return whether they have changed. The next `refresh` returns the changes."""
        async with self._reading:
            before = self._installed
            await asyncio.to_thread(find_new_distributions)
            await asyncio.to_thread(self._read_installed)
            if self._installed == before:
                return False
            await self._offer_models()
            await self._read_uploaded()
            return True

    def _read_installed(self) -> None:
        found = {each.name: each for each in installed_types()}
        files = {name: each.file for name, each in found.items() if each.file is not None}
        for name in self._installed.keys() - self._uploaded.keys() - files.keys():
            if name in self._library:
                self._library.remove(name)
        for name in files.keys() - self._uploaded.keys():
            if (before := self._installed.get(name)) is None or before.file != files[name]:
                self._library.add(files[name])
        for name, each in found.items():
            if each.problem is not None and self._installed.get(name) != each:
                log.warning("installed object type cannot be used", type=name, reason=str(each.problem))
        self._installed = found

    async def _offer_models(self) -> None:
        """Offer the robot models of installed drivers as assets."""
        for folder in sorted({each.folder for each in self._installed.values() if each.folder}):
            try:
                packages = await asyncio.to_thread(robot_packages, Path(folder))
            except OSError as error:
                log.warning("robot models of a driver cannot be read", folder=folder, reason=error.strerror)
                continue
            for name, content in packages.items():
                await self._assets.offer(name, content, "the model of an installed driver's robot")

    async def _read_uploaded(self) -> None:
        first = self._read_at is None
        revision = self._stored_revision
        stored = {one.id: one for one in await self._storage.object_types()}
        for name in self._uploaded.keys() - stored.keys():
            self._withdraw(name)
        for name, one in stored.items():
            if self._uploaded.get(name) == one:
                continue
            try:
                self._library.add(SourceFile.of_upload(one))
            except InvalidData as error:
                log.warning("uploaded object type ignored", type=name, reason=str(error))
                continue
            if name not in self._uploaded and name in self._installed:
                log.warning("uploaded object type shadows an installed one", type=name, of=self._origin(name))
            self._uploaded[name] = one
        # In a thread, since the analysis of many types would block the event loop.
        complete = await self._analyse_huge()
        known = await asyncio.to_thread(self._analyse, await self._storage.types_without_model(), complete)
        self._known_types.replace(known)
        self._pending.set_current(known.metas)
        if first:
            self._pending.take()
        self._read_at = revision
        self.revision += 1

    def _withdraw(self, name: str) -> None:
        """Remove an uploaded type, so that an installed one of that name is used again."""
        del self._uploaded[name]
        self._library.remove(name)
        installed = self._installed.get(name)
        if installed is not None:
            log.info("installed object type is used again", type=name, of=self._origin(name))
            if installed.file is not None:
                self._library.add(installed.file)

    def _origin(self, name: str) -> str:
        """Return the distribution of an installed type, with its version."""
        installed = self._installed[name]
        return f"{installed.distribution} {installed.version}".strip()

    def _analyse(self, without_model: set[str], store: bool) -> AnalysisResults:
        if store and self._stored_analysis is not None and not self._restored(self._stored_analysis):
            self._store(self._stored_analysis)
        analyses = {name: self._library.analyse(name) for name in self._library.names()}
        metas = {}
        for name, analysis in analyses.items():
            if not analysis.is_object_type:
                continue
            meta = analysis.meta
            if (one := self._uploaded.get(name)) is not None:
                meta = replace(meta, object_model=one.model, modified=one.modified)
                problem = self._missing_model(one, without_model)
                if problem is not None and not meta.disabled:
                    meta = meta.disabled_because(problem)
                if name in self._installed:
                    meta = replace(meta, shadows=self._origin(name))
            else:
                meta = replace(meta, built_in=True)
            metas[name] = meta
        for name, installed in self._installed.items():
            if installed.problem is not None and name not in self._uploaded:
                meta = ObjectTypeMeta(name, "", built_in=True, abstract=True)
                metas[name] = meta = meta.disabled_because(installed.problem.message)
                analyses[name] = TypeAnalysis(meta, problem=installed.problem)
        robots = {name: self._with_asset(a.robot) for name, a in analyses.items() if a.robot and name in metas}
        metas, robots = dict(sorted(metas.items())), dict(sorted(robots.items()))
        actions = [analyses[name].actions for name in metas]
        digest = hashlib.sha256(msgspec.msgpack.encode((metas, robots, actions))).hexdigest()
        return AnalysisResults(analyses, metas, robots, digest)

    async def _analyse_huge(self) -> bool:
        """Analyse all types in another process if one of them is huge.

        Return whether the results may be stored. If the analysis fails, the huge types are disabled, and the results
        must not be stored.
        """
        if not worker.is_needed(self._library) or (
            self._stored_analysis is not None and await asyncio.to_thread(self._restored, self._stored_analysis)
        ):
            return True
        try:
            encoded = await worker.analyse(self._library)
        except InvalidData as error:
            log.error("huge object types not analysed", reason=str(error), detail=error.detail)
            reason = Message.of("{error} Split the source into modules.", error=error)
            worker.disable_huge_types(self._library, reason)
            return False
        await asyncio.to_thread(snapshot.restore, self._library, encoded)
        return True

    def _restored(self, file: Path) -> bool:
        """Restore the analysis stored by an earlier process; return False if it is missing or outdated."""
        try:
            return snapshot.restore(self._library, file.read_bytes())
        except OSError:
            return False

    def _store(self, file: Path) -> None:
        """Analyse all types and store the results for the next start."""
        encoded = snapshot.take(self._library)
        try:
            write_private(file, encoded)
        except OSError as error:
            log.warning(
                "analysis cannot be stored, so the next start takes longer", file=str(file), reason=error.strerror
            )

    def _missing_model(self, source: ObjectTypeSource, without_model: set[str]) -> Message | None:
        """Return the problem of a missing collision model or mesh, None if none is missing."""
        if source.id in without_model:
            return Message.of("its collision model {name} is missing", name=source.id)
        mesh = UNSET if isinstance(source.model, Unset) else source.model.mesh
        if isinstance(mesh, Unset) or self._assets.exists(mesh.asset_id):
            return None
        return Message.of("the mesh {name} of its collision model is missing", name=mesh.asset_id)

    def _with_asset(self, robot: RobotMeta) -> RobotMeta:
        name = robot.urdf_package_filename
        if isinstance(name, Unset) or self._assets.exists(name):
            return robot
        return replace(robot, urdf_package_filename=UNSET)

    # ------------------------------------------------------------------------------------------------ changes
    async def add(self, source: ObjectTypeSource) -> ObjectTypeMeta:
        """Save a new or changed uploaded type and analyse it. The caller notifies the clients.

        It shadows an installed type of the same name until it is deleted.

        Raises:
            InvalidData: A base class has this name.
        """
        self.require_replaceable(source.id)
        async with self._reading:
            await self._storage.put_object_type(source)
            await self._read_uploaded()
            self._pending.skip(source.id)
        return self.meta(source.id)

    async def remove(self, name: str) -> ObjectTypeMeta:
        """Delete an uploaded type and return its last metadata. An installed type of that name is used again.

        Raises:
            InvalidData: The type is a base class, or installed.
            NotFound: The type does not exist.
        """
        self.require_deletable(name)
        meta = self.meta(name)
        async with self._reading:
            await self._storage.delete_object_type(name)
            await self._read_uploaded()
            self._pending.skip(name)
        return meta

    def require_replaceable(self, name: str) -> None:
        """Raise InvalidData for a base class, which cannot be replaced."""
        if name in BUILT_IN:
            raise InvalidData("The object type {name} is built in and cannot be replaced.", name=self.shown_name(name))

    def require_deletable(self, name: str) -> None:
        """Raise InvalidData for a base class or an installed type, which cannot be deleted."""
        if name in BUILT_IN:
            raise InvalidData("The object type {name} is built in and cannot be deleted.", name=self.shown_name(name))
        if name in self._installed and name not in self._uploaded:
            origin = self._origin(name) or Message.of("an installed distribution")
            raise InvalidData(
                "The object type {name} belongs to {origin} and cannot be deleted: uninstall {origin}.",
                name=self.shown_name(name),
                origin=origin,
            )

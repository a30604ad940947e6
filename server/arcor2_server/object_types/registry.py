"""What the server knows of object types: built-in, installed and uploaded ones, read by analysis, never imported."""

import asyncio
import hashlib
from collections.abc import Iterable
from pathlib import Path

import msgspec
import structlog
from msgspec import Struct
from msgspec.structs import replace

from arcor2_hw.analysis import (
    BUILT_IN,
    Enumeration,
    InstalledType,
    Library,
    SourceFile,
    TypeAnalysis,
    installed_types,
    module_name,
    snapshot,
    worker,
)
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta, ObjectTypeSource, find_action
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.runtime.messages import TypeCode
from arcor2_server.files import write_private
from arcor2_server.object_types.changes import Changes, PendingChanges
from arcor2_server.object_types.robot_packages import robot_packages
from arcor2_server.storage import AssetStore, Storage

log = structlog.get_logger(__name__)


class PackageType(Data, frozen=True):
    """What Build puts into a package for one object type.

    An uploaded type has `module` and `source`; an installed one `entry_point` ("module:Class") and the `folder` of
    its own code, and is copied from there.
    """

    name: str
    module: str
    source: str = ""
    entry_point: str = ""
    folder: Path | None = None
    distribution: str = ""
    version: str = ""


class _Known(Struct, frozen=True):
    """Everything that follows from the sources, made anew and put in place as a whole."""

    analyses: dict[str, TypeAnalysis] = {}
    metas: dict[str, ObjectTypeMeta] = {}
    robots: dict[str, RobotMeta] = {}
    digest: str = ""


class ObjectTypes:
    """The registry. Look-ups raise NotFound for a type or action that is not known.

    `revision` grows with every change of what is known. A type whose collision model, or the mesh of it, is not there
    is disabled, as is one whose source cannot be read; a robot's description is named only when it is there.
    """

    def __init__(self, storage: Storage, assets: AssetStore, stored_analysis: Path | None = None) -> None:
        self.revision = 0
        self._stored_analysis = stored_analysis
        self._storage = storage
        self._assets = assets
        self._library = Library()
        self._installed: dict[str, InstalledType] = {}
        self._uploaded: dict[str, ObjectTypeSource] = {}
        self._known = _Known()
        self._read_at: tuple[int, int] | None = None
        self._pending = PendingChanges()
        self._reading = asyncio.Lock()

    # ------------------------------------------------------------------------------------------------ life
    async def load(self) -> None:
        """Read built-in, installed and uploaded types."""
        async with self._reading:
            await asyncio.to_thread(self._read_installed)
            await self._offer_models()
            await self._read_uploaded()

    @property
    def up_to_date(self) -> bool:
        """Tell whether there is nothing that clients do not know yet."""
        return self._stored_revision == self._read_at and not self._pending.changes

    @property
    def _stored_revision(self) -> tuple[int, int]:
        return self._storage.types_revision, self._assets.revision

    async def refresh(self) -> Changes:
        """Take in what was put straight into storage since the last time; gives what clients do not know yet."""
        if self.up_to_date:
            return self._pending.changes
        async with self._reading:
            if self._stored_revision != self._read_at:
                await self._read_uploaded()
            return self._pending.take()

    async def take_in(self) -> None:
        """Take in what was put straight into storage; what clients do not know yet waits for the next refresh."""
        async with self._reading:
            if self._stored_revision != self._read_at:
                await self._read_uploaded()

    def _read_installed(self) -> None:
        for installed in installed_types():
            self._installed[installed.name] = installed
            if installed.file is not None:
                self._library.add(installed.file)

    async def _offer_models(self) -> None:
        """Offer the models of robots that lie with installed drivers as assets."""
        for folder in sorted({each.folder for each in self._installed.values() if each.folder}):
            try:
                packages = await asyncio.to_thread(robot_packages, Path(folder))
            except OSError as error:
                log.warning("the models of a driver cannot be read", folder=folder, reason=error.strerror)
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
                self._library.add(SourceFile(name, module_name(name), one.source))
            except InvalidData as error:
                log.warning("uploaded object type ignored", type=name, reason=str(error))
                continue
            if name not in self._uploaded and name in self._installed:
                log.warning("uploaded object type shadows an installed one", type=name, of=self._origin(name))
            self._uploaded[name] = one
        # Off the event loop: a hundred types take a moment to read.
        complete = await self._analyse_huge()
        known = await asyncio.to_thread(self._analyse, await self._storage.types_without_model(), complete)
        self._known = known
        self._pending.set_current(known.metas)
        if first:
            self._pending.take()
        self._read_at = revision
        self.revision += 1

    def _withdraw(self, name: str) -> None:
        """Forget an uploaded type; the installed one of that name is in its place again."""
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

    def _analyse(self, without_model: set[str], store: bool) -> _Known:
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
                problem = f"its collision model {name} is missing" if name in without_model else self._lacking(one)
                if problem and not meta.disabled:
                    meta = replace(meta, disabled=True, problem=problem)
                if name in self._installed:
                    meta = replace(meta, shadows=self._origin(name))
            else:
                meta = replace(meta, built_in=True)
            metas[name] = meta
        for name, installed in self._installed.items():
            if installed.file is None and name not in self._uploaded:
                meta = ObjectTypeMeta(name, "", built_in=True, abstract=True, disabled=True)
                metas[name] = meta = replace(meta, problem=str(installed.problem))
                analyses[name] = TypeAnalysis(meta, problem=installed.problem)
        robots = {name: self._with_asset(a.robot) for name, a in analyses.items() if a.robot and name in metas}
        metas, robots = dict(sorted(metas.items())), dict(sorted(robots.items()))
        actions = [analyses[name].actions for name in metas]
        digest = hashlib.sha256(msgspec.msgpack.encode((metas, robots, actions))).hexdigest()
        return _Known(analyses, metas, robots, digest)

    async def _analyse_huge(self) -> bool:
        """Analyse all types in another process if one of them would keep this one busy for long.

        Return whether the results may be stored: not if the analysis failed, which disables the huge types.
        """
        if not worker.is_needed(self._library) or (
            self._stored_analysis is not None and await asyncio.to_thread(self._restored, self._stored_analysis)
        ):
            return True
        try:
            encoded = await worker.analyse(self._library)
        except InvalidData as error:
            log.error("huge object types not analysed", reason=str(error), detail=error.detail)
            worker.give_up(self._library, f"{error} Split the source into modules.")
            return False
        await asyncio.to_thread(snapshot.restore, self._library, encoded)
        return True

    def _restored(self, file: Path) -> bool:
        """Take over the analysis stored by an earlier process; return False if it is missing or outdated."""
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
            log.warning("analysis not stored: the next start takes longer", file=str(file), reason=error.strerror)

    def _lacking(self, one: ObjectTypeSource) -> str:
        """Say which mesh a type needs that is not there; empty when none is missing."""
        mesh = UNSET if isinstance(one.model, Unset) else one.model.mesh
        if isinstance(mesh, Unset) or self._assets.exists(mesh.asset_id):
            return ""
        return f"the mesh {mesh.asset_id} of its collision model is missing"

    def _with_asset(self, robot: RobotMeta) -> RobotMeta:
        name = robot.urdf_package_filename
        if isinstance(name, Unset) or self._assets.exists(name):
            return robot
        return replace(robot, urdf_package_filename=UNSET)

    # ------------------------------------------------------------------------------------------------ look-ups
    @property
    def digest(self) -> str:
        """Return a digest of all types, robots and actions; it is the same in the next process if they are."""
        return self._known.digest

    def names(self) -> list[str]:
        """Give the names of all types."""
        return list(self._known.metas)

    def known(self, name: str) -> bool:
        """Tell whether there is such a type."""
        return name in self._known.metas

    def metas(self) -> list[ObjectTypeMeta]:
        """Give all types, by name, built-in and disabled ones too."""
        return list(self._known.metas.values())

    def meta(self, name: str) -> ObjectTypeMeta:
        """Give one type."""
        try:
            return self._known.metas[name]
        except KeyError:
            raise NotFound(f"There is no object type {name!r}.") from None

    def _analysis(self, name: str) -> TypeAnalysis:
        self.meta(name)
        return self._known.analyses[name]

    def bases(self, name: str) -> list[str]:
        """Give the names of all ancestors of a type, the nearest first, without the type itself."""
        return list(self._analysis(name).bases)

    def derives_from(self, name: str, base: str) -> bool:
        """Tell whether a type is, or derives from, `base`."""
        return name == base or base in self._analysis(name).bases

    def actions(self, name: str) -> list[ObjectAction]:
        """Give the actions of a type: inherited and disabled ones too, hidden ones not."""
        return [action for action in self._analysis(name).actions if not action.meta.hidden]

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Return one action, by its name or a former one."""
        if (action := find_action(self._analysis(type_name).actions, name)) is not None:
            return action
        raise NotFound(f"The object type {type_name} has no action {name!r}.")

    def enumerations(self, name: str) -> dict[tuple[str, str], Enumeration]:
        """Give the enumerations that the actions of a type take, by action and parameter."""
        return self._analysis(name).enumerations

    def keyword_only(self, name: str) -> frozenset[tuple[str, str]]:
        """Give the parameters of a type's actions that are given by name only, by action and parameter."""
        return self._analysis(name).keyword_only

    def robot_metas(self) -> list[RobotMeta]:
        """Give the features of all non-abstract robot types."""
        return list(self._known.robots.values())

    def robot_meta(self, name: str) -> RobotMeta:
        """Give the features of one robot type; NotFound when it is no robot."""
        self.meta(name)
        if (robot := self._known.robots.get(name)) is None:
            raise NotFound(f"The object type {name} is no robot.")
        return robot

    def implements(self, name: str, method: str) -> bool:
        """Tell whether a type really has an optional method, by itself or by an ancestor."""
        return method in self._analysis(name).implemented

    def files(self) -> list[SourceFile]:
        """Return the sources of installed and then of uploaded types, to be put into another library in this order."""
        installed = (each.file for each in self._installed.values() if each.file is not None)
        return [*installed, *map(self._library.file, self._uploaded)]

    def is_uploaded(self, name: str) -> bool:
        """Tell whether a type was uploaded, and so can be changed and deleted."""
        return name in self._uploaded

    # ------------------------------------------------------------------------------------------------ code
    def type_code(self, name: str) -> TypeCode:
        """Give how the cell host gets at one type."""
        self.meta(name)
        return self._code(name)

    def _code(self, name: str) -> TypeCode:
        if (one := self._uploaded.get(name)) is not None:
            return TypeCode(name, module=module_name(name), source=one.source)
        if (installed := self._installed.get(name)) is not None:
            return TypeCode(name, entry_point=installed.entry_point)
        return TypeCode(name, entry_point=f"arcor2_hw.objects:{name}")

    def _with_needed(self, names: Iterable[str]) -> list[str]:
        """Give types and the uploaded modules that they need, each after those that it needs itself."""
        found: dict[str, None] = {}
        for name in names:
            # A helper or mixin is no type of its own, but its module may be wanted.
            known = self._known.analyses[name] if name in self._uploaded else self._analysis(name)
            for file in known.modules:
                if file.name in self._uploaded:
                    found[file.name] = None
            found[name] = None
        return list(found)

    def type_codes(self, names: Iterable[str]) -> list[TypeCode]:
        """Give how the cell host gets at types and at the uploaded modules they need, bases and mixins first."""
        return [self._code(name) for name in self._with_needed(names)]

    def sources_for(self, names: Iterable[str]) -> list[PackageType]:
        """Give what a package needs of types, with their uploaded bases and mixins first; nothing for built-in ones."""
        found = []
        for name in self._with_needed(names):
            if (one := self._uploaded.get(name)) is not None:
                found.append(PackageType(name, module_name(name), source=one.source))
            elif (installed := self._installed.get(name)) is not None:
                found.append(
                    PackageType(
                        name,
                        module_name(name),
                        entry_point=installed.entry_point,
                        folder=Path(installed.folder) if installed.folder else None,
                        distribution=installed.distribution,
                        version=installed.version,
                    )
                )
        return found

    # ------------------------------------------------------------------------------------------------ changes
    async def add(self, source: ObjectTypeSource) -> ObjectTypeMeta:
        """Save an uploaded type (new, or of changed source or model) and analyse it; the caller notifies the clients.

        It takes the place of an installed type of the same name until it is deleted.

        Raises:
            InvalidData: The name is that of a base class.
        """
        self.require_replaceable(source.id)
        async with self._reading:
            await self._storage.put_object_type(source)
            await self._read_uploaded()
            self._pending.skip(source.id)
        return self.meta(source.id)

    async def remove(self, name: str) -> ObjectTypeMeta:
        """Delete an uploaded type and return its last meta; an installed type of that name is in its place again.

        Raises:
            InvalidData: The type is a base class, or installed.
            NotFound: There is no such type.
        """
        self.require_deletable(name)
        meta = self.meta(name)
        async with self._reading:
            await self._storage.delete_object_type(name)
            await self._read_uploaded()
            self._pending.skip(name)
        return meta

    @staticmethod
    def require_replaceable(name: str) -> None:
        """Refuse to replace a base class; InvalidData."""
        if name in BUILT_IN:
            raise InvalidData(f"The object type {name} is built in and cannot be replaced.")

    def require_deletable(self, name: str) -> None:
        """Refuse to delete a base class or an installed type; InvalidData."""
        if name in BUILT_IN:
            raise InvalidData(f"The object type {name} is built in and cannot be deleted.")
        if name in self._installed and name not in self._uploaded:
            origin = self._origin(name) or "an installed distribution"
            raise InvalidData(f"The object type {name} belongs to {origin} and cannot be deleted: uninstall that.")

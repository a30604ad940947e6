"""Look-ups in the analysed object types, and their code for cell hosts and packages."""

from collections.abc import Iterable
from pathlib import Path

from msgspec import Struct, field

from arcor2_hw.analysis import Enumeration, InstalledType, Library, SourceFile, TypeAnalysis, module_name
from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta, ObjectTypeSource, find_action
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.exceptions import NotFound
from arcor2_hw.runtime.messages import TypeCode


class PackageType(Data, frozen=True):
    """The code of one object type in a package.

    An uploaded type has `module`, `source`, and the `modules` that belong to it. An installed type has `entry_point`
    ("module:Class") and the `folder` of its code, which is copied.
    """

    name: str
    module: str
    source: str = ""
    entry_point: str = ""
    folder: Path | None = None
    distribution: str = ""
    version: str = ""
    modules: dict[str, str] = field(default_factory=dict)


def action_of(meta: ObjectTypeMeta, actions: Iterable[ObjectAction], name: str) -> ObjectAction:
    """Return the action of a type with this present or former name. Raise NotFound if there is none."""
    if (action := find_action(actions, name)) is not None:
        return action
    raise NotFound("The object type {type_name} has no action {name!r}.", type_name=meta.shown_name, name=name)


def robot_of(meta: ObjectTypeMeta, robot: RobotMeta | None) -> RobotMeta:
    """Return the features of a robot type. Raise NotFound if it has none, since it is not a robot."""
    if robot is None:
        raise NotFound("The object type {name} is not a robot.", name=meta.shown_name)
    return robot


class AnalysisResults(Struct, frozen=True):
    """All results of the analysis. They are replaced as a whole."""

    analyses: dict[str, TypeAnalysis] = {}
    metas: dict[str, ObjectTypeMeta] = {}
    robots: dict[str, RobotMeta] = {}
    digest: str = ""


class KnownTypes:
    """The results of the last analysis.

    The registry of object types reads the storage, and the storage hides settings that types declare as secret.
    Both use this object, which avoids a circular dependency.
    """

    def __init__(self) -> None:
        self.results = AnalysisResults()

    def replace(self, results: AnalysisResults) -> None:
        """Use the results of a new analysis."""
        self.results = results

    def names(self) -> list[str]:
        """Return the names of all types."""
        return list(self.results.metas)

    def meta(self, name: str) -> ObjectTypeMeta:
        """Return one type. Raise NotFound if there is none."""
        try:
            return self.results.metas[name]
        except KeyError:
            raise NotFound("Object type {name!r} does not exist.", name=name) from None


class TypeCatalog:
    """The known object types. Look-ups raise NotFound for an unknown type or action."""

    def __init__(self, known: KnownTypes) -> None:
        self.names = known.names
        self.meta = known.meta
        self._known_types = known
        self._library = Library()
        self._installed: dict[str, InstalledType] = {}
        self._uploaded: dict[str, ObjectTypeSource] = {}

    @property
    def _known(self) -> AnalysisResults:
        return self._known_types.results

    # ------------------------------------------------------------------------------------------------ look-ups
    def installed_folders(self) -> list[Path]:
        """Return the folders of installed types, sorted."""
        return sorted({Path(each.folder) for each in self._installed.values() if each.folder})

    def installed_folder(self, name: str) -> Path | None:
        """Return the folder of an installed type that is not shadowed by an uploaded one, otherwise None."""
        found = None if name in self._uploaded else self._installed.get(name)
        return Path(found.folder) if found is not None and found.folder else None

    @property
    def digest(self) -> str:
        """A digest of all types, robots and actions, which does not depend on the process."""
        return self._known.digest

    def known(self, name: str) -> bool:
        """Return whether there is such a type."""
        return name in self._known.metas

    def shown_name(self, name: str) -> str:
        """Return the name of a type for users. For an unknown type, return the given name."""
        return self.meta(name).shown_name if self.known(name) else name

    def metas(self) -> list[ObjectTypeMeta]:
        """Return all types, sorted by name, including built-in and disabled ones."""
        return list(self._known.metas.values())

    def _analysis(self, name: str) -> TypeAnalysis:
        self.meta(name)
        return self._known.analyses[name]

    def bases(self, name: str) -> list[str]:
        """Return the names of all ancestors of a type, the nearest first, without the type itself."""
        return list(self._analysis(name).bases)

    def derives_from(self, name: str, base: str) -> bool:
        """Return whether a type is, or derives from, `base`."""
        return name == base or base in self._analysis(name).bases

    def actions(self, name: str) -> list[ObjectAction]:
        """Return the actions of a type, including inherited and disabled ones, without hidden ones."""
        return [action for action in self._analysis(name).actions if not action.meta.hidden]

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Return one action, by its name or a former one."""
        return action_of(self.meta(type_name), self._known.analyses[type_name].actions, name)

    def enumerations(self, name: str) -> dict[tuple[str, str], Enumeration]:
        """Return the enumerations that the actions of a type take, by action and parameter."""
        return self._analysis(name).enumerations

    def keyword_only(self, name: str) -> frozenset[tuple[str, str]]:
        """Return the keyword-only parameters of a type's actions as pairs of action and parameter."""
        return self._analysis(name).keyword_only

    def robot_metas(self) -> list[RobotMeta]:
        """Return the features of all non-abstract robot types."""
        return list(self._known.robots.values())

    def robot_meta(self, name: str) -> RobotMeta:
        """Return the features of a robot type. Raise NotFound if it is not a robot."""
        return robot_of(self.meta(name), self._known.robots.get(name))

    def implements(self, name: str, method: str) -> bool:
        """Return whether a type or one of its ancestors implements an optional method."""
        return method in self._analysis(name).implemented

    def files(self) -> list[SourceFile]:
        """Return the sources of installed types, then those of uploaded types, which shadow them in this order."""
        installed = (each.file for each in self._installed.values() if each.file is not None)
        return [*installed, *map(self._library.file, self._uploaded)]

    def is_uploaded(self, name: str) -> bool:
        """Return whether a type was uploaded. Only uploaded types can be changed and deleted."""
        return name in self._uploaded

    # ------------------------------------------------------------------------------------------------ code
    def type_code(self, name: str) -> TypeCode:
        """Return the code of one type for the cell host."""
        self.meta(name)
        return self._code(name)

    def _code(self, name: str) -> TypeCode:
        if (one := self._uploaded.get(name)) is not None:
            return TypeCode(name, module=module_name(name), source=one.source, modules=one.own_modules)
        if (installed := self._installed.get(name)) is not None:
            return TypeCode(name, entry_point=installed.entry_point)
        return TypeCode(name, entry_point=f"arcor2_hw.objects:{name}")

    def _with_needed(self, names: Iterable[str]) -> list[str]:
        """Return types and the uploaded modules that they need, in the order of their imports."""
        found: dict[str, None] = {}
        for name in names:
            # A helper or mixin is not a type, but its module may be needed.
            known = self._known.analyses[name] if name in self._uploaded else self._analysis(name)
            for file in known.modules:
                if file.name in self._uploaded:
                    found[file.name] = None
            found[name] = None
        return list(found)

    def type_codes(self, names: Iterable[str]) -> list[TypeCode]:
        """Return the code of types and of the uploaded modules that they need, bases and mixins first."""
        return [self._code(name) for name in self._with_needed(names)]

    def sources_for(self, names: Iterable[str]) -> list[PackageType]:
        """Return the code of types for a package, uploaded bases and mixins first, without built-in types."""
        found = []
        for name in self._with_needed(names):
            if (one := self._uploaded.get(name)) is not None:
                found.append(PackageType(name, module_name(name), source=one.source, modules=one.own_modules))
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

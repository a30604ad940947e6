"""The sources of all object types, and their analyses."""

import ast
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

import msgspec

from arcor2_hw.analysis.actions import ActionReader
from arcor2_hw.analysis.enumerations import enumerations_of
from arcor2_hw.analysis.hierarchy import Hierarchy, is_known_library
from arcor2_hw.analysis.keywords import keyword_only
from arcor2_hw.analysis.module import ClassInfo, Import, Module, Value
from arcor2_hw.analysis.observations import observations_of
from arcor2_hw.analysis.presentation import display_name, of_type
from arcor2_hw.analysis.robots import robot_meta
from arcor2_hw.analysis.settings import SettingsReader
from arcor2_hw.analysis.source import UPLOADED, AnalysisStopped, Problem, SourceFile, Stamp, sendable, stamp_of
from arcor2_hw.analysis.symbols import External, Resolver, is_framework
from arcor2_hw.analysis.type_analysis import TypeAnalysis
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta, ObservationMeta, ParameterMeta
from arcor2_hw.data.older_names import not_offered
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.messages import translatable
from arcor2_hw.parsing import paused_garbage_collection

BUILT_IN: Final = (
    "Camera",
    "CollisionObject",
    "Generic",
    "GenericWithPose",
    "MultiArmRobot",
    "Robot",
    "VirtualCollisionObject",
)
"""Object types that are built in according to the protocol. Our other bases are not visible to clients."""

NO_DESCRIPTION: Final = translatable("No description available.")

_OURS: Final = Path(__file__).resolve().parents[1]


class Library:
    """Sources by type name; our bases are built in. Sources are never imported. For use by one thread."""

    def __init__(self, files: Iterable[SourceFile] = ()) -> None:
        self._files: dict[str, SourceFile] = {}
        self._by_module: dict[str, SourceFile] = {}
        self._roots: dict[str, Path] = {"arcor2_hw": _OURS.parent}
        self._modules: dict[str, Module | AnalysisStopped | None] = {}
        self._parsed: dict[str, Module] = {}  # parsed files; a file is parsed again only when its text changed
        self._analyses: dict[str, TypeAnalysis] = {}
        self.stamps: dict[str, Stamp | None] = {}
        """Stamps of the files that were looked for on the disk, None for a missing one."""
        self._forget(())
        for file in files:
            self.add(file)

    # -------------------------------------------------------------------------------- content
    def add(self, file: SourceFile) -> None:
        """Add a source, replacing one of the same name.

        Raises:
            InvalidData: The name is that of a built-in type, or empty.
        """
        if file.name in BUILT_IN:
            raise InvalidData("{name} is built in and cannot be replaced", name=file.name)
        if not file.name:
            raise InvalidData("a source needs the name of its object type")
        if file.name in self._files:
            self.remove(file.name)
        self._files[file.name] = file
        dotted = _dotted(file)
        modules = {dotted: file} | {each.module: each for each in file.modules}
        self._by_module |= modules
        top, roots = dotted.partition(".")[0], len(self._roots)
        if file.path and top != UPLOADED:
            up = dotted.count(".") + (1 if file.is_package else 0)
            parents = Path(file.path).parents
            if up < len(parents):
                self._roots.setdefault(top, parents[up])
        if len(self._roots) > roots:  # more imports lead to a file
            self._analyses.clear()
        self._forget(modules)

    def remove(self, name: str) -> None:
        """Remove a source.

        Raises:
            NotFound: The source does not exist.
        """
        file = self._file(name)
        del self._files[name]
        modules = [_dotted(file), *(each.module for each in file.modules)]
        for dotted in modules:
            self._by_module.pop(dotted, None)
        # Several types may share a module.
        for other in self._files.values():
            if _dotted(other) == _dotted(file):
                self._by_module[_dotted(other)] = other
        self._forget(modules)

    def names(self) -> list[str]:
        """Return the names of all types, built-in ones first."""
        return [*BUILT_IN, *self._files]

    def __contains__(self, name: object) -> bool:
        return name in BUILT_IN or name in self._files

    def file(self, name: str) -> SourceFile:
        """Return the source of an added type.

        Raises:
            NotFound: The source does not exist.
        """
        return self._file(name)

    def put_analyses(self, analyses: Mapping[str, TypeAnalysis], stamps: Mapping[str, Stamp | None]) -> None:
        """Use results of an earlier analysis of the same sources, and the stamps of the files read for them."""
        self._analyses = dict(analyses)
        self.stamps = dict(stamps)

    def _file(self, name: str) -> SourceFile:
        try:
            return self._files[name]
        except KeyError:
            raise NotFound("The source of object type {name} does not exist.", name=name) from None

    def _forget(self, changed: Iterable[str]) -> None:
        """Forget everything that depends on modules with these full names, or on a file that changed on the disk."""
        if self._analyses and any(stamp_of(Path(path)) != stamp for path, stamp in self.stamps.items()):
            self._analyses.clear()
        above = {name for dotted in changed for name in _packages(dotted)}
        self._analyses = {name: known for name, known in self._analyses.items() if not above & known.lookups}
        self._modules.clear()
        resolver = Resolver(self._load)
        self._hierarchy = Hierarchy(resolver)
        self._actions = ActionReader(self._hierarchy)
        self._settings = SettingsReader(self._hierarchy, self._actions)

    # -------------------------------------------------------------------------------- modules
    def _load(self, dotted: str) -> Module | None:
        """Return a module by its full name: uploaded, of an added distribution, or ours.

        Raises:
            AnalysisStopped: It cannot be parsed.
        """
        if dotted not in self._modules:
            try:
                file = self._by_module.get(dotted) or self._on_disk(dotted)
                self._modules[dotted] = self._shared(dotted) if file is None else self._parse(file, dotted)
            except AnalysisStopped as error:
                self._modules[dotted] = error
        found = self._modules[dotted]
        if isinstance(found, AnalysisStopped):
            raise AnalysisStopped(found.message, found.problem.path, found.problem.line)
        return found

    def _shared(self, dotted: str) -> Module | None:
        """Return the shared module that a type with modules of its own imports relatively."""
        package, _, name = dotted.rpartition(".")
        owner = self._by_module.get(package)
        return self._load(f"{UPLOADED}.{name}") if owner is not None and owner.modules else None

    def _parse(self, file: SourceFile, dotted: str) -> Module:
        file = msgspec.structs.replace(file, module=dotted)
        known = self._parsed.get(dotted)
        if known is None or known.file != file:
            known = self._parsed[dotted] = Module(file)
        return known

    def _on_disk(self, dotted: str) -> SourceFile | None:
        top, _, rest = dotted.partition(".")
        root = self._roots.get(top)
        if root is None or not rest or not all(part.isidentifier() for part in rest.split(".")):
            return None
        if top == "arcor2_hw" and not rest.startswith("objects"):
            return None  # parameter types and data classes are known by name
        base = root.joinpath(*dotted.split("."))
        for path, is_package in ((base.with_suffix(".py"), False), (base / "__init__.py", True)):
            self.stamps[str(path)] = stamp_of(path)
            try:
                return SourceFile("", dotted, path.read_bytes(), str(path), is_package)
            except (FileNotFoundError, NotADirectoryError):
                continue
            except OSError as error:
                raise AnalysisStopped(
                    "the file cannot be read: {reason}", str(path), 1, reason=error.strerror
                ) from None
        return None

    def _needed(self, module: Module, lookups: set[str]) -> list[SourceFile]:
        """Return the files that a module needs, each after its own requirements.

        Args:
            module: to start from.
            lookups: gets the full names of the modules that are looked for.

        Raises:
            AnalysisStopped: A file is missing.
        """
        done: dict[str, SourceFile] = {}
        seen = {module.dotted}

        def visit(of: Module) -> None:
            for found in of.imports:
                lookups.update(self._names_of(found))
                for wanted in self._imported(of, found):
                    if wanted.dotted not in seen and not _is_ours(wanted.dotted):
                        seen.add(wanted.dotted)
                        visit(wanted)
                        done[wanted.dotted] = self._by_module.get(wanted.dotted, wanted.file)

        visit(module)
        return list(done.values())

    def _names_of(self, found: Import) -> list[str]:
        """Return the full names of the modules that an import statement may load, and that a library may contain.

        The module that it names also stands for those below it.
        """
        top, _, _ = found.module.partition(".")
        if top == "arcor2_hw" or (top != UPLOADED and top not in self._roots):
            return []
        shared = (found.module.rpartition(".")[2], found.name) if found.relative else ()
        return [found.module, *(f"{UPLOADED}.{name}" for name in shared)]

    def _imported(self, module: Module, found: Import) -> list[Module]:
        """Return those of the modules loaded by an import statement that are part of the library."""
        if not found.guarded and (lacking := not_offered(found.module, found.name)) is not None:
            raise module.problem(lacking, found.line)
        try:
            first = self._load(found.module)
            second = self._load(f"{found.module}.{found.name}") if found.name not in (None, "*") else None
        except AnalysisStopped:
            if found.guarded:
                return []
            raise
        if found.relative and first is None and second is None and not found.guarded:
            shown = found.module.rpartition(".")[2]
            raise module.problem("the imported module {name} does not exist", found.line, name=shown)
        if second is not None and first is not None and found.name in first.bindings:
            second = None  # a name in the package, not the module of that name
        return [each for each in (first, second) if each is not None]

    # -------------------------------------------------------------------------------- analysis
    def analyse(self, name: str) -> TypeAnalysis:
        """Analyse the source of a type. Errors in it are reported in `problem`, which disables the type.

        Raises:
            NotFound: The source does not exist.
        """
        if name not in self._analyses:
            with paused_garbage_collection():
                self._analyses[name] = self._analyse(name)
        return self._analyses[name]

    def _analyse(self, name: str) -> TypeAnalysis:
        if name in BUILT_IN:
            module = self._load("arcor2_hw.objects")
            found = self._hierarchy.resolver.name(name, module) if module is not None else None
            if not isinstance(found, ClassInfo):
                raise NotFound("the installation lacks the base class {name}", name=name)
            return self._of_class(name, found, ())
        file = self._file(name)
        base = ""
        needed: tuple[SourceFile, ...] = ()
        lookups = {_dotted(file)}
        try:
            module = self._load(_dotted(file))
            assert module is not None
            info = module.bindings.get(name)
            if isinstance(info, Import | Value) or (info is None and self._declares_object_type(module)):
                raise module.problem("the file has no class {name}", 1, name=name)
            needed = tuple(self._needed(module, lookups))
            if not isinstance(info, ClassInfo) or not info.node.bases or not self._is_object_type(info):
                meta = ObjectTypeMeta(name, abstract=True)
                return TypeAnalysis(meta, modules=needed, lookups=frozenset(lookups), is_object_type=False)
            return msgspec.structs.replace(self._of_class(name, info, needed), lookups=frozenset(lookups))
        except AnalysisStopped as error:
            problem = error.problem
        except (RecursionError, MemoryError):
            path = file.path or f"{_dotted(file).replace('.', '/')}.py"
            problem = AnalysisStopped("the source is nested too deeply", path, 1).problem
        meta = ObjectTypeMeta(name, NO_DESCRIPTION, base=base, abstract=True).disabled_because(problem.message)
        return TypeAnalysis(meta, modules=needed, lookups=frozenset(lookups), problem=problem)

    def _declares_object_type(self, module: Module) -> bool:
        classes = (each for each in module.bindings.values() if isinstance(each, ClassInfo))
        return any(self._hierarchy.derives_from(each, "Generic") for each in classes)

    def _is_object_type(self, info: ClassInfo) -> bool:
        """Return whether a class derives from Generic.

        Raises:
            AnalysisStopped: It cannot be determined, or the base is wrong.
        """
        hierarchy = self._hierarchy
        last = info.node.bases[-1]
        if not hierarchy.derives_from(info, "Generic"):
            for each in hierarchy.lineage(info):
                if isinstance(each, External) and not is_known_library(each):
                    raise info.problem("{cls}: the base {base} cannot be read", last, cls=info.name, base=each.dotted)
            return False
        base = hierarchy.base(info)
        if base is None or not hierarchy.derives_from(base, "Generic"):
            raise info.problem(
                "{cls}: the last base is not an object type; mixins must come before the base", last, cls=info.name
            )
        return True

    def _of_class(self, name: str, info: ClassInfo, needed: tuple[SourceFile, ...]) -> TypeAnalysis:
        hierarchy = self._hierarchy
        problem: Problem | None = None
        settings: list[ParameterMeta] = []
        abstract = True
        robot: RobotMeta | None = None
        observations: list[ObservationMeta] = []
        bases = self._bases(info)
        try:
            abstract = bool(hierarchy.attribute(info, "_ABSTRACT", True)) or bool(hierarchy.unimplemented(info))
            settings = self._settings.settings(info)
            observations = observations_of(info, hierarchy)
            if hierarchy.derives_from(info, "Robot") and not abstract:
                robot = robot_meta(name, info, hierarchy)
        except AnalysisStopped as error:
            problem = error.problem
        meta = ObjectTypeMeta(
            name,
            _description(info),
            built_in=name in BUILT_IN,
            base=bases[0] if bases else "",
            has_pose=hierarchy.derives_from(info, "GenericWithPose"),
            abstract=abstract,
            settings=settings,
        )
        if problem is not None:
            meta = meta.disabled_because(problem.message)
        category, icon = of_type(info, hierarchy)
        observes = hierarchy.method(info, "observations")
        meta = msgspec.structs.replace(
            meta,
            display_name=display_name(info, hierarchy),
            category=category,
            icon=icon,
            observable=True if observes is not None and observes[0].name != "Generic" else UNSET,
            observations=observations or UNSET,
        )
        direct = hierarchy.bases(info)
        actions = tuple(self._all_actions(info, bases))
        return TypeAnalysis(
            meta,
            actions,
            robot,
            frozenset() if name in BUILT_IN else hierarchy.implemented_hooks(info),
            tuple(bases),
            tuple(base.name if isinstance(base, ClassInfo) else base.dotted for base in direct[:-1]),
            needed,
            problem=problem,
            enumerations=enumerations_of(info, actions, hierarchy),
            keyword_only=keyword_only(info, actions, hierarchy),
        )

    def _type_name(self, info: ClassInfo) -> str | None:
        """Return the name under which clients know a class, or None if they do not."""
        if is_framework(info):
            return info.name if info.name in BUILT_IN else None
        file = self._files.get(info.name)
        return info.name if file is not None and _dotted(file) == info.module.dotted else None

    def _bases(self, info: ClassInfo) -> list[str]:
        """Return the object types that a class derives from by its bases, nearest first."""
        return [name for each in self._chain(info)[1:] if (name := self._type_name(each)) is not None]

    def _chain(self, info: ClassInfo) -> list[ClassInfo]:
        """Return a class, its base, the base of that and so on, without mixins."""
        chain: list[ClassInfo] = []
        current: ClassInfo | None = info
        while current is not None and current not in chain:
            chain.append(current)
            current = self._hierarchy.base(current)
        return chain

    def _all_actions(self, info: ClassInfo, bases: list[str]) -> list[ObjectAction]:
        """Return own and inherited actions, nearest ancestors first, each level by name.

        Actions of a mixin, or of a class unknown to clients, belong to the type that adds it.
        """
        if self._type_name(info) in BUILT_IN:
            return list(self._actions.actions(info, info).values())
        levels: dict[str, dict[str, ObjectAction]] = {}
        inherited: set[str] = set()
        taken: set[str] = set()
        homes = self._homes(info)
        for each in self._hierarchy.ancestors(info):
            own = self._actions.actions(each, info)
            for name, found in own.items():
                if name in taken:
                    inherited.add(name)
                else:
                    levels.setdefault(homes[each], {})[name] = found
            taken |= set(each.members)
        result: list[ObjectAction] = []
        for level in (info.name, *bases):
            for name, found in sorted(levels.get(level, {}).items()):
                origin: str | msgspec.UnsetType = UNSET if level == info.name else level
                if level == info.name and name in inherited and bases:
                    origin = bases[0]
                result.append(msgspec.structs.replace(found, origins=origin))
        return result

    def _homes(self, info: ClassInfo) -> dict[ClassInfo, str]:
        """Return for each ancestor the known type that added it first."""
        chain = self._chain(info)
        names: list[str] = []
        for each in chain:
            names.append(self._type_name(each) or (names[-1] if names else info.name))
        homes: dict[ClassInfo, str] = {}
        for each, name in zip(reversed(chain), reversed(names), strict=True):
            for ancestor in self._hierarchy.ancestors(each):
                homes.setdefault(ancestor, name)
        return homes


def _dotted(file: SourceFile) -> str:
    """Return the full name of a file's module; uploaded files get a package."""
    return file.module if "." in file.module else f"{UPLOADED}.{file.module}"


def _packages(dotted: str) -> list[str]:
    """Return the full name of a module and those of the packages that contain it."""
    parts = dotted.split(".")
    return [".".join(parts[: count + 1]) for count in range(len(parts))]


def _is_ours(dotted: str) -> bool:
    return dotted.partition(".")[0] == "arcor2_hw"


def _description(info: ClassInfo) -> str:
    text = (ast.get_docstring(info.node) or "").strip()
    return sendable(text.partition("\n")[0].strip()) or NO_DESCRIPTION

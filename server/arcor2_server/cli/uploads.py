"""Assigns modules to the object types that `arcor2-hw object-type add` uploads."""

from collections.abc import Mapping, Sequence

from arcor2_hw.analysis import Library, SourceFile
from arcor2_hw.client import Rest
from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectTypeSource
from arcor2_hw.runtime.type_files import shared_modules, sibling_modules
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.server_connection import Failed


class Upload(Data, frozen=True):
    """One object type or shared module to upload.

    Attributes:
        modules: Sources of the modules that belong to the type, by name.
        users: For a shared module: the types on the server that import it.
    """

    name: str
    source: str
    modules: dict[str, str]
    users: Sequence[str] = ()

    def __str__(self) -> str:
        if self.modules:
            return f"{self.name} uploaded with {', '.join(sorted(self.modules))}"
        users = f", used by {', '.join(self.users)}" if self.users else ""
        return f"{self.name} uploaded{users}"


async def plan_uploads(given: Mapping[str, SourceFile], rest: Rest) -> list[Upload]:
    """Return the uploads of files, each after those that it imports.

    A module without an object type belongs to the one given type that imports it relatively. If several import it, or
    none, it is shared by all types on the server.

    Raises:
        Failed: A file has a problem, or a shared module of types that are not given would be replaced.
    """
    listed = [entry.id for entry in await rest.object_types()]
    stored = {name: await rest.object_type(name) for name in listed if name in given}
    files = {name: _with_stored_modules(file, given, stored.get(name)) for name, file in given.items()}
    library = Library(files.values())
    if any(library.analyse(name).problem for name in given):
        stored |= await _others(listed, stored, rest)
        for name in stored.keys() - given.keys():
            library.add(SourceFile.of_upload(stored[name]))
    analyses = {name: library.analyse(name) for name in given}
    for analysis in analyses.values():
        if analysis.problem is not None:
            raise Failed(ExitStatus.ANALYSIS_PROBLEMS, str(analysis.problem))
    helpers = {given[name].module: _text(given[name]) for name in given if not analyses[name].is_object_type}
    modules = {name: _reachable(files[name], helpers) for name, analysis in analyses.items() if analysis.is_object_type}
    users = {module: [name for name, own in modules.items() if module in own] for module in helpers}
    ordered = {each.name: None for name in given for each in (*analyses[name].modules, files[name])}
    uploads = []
    for name in ordered:
        if name in modules:
            own = {each: text for each, text in modules[name].items() if len(users.get(each, ())) < 2}
            uploads.append(Upload(name, _text(given[name]), own))
        elif name in given and len(users[given[name].module]) != 1:
            stored |= await _others(listed, stored, rest)
            uploads.append(_shared(given[name], users[given[name].module], given, stored))
    return uploads


async def _others(
    listed: Sequence[str], stored: Mapping[str, ObjectTypeSource], rest: Rest
) -> dict[str, ObjectTypeSource]:
    return {name: await rest.object_type(name) for name in listed if name not in stored}


def _shared(
    file: SourceFile, users: Sequence[str], given: Mapping[str, SourceFile], stored: Mapping[str, ObjectTypeSource]
) -> Upload:
    """Return the upload of a shared module. Raise Failed if it is the module of types that are not given."""
    source, old = _text(file), stored.get(file.name)
    others = [name for name, one in stored.items() if name not in given and file.module in shared_modules(*one.code)]
    owners = [name for name, one in stored.items() if file.module in one.own_modules]
    if owners and not users and not others:
        raise Failed(
            ExitStatus.USAGE,
            f"{file.path} belongs to {', '.join(owners)} on the server. Specify it together with the file of the type.",
        )
    if users and others and old is not None and old.source != source:
        raise Failed(
            ExitStatus.USAGE,
            f"{file.path} would replace the module {file.module} that {', '.join(others)} imports. Rename it, upload "
            f"{', '.join(users)} separately, or upload {file.path} alone to change it for all types.",
        )
    return Upload(file.name, source, {}, others)


def _with_stored_modules(
    file: SourceFile, given: Mapping[str, SourceFile], stored: ObjectTypeSource | None
) -> SourceFile:
    """Return a file with the modules that belong to it on the server and are not given."""
    if stored is None:
        return file
    replaced = {each.module for each in given.values()}
    own = {name: text for name, text in stored.own_modules.items() if name not in replaced}
    return file.with_modules({name: SourceFile("", name, text) for name, text in own.items()})


def _reachable(file: SourceFile, helpers: Mapping[str, str]) -> dict[str, str]:
    """Return the helper modules, and the modules of the file, that it imports relatively, directly or indirectly."""
    texts = {**helpers, **{each.module.rpartition(".")[2]: _text(each) for each in file.modules}}
    found: dict[str, str] = {}
    waiting = sibling_modules(_text(file))
    while waiting:
        module = waiting.pop()
        if module in texts and module not in found:
            found[module] = texts[module]
            waiting |= sibling_modules(texts[module])
    return found


def _text(file: SourceFile) -> str:
    return file.source if isinstance(file.source, str) else file.source.decode()

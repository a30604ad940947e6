"""Validates an export file without a server. Each problem names its entry."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Literal

from arcor2_hw.analysis import SourceFile
from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta
from arcor2_hw.data.project import END, START, Project
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, InvalidProject, NotFound
from arcor2_server.build import script
from arcor2_server.build.combined_types import CombinedTypes
from arcor2_server.documents.checks.interlocks import interlock_problems, interlocks_of
from arcor2_server.documents.checks.project import project_findings
from arcor2_server.documents.checks.scene import scene_findings
from arcor2_server.documents.renamed_actions import with_present_names
from arcor2_server.exchange.archive import PROJECT, SCENE, SCRIPT, Archive, mesh_of
from arcor2_server.object_types.catalog import action_of, robot_of


class Finding(Data, frozen=True):
    """A problem of an export.

    Attributes:
        entry: The file in the export and the entry in it.
        text: The problem.
        level: An error prevents the document from being opened or run. A note does not (an unfinished program).
    """

    entry: str
    text: str
    level: Literal["error", "note"] = "error"


class AvailableTypes:
    """The object types of the export, the installed ones, and those of the importing server.

    Args:
        archive: The export, whose types take precedence.
        installed: Sources of installed types.
        elsewhere: Metadata of the types on the server.
        actions: Actions of these types.
        robots: Metadata of the robot types on the server.
    """

    def __init__(
        self,
        archive: Archive,
        installed: Iterable[SourceFile],
        elsewhere: Mapping[str, ObjectTypeMeta] | None = None,
        actions: Mapping[str, Mapping[str, ObjectAction]] | None = None,
        robots: Mapping[str, RobotMeta] | None = None,
    ) -> None:
        self.candidates = CombinedTypes(installed, archive.types)
        self._given = archive.types
        self._elsewhere = elsewhere or {}
        self._actions = actions or {}
        self._robots = robots or {}

    def _from_elsewhere(self, name: str) -> bool:
        return name in self._elsewhere and name not in self._given

    def meta(self, name: str) -> ObjectTypeMeta:
        """Return one type. Raise NotFound if there is none."""
        return self._elsewhere[name] if self._from_elsewhere(name) else self.candidates.meta(name)

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Return one action. Raise NotFound if there is none."""
        if not self._from_elsewhere(type_name):
            return self.candidates.action(type_name, name)
        return action_of(self._elsewhere[type_name], self._actions.get(type_name, {}).values(), name)

    def robot_meta(self, name: str) -> RobotMeta:
        """Return the features of a robot type. Raise NotFound if the type is not a robot."""
        if not self._from_elsewhere(name):
            return self.candidates.robot_meta(name)
        return robot_of(self._elsewhere[name], self._robots.get(name))


def find_problems(archive: Archive, types: AvailableTypes, assets: Iterable[str] | None = None) -> Iterator[Finding]:
    """Return the problems of an export. `assets`: ids that exist on the server; None without a server."""
    available = {*archive.assets, *(assets or ())}
    for name, one in archive.types.items():
        analysis = types.candidates.analysis(name)
        if analysis.problem is not None:
            yield Finding(f"object_types/{name}", str(analysis.problem))
        for action in analysis.actions:
            if action.disabled:
                text = f"The action cannot be used: {action.why_disabled}"
                yield Finding(f"object_types/{name}.{action.name}", text, "note")
        mesh = mesh_of(one)
        if mesh is not None and mesh not in available:
            text = f"The mesh needs the asset {mesh!r}, which is missing."
            yield Finding(
                f"data/models of {name}", text, "note" if archive.from_package and assets is None else "error"
            )
    errors = False
    for entry, text in _document_findings(archive, types):
        errors = True
        yield Finding(entry, text)
    if archive.project is not None and archive.scene is not None:
        project = with_present_names(archive.scene, archive.project, types)
        yield from _program(archive, archive.scene, project, types, errors)


def _document_findings(archive: Archive, types: AvailableTypes) -> Iterator[tuple[str, str]]:
    scene, project = archive.scene, archive.project
    if scene is None:
        return
    scene_names = {f"objects[{index}]": obj.name for index, obj in enumerate(scene.objects)}
    if project is None:
        for entry, problem in scene_findings(scene, types):
            yield _titled(SCENE, entry, scene_names), problem.text
    else:
        names = scene_names | _project_names(project)
        for entry, problem in project_findings(scene, project, types):
            document, _, inner = entry.partition(".")
            yield _titled(SCENE if document == "scene" else PROJECT, inner, names), problem.text
        yield from _logic(project)
    for interlock in interlock_problems(scene, types):
        yield SCENE, interlock.text
    keys = [*(obj.id for obj in scene.objects), *(one.id for one in interlocks_of(scene))]
    yield from _duplicate_ids(SCENE, [scene.id, *keys])
    if project is not None:
        ids = [project.id, *(one.id for one in project.parameters), *(item.id for item in project.logic)]
        for point in project.action_points:
            ids += [point.id, *(one.id for one in point.orientations), *(one.id for one in point.robot_joints)]
        ids += [action.id for action in project.all_actions()]
        for function in project.functions:
            ids += [function.id, *(item.id for item in function.logic)]
        yield from _duplicate_ids(PROJECT, ids)


def _project_names(project: Project) -> dict[str, str]:
    names = {f"parameters[{index}]": one.name for index, one in enumerate(project.parameters)}
    for index, point in enumerate(project.action_points):
        at = f"action_points[{index}]"
        names[at] = point.name
        names |= {f"{at}.actions[{number}]": one.name for number, one in enumerate(point.actions)}
        names |= {f"{at}.robot_joints[{number}]": one.name for number, one in enumerate(point.robot_joints)}
    for index, function in enumerate(project.functions):
        at = f"functions[{index}]"
        names[at] = function.name
        names |= {f"{at}.actions[{number}]": one.name for number, one in enumerate(function.actions)}
    return names


def _titled(path: str, entry: str, names: Mapping[str, str]) -> str:
    name = names.get(entry)
    return f"{path}: {entry}" if name is None else f"{path}: {entry} ({name})"


def _duplicate_ids(path: str, ids: list[str]) -> Iterator[tuple[str, str]]:
    for key, count in Counter(ids).items():
        if not key:
            yield path, "An entry has no id."
        elif count > 1:
            yield path, f"{count} entries have the id {key}."


def _logic(project: Project) -> Iterator[tuple[str, str]]:
    of_program = [action for point in project.action_points for action in point.actions]
    parts = [("logic", of_program, project.logic)]
    parts += [(f"functions[{index}].logic", one.actions, one.logic) for index, one in enumerate(project.functions)]
    for at, actions, logic in parts:
        known = {START, END, *(action.id for action in actions)}
        for index, item in enumerate(logic):
            for place in {item.start.partition("/")[0], item.end.partition("/")[0]} - known:
                yield (
                    f"{PROJECT}: {at}[{index}]",
                    f"The connection leads from or to action {place}, which does not exist.",
                )


def _program(
    archive: Archive, scene: Scene, project: Project, types: AvailableTypes, errors: bool
) -> Iterator[Finding]:
    if not project.has_logic:
        try:
            script.check_syntax(archive.script or "")
        except InvalidProject as error:
            yield Finding(SCRIPT, str(error))
    elif not errors:
        try:
            script.from_logic(scene, project, types.candidates.facts(scene))
        except NotFound:
            return  # a type that only the server has; the server checks it at the build
        except Arcor2Error as error:
            yield Finding(f"{PROJECT}: logic", f"The project cannot be built yet: {error}", "note")

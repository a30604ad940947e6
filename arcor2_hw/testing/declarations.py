"""Checks of a driver's source by analysis, without importing it and without a device."""

import ast
import inspect
from pathlib import Path
from typing import Final

from arcor2_hw.analysis import (
    InstalledType,
    Library,
    SourceFile,
    TypeAnalysis,
    alarms,
    extraction,
    installed_types,
    translations,
)
from arcor2_hw.analysis.library import NO_DESCRIPTION
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.parsing import parse
from arcor2_hw.testing import quality

STOCK: Final = "arcor2_hw.objects."
"""Package of the stock types, which are not drivers."""
BASES: Final = ("Generic", "GenericWithPose", "CollisionObject", "Robot", "MultiArmRobot", "Camera")
MOTION: Final = ("move_to_pose", "move_to_joints", "move_path", "move_until_contact", "jog")


def drivers() -> list[InstalledType]:
    """Return the installed object types that are drivers by name, without importing them."""
    return [each for each in installed_types() if not each.entry_point.startswith(STOCK)]


def source_of(kind: type) -> SourceFile:
    """Return the source of an imported type."""
    path = Path(inspect.getfile(kind))
    return SourceFile(kind.__name__, kind.__module__, path.read_bytes(), str(path), path.stem == "__init__")


def faults(file: SourceFile) -> list[str]:
    """Return a sentence for each fault of the source or the quality.yaml of a driver."""
    library = Library([file])
    found = library.analyse(file.name)
    if found.problem is not None:
        return [f"{file.name}: {found.problem.what}"]
    if not found.is_object_type:
        return [f"{file.name} does not derive from Generic"]
    wrong = _of_the_type(file, found)
    try:
        claims = quality.read(Path(file.path).parent / quality.FILE)
    except Arcor2Error as error:
        return [*wrong, str(error)]
    if file.name not in claims.types:
        wrong.append(f"quality.yaml: types does not name {file.name}")
    offered = {action.name for action in found.actions}
    if unknown := set(claims.actions_of(file.name)) - offered:
        wrong.append(f"quality.yaml: {file.name} has no action {', '.join(sorted(unknown))}")
    own = {action.name for action in own_actions(found)}
    if unnamed := own - set(claims.actions_of(file.name)):
        wrong.append(f"quality.yaml: actions does not name {', '.join(sorted(unnamed))} of {file.name}")
    return wrong


def translation_faults(file: SourceFile) -> list[str]:
    """Return a sentence for each fault of the translations of a driver."""
    folder = Path(file.path).parent
    if not (folder / translations.FOLDER).is_dir():
        return []
    return translations.faults(folder, extraction.texts(folder, [file]) | extraction.translated_by_library())


def alarm_faults(file: SourceFile) -> list[str]:
    """Return a sentence for each fault of the alarms that a driver declares."""
    folder = Path(file.path).parent
    try:
        declared = alarms.read(folder)
    except InvalidData as error:
        return [str(error)]
    wrong = [
        f"{alarms.FILE}: alarm {kind.number} ({kind.code}) has no {name}"
        for kind in declared
        for name in ("cause", "remedy")
        if not getattr(kind, name)
    ]
    if not declared or not (folder / translations.FOLDER).is_dir():
        return wrong  # without reading all sources of the library for its texts, which takes seconds
    shared = extraction.translated_by_library()
    for language in alarms.LANGUAGES:
        path = translations.file_of(folder, language)
        known = translations.read(path) if path.exists() else {}
        wrong += [
            f"{path.name}: the text {text!r} of {alarms.FILE} is not translated"
            for text in sorted(set(alarms.texts_of(declared)) - set(shared))
            if not known.get(text)
        ]
    return wrong


def own_actions(found: TypeAnalysis) -> list[ObjectAction]:
    """Return the actions of a type, except those of our base types."""
    return [action for action in found.actions if isinstance(action.origins, Unset) or action.origins not in BASES]


def _of_the_type(file: SourceFile, found: TypeAnalysis) -> list[str]:
    name = file.name
    wrong = []
    if found.meta.abstract:
        wrong.append(f"{name} cannot be added to a scene: it is _ABSTRACT, or a mandatory method is missing")
    if found.meta.disabled:
        wrong.append(f"{name} is disabled: {found.meta.problem}")
    if found.meta.description in ("", NO_DESCRIPTION):
        wrong.append(f"{name} has no docstring")
    wrong += [f"{name}: setting {each.name} is not described" for each in found.meta.settings if not each.description]
    for action in found.actions:
        wrong += [f"{name}.{action.name} {fault}" for fault in _of_an_action(action)]
    if set(MOTION) & found.implemented and "stop" not in found.implemented:
        wrong.append(f"{name} can move, but has no stop()")
    if found.robot is not None and "state" not in found.implemented:
        wrong.append(f"{name} is a robot, but has no state()")
    if not any(_declares_reaction(each.source) for each in (file, *found.modules)):
        wrong.append(f"{name} does not declare loss_reaction")
    return wrong


def _of_an_action(action: ObjectAction) -> list[str]:
    if action.disabled:
        return [f"is disabled: {action.problem}"]
    faults_found = [] if action.description else ["has no docstring"]
    return faults_found + [
        f"does not describe its parameter {each.name}" for each in action.parameters if not each.description
    ]


def _declares_reaction(source: str | bytes) -> bool:
    classes = (node for node in ast.walk(parse(source)) if isinstance(node, ast.ClassDef))
    return any(
        isinstance(target, ast.Name) and target.id == "loss_reaction"
        for each in classes
        for line in each.body
        for target in ([line.target] if isinstance(line, ast.AnnAssign) else getattr(line, "targets", []))
    )

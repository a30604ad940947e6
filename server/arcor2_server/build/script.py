"""Generates script.py of a package: the logic of a project as readable Python."""

import ast
import contextlib
from collections.abc import Mapping

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, InvalidProject
from arcor2_hw.parsing import paused_garbage_collection
from arcor2_server.build.frame import Frame, TypeFacts
from arcor2_server.build.functions import cycles_of
from arcor2_server.build.style import Writer


@paused_garbage_collection()
def from_logic(scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> str:
    """Return the script of a project's logic. It repeats the logic until it is stopped or an action finishes it.

    Comments and formatting are those of the project's script, if it has one.

    Raises:
        InvalidProject: an action or the logic is invalid.
        NotFound: `types` does not contain an object type.
    """
    if project.script:
        from arcor2_server.build.merging.merging import merged  # reads scripts, not needed for the start of the server

        if (found := merged(scene, project, types, _tree)) is not None:
            return found
    frame = Frame(scene, project, types)
    tree = _tree(frame)
    return Writer(frame.comments).module(tree)


def _tree(frame: Frame) -> ast.Module:
    program, functions = cycles_of(frame, frame.project)
    definitions: list[ast.stmt] = [function.definition() for function in functions]
    return frame.tree([ast.While(ast.Constant(True), program.statements(), [])], definitions)


@paused_garbage_collection()
def read_with_text(source: str, scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> Project:
    """Return the project updated from its script, with the script itself if it differs from the generated one.

    Args:
        source: the script.
        scene: the scene of the project.
        project: the project from which the script was generated.
        types: the object types of the scene, with all actions.

    Raises:
        NotUnderstood: a line cannot be converted.
        NotFound: `types` does not contain an object type.
        InvalidData: an action is invalid.
    """
    from arcor2_server.build.reading import completed_from_script  # not needed for the start of the server

    source = source.replace("\r\n", "\n").replace("\r", "\n")
    found = completed_from_script(source, scene, project, types)
    for text in (UNSET, project.script):
        candidate = replace(found, script=text)
        with contextlib.suppress(Arcor2Error):  # logic that cannot be built can be imported
            if from_logic(scene, candidate, types) == source:
                return candidate
    return replace(found, script=source)


def without_logic(scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> str:
    """Return a script that defines objects, action points and parameters, without a loop."""
    return Frame(scene, project, types).module([])


def check_syntax(source: str) -> None:
    """Raise InvalidProject, with the line, if `source` is not valid Python."""
    try:
        compile(source, "script.py", "exec", dont_inherit=True)
    except SyntaxError as error:
        raise InvalidProject(
            "script.py, line {lineno}: {msg}", error.text or "", lineno=error.lineno, msg=error.msg
        ) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise InvalidProject("script.py is not valid Python: {reason}", reason=error) from error

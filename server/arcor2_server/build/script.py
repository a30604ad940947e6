"""Generates script.py of a package: the logic of a project as readable Python."""

import ast
from collections.abc import Mapping

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build.frame import Frame, TypeFacts
from arcor2_server.build.functions import cycles_of


def from_logic(scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> str:
    """Return the script of a project's logic. It repeats the logic until it is stopped or an action finishes it.

    Raises:
        InvalidProject: an action or the logic is invalid.
        NotFound: `types` does not contain an object type.
    """
    frame = Frame(scene, project, types)
    program, functions = cycles_of(frame, project)
    definitions: list[ast.stmt] = [function.definition() for function in functions]
    return frame.module([ast.While(ast.Constant(True), program.statements(), [])], definitions)


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

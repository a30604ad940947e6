"""script.py of a package: the logic of a project as readable Python."""

import ast
from collections.abc import Mapping

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build.cycle import Cycle
from arcor2_server.build.frame import Frame, TypeFacts
from arcor2_server.documents import logic_graph


def from_logic(scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> str:
    """Return the script of a project's logic, which runs in a loop until it is stopped or an action finishes it.

    Raises InvalidProject naming the action that is wrong, NotFound for an object type that `types` does not have.
    """
    frame = Frame(scene, project, types)
    body = Cycle(frame, logic_graph.read(project)).statements()
    return frame.module([ast.While(ast.Constant(True), body, [])])


def without_logic(scene: Scene, project: Project, types: Mapping[str, TypeFacts]) -> str:
    """Return a script that makes objects, action points and parameters known and does nothing yet."""
    return Frame(scene, project, types).module([])


def check_syntax(source: str) -> None:
    """Return when `source` is Python; InvalidProject names the line when it is not."""
    try:
        compile(source, "script.py", "exec", dont_inherit=True)
    except SyntaxError as error:
        raise InvalidProject(
            "script.py, line {lineno}: {msg}", error.text or "", lineno=error.lineno, msg=error.msg
        ) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise InvalidProject("script.py is no Python: {reason}", reason=error) from error

"""The script of a package: executes it, and stores the traceback of its failure."""

import ast
import contextlib
import os
import sys
import traceback
import types
from datetime import UTC, datetime
from pathlib import Path

from arcor2_hw.data.project import Project
from arcor2_hw.runtime.continuing import set_variables
from arcor2_hw.runtime.documents import read_document
from arcor2_hw.runtime.package import put_on_path
from arcor2_hw.runtime.program import Program
from arcor2_hw.runtime.program_values import set_values


def execute(directory: Path, program: Program) -> None:
    """Run script.py as `__main__` in its directory, with the values of the recipe.

    Raises:
        InvalidPackage: the values cannot be used in this script.
    """
    put_on_path(directory)
    os.chdir(directory)
    script = directory / "script.py"
    sys.argv = [str(script)]
    module = types.ModuleType("__main__")
    module.__file__ = str(script)
    sys.modules["__main__"] = module
    source = ast.parse(script.read_bytes(), str(script))
    continues = program.record is not None and program.record.continues
    if program.values or continues:
        project = read_document(directory / "data" / "project.json", Project)
        if program.values and project.has_logic:  # other scripts read values by `res.parameter`
            set_values(source, project, program.values)
        if program.record is not None and continues:  # values that the interrupted program assigned
            set_variables(source, program.record.former_variables(project.scene_id))
    code = compile(source, str(script), "exec")
    try:
        program.inside = False
        exec(code, module.__dict__)  # noqa: S102 - this process exists to run the script
    finally:
        program.inside = True


def save_traceback(directory: Path, error: BaseException) -> None:
    """Write the traceback of a failed program next to its script. A full disk is ignored."""
    path = directory / f"traceback-{datetime.now(UTC):%Y-%m-%dT%H-%M-%S}.txt"
    with contextlib.suppress(OSError):
        path.write_text(traceback_text(error), encoding="utf-8")


def traceback_text(error: BaseException) -> str:
    """Return the traceback of an exception as text."""
    return "".join(traceback.format_exception(error))

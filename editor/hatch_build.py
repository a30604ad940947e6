"""Build hook of the distribution: a wheel contains the built editor; an editable install leaves that to make."""

import importlib.util
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_spec = importlib.util.spec_from_file_location("editor_build", Path(__file__).with_name("build.py"))
assert _spec is not None
assert _spec.loader is not None
editor = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(editor)


class EditorBuild(BuildHookInterface[Any]):
    """Build hook that builds the editor before the wheel is packed."""

    def dependencies(self) -> list[str]:
        """Return the requirement of Node.js from PyPI if the machine has no recent Node.js."""
        return [] if editor.node_of_machine() else [editor.NODE_REQUIREMENT]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the editor, and add the output, which version control ignores, to the wheel.

        Raises:
            RuntimeError: if Node.js is missing.
            subprocess.CalledProcessError: if npm fails.
        """
        if version == "editable":
            return
        editor.run("build")
        build_data["artifacts"].append("server/arcor2_server/editor_files/**")

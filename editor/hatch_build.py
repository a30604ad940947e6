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
    """Builds the editor before the wheel is packed."""

    def dependencies(self) -> list[str]:
        """Ask for Node.js from PyPI only where the machine has none."""
        return [] if editor.node_of_machine() else [editor.NODE_REQUIREMENT]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, and pack the output although version control ignores it."""
        if version == "editable":
            return
        editor.run("build")
        build_data["artifacts"].append("server/arcor2_server/editor_files/**")

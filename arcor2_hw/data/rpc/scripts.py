"""Arguments and answers of the requests that read and edit the script of the open project."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, TranslatableData, Unset
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.history import HistoryItem

__all__ = [
    "SCRIPT_RPCS",
    "CheckScriptData",
    "ImportScriptData",
    "ProjectScriptData",
    "ScriptArgs",
    "ScriptProblem",
]


class ProjectScriptData(Data, frozen=True):
    """Answer to ProjectScript: the script, and the revision of the project from which it was generated.

    `editable` is whether an edited script can be imported: if the project has logic.
    """

    revision: int
    script: str
    editable: bool


class ScriptArgs(Data, frozen=True):
    """Arguments of CheckScript and ImportScript: an edited script, and the revision of the script before."""

    script: Annotated[str, Meta(max_length=2_000_000)]
    revision: int


class ScriptProblem(TranslatableData, frozen=True):
    """The reason why a script cannot be imported. `line` and `column` from 1 are omitted for the whole script."""

    message: str
    line: int | Unset = UNSET
    column: int | Unset = UNSET


class CheckScriptData(Data, frozen=True):
    """Answer to CheckScript: the first problem, or the items that the import would change."""

    revision: int
    problems: list[ScriptProblem]
    changes: list[HistoryItem]


class ImportScriptData(Data, frozen=True):
    """Answer to ImportScript: the new revision, and the changed items."""

    revision: int
    changes: list[HistoryItem]


SCRIPT_RPCS: Final = (
    Rpc("CheckScript", ScriptArgs, CheckScriptData, Role.STANDARD_USER, additional=True),
    Rpc("ImportScript", ScriptArgs, ImportScriptData, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("ProjectScript", None, ProjectScriptData, Role.OPERATOR, additional=True),
)
"""Requests about the script of the open project."""

"""Arguments and answers about projects, actions and logic."""

from typing import Final

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.project import ActionParameter, BareProject, Flow, LogicWhen, Project, ProjectLogicIf, Retry
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.general import IdArgs
from arcor2_hw.messages import Message


class AddActionArgs(Data, frozen=True):
    """Arguments of AddAction; `error_output` names its error, `retry` repeats it after it has failed."""

    action_point_id: str
    name: str
    type: str
    parameters: list[ActionParameter] = field(default_factory=list)
    flows: list[Flow] = field(default_factory=list)
    error_output: str | Unset = UNSET
    retry: Retry | Unset = UNSET


class AddLogicItemArgs(Data, frozen=True):
    """Arguments of AddLogicItem; `error_kinds` make the item an error exit, `when` is a condition of comparisons."""

    start: str
    end: str
    condition: ProjectLogicIf | Unset = UNSET
    error_kinds: list[str] | Unset = UNSET
    when: LogicWhen | Unset = UNSET


class AddProjectParameterArgs(Data, frozen=True):
    """Arguments of AddProjectParameter; actions can change a `variable`."""

    name: str
    type: str
    value: str
    variable: bool | Unset = UNSET


class CloseProjectArgs(Data, frozen=True):
    """Arguments of CloseProject."""

    force: bool = False


class CopyProjectArgs(Data, frozen=True):
    """Arguments of CopyProject."""

    source_id: str
    target_name: str


class ListProjectsData(BareProject, frozen=True):
    """Answer to ListProjects; `problem_messages` as in ListScenes."""

    problems: list[str] | Unset = UNSET
    problem_messages: list[Message] | Unset = UNSET


class NewProjectArgs(Data, frozen=True):
    """Arguments of NewProject."""

    scene_id: str
    name: str
    description: str = ""
    has_logic: bool = True


class RemoveLogicItemArgs(Data, frozen=True):
    """Arguments of RemoveLogicItem."""

    logic_item_id: str


class RemoveProjectParameterArgs(Data, frozen=True):
    """Arguments of RemoveProjectParameter."""

    id: str


class RemoveActionArgs(Data, frozen=True):
    """Arguments of RemoveAction. With `with_steps`, its connections and parallel calls are removed in the same edit."""

    id: str
    with_steps: bool = False


class RenameActionArgs(Data, frozen=True):
    """Arguments of RenameAction."""

    action_id: str
    new_name: str


class RenameProjectArgs(Data, frozen=True):
    """Arguments of RenameProject."""

    project_id: str
    new_name: str


class UpdateActionArgs(Data, frozen=True):
    """Arguments of UpdateAction."""

    action_id: str
    parameters: list[ActionParameter] | Unset = UNSET
    flows: list[Flow] | Unset = UNSET
    error_output: str | Unset = UNSET
    retry: Retry | Unset = UNSET


class UpdateLogicItemArgs(Data, frozen=True):
    """Arguments of UpdateLogicItem; omitted `error_kinds` or `when` are unchanged, empty ones are removed.

    A `condition` removes `when`.
    """

    logic_item_id: str
    start: str
    end: str
    condition: ProjectLogicIf | Unset = UNSET
    error_kinds: list[str] | Unset = UNSET
    when: LogicWhen | Unset = UNSET


class UpdateProjectDescriptionArgs(Data, frozen=True):
    """Arguments of UpdateProjectDescription."""

    project_id: str
    new_description: str


class UpdateProjectHasLogicArgs(Data, frozen=True):
    """Arguments of UpdateProjectHasLogic."""

    project_id: str
    new_has_logic: bool


class UpdateProjectParameterArgs(Data, frozen=True):
    """Arguments of UpdateProjectParameter."""

    id: str
    name: str | Unset = UNSET
    value: str | Unset = UNSET


PROJECT_RPCS: Final = (
    Rpc("AddAction", AddActionArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("AddLogicItem", AddLogicItemArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("AddProjectParameter", AddProjectParameterArgs, None, Role.ADVANCED_USER, dry_run=True),
    Rpc("CloseProject", CloseProjectArgs, None, Role.STANDARD_USER, args_optional=True, dry_run=True),
    Rpc("CopyProject", CopyProjectArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("DeleteProject", IdArgs, None, Role.STANDARD_USER),
    Rpc("GetProject", IdArgs, Project, Role.OPERATOR),
    Rpc("ListProjects", None, list[ListProjectsData], Role.OPERATOR),
    Rpc("NewProject", NewProjectArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("OpenProject", IdArgs, None, Role.STANDARD_USER),
    Rpc("ProjectsWithScene", IdArgs, set[str], Role.OPERATOR),
    Rpc("RemoveAction", RemoveActionArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("RemoveLogicItem", RemoveLogicItemArgs, None, Role.STANDARD_USER),
    Rpc("RemoveProjectParameter", RemoveProjectParameterArgs, None, Role.ADVANCED_USER, dry_run=True),
    Rpc("RenameAction", RenameActionArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("RenameProject", RenameProjectArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("SaveProject", None, None, Role.STANDARD_USER, dry_run=True),
    Rpc("UpdateAction", UpdateActionArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("UpdateLogicItem", UpdateLogicItemArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("UpdateProjectDescription", UpdateProjectDescriptionArgs, None, Role.STANDARD_USER),
    Rpc("UpdateProjectHasLogic", UpdateProjectHasLogicArgs, None, Role.ADVANCED_USER),
    Rpc("UpdateProjectParameter", UpdateProjectParameterArgs, None, Role.STANDARD_USER, dry_run=True),
)
"""Requests about projects."""

"""Arguments about packages and single actions."""

from typing import Final

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.held import HeldData, HoldChoice, OnError
from arcor2_hw.data.package import PackageSummary
from arcor2_hw.data.parts import ConfirmedPart, PartInventory
from arcor2_hw.data.position import ProgramPosition, ProgramStep
from arcor2_hw.data.recipes import OrderId
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.general import IdArgs


class BuildProjectArgs(Data, frozen=True):
    """Arguments of BuildProject."""

    project_id: str
    package_name: str


class BuildProjectData(Data, frozen=True):
    """Answer to BuildProject."""

    package_id: str


class ExecuteActionArgs(Data, frozen=True):
    """Arguments of ExecuteAction."""

    action_id: str


class RenamePackageArgs(Data, frozen=True):
    """Arguments of RenamePackage."""

    package_id: str
    new_name: str


class RunPackageArgs(IdArgs, frozen=True):
    """Arguments of RunPackage.

    shared_breakpoints: whether the breakpoints of the project (SetBreakpoints) are used in addition to `breakpoints`.
    on_error: reaction of the program if an action fails and no error exit applies. checkpoints: whether the state is
    stored before and after each action; default: true. continues: whether the program continues at the
    interruption, which requires that it is held on errors. continue_at: position in the cycle of another action at
    which it continues (see Restart). recipe_id: the recipe, whose package this must be.
    recipe_values: values of this run by name, JSON in a string, within the limits of the recipe. order: id of the order
    that is stored with the produced units.
    """

    start_paused: bool = False
    breakpoints: set[str] | Unset = UNSET
    shared_breakpoints: bool | Unset = UNSET
    on_error: OnError | Unset = UNSET
    checkpoints: bool | Unset = UNSET
    continues: bool | Unset = UNSET
    continue_at: int | Unset = UNSET
    recipe_id: str | Unset = UNSET
    recipe_values: dict[str, str] | Unset = UNSET
    order: OrderId | Unset = UNSET


class TemporaryPackageArgs(Data, frozen=True):
    """Arguments of TemporaryPackage.

    shared_breakpoints: whether the breakpoints of the project (SetBreakpoints) are used in addition to `breakpoints`.
    on_error: reaction of the program if an action fails and no error exit applies. checkpoints: as in RunPackage.
    """

    start_paused: bool = False
    breakpoints: set[str] | Unset = UNSET
    shared_breakpoints: bool | Unset = UNSET
    on_error: OnError | Unset = UNSET
    checkpoints: bool | Unset = UNSET


class StepActionArgs(Data, frozen=True):
    """Arguments of StepAction; `branch` is the id of a branch of the program, by default the one that waits longest."""

    mode: ProgramStep = ProgramStep.OVER
    branch: str | Unset = UNSET


class DecideHeldArgs(Data, frozen=True):
    """Arguments of DecideHeld.

    number: of the action at which the program is held. results: for `result`, the results of the action, each as JSON
    in a text. exit_id: for `error_exit`, the id of the logic item; default: the first exit. confirmed: for `retry` of
    an action that is not safe to repeat, whether a person has confirmed it.
    """

    number: int
    choice: HoldChoice
    results: list[str] | Unset = UNSET
    exit_id: str | Unset = UNSET
    confirmed: bool = False


class GetHeldData(Data, frozen=True):
    """Answer to GetHeld; `held` is omitted while the program is not held."""

    held: HeldData | Unset = UNSET


class ConfirmPartsArgs(Data, frozen=True):
    """Arguments of ConfirmParts: places where a person has found parts. No parts: only confirms the interruption.

    dismiss: the interrupted program does not continue; it starts from its beginning.
    """

    scene_id: str
    parts: list[ConfirmedPart]
    dismiss: bool = False


class UploadPackageArgs(Data, frozen=True):
    """Arguments of UploadPackage."""

    id: str
    data: str


EXECUTION_RPCS: Final = (
    Rpc("BuildProject", BuildProjectArgs, BuildProjectData, Role.STANDARD_USER),
    Rpc("CancelAction", None, None, Role.OPERATOR),
    Rpc("ConfirmParts", ConfirmPartsArgs, None, Role.OPERATOR, additional=True),
    Rpc("DecideHeld", DecideHeldArgs, None, Role.OPERATOR, additional=True),
    Rpc("DeletePackage", IdArgs, None, Role.ADVANCED_USER),
    Rpc("ExecuteAction", ExecuteActionArgs, None, Role.STANDARD_USER, dry_run=True),
    Rpc("GetHeld", None, GetHeldData, Role.OPERATOR, additional=True),
    Rpc("GetParts", None, list[PartInventory], Role.OPERATOR, additional=True),
    Rpc("GetProgramPosition", None, ProgramPosition, Role.OPERATOR, additional=True),
    Rpc("ListPackages", None, list[PackageSummary], Role.OPERATOR),
    Rpc("PausePackage", None, None, Role.OPERATOR),
    Rpc("RenamePackage", RenamePackageArgs, None, Role.ADVANCED_USER),
    Rpc("ResumePackage", None, None, Role.OPERATOR),
    Rpc("RunPackage", RunPackageArgs, None, Role.OPERATOR),
    Rpc("StepAction", StepActionArgs, None, Role.OPERATOR, args_optional=True),
    Rpc("StopPackage", None, None, Role.OPERATOR),
    Rpc("TemporaryPackage", TemporaryPackageArgs, None, Role.STANDARD_USER, args_optional=True),
    Rpc("UploadPackage", UploadPackageArgs, None, Role.PROGRAMMER),
)
"""Requests about packages and their execution."""

"""Arguments and answers of the requests about the functions of the open project."""

from typing import Annotated, Final

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import MAX_BRANCHES, MIN_BRANCHES, ProjectFunction
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.general import IdArgs

__all__ = [
    "FUNCTION_RPCS",
    "AddFunctionArgs",
    "AddFunctionData",
    "AddFunctionParameterArgs",
    "AddFunctionResultArgs",
    "DissolveCallArgs",
    "DissolveCallData",
    "DissolveParallelArgs",
    "FunctionExport",
    "ImportFunctionArgs",
    "ImportFunctionData",
    "MakeFunctionArgs",
    "MakeFunctionData",
    "MakeParallelArgs",
    "MakeParallelData",
    "NamedReference",
    "RemoveFunctionParameterArgs",
    "RemoveFunctionResultArgs",
    "RenameFunctionArgs",
    "UpdateFunctionParameterArgs",
    "UpdateFunctionResultArgs",
    "UpdateParallelArgs",
]


class MakeFunctionArgs(Data, frozen=True):
    """Arguments of MakeFunction: the name of the function, its actions, and the name of the action that calls it.

    `call_name`: by default the name of the function, with a number if an action has it.
    """

    name: str
    action_ids: Annotated[list[str], Meta(min_length=1, max_length=10_000)]
    call_name: str | Unset = UNSET


class MakeFunctionData(Data, frozen=True):
    """Answer to MakeFunction: the function, and the action that calls it."""

    function_id: str
    action_id: str


class MakeParallelArgs(Data, frozen=True):
    """Arguments of MakeParallel: the name of the parallel action, and the calls that it runs at once."""

    name: str
    action_ids: Annotated[list[str], Meta(min_length=MIN_BRANCHES, max_length=MAX_BRANCHES)]


class MakeParallelData(Data, frozen=True):
    """Answer to MakeParallel: the parallel action."""

    action_id: str


class UpdateParallelArgs(Data, frozen=True):
    """Arguments of UpdateParallel: the calls that a parallel action runs at once, in their order."""

    action_id: str
    branches: Annotated[list[str], Meta(min_length=MIN_BRANCHES, max_length=MAX_BRANCHES)]


class DissolveParallelArgs(Data, frozen=True):
    """Arguments of DissolveParallel: a parallel action, whose calls then run one after the other."""

    action_id: str


class AddFunctionArgs(Data, frozen=True):
    """Arguments of AddFunction."""

    name: str


class AddFunctionData(Data, frozen=True):
    """Answer to AddFunction."""

    id: str


class RenameFunctionArgs(Data, frozen=True):
    """Arguments of RenameFunction."""

    function_id: str
    new_name: str


class AddFunctionParameterArgs(Data, frozen=True):
    """Arguments of AddFunctionParameter; `value` is the parameter for the present calls of the function."""

    function_id: str
    name: str
    type: str
    value: Parameter | Unset = UNSET


class UpdateFunctionParameterArgs(Data, frozen=True):
    """Arguments of UpdateFunctionParameter; `value` replaces the parameter in the present calls of the function."""

    function_id: str
    name: str
    new_name: str | Unset = UNSET
    type: str | Unset = UNSET
    value: Parameter | Unset = UNSET


class RemoveFunctionParameterArgs(Data, frozen=True):
    """Arguments of RemoveFunctionParameter."""

    function_id: str
    name: str


class AddFunctionResultArgs(Data, frozen=True):
    """Arguments of AddFunctionResult; `link` is `<action id>/default/<output index>`."""

    function_id: str
    link: str


class UpdateFunctionResultArgs(Data, frozen=True):
    """Arguments of UpdateFunctionResult; `index` counts from 0."""

    function_id: str
    index: int
    link: str


class RemoveFunctionResultArgs(Data, frozen=True):
    """Arguments of RemoveFunctionResult; `index` counts from 0."""

    function_id: str
    index: int


class DissolveCallArgs(Data, frozen=True):
    """Arguments of DissolveCall: an action that calls a function, and whether to remove the function."""

    action_id: str
    remove_function: bool = False


class DissolveCallData(Data, frozen=True):
    """Answer to DissolveCall: the actions that replace the call."""

    action_ids: list[str]


class NamedReference(Data, frozen=True):
    """An item to which the actions of an exported function refer.

    kind: pose, position, joints, object or project_parameter. point_id, point: id and name of the action point of a
    pose, position or joints. type: object type, or type of a project parameter. robot_id: the robot of joints.
    """

    kind: str
    id: str
    name: str
    point_id: str | Unset = UNSET
    point: str | Unset = UNSET
    type: str | Unset = UNSET
    robot_id: str | Unset = UNSET


class FunctionExport(Data, frozen=True):
    """A function with the functions that it calls, and the items to which their actions refer.

    functions: called functions come before their callers; the exported function is the last one.
    """

    scene_id: str
    functions: Annotated[list[ProjectFunction], Meta(min_length=1, max_length=1000)]
    references: list[NamedReference] = field(default_factory=list)


class ImportFunctionArgs(Data, frozen=True):
    """Arguments of ImportFunction.

    points: the action points of the open project, by the id or name of the exported ones. Other items are found by
    their id, otherwise by their name.
    """

    function: FunctionExport
    points: dict[str, str] | Unset = UNSET


class ImportFunctionData(Data, frozen=True):
    """Answer to ImportFunction: the ids of the new functions, in the order of the export."""

    ids: list[str]


FUNCTION_RPCS: Final = (
    Rpc("AddFunction", AddFunctionArgs, AddFunctionData, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("AddFunctionParameter", AddFunctionParameterArgs, None, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("AddFunctionResult", AddFunctionResultArgs, None, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("DissolveCall", DissolveCallArgs, DissolveCallData, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("ExportFunction", IdArgs, FunctionExport, Role.OPERATOR, additional=True),
    Rpc("ImportFunction", ImportFunctionArgs, ImportFunctionData, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("MakeParallel", MakeParallelArgs, MakeParallelData, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("UpdateParallel", UpdateParallelArgs, None, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("DissolveParallel", DissolveParallelArgs, None, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("MakeFunction", MakeFunctionArgs, MakeFunctionData, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("RemoveFunction", IdArgs, None, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc(
        "RemoveFunctionParameter", RemoveFunctionParameterArgs, None, Role.STANDARD_USER, dry_run=True, additional=True
    ),
    Rpc("RemoveFunctionResult", RemoveFunctionResultArgs, None, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc("RenameFunction", RenameFunctionArgs, None, Role.STANDARD_USER, dry_run=True, additional=True),
    Rpc(
        "UpdateFunctionParameter", UpdateFunctionParameterArgs, None, Role.STANDARD_USER, dry_run=True, additional=True
    ),
    Rpc("UpdateFunctionResult", UpdateFunctionResultArgs, None, Role.STANDARD_USER, dry_run=True, additional=True),
)
"""Requests about the functions of the open project."""

"""Arguments about packages and single actions."""

from arcor2_hw.data.base import UNSET, Data, Unset
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
    """

    start_paused: bool = False
    breakpoints: set[str] | Unset = UNSET
    shared_breakpoints: bool | Unset = UNSET


class TemporaryPackageArgs(Data, frozen=True):
    """Arguments of TemporaryPackage.

    shared_breakpoints: whether the breakpoints of the project (SetBreakpoints) are used in addition to `breakpoints`.
    """

    start_paused: bool = False
    breakpoints: set[str] | Unset = UNSET
    shared_breakpoints: bool | Unset = UNSET


class UploadPackageArgs(Data, frozen=True):
    """Arguments of UploadPackage."""

    id: str
    data: str

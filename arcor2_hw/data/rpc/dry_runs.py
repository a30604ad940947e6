"""Arguments and answers of the requests about dry runs of the open project."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.dry_run import DryRunHead, Prediction
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc

__all__ = [
    "DRY_RUN_RPCS",
    "GetDryRunArgs",
    "GetDryRunData",
    "StartDryRunArgs",
]


class StartDryRunArgs(Data, frozen=True):
    """Arguments of StartDryRun.

    from_action: first action; default: the one after START. branches: for actions with several branches, the id of the
    next action, or END.
    """

    from_action: str | Unset = UNSET
    branches: Annotated[dict[str, str], Meta(max_length=10_000)] | Unset = UNSET


class GetDryRunArgs(Data, frozen=True):
    """Arguments of GetDryRun: the number of a dry run; default: the newest one of the open project."""

    number: int | Unset = UNSET


class GetDryRunData(Data, frozen=True):
    """Answer to GetDryRun.

    prediction: the result, if the dry run has finished. outdated: whether the project was edited since. stored: the
    dry runs of the project with a result, newest first.
    """

    dry_run: DryRunHead
    outdated: bool
    stored: list[DryRunHead]
    prediction: Prediction | Unset = UNSET


DRY_RUN_RPCS: Final = (
    Rpc("CancelDryRun", None, None, Role.STANDARD_USER, additional=True),
    Rpc("GetDryRun", GetDryRunArgs, GetDryRunData, Role.OPERATOR, args_optional=True, additional=True),
    Rpc("StartDryRun", StartDryRunArgs, DryRunHead, Role.STANDARD_USER, args_optional=True, additional=True),
)
"""Requests about dry runs."""

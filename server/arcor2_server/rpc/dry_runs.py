"""Requests about dry runs of the open project (docs/protocol/programs.md)."""

from dataclasses import dataclass

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.dry_run import DryRunHead
from arcor2_hw.data.rpc import GetDryRunArgs, GetDryRunData, StartDryRunArgs
from arcor2_server.dry_run.service import DryRuns
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class DryRunRequests:
    """Requests about dry runs of the open project."""

    _dry_runs: DryRuns

    @rpc("StartDryRun")
    async def start_dry_run(self, context: Context, args: StartDryRunArgs) -> DryRunHead:
        """Start a dry run. DryRunChanged publishes its end."""
        return await self._dry_runs.start(args, context.client.name)

    @rpc("CancelDryRun")
    async def cancel_dry_run(self, context: Context, args: None) -> None:
        """Cancel the dry run in progress."""
        self._dry_runs.cancel()

    @rpc("GetDryRun")
    async def get_dry_run(self, context: Context, args: GetDryRunArgs) -> GetDryRunData:
        """Return a dry run with its result."""
        found = self._dry_runs.get(None if isinstance(args.number, Unset) else args.number)
        if context.codes:
            return found
        prediction = found.prediction
        if not isinstance(prediction, Unset):
            problem = UNSET if isinstance(prediction.problem, Unset) else prediction.problem.untranslated()
            assumptions = context.translatable(prediction.assumptions)
            prediction = replace(prediction, problem=problem, assumptions=assumptions)
        return GetDryRunData(
            found.dry_run.untranslated(), found.outdated, context.translatable(found.stored), prediction
        )

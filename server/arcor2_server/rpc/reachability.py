"""The request for the reachability of poses in the open project (docs/protocol.md)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.editor import ReachabilityData
from arcor2_hw.data.rpc import ReachabilityArgs
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.reachability import ReachabilityBoard


@dataclass(frozen=True, slots=True)
class ReachabilityRequests:
    """The request for the reachability of poses in the open project (docs/protocol.md)."""

    _reachability: ReachabilityBoard

    @rpc("Reachability")
    async def reachability(self, context: Context, args: ReachabilityArgs) -> list[ReachabilityData]:
        """Return the reachable poses of each end effector. ReachabilityChanged publishes results computed later."""
        found = await self._reachability.ask(args)
        return [replace(each, items=context.translatable(each.items)) for each in found]

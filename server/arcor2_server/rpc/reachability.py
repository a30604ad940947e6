"""The request for the reachability of poses in the open project (docs/protocol.md)."""

from arcor2_hw.data.editor import ReachabilityData
from arcor2_hw.data.rpc import ReachabilityArgs
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.workspace.reachability import ReachabilityBoard


class ReachabilityRequests:
    """The request for what robots reach of the open project (docs/protocol.md)."""

    def __init__(self, reachability: ReachabilityBoard) -> None:
        self._reachability = reachability

    @rpc("Reachability")
    async def reachability(self, context: Context, args: ReachabilityArgs) -> list[ReachabilityData]:
        """Tell, for each end effector, what it reaches; what is not known yet comes by the event."""
        return await self._reachability.ask(args)

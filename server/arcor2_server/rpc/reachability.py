"""The request for what robots reach of the open project (docs/protocol.md)."""

from arcor2_hw.data.editor import ReachabilityData
from arcor2_hw.data.rpc import ReachabilityArgs
from arcor2_server.rpc.registry import Context, rpc


@rpc("Reachability")
async def reachability(context: Context, args: ReachabilityArgs) -> list[ReachabilityData]:
    """Tell, for each end effector, what it reaches; what is not known yet comes by the event."""
    return await context.services.reachability.ask(args)

"""Requests about forced outputs (docs/protocol/points.md)."""

from dataclasses import dataclass

from arcor2_hw.data.rpc import EndForceArgs, ForcePointArgs, ForcePointData, RenewForcesArgs
from arcor2_server.execution.service import Execution
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class ForceRequests:
    """Requests about forced outputs (docs/protocol/points.md)."""

    _online: OnlineScene
    _execution: Execution

    @rpc("ForcePoint")
    async def force_point(self, context: Context, args: ForcePointArgs) -> ForcePointData:
        """Force an output for this client."""
        self._execution.require_no_program()
        return ForcePointData(await self._online.forces.start(context.client, context.user, args))

    @rpc("RenewForces")
    async def renew_forces(self, context: Context, args: RenewForcesArgs) -> None:
        """Renew forces of this client."""
        self._online.forces.renew(context.client, args.ids, args.valid_ms)

    @rpc("EndForce")
    async def end_force(self, context: Context, args: EndForceArgs) -> None:
        """End a force of any client. The answer comes when the output has its previous value again."""
        await self._online.forces.end(args.id)

"""Requests about nodes (docs/protocol/nodes.md)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.nodes import NodesData
from arcor2_hw.data.rpc import SetObjectNodeArgs
from arcor2_server.collaboration.locks import Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.nodes.board import NodeBoard
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class NodeRequests:
    """Requests about nodes (docs/protocol/nodes.md)."""

    _locks: Locks
    _session: Session
    _online: OnlineScene
    _nodes: NodeBoard
    _editing: Editing

    @rpc("ListNodes")
    async def list_nodes(self, context: Context, args: None) -> NodesData:
        """Return the nodes and their state."""
        return self._nodes.data()

    @rpc("SetObjectNode")
    async def set_object_node(self, context: Context, args: SetObjectNodeArgs) -> None:
        """Set the node on which an object of the scene runs, also while a project is open."""
        async with self._locks.auto_skip_held(context.user, args.id):
            document = self._session.require_scene_open()
            self._online.require_offline()
            changed = replace(document.scene_object(args.id), node=args.node or UNSET)
            await self._editing.commit_one(context, document.update(Kind.OBJECT, args.id, changed))

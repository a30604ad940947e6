"""Requests about nodes (docs/protocol/nodes.md)."""

from typing import Final

from arcor2_hw.data.base import Data
from arcor2_hw.data.nodes import NodeName, NodesData
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class SetObjectNodeArgs(Data, frozen=True):
    """Arguments of SetObjectNode: the scene object, and the name of its node; empty for none."""

    id: str
    node: NodeName


NODE_RPCS: Final = (
    Rpc("ListNodes", None, NodesData, Role.OPERATOR, additional=True),
    Rpc("SetObjectNode", SetObjectNodeArgs, None, Role.TECHNICIAN, dry_run=True, additional=True),
)
"""Requests about nodes."""

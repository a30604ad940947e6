"""The variables of the PLC in OPC UA: handshake and points."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, Final

from asyncua import Server, ua
from asyncua.common.callback import CallbackType, ServerItemCallback
from asyncua.common.node import Node

NAMESPACE: Final = "urn:arcor2-hw:fake-plc"
_T: Final = ua.VariantType
HANDSHAKE: Final = {
    "Owner": (_T.UInt32, True),
    "HostLife": (_T.UInt16, True),
    "Number": (_T.Int16, True),
    "Request": (_T.Boolean, True),
    "PlcLife": (_T.UInt16, False),
    "Busy": (_T.Boolean, False),
    "Done": (_T.Boolean, False),
    "Error": (_T.Boolean, False),
    "Code": (_T.Int32, False),
}
"""Type of each variable of the handshake, and whether the host writes it."""
POINTS: Final[dict[str, tuple[ua.VariantType, bool, Any]]] = {
    "PartPresent": (_T.Boolean, False, False),
    "DoorClosed": (_T.Boolean, False, True),
    "Level": (_T.Int16, False, 500),
    "Temperature": (_T.Float, False, 21.5),
    "Lamp": (_T.Boolean, True, False),
    "Valve": (_T.Boolean, True, False),
    "Speed": (_T.UInt16, True, 0),
    "Pressure": (_T.Double, True, 0.0),
    "Recipe": (_T.String, False, "standard"),
}
"""Type of each point, whether the host writes it, and its value at power on."""
OFF_ON_LOSS: Final = ("Lamp", "Speed")
"""Outputs that are set to 0 when the host is lost; the others hold their value."""


class Space:
    """The variables. `written` stores the writes of the host in order."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self.nodes: dict[str, Node] = {}
        self.written: list[tuple[str, Any]] = []
        self._kept: dict[str, tuple[ua.VariantType, Any, ua.StatusCode]] = {}
        self._names: dict[ua.NodeId, str] = {}

    async def build(self) -> None:
        """Create the variables."""
        index = await self._server.register_namespace(NAMESPACE)
        for folder, variables in (("Handshake", HANDSHAKE), ("Cell", POINTS)):
            parent = await self._server.nodes.objects.add_folder(
                ua.NodeId.from_string(f"ns={index};s={folder}"), folder
            )
            for name, (kind, writable, *rest) in variables.items():
                value = rest[0] if rest else (False if kind is _T.Boolean else 0)
                full = f"{folder}.{name}"
                node = await parent.add_variable(ua.NodeId.from_string(f"ns={index};s={full}"), name, value, kind)
                if writable:
                    await node.set_writable()
                self.nodes[full], self._names[node.nodeid] = node, full
                self._kept[full] = (kind, value, ua.StatusCode())
                await self._put(full)
        self._server.subscribe_server_callback(CallbackType.PostWrite, self._was_written)

    def _was_written(self, event: Any, _: Any = None) -> None:
        if not isinstance(event, ServerItemCallback) or not event.is_external:
            return
        for item, status in zip(event.request_params.NodesToWrite, event.response_params, strict=True):
            name = self._names.get(item.NodeId)
            if name is None or item.AttributeId != ua.AttributeIds.Value or not status.is_good():
                continue
            kind, _, quality = self._kept[name]
            self._kept[name] = (kind, item.Value.Value.Value, quality)
            if name != "Handshake.HostLife":  # it changes periodically
                self.written.append((name, item.Value.Value.Value))

    def value(self, name: str) -> Any:
        """Return the value of a variable."""
        return self._kept[name][1]

    async def set(self, name: str, value: Any, status: int | None = None) -> None:
        """Set a variable with its source time, if its value changes."""
        kind, before, code = self._kept[name]
        now = code if status is None else ua.StatusCode(ua.UInt32(status))
        if before != value or now != code:
            self._kept[name] = (kind, value, now)
            await self._put(name)

    async def _put(self, name: str) -> None:
        kind, value, status = self._kept[name]
        stamp: Any = datetime.now(UTC)
        await self.nodes[name].write_value(
            ua.DataValue(ua.Variant(value, kind), status, SourceTimestamp=stamp, ServerTimestamp=stamp)
        )

    async def remove(self, name: str) -> None:
        """Remove a variable, as a program download without it does."""
        await self._server.delete_nodes([self.nodes[name]])

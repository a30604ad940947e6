"""The address space: loads the companion specifications, and adds objects, variables and methods of our own."""

import math
from collections.abc import Awaitable, Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from asyncua import Server, ua
from asyncua.common.manage_nodes import delete_nodes

NODESETS: Final = Path(__file__).parent / "nodesets"
FILES: Final = {
    "di": "Opc.Ua.Di.NodeSet2.xml",
    "ia": "Opc.Ua.IA.NodeSet2.xml",
    "machinery": "Opc.Ua.Machinery.NodeSet2.xml",
    "robotics": "Opc.Ua.Robotics.NodeSet2.xml",
    "packml": "Opc.Ua.PackML.NodeSet2.xml",
}
"""Files in the order in which they are loaded, by our short name of the namespace."""
URIS: Final = {
    "ua": "http://opcfoundation.org/UA/",
    "di": "http://opcfoundation.org/UA/DI/",
    "ia": "http://opcfoundation.org/UA/IA/",
    "machinery": "http://opcfoundation.org/UA/Machinery/",
    "robotics": "http://opcfoundation.org/UA/Robotics/",
    "packml": "http://opcfoundation.org/UA/PackML/",
    "own": "urn:arcor2-hw:cell",
}
"""Namespace URIs by our short names. `own`: our own namespace, with all instances and a few additional variables."""
GOOD: Final = ua.StatusCodes.Good
NOT_CONNECTED: Final = ua.StatusCodes.BadNoCommunication
UNKNOWN: Final = ua.StatusCodes.BadNoDataAvailable
REFRESH: Final = 1.0
"""Time after which an unchanged value gets a new time, s."""
UNITS: Final = {
    "rad": 4405297,
    "m": 5067858,
    "rad/s": 12865,
    "m/s": 5067859,
    "s": 5457219,
    "kg": 4933453,
    "N": 5129559,
    "Pa": 5259596,
    "V": 5655636,
    "A": 4279632,
    "Hz": 4740186,
    "°C": 4408652,
    "%": 20529,
    "mm": 5066068,
    "g": 4674125,
}
"""Numbers of units (OPC 10000-8: UN/CEFACT common codes)."""
Method = Callable[..., Awaitable[Any]]


def node_id(identifier: Any, namespace: Any = 0) -> ua.NodeId:
    """Return a node identifier."""
    return ua.NodeId(identifier, namespace)


def status_code(code: Any) -> ua.StatusCode:
    """Return a status code."""
    return ua.StatusCode(code)


class Tag:
    """A variable whose value is written repeatedly. An unchanged value is written once per REFRESH.

    Args:
        server: the OPC UA server.
        node: the variable.
        kind: type of its values; None: that of each value.
    """

    __slots__ = ("_at", "_kind", "_last", "_server", "node")

    def __init__(self, server: Server, node: ua.NodeId, kind: ua.VariantType | None) -> None:
        self._server, self.node, self._kind = server, node, kind
        self._last: tuple[Any, int] | None = None
        self._at = -math.inf

    @property
    def monitored(self) -> bool:
        """Whether a client monitors the value."""
        return bool(self._server.iserver.aspace[self.node].attributes[ua.AttributeIds.Value].datachange_callbacks)

    async def write(self, value: Any, status: int = GOOD, at: datetime | None = None) -> None:
        """Write a value with its status and the time at which it was read."""
        at = at or datetime.now(UTC)
        last, stamp = (value, status), at.timestamp()
        if last == self._last and stamp - self._at < REFRESH:
            return
        self._last, self._at = last, stamp
        kind = None if value is None else self._kind
        stamped: Any = at
        data = ua.DataValue(_variant(value, kind), StatusCode=status_code(status), SourceTimestamp=stamped)
        await self._server.write_attribute_value(self.node, data)

    async def invalidate(self, status: int) -> None:
        """Replace the status; the last value and its time stay."""
        value, before = self._last or (None, None)
        if before == status:
            return
        at = datetime.fromtimestamp(self._at, UTC) if math.isfinite(self._at) else None
        self._at = -math.inf
        await self.write(value, status, at)


class Space:
    """The address space of a server, after `load`."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self._index: dict[str, int] = {"ua": 0}

    async def load(self) -> None:
        """Load the companion specifications. Nodes with errors in the files are left out."""
        for file in FILES.values():
            await self.server.import_xml(str(NODESETS / file), strict_mode=False)
        await self.server.load_data_type_definitions()
        await self.server.register_namespace(URIS["own"])
        uris = await self.server.get_namespace_array()
        self._index |= {name: uris.index(uri) for name, uri in URIS.items()}

    # -------------------------------------------------------------------------------- identifiers
    def standard(self, namespace: str, number: int) -> ua.NodeId:
        """Return a node of a specification by its number."""
        return node_id(number, self._index[namespace])

    def own(self, *path: str) -> ua.NodeId:
        """Return the identifier of one of our nodes. It stays the same after a restart."""
        return node_id("/".join(path), self._index["own"])

    def name(self, namespace: str, name: str) -> ua.QualifiedName:
        """Return a browse name."""
        return ua.QualifiedName(name, self._index[namespace])

    # -------------------------------------------------------------------------------- nodes
    async def add_object(
        self,
        parent: ua.NodeId,
        name: ua.QualifiedName,
        kind: ua.NodeId | int = ua.ObjectIds.BaseObjectType,
        reference: ua.NodeId | int = ua.ObjectIds.HasComponent,
        *,
        node: ua.NodeId | None = None,
    ) -> ua.NodeId:
        """Add an object without the components of its type; return its identifier.

        Args:
            parent: the node to which it belongs.
            name: its browse name.
            kind: its type.
            reference: type of the reference from the parent.
            node: its identifier; None: that of the parent with the name.
        """
        attributes = ua.ObjectAttributes()
        attributes.EventNotifier = 0
        return await self._add(parent, name, kind, reference, ua.NodeClass.Object, attributes, node)

    async def add_folder(self, parent: ua.NodeId, name: ua.QualifiedName) -> ua.NodeId:
        """Add a folder."""
        return await self.add_object(parent, name, ua.ObjectIds.FolderType)

    async def add_variable(
        self,
        parent: ua.NodeId,
        name: ua.QualifiedName,
        value: Any,
        data_type: ua.NodeId | int = ua.ObjectIds.String,
        kind: ua.NodeId | int = ua.ObjectIds.BaseDataVariableType,
        *,
        status: int = GOOD,
        variant: ua.VariantType | None = None,
        rank: int = -1,
    ) -> Tag:
        """Add a variable that clients can read.

        Args:
            parent: the node to which it belongs.
            name: its browse name.
            value: its first value.
            data_type: the type of its value.
            kind: its type. A property is added with the reference HasProperty.
            status: status of the first value.
            variant: encoding of its values; None: by the data type, if it is a number of a built-in type.
            rank: -1: one value, 1: an array.
        """
        data_type = data_type if isinstance(data_type, ua.NodeId) else node_id(data_type)
        number: Any = data_type.Identifier
        if variant is None and data_type.NamespaceIndex == 0 and number <= ua.ObjectIds.LocalizedText:
            variant = ua.VariantType(number)
        elif variant is None and type(value) is int:
            variant = ua.VariantType.Int32  # an enumeration
        attributes = ua.VariableAttributes()
        attributes.DataType = data_type
        attributes.ValueRank = rank
        attributes.ArrayDimensions = [0] if rank > 0 else []
        attributes.AccessLevel = attributes.UserAccessLevel = ua.AccessLevel.CurrentRead.mask
        attributes.MinimumSamplingInterval = 100.0
        attributes.Historizing = False
        attributes.Value = _variant(value, None if value is None else variant)
        is_property = kind == ua.ObjectIds.PropertyType
        reference = ua.ObjectIds.HasProperty if is_property else ua.ObjectIds.HasComponent
        node = await self._add(parent, name, kind, reference, ua.NodeClass.Variable, attributes, None)
        tag = Tag(self.server, node, variant)
        await tag.write(value, status)
        return tag

    async def add_property(
        self, parent: ua.NodeId, name: ua.QualifiedName, value: Any, data_type: ua.NodeId | int = ua.ObjectIds.String
    ) -> Tag:
        """Add a property."""
        return await self.add_variable(parent, name, value, data_type, ua.ObjectIds.PropertyType)

    async def add_unit(self, variable: ua.NodeId, unit: str) -> None:
        """State the engineering unit of a variable."""
        information = ua.EUInformation(
            "http://www.opcfoundation.org/UA/units/un/cefact", UNITS.get(unit, -1), ua.LocalizedText(unit)
        )
        name = self.name("ua", "EngineeringUnits")
        await self.add_property(variable, name, information, ua.ObjectIds.EUInformation)

    async def add_method(
        self,
        parent: ua.NodeId,
        name: ua.QualifiedName,
        method: Method | None,
        inputs: Sequence[ua.Argument] = (),
        outputs: Sequence[ua.Argument] = (),
    ) -> None:
        """Add a method. Without a function, clients see that it cannot be executed."""

        async def refuse(_parent: ua.NodeId, *_arguments: ua.Variant) -> ua.StatusCode:
            return status_code(ua.StatusCodes.BadNotExecutable)

        node = await self.server.get_node(parent).add_method(
            self.own(str(parent.Identifier), str(name.Name)),
            name,
            method or refuse,
            list(inputs),
            list(outputs),
        )
        if method is None:
            for attribute in (ua.AttributeIds.Executable, ua.AttributeIds.UserExecutable):
                await node.write_attribute(attribute, ua.DataValue(ua.Variant(False)))

    async def add_reference(self, source: ua.NodeId, kind: ua.NodeId | int, target: ua.NodeId) -> None:
        """Add a reference in both directions."""
        await self.server.get_node(source).add_reference(self.server.get_node(target), kind)

    async def remove(self, node: ua.NodeId) -> None:
        """Remove a node with its components, and all references to them.

        The nodes are visited once for the references. The library would visit them once for each removed node.
        """
        internal = self.server.iserver
        removed, _ = await delete_nodes(
            internal.isession, [self.server.get_node(node)], recursive=True, delete_target_references=False
        )
        gone, own = {each.nodeid for each in removed}, self._index["own"]
        for key in internal.aspace.keys():  # noqa: SIM118 - it is not iterable
            references = internal.aspace[key].references
            if any(each.NodeId.NamespaceIndex == own and each.NodeId in gone for each in references):
                references[:] = [each for each in references if each.NodeId not in gone]

    async def _add(
        self,
        parent: ua.NodeId,
        name: ua.QualifiedName,
        kind: ua.NodeId | int,
        reference: ua.NodeId | int,
        node_class: ua.NodeClass,
        attributes: Any,
        node: ua.NodeId | None,
    ) -> ua.NodeId:
        prefix = str(parent.Identifier) if parent.NamespaceIndex == self._index["own"] else ""
        item = ua.AddNodesItem()
        item.ParentNodeId = parent
        item.ReferenceTypeId = reference if isinstance(reference, ua.NodeId) else node_id(reference)
        item.RequestedNewNodeId = node or self.own(*filter(None, (prefix, str(name.Name))))
        item.BrowseName = name
        item.NodeClass = node_class
        item.TypeDefinition = kind if isinstance(kind, ua.NodeId) else node_id(kind)
        attributes.DisplayName = ua.LocalizedText(name.Name)
        attributes.WriteMask = attributes.UserWriteMask = 0
        item.NodeAttributes = attributes
        (result,) = await self.server.iserver.isession.add_nodes([item])
        result.StatusCode.check()
        added: ua.NodeId = result.AddedNodeId
        return added


def _variant(value: Any, kind: Any) -> ua.Variant:
    return ua.Variant(value, kind)

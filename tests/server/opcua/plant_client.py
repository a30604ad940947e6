"""A client of plant systems that knows only the specifications: browse names, types, and services."""

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from asyncua import Client, Node, ua
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import NameOID

WITHIN = 40.0
DI, MACHINERY, ROBOTICS, PACKML = (
    f"http://opcfoundation.org/UA/{name}/" for name in ("DI", "Machinery", "Robotics", "PackML")
)
OWN = "urn:arcor2-hw:cell"
URI = "urn:example:scada"


def client_certificate(folder: Path) -> tuple[Path, Path]:
    """Write a self-signed certificate of a client and its key."""
    key = rsa.generate_private_key(65537, 2048)
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "SCADA")])
    at = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(7)
        .not_valid_before(at - timedelta(days=1))
        .not_valid_after(at + timedelta(days=30))
        .add_extension(x509.SubjectAlternativeName([x509.UniformResourceIdentifier(URI)]), critical=False)
        .sign(key, hashes.SHA256())
    )
    files = folder / "client.der", folder / "client.pem"
    files[0].write_bytes(certificate.public_bytes(serialization.Encoding.DER))
    formats = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    files[1].write_bytes(key.private_bytes(serialization.Encoding.PEM, *formats))
    return files


async def encrypted(url: str, files: tuple[Path, Path], user: str = "", secret: str = "") -> Client:
    """Return a client, not connected yet, for the endpoint Basic256Sha256 SignAndEncrypt."""
    client = Client(url, timeout=WITHIN)
    client.application_uri = URI
    await client.set_security_string(f"Basic256Sha256,SignAndEncrypt,{files[0]},{files[1]}")
    if user:
        client.set_user(user)
        client.set_password(secret)
    return client


async def connected(client: Client) -> Client:
    """Connect a client. The library leaves the socket of a refused one open."""
    try:
        await client.connect()
    except BaseException:
        client.disconnect_socket()
        raise
    return client


async def child(node: Node, *names: tuple[str, str]) -> Node:
    """Return a descendant by namespace URIs and browse names."""
    uris = await namespaces(node)
    return await node.get_child([ua.QualifiedName(name, uris.index(uri)) for uri, name in names])


async def namespaces(node: Node) -> list[str]:
    array = Node(node.session, ua.NodeId(ua.ObjectIds.Server_NamespaceArray))
    found: list[str] = await array.read_value()
    return found


async def typed(node: Node, namespace: str, type_name: str) -> list[Node]:
    """Return the children whose type has a browse name."""
    index = (await namespaces(node)).index(namespace)
    found = []
    for each in await node.get_children():
        if await each.read_node_class() in (ua.NodeClass.Object, ua.NodeClass.Variable):
            kind = Node(node.session, await each.read_type_definition())
            if await kind.read_browse_name() == ua.QualifiedName(type_name, index):
                found.append(each)
    return found


async def eventually(read: Callable[[], Awaitable[Any]], condition: Callable[[Any], bool]) -> Any:
    """Read until the result meets a condition, and return it."""
    async with asyncio.timeout(WITHIN):
        while not condition(found := await read()):
            await asyncio.sleep(0.1)
    return found


class Mandatory:
    """Finds the mandatory members of types (OPC 10000-3), with those of their supertypes."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._known: dict[ua.NodeId, set[str]] = {}

    async def members(self, kind: ua.NodeId) -> set[str]:
        if kind in self._known:
            return self._known[kind]
        names: set[str] = set()
        node = self._client.get_node(kind)
        for member in await node.get_children():
            rules = await member.get_referenced_nodes(refs=ua.ObjectIds.HasModellingRule)
            if any(rule.nodeid == ua.NodeId(ua.ObjectIds.ModellingRule_Mandatory) for rule in rules):
                names.add((await member.read_browse_name()).to_string())
        for base in await node.get_referenced_nodes(
            refs=ua.ObjectIds.HasSubtype, direction=ua.BrowseDirection.Inverse, includesubtypes=False
        ):
            names |= await self.members(base.nodeid)
        self._known[kind] = names
        return names

    async def missing(self, node: Node, path: str = "", seen: set[ua.NodeId] | None = None) -> list[str]:
        """Return the paths of mandatory members that a node and its descendants lack."""
        seen = set() if seen is None else seen
        if node.nodeid in seen:
            return []
        seen.add(node.nodeid)
        children = await node.get_children()
        names = {(await each.read_browse_name()).to_string() for each in children}
        lacking = [f"{path}/{each}" for each in await self.members(await node.read_type_definition()) - names]
        for each in children:
            if await each.read_node_class() in (ua.NodeClass.Object, ua.NodeClass.Variable):
                lacking += await self.missing(each, f"{path}/{(await each.read_browse_name()).Name}", seen)
        return lacking


class Watch:
    """Collects the notifications of a subscription."""

    def __init__(self) -> None:
        self.values: list[tuple[ua.NodeId, ua.DataValue]] = []
        self.events: list[Any] = []
        self._changed = asyncio.Event()

    def datachange_notification(self, node: Node, _value: Any, data: Any) -> None:
        self.values.append((node.nodeid, data.monitored_item.Value))
        self._changed.set()

    def event_notification(self, event: Any) -> None:
        self.events.append(event)
        self._changed.set()

    async def value(self, node: Node, condition: Callable[[ua.DataValue], bool]) -> ua.DataValue:
        """Return the first new value of a node that meets a condition."""
        return await self._first(lambda: (value for of, value in self.values if of == node.nodeid and condition(value)))

    async def event(self, condition: Callable[[Any], bool]) -> Any:
        """Return the first event that meets a condition."""
        return await self._first(lambda: (event for event in self.events if condition(event)))

    async def _first(self, found: Callable[[], Iterator[Any]]) -> Any:
        async with asyncio.timeout(WITHIN):
            while (first := next(found(), None)) is None:
                self._changed.clear()
                await self._changed.wait()
        return first

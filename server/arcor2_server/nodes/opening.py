"""The request that opens a session at a node, and its answer."""

import msgspec

from arcor2_hw.messages import Message
from arcor2_server.nodes.presence import own_version
from arcor2_server.nodes.session import SILENCE_TIMEOUT


class Opening(msgspec.Struct, frozen=True):
    """A request of a server.

    session: random id. version: of the server. silence: time without a beat after which both ends end the session, s.
    """

    session: str
    version: str
    silence: float = SILENCE_TIMEOUT


class Opened(msgspec.Struct, frozen=True):
    """The answer of a node. refusal: why it does not open a session; None if it does."""

    refusal: Message | None = None


def refusal_of(node: str, opening: Opening) -> Message | None:
    """Return why a node refuses a request, None if it accepts it."""
    if opening.version == own_version():
        return None
    return Message.of(
        "The node {node} runs version {node_version} and the server version {server_version}: install the same one.",
        node=node,
        node_version=own_version(),
        server_version=opening.version,
    )

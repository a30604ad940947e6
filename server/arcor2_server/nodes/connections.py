"""Connections to the broker (NATS), one for each lane."""

import asyncio
import ssl
from collections.abc import Callable
from typing import Final
from urllib.parse import urlsplit

import nats
from nats.aio.client import Client
from nats.errors import Error as NatsError

from arcor2_hw.exceptions import ConnectionLost
from arcor2_server.nodes.lanes import Lane
from arcor2_server.nodes.session import Connections

PREFIX: Final = "arcor2"
"""First token of all subjects."""
CONNECT_WITHIN: Final = 2.0
"""Time limit for a connection, s."""
CLOSE_WITHIN: Final = 0.5
"""Time limit for closing a connection, s."""


def open_subject(node: str) -> str:
    """Return the subject of requests to open a session at a node."""
    return f"{PREFIX}.{node}.open"


def session_subject(node: str, session: str) -> str:
    """Return the subject of a session at a node."""
    return f"{PREFIX}.{node}.{session}"


async def connect(url: str, lost: Callable[[], None] = lambda: None, authority: str = "") -> Connections:
    """Connect to the broker.

    A connection that is lost is not established again, because messages may have been lost with it.

    Args:
        url: address of the broker, such as nats://10.0.0.1:4222, with user and password if the broker requires them.
        lost: called when a connection has ended by itself.
        authority: file of the certificate to trust for tls://; empty for those that the system trusts.

    Raises:
        ConnectionLost: the broker cannot be reached, or refuses the connection.
    """
    connections: dict[Lane, Client] = {}

    async def disconnected() -> None:
        lost()

    async def ignore(_: Exception) -> None:
        """Errors end the connection, or the call that caused them raises them."""

    try:
        # Without it, the client would also accept a broker without TLS.
        tls = ssl.create_default_context(cafile=authority or None) if url.startswith("tls://") else None
        for lane in Lane:
            connections[lane] = await asyncio.wait_for(
                nats.connect(
                    url,
                    name=f"arcor2-hw {lane}",
                    allow_reconnect=False,
                    connect_timeout=int(CONNECT_WITHIN),
                    tls=tls,
                    disconnected_cb=disconnected,
                    error_cb=ignore,
                ),
                CONNECT_WITHIN,
            )
    except (NatsError, OSError, TimeoutError) as error:
        await close(connections)
        raise ConnectionLost(
            "The broker at {address} cannot be reached. Check that nats-server is running there.",
            f"{type(error).__name__}: {error}",
            address=_address(url),
        ) from error
    return connections


async def close(connections: Connections) -> None:
    """Close connections. Those that do not close in time, because their peer cannot be reached, are abandoned."""
    closing = [asyncio.wait_for(client.close(), CLOSE_WITHIN) for client in connections.values()]
    await asyncio.gather(*closing, return_exceptions=True)


def _address(url: str) -> str:
    """Return an address without user and password."""
    parts = urlsplit(url)
    return f"{parts.hostname or url}:{parts.port or 4222}"

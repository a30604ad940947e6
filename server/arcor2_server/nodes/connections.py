"""Connections to the broker (NATS), one for each lane."""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Final

from nats.aio.client import DEFAULT_INBOX_PREFIX, Client
from nats.errors import Error as NatsError

from arcor2_hw.exceptions import ConnectionLost
from arcor2_server.nodes.credentials import Credentials, address_of
from arcor2_server.nodes.lanes import PREFIX, Lane
from arcor2_server.nodes.session import Connections

CONNECT_TIMEOUT: Final = 2.0
"""Time limit for a connection, s."""
REFUSAL: Final = "authorization violation"
"""The answer of a broker to wrong credentials, in lower case."""
CLOSE_TIMEOUT: Final = 0.5
"""Time limit for closing a connection, s."""


class CredentialsRefused(ConnectionLost):
    """The broker refuses the credentials."""


def open_subject(node: str) -> str:
    """Return the subject of requests to open a session at a node."""
    return f"{PREFIX}.{node}.open"


def session_subject(node: str, session: str) -> str:
    """Return the subject of a session at a node."""
    return f"{PREFIX}.{node}.{session}"


def answer_subject(node: str) -> str:
    """Return the start of the subjects of answers of a node, which may publish only subjects of its own."""
    return f"{PREFIX}.{node}.answer"


async def connect(credentials: Credentials, node: str, lost: Callable[[], None] = lambda: None) -> Connections:
    """Connect to the broker once for each lane, for a session with a node or at the node.

    For the other arguments and the errors see `connect_client`.
    """
    connections: dict[Lane, Client] = {}
    try:
        for lane in Lane:
            connections[lane] = await connect_client(credentials, f"arcor2-hw {lane}", lost, answer_subject(node))
    except BaseException:
        await close(connections)
        raise
    return connections


async def connect_client(
    credentials: Credentials,
    name: str,
    lost: Callable[[], None] = lambda: None,
    answers: str = DEFAULT_INBOX_PREFIX.decode(),
) -> Client:
    """Connect to the broker.

    A connection that is lost is not established again, because messages may have been lost with it.

    Args:
        credentials: address and credentials of the broker.
        name: of the connection, in the log of the broker.
        lost: called when the connection has ended by itself.
        answers: start of the subjects on which answers to requests are received.

    Raises:
        InvalidData: the broker is on another computer and the address is without TLS, or a value is damaged.
        ConnectionLost: the broker cannot be reached.
        CredentialsRefused: the broker refuses the credentials.
    """
    options = credentials.options()
    client = Client()

    async def disconnected() -> None:
        lost()

    async def ignore(_: Exception) -> None:
        """Errors end the connection, or the call that caused them raises them."""

    try:
        async with asyncio.timeout(CONNECT_TIMEOUT):
            await client.connect(
                credentials.url,
                name=name,
                allow_reconnect=False,
                connect_timeout=int(CONNECT_TIMEOUT),
                disconnected_cb=disconnected,
                error_cb=ignore,
                inbox_prefix=answers,
                **options,
            )
    except (NatsError, OSError, TimeoutError) as error:
        await _close(client)  # the socket of a refused connection is open, too
        detail, address = f"{type(error).__name__}: {error}", address_of(credentials.url)
        if REFUSAL in str(error).lower():
            raise CredentialsRefused(
                "The broker at {address} refuses the credentials. A node that was revoked must be paired again.",
                detail,
                address=address,
            ) from error
        raise ConnectionLost(
            "The broker at {address} cannot be reached. Check that nats-server is running there.",
            detail,
            address=address,
        ) from error
    return client


async def close(connections: Connections) -> None:
    """Close connections. Those that do not close in time, because their peer cannot be reached, are abandoned."""
    await asyncio.gather(*(_close(client) for client in connections.values()))


async def _close(client: Client) -> None:
    with contextlib.suppress(NatsError, OSError, TimeoutError):
        async with asyncio.timeout(CLOSE_TIMEOUT):
            await client.close()

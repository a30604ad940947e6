"""Connections to the broker, which are re-established after each loss."""

import asyncio
import contextlib
import ssl
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Final

from aiomqtt import Client, MqttError, Will

from arcor2_hw.mqtt.messages import Broker, LinkChanged

FIRST_PAUSE: Final = 1.0
MAX_PAUSE: Final = 30.0
"""Shortest and longest pause between two attempts to connect, s. The pause doubles after each failed attempt."""
KEEP_ALIVE: Final = 10
"""Time without a message after which the client pings the broker, s. The broker publishes the will after 1.5 times
this time without a message of the client."""
TIMEOUT: Final = 10.0
"""Time limit for an answer of the broker, s."""
MAX_INCOMING: Final = 100
"""Maximum number of received messages that wait. Further ones are dropped."""


@contextlib.asynccontextmanager
async def connection(broker: Broker, identifier: str, will: Will) -> AsyncIterator[Client]:
    """Connect to the broker and yield the client.

    Args:
        broker: how to connect.
        identifier: identifier of the client. The broker ends an older connection with the same identifier.
        will: message that the broker publishes when the connection is lost.

    Raises:
        MqttError: the broker cannot be reached, does not answer, or refuses the client.
        OSError: a file of a certificate or key cannot be used.
    """
    context = None
    if broker.tls:
        context = ssl.create_default_context(cafile=broker.authority or None)
        if broker.certificate:
            context.load_cert_chain(broker.certificate, broker.key)
    client = Client(
        broker.host,
        broker.port,
        username=broker.user or None,
        password=broker.password or None,
        identifier=identifier,
        will=will,
        clean_session=True,
        keepalive=KEEP_ALIVE,
        timeout=TIMEOUT,
        tls_context=context,
        max_queued_incoming_messages=MAX_INCOMING,
    )
    try:
        async with client:
            yield client
    finally:
        client._client.disconnect()  # otherwise aiomqtt keeps the socket of a broker that did not answer


def end_if_cancelled() -> None:
    """Raise CancelledError if the running task was cancelled.

    A call of the client that completes at the moment of the cancellation swallows it (asyncio.wait_for before Python
    3.12).
    """
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError


class Link:
    """Runs sessions with the broker, one after the other.

    Args:
        name: name of the link in LinkChanged.
        report: sends a message to the server.
    """

    def __init__(self, name: str, report: Callable[[LinkChanged], None]) -> None:
        self._name, self._report = name, report
        self._reported: bool | None = None

    async def keep(self, session: Callable[[], Awaitable[None]]) -> None:
        """Run sessions until cancelled. A session calls `up`, and ends with MqttError when the connection is lost."""
        pause = FIRST_PAUSE
        while True:
            started = time.monotonic()
            try:
                await session()
            except (MqttError, OSError) as error:
                self._down(str(error))
            end_if_cancelled()
            pause = FIRST_PAUSE if time.monotonic() - started > pause else min(2.0 * pause, MAX_PAUSE)
            await asyncio.sleep(pause)

    def up(self) -> None:
        """Report that the client is connected."""
        if self._reported is not True:
            self._reported = True
            self._report(LinkChanged(self._name, True))

    def _down(self, reason: str) -> None:
        if self._reported is not False:
            self._reported = False
            self._report(LinkChanged(self._name, False, reason))

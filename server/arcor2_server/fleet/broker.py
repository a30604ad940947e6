"""A connection to the broker (NATS) that is established again after it was lost. It needs the extra `nodes`."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Final

import structlog
from nats.aio.client import DEFAULT_INBOX_PREFIX, Client
from nats.errors import Error as NatsError

from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.nodes.credentials import Credentials, address_of

log = structlog.get_logger(__name__)

CONNECT_TIMEOUT: Final = 3.0
"""Time limit for a connection, s."""
CLOSE_TIMEOUT: Final = 0.5
"""Time limit for closing a connection, s."""
PING_PERIOD: Final = 1
"""Period of pings, s. A connection whose peer has not answered two of them is lost."""
RETRY_PERIOD: Final = 1.0
"""Time between two attempts to connect, s."""


async def keep_connected(
    credentials: Callable[[], Credentials],
    name: str,
    use: Callable[[Client], Awaitable[None]],
    lost: Callable[[], None],
    answers: str = "",
) -> None:
    """Connect to the broker and use the connection; connect again after it was lost, until this is cancelled.

    Each loss of the connection and each new connection is logged once, failed attempts only the first time.

    Args:
        credentials: returns address and credentials of the broker, before each attempt. They may be paired again.
        name: of the connection, for the monitoring of the broker.
        use: uses a connection; it is cancelled when the connection is lost.
        lost: called after a connection was lost.
        answers: start of the subjects on which answers to requests are received; empty for the usual one.
    """
    reported, address = False, ""

    def unreached(error: Exception) -> None:
        nonlocal reported
        if not reported:
            reported = True
            reason = f"{type(error).__name__}: {error}"
            log.warning("the broker is not reached; trying again", broker=address, reason=reason)

    while True:
        ended = asyncio.Event()
        try:
            current = credentials()
            address = address_of(current.url)
            client = await _connect(current, name, ended, unreached, answers)
        except (NatsError, OSError, TimeoutError, Arcor2Error) as error:
            unreached(error)
            await asyncio.sleep(RETRY_PERIOD)
            continue
        reported = False
        log.info("connected to the broker", broker=address, name=name)
        using = asyncio.ensure_future(use(client))
        waiting = asyncio.create_task(ended.wait(), name="connection to the broker")
        try:
            await asyncio.wait({using, waiting}, return_when=asyncio.FIRST_COMPLETED)
            if ended.is_set():
                reported = True
                log.warning("the connection to the broker was lost; trying again", broker=address)
            else:
                await using  # raises what has ended it
        except (NatsError, OSError, TimeoutError) as error:
            reported = True
            log.warning("the connection to the broker failed; trying again", broker=address, reason=str(error))
        finally:
            using.cancel()
            waiting.cancel()
            await asyncio.gather(using, waiting, return_exceptions=True)
            await _close(client)
            lost()
        await asyncio.sleep(RETRY_PERIOD)


async def _connect(
    credentials: Credentials, name: str, ended: asyncio.Event, unreached: Callable[[Exception], None], answers: str
) -> Client:
    reported: set[str] = set()
    connected, address = False, address_of(credentials.url)

    async def disconnected() -> None:
        ended.set()

    async def failed(error: Exception) -> None:
        """Report errors such as a missing permission once for each connection."""
        if not connected:
            unreached(error)
        elif (text := f"{type(error).__name__}: {error}") not in reported and len(reported) < 10:
            reported.add(text)
            log.warning("error of the broker", broker=address, reason=text)

    client = Client()
    try:
        async with asyncio.timeout(CONNECT_TIMEOUT):
            await client.connect(
                credentials.url,
                name=name,
                allow_reconnect=False,
                connect_timeout=int(CONNECT_TIMEOUT),
                ping_interval=PING_PERIOD,
                max_outstanding_pings=2,
                disconnected_cb=disconnected,
                closed_cb=disconnected,
                error_cb=failed,
                inbox_prefix=answers or DEFAULT_INBOX_PREFIX,
                **credentials.options(),
            )
    except BaseException:
        await _close(client)  # the socket of a refused connection is open, too
        raise
    connected = True
    return client


async def _close(client: Client) -> None:
    with contextlib.suppress(NatsError, OSError, TimeoutError):
        async with asyncio.timeout(CLOSE_TIMEOUT):
            await client.close()

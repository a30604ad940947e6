"""Sends one request to the control channel of a fake."""

import asyncio
from typing import Any

import msgspec

from arcor2_hw.exceptions import ConnectionLost, Refused

MAX_ANSWER = 4 * 1024 * 1024
"""Maximum length of an answer, bytes."""


async def ask(address: str, do: str, /, *, within: float = 5.0, **arguments: Any) -> Any:
    """Send a command to a fake and return the data of its answer.

    Args:
        address: address of its control channel, HOST:PORT.
        do: the command.
        within: time limit, s.
        arguments: arguments of the command.

    Raises:
        ConnectionLost: the fake does not answer.
        Refused: the fake refused the command.
    """
    host, _, port = address.rpartition(":")
    try:
        async with asyncio.timeout(within):
            reader, writer = await asyncio.open_connection(host.strip("[]"), int(port), limit=MAX_ANSWER)
            try:
                writer.write(msgspec.json.encode({"id": 1, "do": do, **arguments}) + b"\n")
                answer = msgspec.json.decode(await reader.readline())
            finally:
                writer.close()
    except (OSError, OverflowError, ValueError, msgspec.DecodeError) as e:
        reason = "no answer in time" if isinstance(e, TimeoutError) else "it is not the control channel of a fake"
        reason = "connection refused" if isinstance(e, ConnectionRefusedError) else reason
        raise ConnectionLost(
            "the fake at {address} does not answer: {reason}", str(e), address=address, reason=reason
        ) from e
    if not isinstance(answer, dict) or not answer.get("ok"):
        raise Refused(
            "the fake at {address} refuses: {answer}",
            address=address,
            answer=answer.get("error") if isinstance(answer, dict) else answer,
        )
    return answer.get("data")

"""The start of a process for plant systems, and its connection to the server."""

import argparse
import asyncio
import contextlib
import faulthandler
import os
import resource
import signal
import socket
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, Final

from arcor2_hw.framing import PREFIX_SIZE, body_length
from arcor2_hw.plant.messages import MAX_MESSAGE, encode

NICENESS: Final = 5
"""Scheduling priority below that of devices and the server."""


class ServerLink:
    """The connection to the server.

    Args:
        descriptor: file descriptor of the connected socket.
        decode: decodes messages of the server.
    """

    def __init__(self, descriptor: int, decode: Callable[[bytes], Any]) -> None:
        self._socket = socket.socket(fileno=descriptor)
        self._decode = decode

    async def open(self) -> None:
        """Use the socket with the running event loop."""
        self._reader, self._writer = await asyncio.open_unix_connection(sock=self._socket)

    async def read(self) -> Any:
        """Return the next message of the server.

        Raises:
            IncompleteReadError: the server has closed the connection.
        """
        size = body_length(await self._reader.readexactly(PREFIX_SIZE), MAX_MESSAGE)
        return self._decode(await self._reader.readexactly(size))

    def send(self, message: Any) -> None:
        """Send a message to the server."""
        self._writer.write(encode(message))


def run_until_closed(name: str, arguments: Sequence[str], work: Callable[[int], Coroutine[Any, Any, None]]) -> int:
    """Run the work of a process until the server closes the socket with the file descriptor of `--fd`.

    Args:
        name: name of the module.
        arguments: of the command line.
        work: gets the file descriptor; it ends with IncompleteReadError or ConnectionError.
    """
    parser = argparse.ArgumentParser(prog=name)
    parser.add_argument("--fd", type=int, required=True)
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):
        os.nice(NICENESS)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the server, which ends this process
    with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):  # the server has ended
        asyncio.run(work(parser.parse_args(arguments).fd))
    return 0

"""The public port of the PLC: a proxy to the OPC UA stack that simulates faults."""

from __future__ import annotations

import asyncio
import contextlib

from arcor2_fakes.wire import Connection, TcpWire

CHUNK = 65536


class Proxy:
    """Forwards connections to 127.0.0.1:`inner`."""

    def __init__(self, host: str, port: int, inner: int) -> None:
        self.wire = TcpWire("opcua", host, port, self._opened)
        self._inner = inner
        self._tasks: set[asyncio.Task[None]] = set()

    def _opened(self, connection: Connection) -> None:
        queue: asyncio.Queue[bytes] = asyncio.Queue()
        connection.received = queue.put_nowait
        task = asyncio.ensure_future(self._pass(connection, queue))

        def closed() -> None:
            task.cancel()

        connection.closed = closed
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _pass(self, connection: Connection, queue: asyncio.Queue[bytes]) -> None:
        try:
            reader, writer = await asyncio.open_connection("127.0.0.1", self._inner)
        except OSError:
            connection.reset()
            return
        try:
            onward = asyncio.ensure_future(self._onward(queue, writer))
            try:
                while data := await reader.read(CHUNK):
                    connection.send(data)
            finally:
                onward.cancel()
        except ConnectionError:
            pass  # the stack has closed the connection
        finally:
            writer.close()
            connection.close()

    @staticmethod
    async def _onward(queue: asyncio.Queue[bytes], writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while True:
                writer.write(await queue.get())
                await writer.drain()

    async def close(self) -> None:
        """Close the port and every connection."""
        self.wire.close()
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

"""Events to many clients: latency at the last of 50, throughput, and cost of clients that never read."""

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import AsyncIterator
from pathlib import Path

from websockets.asyncio.client import ClientConnection

from benchmarks import server_process
from benchmarks.metrics import Metric, Report, median, percentile

CLIENTS = 50
DEAF = 10
ROUNDS = 300
BURST = 2_000
"""Number of locks acquired and released without a pause; each sends two events to every client and no disk write."""


def _lock(name: str) -> str:
    return json.dumps({"id": 7, "request": name, "args": {"object_id": "ADDING_OBJECT"}})


LOCK, UNLOCK = _lock("WriteLock"), _lock("WriteUnlock")


@contextlib.asynccontextmanager
async def _connected(url: str, count: int) -> AsyncIterator[list[ClientConnection]]:
    """Connect clients of the websockets library; the first is logged in."""
    async with contextlib.AsyncExitStack() as stack:
        clients = [await stack.enter_async_context(server_process.socket(url)) for _ in range(count)]
        for each in clients:
            await each.recv()  # the greeting
        login = {"id": 1, "request": "RegisterUser", "args": {"user_name": "bench"}}
        await server_process.answer(clients[0], json.dumps(login))
        yield clients


async def _last_client_latencies(clients: list[ClientConnection]) -> list[float]:
    """Return the times from a request to its event at the last client, s."""
    samples = []
    for number in range(ROUNDS):
        begin = time.perf_counter()
        await clients[0].send(UNLOCK if number % 2 else LOCK)
        await clients[0].recv()  # the response
        for each in clients:
            await each.recv()
        samples.append(time.perf_counter() - begin)
    return samples


async def _take(client: ClientConnection, messages: int) -> None:
    for _ in range(messages):
        await client.recv()


async def _deliveries(clients: list[ClientConnection]) -> float:
    """Return the number of events per second that all clients receive together."""
    readers = [asyncio.create_task(_take(each, 2 * BURST)) for each in clients[1:]]
    own = asyncio.create_task(_take(clients[0], 4 * BURST))
    begin = time.perf_counter()
    for _ in range(BURST):
        await clients[0].send(LOCK)
        await clients[0].send(UNLOCK)
    await asyncio.gather(own, *readers)
    return 2 * BURST * len(clients) / (time.perf_counter() - begin)


async def _deaf(url: str) -> socket.socket:
    """Connect a client that never reads; its buffer is small, so that its events queue at the server."""
    host, _, port = url.removeprefix("ws://").partition(":")
    deaf = socket.socket()
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    deaf.setblocking(False)
    loop = asyncio.get_running_loop()
    await loop.sock_connect(deaf, (host, int(port.strip("/"))))
    head = f"GET / HTTP/1.1\r\nHost: {host}:{port.strip('/')}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    await loop.sock_sendall(deaf, (head + key).encode())
    await loop.sock_recv(deaf, 1024)
    return deaf


async def run(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    async with server_process.server(directory / "listeners") as (url, process):
        async with _connected(url, CLIENTS) as clients:
            samples = await _last_client_latencies(clients)
            note = f"including the request; p95 {percentile(samples, 95) * 1e3:.2f} ms"
            report.add(Metric("event_last_of_50_ms", median(samples) * 1e3, len(samples), note))
            rates = [await _deliveries(clients) for _ in range(3)]
            report.add(Metric("deliveries_per_s", max(rates), 3 * 2 * BURST * CLIENTS, "best of three"))
        async with _connected(url, CLIENTS - DEAF) as clients:
            before = process.memory_full_info().pss
            alone = median(await _last_client_latencies(clients))
            deaf = [await _deaf(url) for _ in range(DEAF)]
            try:
                rate = await _deliveries(clients)
                with_deaf = median(await _last_client_latencies(clients))
                cost = (process.memory_full_info().pss - before) / 2**20
            finally:
                for each in deaf:
                    each.close()
            note = f"after {2 * BURST + ROUNDS} events to each; {rate:.0f} deliveries/s to the others meanwhile"
            report.add(Metric("deaf_clients_mib", cost, DEAF, note))
            note = f"{with_deaf * 1e3:.2f} ms to the last of {len(clients)} against {alone * 1e3:.2f} ms without them"
            report.add(Metric("deaf_clients_delay_ms", (with_deaf - alone) * 1e3, ROUNDS, note))

"""Events to many clients: how soon the last of 50 has one, how many are delivered, what those cost who never read."""

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
"""Locks that are taken and given back in one go: two events each to everybody, and nothing that waits for a disk."""


def _lock(name: str) -> str:
    return json.dumps({"id": 7, "request": name, "args": {"object_id": "ADDING_OBJECT"}})


LOCK, UNLOCK = _lock("WriteLock"), _lock("WriteUnlock")


@contextlib.asynccontextmanager
async def _crowd(url: str, count: int) -> AsyncIterator[list[ClientConnection]]:
    """Clients of the websockets library; the first is logged in."""
    async with contextlib.AsyncExitStack() as stack:
        crowd = [await stack.enter_async_context(server_process.socket(url)) for _ in range(count)]
        for each in crowd:
            await each.recv()  # what it is greeted with
        login = {"id": 1, "request": "RegisterUser", "args": {"user_name": "bench"}}
        await server_process.answer(crowd[0], json.dumps(login))
        yield crowd


async def _to_the_last(crowd: list[ClientConnection]) -> list[float]:
    """Give the times from a request to its event at the last client, s."""
    samples = []
    for number in range(ROUNDS):
        begin = time.perf_counter()
        await crowd[0].send(UNLOCK if number % 2 else LOCK)
        await crowd[0].recv()  # the answer
        for each in crowd:
            await each.recv()
        samples.append(time.perf_counter() - begin)
    return samples


async def _take(client: ClientConnection, messages: int) -> None:
    for _ in range(messages):
        await client.recv()


async def _deliveries(crowd: list[ClientConnection]) -> float:
    """Give the events that all clients together take in a second."""
    readers = [asyncio.create_task(_take(each, 2 * BURST)) for each in crowd[1:]]
    own = asyncio.create_task(_take(crowd[0], 4 * BURST))
    begin = time.perf_counter()
    for _ in range(BURST):
        await crowd[0].send(LOCK)
        await crowd[0].send(UNLOCK)
    await asyncio.gather(own, *readers)
    return 2 * BURST * len(crowd) / (time.perf_counter() - begin)


async def _deaf(url: str) -> socket.socket:
    """A client that connects, and never reads again; its own buffer is small, so that all waits at the server."""
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
        async with _crowd(url, CLIENTS) as crowd:
            samples = await _to_the_last(crowd)
            note = f"with the request; p95 {percentile(samples, 95) * 1e3:.2f} ms"
            report.add(Metric("event_last_of_50_ms", median(samples) * 1e3, len(samples), note))
            rates = [await _deliveries(crowd) for _ in range(3)]
            report.add(Metric("deliveries_per_s", max(rates), 3 * 2 * BURST * CLIENTS, "best of three"))
        async with _crowd(url, CLIENTS - DEAF) as crowd:
            before = process.memory_full_info().pss
            alone = median(await _to_the_last(crowd))
            deaf = [await _deaf(url) for _ in range(DEAF)]
            try:
                rate = await _deliveries(crowd)
                beside = median(await _to_the_last(crowd))
                cost = (process.memory_full_info().pss - before) / 2**20
            finally:
                for each in deaf:
                    each.close()
            note = f"after {2 * BURST + ROUNDS} events to each; {rate:.0f} deliveries/s to the others meanwhile"
            report.add(Metric("deaf_clients_mib", cost, DEAF, note))
            note = f"{beside * 1e3:.2f} ms to the last of {len(crowd)} against {alone * 1e3:.2f} ms without them"
            report.add(Metric("deaf_clients_delay_ms", (beside - alone) * 1e3, ROUNDS, note))

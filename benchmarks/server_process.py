"""Server process for measurements, and the echo server for comparison."""

import asyncio
import contextlib
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

import psutil
from websockets.asyncio.client import ClientConnection, connect

from arcor2_server.demo.processes import Child, python_module


@contextlib.asynccontextmanager
async def server(directory: Path) -> AsyncIterator[tuple[str, psutil.Process]]:
    """Run `arcor2-hw serve` with a data directory; yield its address and process."""
    child = Child(
        "server",
        python_module("arcor2_server.cli.main", "serve", "--port", "0", "--data-dir", str(directory)),
        directory.with_suffix(".log"),
    )
    try:
        url = await child.start()
        assert child._process is not None
        yield url.replace("http://", "ws://"), psutil.Process(child._process.pid)
    finally:
        await child.stop()


@contextlib.asynccontextmanager
async def echo(directory: Path, size: int) -> AsyncIterator[str]:
    """Run an echo server that answers `size` bytes with the same libraries; yield its address."""
    child = Child("echo", [sys.executable, "-m", "benchmarks.echo_server", str(size)], directory / f"echo-{size}.log")
    try:
        yield await child.start()
    finally:
        await child.stop()


@contextlib.asynccontextmanager
async def socket(url: str) -> AsyncIterator[ClientConnection]:
    """Open a plain websocket, so that the client's decoding is not measured."""
    async with connect(url, compression=None, max_size=None) as opened:
        yield opened


async def answer(opened: ClientConnection, request: str) -> str | bytes:
    """Send a request and return the response, ignoring events."""
    await opened.send(request)
    while True:
        text = await opened.recv()
        head = text[:120]
        if ('"event"' not in head) if isinstance(head, str) else (b'"event"' not in head):
            return text


async def round_trips(opened: ClientConnection, request: str, n: int) -> list[float]:
    """Return the durations of `n` round trips, s."""
    samples = []
    for _ in range(n):
        begin = time.perf_counter()
        await answer(opened, request)
        samples.append(time.perf_counter() - begin)
        await asyncio.sleep(0)
    return samples

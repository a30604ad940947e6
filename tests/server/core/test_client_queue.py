"""The send queue of a client: order, the newest message of a stream, limits."""

import asyncio
from pathlib import Path

import pytest

from arcor2_server.settings import ServerSettings
from arcor2_server.websocket.client import Client, CloseCode, Wire
from tests.server.core.serving import until


class ValveWire(Wire):
    """A connection whose sending can be blocked."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.open = asyncio.Event()
        self.open.set()
        self.closed: tuple[int, str] | None = None
        self.aborted = False

    def send_now(self, message: bytes) -> bool:
        if self.open.is_set():
            self.sent.append(message)
        return self.open.is_set()

    async def send(self, message: bytes) -> None:
        while not self.send_now(message):
            await self.open.wait()
            if self.aborted:
                raise ConnectionError

    async def ping(self) -> None:
        await self.open.wait()

    async def close(self, code: int, reason: str) -> None:
        await self.open.wait()
        self.closed = (code, reason)

    def admit(self) -> None: ...

    def abort(self) -> None:
        self.aborted = True
        self.open.set()


@pytest.fixture
def wire() -> ValveWire:
    return ValveWire()


def client_of(wire: ValveWire, tmp_path: Path, **limits: float) -> Client:
    return Client(wire, ServerSettings(data_dir=tmp_path, **limits))  # type: ignore[arg-type]


async def test_order_and_newest_of_a_stream(wire: ValveWire, tmp_path: Path) -> None:
    client = client_of(wire, tmp_path)
    writer = asyncio.create_task(client.write())
    client.put(b"at once")
    assert wire.sent == [b"at once"]
    wire.open.clear()
    client.put(b"first")
    await asyncio.sleep(0)  # the writer is now sending `first`
    client.put_newest("joints/a", b"a1")
    client.put(b"second")
    client.put_newest("joints/b", b"b1")
    for n in range(2, 1000):
        client.put_newest("joints/a", f"a{n}".encode())
    client.put(b"third")
    wire.open.set()
    client.put(b"fourth")
    await until(lambda: len(wire.sent) == 7)
    assert wire.sent[1:] == [b"first", b"a999", b"second", b"b1", b"third", b"fourth"]
    client.put_newest("joints/a", b"later")
    assert wire.sent[-1] == b"later"
    client.close(1000, "bye")
    await writer
    assert wire.closed == (1000, "bye")


@pytest.mark.parametrize("limits", [{"outgoing_messages": 10}, {"outgoing_bytes": 1000}, {"outgoing_age": 60.0}])
async def test_a_client_that_lags_too_far_is_closed(
    wire: ValveWire, tmp_path: Path, limits: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arcor2_server.websocket.client.ABORT_AFTER", 0.05)
    client = client_of(wire, tmp_path, **limits)
    writer = asyncio.create_task(client.write())
    wire.open.clear()
    for _ in range(9):
        client.put(b"x" * 90)
        await asyncio.sleep(0)
    assert not client.closed
    assert client._sending_since is not None
    client._sending_since -= 61.0
    for _ in range(9):
        client.put(b"x" * 90)
    assert client.closed
    client.put(b"nothing is queued any more")
    assert client._bytes == 0
    assert client._closing is not None
    assert client._closing[0] == CloseCode.TOO_SLOW
    async with asyncio.timeout(30):
        await writer
    assert wire.aborted


async def test_streams_alone_never_close_a_client(wire: ValveWire, tmp_path: Path) -> None:
    client = client_of(wire, tmp_path, outgoing_messages=5, outgoing_bytes=1000)
    writer = asyncio.create_task(client.write())
    wire.open.clear()
    for n in range(10_000):
        client.put_newest(f"joints/{n % 3}", b"x" * 100)
    assert not client.closed
    writer.cancel()
    await asyncio.gather(writer, return_exceptions=True)


async def test_pings_are_answered(wire: ValveWire, tmp_path: Path) -> None:
    client = client_of(wire, tmp_path)
    assert await client.ping(0.5)
    wire.open.clear()
    assert not await client.ping(0.02)

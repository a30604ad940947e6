"""Search for devices at the addresses that a user enters, with fakes and other servers on the loopback network."""

import asyncio
import struct
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import pytest

from arcor2_hw.exceptions import InvalidData
from arcor2_hw.runtime.network_search import (
    ANSWER_TIME,
    MAX_ADDRESSES,
    addresses_of,
    modbus_device,
    search,
    universal_robot,
)
from arcor2_server.demo.fakes import free_loopback_address
from tests.fakes.conftest import FakeProcess


@pytest.mark.parametrize(
    ("text", "addresses"),
    [
        ("127.0.0.1", ["127.0.0.1"]),
        ("192.168.1.4, 10.0.0.9 192.168.1.4", ["192.168.1.4", "10.0.0.9"]),
        ("192.168.1.8/30", ["192.168.1.9", "192.168.1.10"]),
        ("192.168.1.9/30", ["192.168.1.9", "192.168.1.10"]),
        ("::1", ["::1"]),
    ],
)
def test_addresses_and_networks_are_listed(text: str, addresses: list[str]) -> None:
    assert addresses_of(text) == addresses


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "Enter the addresses"),
        (" , ", "Enter the addresses"),
        ("robot.local", "not an address"),
        ("192.168.1.300", "not an address"),
        ("8.8.8.8", "outside of private networks"),
        ("0.0.0.0/0", "outside of private networks|At most"),
        ("10.0.0.0/8", f"At most {MAX_ADDRESSES} addresses"),
        ("192.168.0.0/24, 192.168.1.0/24", f"At most {MAX_ADDRESSES} addresses"),
    ],
)
def test_other_texts_and_too_many_addresses_are_refused(text: str, reason: str) -> None:
    with pytest.raises(InvalidData, match=reason):
        addresses_of(text)


@pytest.fixture(scope="module")
def tester() -> Iterator[FakeProcess]:
    fake = FakeProcess("functional_tester")
    assert fake.control  # connects
    yield fake
    fake.end()


async def test_a_modbus_device_is_found_by_its_identification(tester: FakeProcess) -> None:
    host, _, port = tester.ready["modbus"].rpartition(":")
    before = tester.control.do("truth")
    (found,) = await search(modbus_device, ["127.0.0.9", host], int(port))
    assert (found.kind, found.address) == ("Modbus TCP", host)
    assert found.description not in ("", "Modbus TCP")
    assert tester.control.do("truth")["state"] == before["state"]


async def test_a_universal_robot_is_found_with_model_and_serial_number() -> None:
    host = free_loopback_address()
    robot = FakeProcess("ur", "--host", host)
    try:
        (found,) = await search(universal_robot, [host, free_loopback_address()], 29999)
        assert found.address == host
        assert found.description.startswith("Universal Robots UR5, PolyScope ")
        assert found.serial
    finally:
        robot.end()


@asynccontextmanager
async def answering(answer: bytes | None) -> AsyncIterator[int]:
    """Run a server that answers every connection with these bytes, or with None accepts it and sends nothing."""

    async def serve(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if answer is not None:
            writer.write(answer)
            await writer.drain()
            writer.close()
            return
        await silent.wait()
        writer.close()

    silent = asyncio.Event()
    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        silent.set()
        server.close()
        await server.wait_closed()


def frame(content: bytes) -> bytes:
    return struct.pack(">HHHB", 1, 0, len(content) + 1, 255) + content


@pytest.mark.parametrize(
    "answer",
    [
        b"HTTP/1.1 400 Bad Request\r\n\r\n",
        b"\0" * 300,
        b"",
        frame(b"\x03\x00"),
        frame(b"\x2b\x0e\x01\x82\0\0\x03\x00\x40short"),
        b"Connected: something else\n",
    ],
)
async def test_other_servers_and_malformed_answers_are_not_devices(answer: bytes) -> None:
    async with answering(answer) as port:
        assert await search(modbus_device, ["127.0.0.1"], port) == []
        assert await search(universal_robot, ["127.0.0.1"], port) == []


async def test_a_modbus_device_without_identification_is_found_too() -> None:
    async with answering(frame(bytes((0x2B | 0x80, 1)))) as port:
        (found,) = await search(modbus_device, ["127.0.0.1"], port)
    assert found.description == "Modbus TCP"


async def test_a_silent_server_is_not_found() -> None:
    async with answering(None) as port, asyncio.timeout(20 * ANSWER_TIME):
        assert await search(modbus_device, ["127.0.0.1"], port) == []

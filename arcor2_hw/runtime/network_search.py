"""Search for devices in the network, only at the addresses that a user enters. Nothing is switched or moved.

Universal Robots controllers are asked for model and serial number on their dashboard server. Modbus TCP devices are
asked for their identification (function 43/14, MODBUS Application Protocol V1.1b3), which reads no process data.
"""

import asyncio
import contextlib
import ipaddress
import itertools
import struct
from collections.abc import Awaitable, Callable
from typing import Final

from arcor2_hw.data.discovery import Found
from arcor2_hw.exceptions import InvalidData

MAX_ADDRESSES: Final = 256
"""Maximum number of addresses of one search."""
ANSWER_TIME: Final = 1.0
"""Time in which a device at one address accepts a connection and answers, s."""
SEARCH_TIME: Final = 10.0
"""Time limit of one search, s. Devices found until then are returned."""
MAX_CONNECTIONS: Final = 64
"""Maximum number of open connections."""
DASHBOARD_PORT: Final = 29999
_GREETING: Final = b"Universal Robots Dashboard Server"
_UNIT: Final = 255
"""Unit id of the device at the address itself, not behind a gateway."""
_IDENTIFICATION: Final = bytes((43, 14, 1, 0))
"""Read the basic identification from its first object."""
_LONGEST: Final = 260
"""Length of the longest frame of Modbus TCP, bytes."""

Probe = Callable[[str, int], Awaitable[Found | None]]


def addresses_of(text: str) -> list[str]:
    """Return the addresses in a text of addresses and networks, separated by commas or spaces, without duplicates.

    Raises:
        InvalidData: There is none, one is not valid or not private, or there are more than MAX_ADDRESSES.
    """
    found: dict[str, None] = {}
    for word in text.replace(",", " ").split():
        try:
            network = ipaddress.ip_network(word, strict=False)
        except ValueError:
            raise InvalidData(
                "{address!r} is not an address. Examples: 192.168.1.20 or 192.168.1.0/28", address=word
            ) from None
        if not network.is_private:
            raise InvalidData("{address} is outside of private networks and is not searched.", address=word)
        hosts = [network.network_address] if network.num_addresses == 1 else network.hosts()
        found |= dict.fromkeys(map(str, itertools.islice(hosts, MAX_ADDRESSES + 1)))
        if len(found) > MAX_ADDRESSES:
            raise InvalidData("At most {most} addresses are searched at once.", most=MAX_ADDRESSES)
    if not found:
        raise InvalidData("Enter the addresses to be searched.")
    return list(found)


async def search(probe: Probe, addresses: list[str], port: int) -> list[Found]:
    """Return the devices that answer at these addresses within SEARCH_TIME, in the order of the addresses."""
    found: dict[str, Found] = {}
    free = asyncio.Semaphore(MAX_CONNECTIONS)

    async def one(address: str) -> None:
        async with free:
            with contextlib.suppress(OSError, TimeoutError, EOFError, ValueError):
                async with asyncio.timeout(ANSWER_TIME):
                    if (device := await probe(address, port)) is not None:
                        found[address] = device

    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(SEARCH_TIME), asyncio.TaskGroup() as tasks:
            for address in addresses:
                tasks.create_task(one(address))
    return [found[address] for address in addresses if address in found]


async def universal_robot(address: str, port: int = DASHBOARD_PORT) -> Found | None:
    """Return the controller whose dashboard server is at an address, None if another program answers."""
    reader, writer = await asyncio.open_connection(address, port, limit=1024)
    try:
        if _GREETING not in await reader.readline():
            return None

        async def ask(question: str) -> str:
            writer.write(f"{question}\n".encode())
            return (await reader.readline()).decode("utf-8", "replace").strip()[:80]

        model, version, serial = [await ask(each) for each in ("get robot model", "version", "get serial number")]
        writer.write(b"quit\n")
        return Found("Universal Robots", address, f"Universal Robots {model}, PolyScope {version}", serial)
    finally:
        writer.close()


async def modbus_device(address: str, port: int = 502) -> Found | None:
    """Return the Modbus TCP device at an address, with its identification if it has one."""
    reader, writer = await asyncio.open_connection(address, port)
    try:
        request = struct.pack(">HHHB", 1, 0, len(_IDENTIFICATION) + 1, _UNIT) + _IDENTIFICATION
        writer.write(request)
        number, protocol, length = struct.unpack(">HHH", await reader.readexactly(6))
        if (number, protocol) != (1, 0) or not 3 <= length <= _LONGEST - 6:
            return None
        answer = (await reader.readexactly(length))[1:]
        if answer[0] & 0x7F != _IDENTIFICATION[0]:
            return None
        words = _objects(answer) if answer[0] == _IDENTIFICATION[0] else []
        return Found("Modbus TCP", address, " ".join(words) or "Modbus TCP", "")
    finally:
        writer.close()


def _objects(answer: bytes) -> list[str]:
    """Return the texts of an identification: vendor, product code, revision. Raises ValueError if it is malformed."""
    if len(answer) < 7 or answer[1:3] != _IDENTIFICATION[1:3]:
        raise ValueError("not a device identification")
    words = []
    rest = answer[7:]
    for _ in range(answer[6]):
        if len(rest) < 2 or len(rest) < 2 + rest[1]:
            raise ValueError("a device identification is cut off")
        words.append(rest[2 : 2 + rest[1]].decode("latin-1").strip())
        rest = rest[2 + rest[1] :]
    return [word for word in words if word.isprintable() and word]

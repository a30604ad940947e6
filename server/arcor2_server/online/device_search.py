"""Searches for connected devices, each kind in its own process with a time limit. Nothing is switched or moved."""

import asyncio
import sys
from collections.abc import Mapping
from typing import Final

import msgspec

from arcor2_hw.data.base import Unset
from arcor2_hw.data.discovery import Found, Search
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message
from arcor2_server.errors import RequestRefused

SEARCH_TIMEOUT: Final = 15.0
"""Time limit for one kind of devices, s; 127 answering CAN nodes take about 10 s."""
BUS: Final = ("interface", "channel", "bitrate")
"""Settings that describe a CAN bus, as in python-can."""


async def search(kind: Search, where: str = "", port: int | None = None) -> list[Found]:
    """Search for devices of one kind.

    Args:
        kind: The kind of devices.
        where: The CAN bus (as `device scan --can`), or the addresses in the network.
        port: Port of Modbus TCP; by default 502.

    Raises:
        RequestRefused: The search failed or took too long; the message states the reason.
    """
    command = [sys.executable, "-P", "-m", "arcor2_hw.runtime.scanning", kind.value, *([where] if where else [])]
    if port is not None:
        command += ["--port", str(port)]
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(*command, stdin=asyncio.subprocess.DEVNULL, stdout=pipe, stderr=pipe)
    try:
        async with asyncio.timeout(SEARCH_TIMEOUT):
            output, errors = await process.communicate()
    except TimeoutError:
        raise RequestRefused("The search did not end within {limit:g} s.", limit=SEARCH_TIMEOUT) from None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode:
        *_, last = errors.splitlines() or [b""]
        try:
            raise RequestRefused(msgspec.json.decode(last, type=Message))
        except msgspec.MsgspecError:  # a library has ended the process
            text = last.decode(errors="replace").strip()
            raise RequestRefused(text or f"The library ended the process with status {process.returncode}.") from None
    return msgspec.json.decode(output, type=list[Found])


def bus_of(settings: Mapping[str, str | int]) -> str:
    """Return the name of the CAN bus in the settings of a device. Raises InvalidData if one is missing."""
    if not all(settings.get(name) for name in BUS):
        raise InvalidData("The search needs the settings {names}.", names=", ".join(BUS))
    interface, channel, bitrate = (str(settings[name]) for name in BUS)
    match interface:
        case "slcan":
            return f"slcan:{channel}@{bitrate}"
        case "socketcand":
            return f"socketcand:{channel.removeprefix('socket://')}"
        case _:
            return f"{interface}:{channel}"


def value_of(found: Found, kind: Search) -> str | int:
    """Return the value of a setting that selects a device: its node number, device id or address."""
    match kind:
        case Search.CAN if not isinstance(found.node, Unset):
            return found.node
        case Search.OAK if found.serial:
            return found.serial
        case _:
            return found.address

"""Scan for connected devices. Runs in its own process, because vendor libraries may hang or crash.

`python -m arcor2_hw.runtime.scanning serial | can BUS | oak | ur ADDRESSES | modbus ADDRESSES [--port PORT]` prints a
JSON list of Found, or on stderr the message of an error in JSON. Serial ports are not opened. On a CAN bus it listens,
then reads the identity object of each node by SDO, which does not change the nodes.
"""

import argparse
import asyncio
import logging
import os
import sys
import time
from collections.abc import Callable
from typing import Any, Final

import msgspec

from arcor2_hw.data.discovery import Found, Search
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotConnected, NotFound
from arcor2_hw.objects.settings import check_serial_port
from arcor2_hw.runtime.network_search import DASHBOARD_PORT, Probe, addresses_of, modbus_device, search, universal_robot

LISTEN_TIME: Final = 1.2
"""Time of listening on a CAN bus, s. Nodes usually send a heartbeat at least once a second."""
SEARCH_TIME: Final = 0.4
"""Time in which nodes answer the search, s."""
SDO_TIMEOUT: Final = 0.3
"""Time in which a node answers an SDO request, s."""
DEVICE_TYPE, DEVICE_NAME, IDENTITY = 0x1000, 0x1008, 0x1018
"""Indexes in the object dictionary (CiA 301)."""
EXIT_FAILED: Final = 3
"""Exit status after an error."""


def serial_ports() -> list[Found]:
    """List the serial ports without opening them. Raises NotFound if pyserial is not installed."""
    try:
        from serial.tools import list_ports
    except ImportError as error:
        raise NotFound("pyserial is not installed. Install arcor2-hw[serial].") from error
    found = []
    for port in sorted(list_ports.comports()):
        if port.hwid in ("", "n/a") and port.description in ("", "n/a"):
            continue  # the kernel lists the port, but it has no hardware
        usb = f" (USB {port.vid:04x}:{port.pid:04x})" if port.vid is not None else ""
        found.append(Found("serial port", port.device, f"{port.description}{usb}", port.serial_number or ""))
    return found


def bus_options(named: str) -> dict[str, Any]:
    """Convert the name of a CAN bus to arguments of python-can. Raises InvalidData.

    named: slcan:CHANNEL[@BITRATE], where the channel is a serial port or socket://host:port; socketcan:INTERFACE; or
    socketcand:HOST:PORT/BUS.
    """
    kind, _, rest = named.partition(":")
    if kind == "slcan" and rest:
        channel, _, rate = rest.partition("@")
        if rate and not rate.isdigit():
            raise InvalidData("{named}: {rate!r} is not a bit rate", named=named, rate=rate)
        check_serial_port("channel", channel)
        return {
            "interface": "slcan",
            "channel": channel,
            "bitrate": int(rate or 500000),
            "sleep_after_open": 0.0,
            "timeout": 0.05,
        }
    if kind == "socketcan" and rest:
        return {"interface": "socketcan", "channel": rest}
    if kind == "socketcand":
        server, _, bus = rest.partition("/")
        host, _, port = server.rpartition(":")
        if host and port.isdigit() and bus:
            return {"interface": "socketcand", "host": host, "port": int(port), "channel": bus}
    raise InvalidData(
        "{named!r} is not a CAN bus. Examples: slcan:/dev/ttyUSB0@500000, socketcan:can0 or socketcand:HOST:PORT/can0",
        named=named,
    )


def can_nodes(named: str) -> list[Found]:
    """Find the CANopen nodes of a bus and read their identity. Raises InvalidData, NotFound, NotConnected."""
    options = bus_options(named)
    try:
        import can
        import canopen
    except ImportError as error:
        raise NotFound("python-can and canopen are not installed. Install arcor2-hw[can].") from error
    logging.getLogger("canopen").setLevel(
        logging.CRITICAL
    )  # canopen logs an error if a node lacks an object, which is normal here
    network: Any = canopen.Network()  # the library has no type hints
    try:
        network.connect(**options)
    except (can.CanError, OSError, ValueError) as error:
        raise NotConnected("{named} cannot be opened: {reason}", named=named, reason=error) from error
    try:
        time.sleep(LISTEN_TIME)
        network.scanner.search()
        time.sleep(SEARCH_TIME)
        return [_node(network, named, number) for number in sorted(network.scanner.nodes)]
    except (can.CanError, OSError) as error:
        raise NotConnected("the connection to {named} was lost: {reason}", named=named, reason=error) from error
    finally:
        network.disconnect()


def _node(network: Any, named: str, number: int) -> Found:
    """Read the identity of a node. Objects that it lacks are left out."""
    import canopen
    from canopen.sdo.exceptions import SdoError

    node = canopen.RemoteNode(number, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
    network.add_node(node)
    node.sdo.RESPONSE_TIMEOUT = SDO_TIMEOUT
    node.sdo.MAX_RETRIES = 0

    def read(index: int, sub: int = 0) -> bytes:
        try:
            answer: bytes = node.sdo.upload(index, sub)
        except (SdoError, OSError):
            return b""
        return answer

    texts = [f"node {number}"]
    if name := read(DEVICE_NAME).decode("latin-1").strip("\0 "):
        texts.append(name)
    if kind := read(DEVICE_TYPE):
        texts.append(f"profile {int.from_bytes(kind[:2], 'little')}")
    for label, sub in (("vendor", 1), ("product", 2), ("revision", 3)):
        if value := read(IDENTITY, sub):
            texts.append(f"{label} 0x{int.from_bytes(value, 'little'):x}")
    serial = read(IDENTITY, 4)
    return Found("CAN node", named, ", ".join(texts), str(int.from_bytes(serial, "little")) if serial else "", number)


def oak_cameras() -> list[Found]:
    """List the OAK cameras on USB and in the network. Raises NotFound if depthai is not installed."""
    try:
        import depthai
    except ImportError as error:
        raise NotFound("depthai is not installed. Install arcor2-hw[depthai].") from error
    library: Any = depthai
    return [
        Found("OAK camera", str(one.name), f"{one.state.name}, {one.protocol.name}", str(one.getDeviceId()))
        for one in library.Device.getAllAvailableDevices()
    ]


def _in_network(probe: Probe, network: str, port: int) -> list[Found]:
    return asyncio.run(search(probe, addresses_of(network), port))


def main() -> None:
    """Scan for one kind of device and print the result."""
    parser = argparse.ArgumentParser(description="Scan for connected devices.")
    parser.add_argument("kind", choices=tuple(Search))
    parser.add_argument("where", nargs="?", default="", help="the CAN bus, or addresses in the network")
    parser.add_argument("--port", type=int, default=502, help="port of Modbus TCP")
    options = parser.parse_args()
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # keeps the output of vendor libraries separate from the result
    kinds: dict[str, Callable[[], list[Found]]] = {
        Search.SERIAL: serial_ports,
        Search.OAK: oak_cameras,
        Search.CAN: lambda: can_nodes(options.where),
        Search.UR: lambda: _in_network(universal_robot, options.where, DASHBOARD_PORT),
        Search.MODBUS: lambda: _in_network(modbus_device, options.where, options.port),
    }
    try:
        found = kinds[options.kind]()
    except Arcor2Error as error:
        sys.stderr.write(msgspec.json.encode(error.message).decode() + "\n")
        sys.stderr.flush()
        os._exit(EXIT_FAILED)
    results.write(msgspec.json.encode(found))
    results.flush()
    os._exit(0)


if __name__ == "__main__":
    main()

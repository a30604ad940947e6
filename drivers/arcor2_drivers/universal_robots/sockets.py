"""TCP connections to the ports of a controller, with typed errors."""

import contextlib
import socket
import struct
from collections.abc import Iterator

from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected
from arcor2_hw.messages import Message


def connect(port_name: Message, host: str, port: int, timeout: float) -> socket.socket:
    """Connect within `timeout` s.

    Args:
        port_name: Name of the port, for errors.
        host: Address of the controller.
        port: TCP port.
        timeout: Time limit, s.

    Raises:
        NotConnected: The connection is refused, or the host is unreachable.
        DeviceTimeout: The controller does not answer.
        ConnectionLost: The controller accepts and resets the connection.
    """
    address = f"{host}:{port}"
    try:
        with exchange(port_name, address, timeout):
            return socket.create_connection((host, port), timeout)
    except ConnectionLost as e:
        if isinstance(
            e.__cause__, ConnectionResetError
        ):  # the port is open; a reset may arrive before the connection is reported
            raise
        raise NotConnected("No {port_name} at {address}.", e.detail, port_name=port_name, address=address) from e


@contextlib.contextmanager
def exchange(port_name: Message, address: str, timeout: float, detail: str = "") -> Iterator[None]:
    """Convert the errors of a socket and of decoding to DeviceTimeout (with `detail`) and ConnectionLost."""
    try:
        yield
    except TimeoutError as e:
        raise DeviceTimeout(
            "The {port_name} {address} did not answer within {timeout:g} s.",
            detail,
            port_name=port_name,
            address=address,
            timeout=timeout,
        ) from e
    except (OSError, ValueError, IndexError, struct.error) as e:
        raise ConnectionLost(
            "The connection to the {port_name} {address} broke.", str(e), port_name=port_name, address=address
        ) from e

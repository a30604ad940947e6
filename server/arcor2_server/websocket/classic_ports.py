"""Ports of the ARCOR2 services, from the environment variables of ARCOR2 (protocol, section 1)."""

import os
from collections.abc import Mapping
from typing import Final
from urllib.parse import urlsplit

from arcor2_hw.exceptions import InvalidData

SOCKET: Final = "Execution websocket"
"""Name of the websocket of the Execution service, which has its own port."""
_NUMBERS: Final = {
    "Storage": ("ARCOR2_STORAGE_SERVICE_PORT", 10000),
    "Scene": ("ARCOR2_SCENE_SERVICE_PORT", 5013),
    "Execution": ("ARCOR2_EXECUTION_PROXY_PORT", 5009),
}
_URLS: Final = {
    "Build": ("ARCOR2_BUILD_URL", 5008),
    SOCKET: ("ARCOR2_EXECUTION_URL", 6790),
    "Calibration": ("ARCOR2_CALIBRATION_URL", 5014),
}


def ports_from_environment(environment: Mapping[str, str] = os.environ) -> dict[str, int]:
    """Return the port of each service, 0 for none.

    Raises:
        InvalidData: a variable does not contain a port, or two services have the same port.
    """
    ports = {name: _port_of_number(environment, variable, default) for name, (variable, default) in _NUMBERS.items()}
    ports |= {name: _port_of_url(environment, variable, default) for name, (variable, default) in _URLS.items()}
    fixed = [port for port in ports.values() if port]
    if twice := sorted(name for name, port in ports.items() if fixed.count(port) > 1):
        raise InvalidData("{twice} cannot have the same port.", twice=" and ".join(twice))
    return ports


def _port_of_number(environment: Mapping[str, str], variable: str, default: int) -> int:
    text = environment.get(variable) or str(default)
    if not text.isdecimal() or int(text) > 0xFFFF:
        raise InvalidData("{variable}={text!r} is not a port number.", variable=variable, text=text)
    return int(text)


def _port_of_url(environment: Mapping[str, str], variable: str, default: int) -> int:
    text = environment.get(variable)
    if not text:
        return default
    try:
        port = urlsplit(text).port
    except ValueError:
        port = None
    if port is None:
        raise InvalidData("{variable}={text!r} contains no port.", variable=variable, text=text)
    return port

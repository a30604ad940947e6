"""Addresses in the settings of a device. A stored secret is sent only to the hosts that it was entered for."""

import re
from typing import Final

_HOST: Final = r"[\w.-]+|\[?[0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*(?:%[\w.-]+)?\]?"
HOST: Final = re.compile(_HOST)
"""A host name, an IPv4 address, or an IPv6 address with or without brackets and zone."""

_URL: Final = re.compile(rf"[A-Za-z][A-Za-z0-9+.-]*://({_HOST})(?::\d*)?(?:[/?#].*)?")
_HOST_AND_PORT: Final = re.compile(rf"({_HOST})(?::\d+)?")
_NAMES: Final = re.compile(
    r"(?:^|_)(?:host|host_?name|ip|addr|address|url|uri|endpoint|server|broker|proxy|gateway|port)_?\d*$"
)
_HUMP: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def is_address_name(name: str) -> bool:
    """Return whether a text setting of this name contains the address of the device."""
    return _NAMES.search(_HUMP.sub("_", name).lower()) is not None


def host_of(address: str) -> str:
    """Return the host of a URL, of host:port or of a host alone, in lower case; otherwise the address unchanged.

    A URL with user and password, or one that parsers interpret differently, is returned unchanged.
    """
    found = (_URL if "://" in address else _HOST_AND_PORT).fullmatch(address) if address.isprintable() else None
    return address if found is None else found[1].strip("[]").lower()

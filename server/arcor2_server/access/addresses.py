"""The addresses at which other machines reach this server, for inviting users."""

import ipaddress
import socket

from arcor2_hw.data.base import Data
from arcor2_server.settings import ServerSettings

_DOCUMENTATION = "192.0.2.1"
"""A documentation address (RFC 5737) for finding the outgoing interface. Nothing is sent to it."""


class Joining(Data, frozen=True):
    """The addresses for inviting users.

    addresses: URLs of the editor, the best one first; empty if only this machine reaches the server.
    fingerprint: SHA-256 of the certificate, as browsers show it; empty without TLS.
    name: the name of this machine.
    """

    addresses: list[str]
    fingerprint: str
    name: str


def joining(settings: ServerSettings, port: int) -> Joining:
    """Return how others join; `port` is the one at which it was asked, for a server that took any free one."""
    from arcor2_server.access.admission import is_loopback  # which needs the routes, of which this is one

    scheme = "https" if settings.fingerprint else "http"
    at = settings.port or port
    hosts = [host for host in _hosts(settings.host) if not is_loopback(host)]
    found = [f"{scheme}://{f'[{host}]' if ':' in host else host}:{at}" for host in hosts]
    return Joining(found, settings.fingerprint, socket.gethostname())


def _hosts(host: str) -> list[str]:
    """Return the addresses of this machine for a listening address."""
    try:
        address = ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return [host]  # a name
    if not address.is_unspecified:
        return [str(address)]
    return [host for host in dict.fromkeys((_way_out(), *_of_name())) if host]


def _way_out() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((_DOCUMENTATION, 9))
            return str(probe.getsockname()[0])
        except OSError:
            return ""


def _of_name() -> list[str]:
    try:
        known = socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET, socket.SOCK_STREAM)
    except OSError:
        return []
    return [str(each[4][0]) for each in known]

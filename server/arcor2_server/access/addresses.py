"""The addresses at which other machines reach this server, for inviting users."""

import ipaddress
import socket
from pathlib import Path

from arcor2_hw.data.base import Data
from arcor2_server.settings import ServerSettings, is_loopback

_DOCUMENTATION = "192.0.2.1"
"""A documentation address (RFC 5737) for finding the outgoing interface. Nothing is sent to it."""


class ServerAddresses(Data, frozen=True):
    """The addresses for inviting users.

    addresses: URLs of the editor, the best one first; empty if only this machine reaches the server.
    fingerprint: SHA-256 of the certificate, as browsers show it; empty without TLS.
    name: the name of this machine.
    authority: SHA-256 of the local authority that issued the certificate. Devices install it from the address with
        `http` instead of `https`. Empty without TLS, or if the user provides the certificate.
    """

    addresses: list[str]
    fingerprint: str
    name: str
    authority: str = ""


def server_addresses(settings: ServerSettings, port: int) -> ServerAddresses:
    """Return the addresses of this server. `port` is used if the settings do not name one."""
    scheme = "https" if settings.certificate else "http"
    port = settings.port or port
    hosts = [host for host in _hosts(settings.host) if not is_loopback(host)]
    urls = [f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}" for host in hosts]
    # The certificate may have been renewed since the start.
    fingerprints = [_fingerprint(file) for file in (settings.certificate, settings.authority)]
    return ServerAddresses(urls, fingerprints[0], socket.gethostname(), fingerprints[1])


def certified_hosts(host: str) -> list[str]:
    """Return the names and addresses for the certificate of a server that listens on `host`."""
    name = socket.gethostname()
    local = f"{name.partition('.')[0]}.local"
    return list(dict.fromkeys((*_hosts(host), name, local, "localhost", "127.0.0.1", "::1")))


def _fingerprint(file: Path | None) -> str:
    if file is None:
        return ""
    from arcor2_server.access.certificate import fingerprint  # slow to import, and not needed without TLS

    return fingerprint(file)


def _hosts(host: str) -> list[str]:
    """Return the addresses of this machine for a listening address."""
    try:
        address = ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return [host]  # a host name
    if not address.is_unspecified:
        return [str(address)]
    return [host for host in dict.fromkeys((_outgoing_address(), *_addresses_of_host_name())) if host]


def _outgoing_address() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((_DOCUMENTATION, 9))
            return str(probe.getsockname()[0])
        except OSError:
            return ""


def _addresses_of_host_name() -> list[str]:
    try:
        known = socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET, socket.SOCK_STREAM)
    except OSError:
        return []
    return [str(each[4][0]) for each in known]

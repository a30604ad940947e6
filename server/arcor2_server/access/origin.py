"""Origin and host checks, so that pages of other web sites can neither control nor read this server."""

import ipaddress
import socket
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from litestar.connection import ASGIConnection
from litestar.exceptions import PermissionDeniedException
from litestar.handlers import BaseRouteHandler, WebsocketRouteHandler

from arcor2_hw.messages import Message, translatable
from arcor2_server.settings import ServerSettings

HOSTS: Final = Path("/etc/hosts")
"""File with the names of this machine."""
RESOLVER: Final = Path("/etc/resolv.conf")
"""File with the domains of this machine."""


class HostNames:
    """The valid names of this server: any IP address, localhost, the names of the machine, and configured names.

    An attacker could let any other name resolve to this machine (DNS rebinding). The attacker's page would then have
    the origin of this server. IP addresses do not have this problem.
    """

    def __init__(self, configured: Iterable[str] = ()) -> None:
        self._names = frozenset(name.lower().rstrip(".") for name in ("localhost", *machine_names(), *configured))

    @classmethod
    def of(cls, settings: ServerSettings) -> "HostNames":
        """Return the names for these settings."""
        legacy = () if settings.legacy is None else (settings.legacy.host,)
        return cls((settings.host, *legacy, *settings.allowed_hosts))

    def __contains__(self, name: object) -> bool:
        """Return whether a host name, without port and brackets, is a name of this server."""
        if not isinstance(name, str) or not name:
            return False
        if name.lower().rstrip(".") in self._names:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True


def machine_names() -> set[str]:
    """Return the names of this machine from files. A name server may not answer, or belong to an attacker."""
    full = socket.gethostname()
    short = full.partition(".")[0]
    names = {full, short, f"{short}.local"}
    for fields in _lines(HOSTS):
        if full in fields[1:]:
            names.update(fields[1:])
    for fields in _lines(RESOLVER):
        if fields[0] in ("domain", "search"):
            names.update(f"{short}.{domain}" for domain in fields[1:])
    return names


def _lines(file: Path) -> list[list[str]]:
    try:
        text = file.read_text("utf-8", "replace")
    except OSError:
        return []
    return [fields for line in text.splitlines() if (fields := line.partition("#")[0].split())]


def host_of(header: str | None) -> str | None:
    """Return the name or address in a Host header; None for a missing or malformed one."""
    try:
        return urlsplit(f"//{header or ''}").hostname
    except ValueError:
        return None


def may_connect(origin: str | None, host: str | None, names: HostNames) -> bool:
    """Return whether a page of this origin may use the server that it addresses as `host`.

    Only browsers send an Origin header. It must be the origin of this server.
    """
    if origin is None:
        return True
    try:
        page, server = urlsplit(origin), urlsplit(f"//{host or ''}")
        same = (page.hostname, page.port) == (server.hostname, server.port)
    except ValueError:
        return False
    return same and page.hostname in names


def own_pages_only(connection: ASGIConnection[Any, Any, Any, Any], handler: BaseRouteHandler) -> None:
    """Refuse requests from pages of other origins (a guard of Litestar for routes and the websocket).

    A browser sends no Origin header with requests of a page to its own host. HTTP requests must therefore also have a
    valid host name. A browser always sends an Origin header with a websocket; a websocket without one comes from
    another kind of client, which may use any host name.
    """
    names: HostNames = connection.app.state.host_names
    origin, host = connection.headers.get("origin"), connection.headers.get("host")
    if not may_connect(origin, host, names):
        raise PermissionDeniedException(translatable("Pages of other origins may not use this server."))
    if host is None or isinstance(handler, WebsocketRouteHandler):
        return
    if (name := host_of(host)) not in names:
        message = Message.of(
            "This server is not reached as {name}: use its address, or add the name to {setting}.",
            name=name or host,
            setting="ARCOR2_HW_ALLOWED_HOSTS",
        )
        raise PermissionDeniedException(message.text, extra=message.translation())

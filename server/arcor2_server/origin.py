"""Keeps foreign web pages out: a page that somebody has open elsewhere must not command the robots here."""

import ipaddress
import socket
from typing import Any
from urllib.parse import urlsplit

from litestar.connection import ASGIConnection
from litestar.exceptions import PermissionDeniedException
from litestar.handlers import BaseRouteHandler


def may_connect(origin: str | None, host: str | None, allowed: frozenset[str] = frozenset()) -> bool:
    """Tell whether a request with these headers may be served.

    Programs send no Origin and may. A browser sends the page's: it must be a page of ours, so from the very host that
    is asked, and that by an address, as localhost, by this machine's name or a name in `allowed`. Any other name could
    be one that its owner points at this machine (DNS rebinding).
    """
    if origin is None:
        return True
    try:
        page, asked = urlsplit(origin), urlsplit(f"//{host or ''}")
        same = (page.hostname, page.port) == (asked.hostname, asked.port)
    except ValueError:
        return False
    name = page.hostname
    if name is None or not same:
        return False
    if name in allowed or name == "localhost" or name == socket.gethostname().lower():
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def own_pages_only(connection: ASGIConnection[Any, Any, Any, Any], _: BaseRouteHandler) -> None:
    """Refuse a connection from a foreign page (a guard of Litestar, for routes and the websocket)."""
    allowed = connection.app.state.services.settings.allowed_hosts
    if not may_connect(connection.headers.get("origin"), connection.headers.get("host"), allowed):
        raise PermissionDeniedException("Pages of other origins may not use this server.")

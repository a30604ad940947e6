"""Headers of every HTTP response."""

from typing import Final
from urllib.parse import parse_qsl

from litestar.datastructures import MutableScopeHeaders
from litestar.types import Message, Scope

from arcor2_server.access.admission import PARAMETER

COMMON_HEADERS: Final = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}
PAGE_POLICY: Final = "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
"""Content security policy of pages without their own header. A page may add rules in its markup."""
DATA_POLICY: Final = "default-src 'none'; frame-ancestors 'none'"
"""Content security policy of responses other than pages."""


async def add_headers(message: Message, scope: Scope) -> None:
    """Add the missing headers to a response (a hook of Litestar)."""
    if message["type"] != "http.response.start":
        return
    headers = MutableScopeHeaders.from_message(message)
    for name, value in COMMON_HEADERS.items():
        headers.setdefault(name, value)
    is_page = headers.get("content-type", "").startswith("text/html")
    headers.setdefault("Content-Security-Policy", PAGE_POLICY if is_page else DATA_POLICY)
    if any(name == PARAMETER for name, _ in parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)):
        headers["Cache-Control"] = "no-store"

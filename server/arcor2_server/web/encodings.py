"""Content encodings that a client accepts (RFC 9110, 12.5.3)."""

from typing import Any

from litestar import Request


def accepted_encodings(request: Request[Any, Any, Any]) -> set[str]:
    """Return the content encodings that a client accepts."""
    accepted = set()
    for part in request.headers.get("accept-encoding", "").lower().split(","):
        name, _, quality = part.strip().partition(";")
        if quality.replace(" ", "") not in ("q=0", "q=0.0", "q=0.00", "q=0.000"):
            accepted.add(name.strip())
    return accepted

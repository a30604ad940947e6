"""Codec for HTTP/1.1 requests and answers. Pure functions.

Source: RFC 9112 (message syntax), RFC 9110 (semantics). Bodies by Content-Length only.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, Final

import msgspec

MAX_HEAD: Final = 16384
MAX_BODY: Final = 1 << 20
REASONS: Final = {
    200: "OK",
    201: "Created",
    302: "Found",
    400: "Bad Request",
    401: "Unauthorized",
    403: "Forbidden",
    404: "Not Found",
    405: "Method Not Allowed",
    409: "Conflict",
    413: "Content Too Large",
    422: "Unprocessable Content",
    429: "Too Many Requests",
    500: "Internal Server Error",
    503: "Service Unavailable",
}


class BadRequest(ValueError):
    """The request is invalid; the connection must be closed after an answer with `status`."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclasses.dataclass(frozen=True)
class Request:
    """A request; names of headers are in lower case."""

    method: str
    path: str
    headers: dict[str, str]
    body: bytes


class Requests:
    """Splits received bytes into requests."""

    def __init__(self) -> None:
        self._buffer = b""

    def feed(self, data: bytes) -> Iterator[Request]:
        """Return the requests that are complete. Raises BadRequest."""
        self._buffer += data
        while (request := self._next()) is not None:
            yield request

    def _next(self) -> Request | None:
        head, found, rest = self._buffer.partition(b"\r\n\r\n")
        if not found:
            if len(head) > MAX_HEAD:
                raise BadRequest(400, "the head of the request is too long")
            return None
        try:
            first, *lines = head.decode("ascii").split("\r\n")
            method, path, version = first.split(" ")
            headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
            length = int(headers.get("content-length", "0"))
        except ValueError as e:
            raise BadRequest(400, "the head of the request cannot be read") from e
        if version != "HTTP/1.1" or "transfer-encoding" in headers or length < 0:
            raise BadRequest(400, "HTTP/1.1 with a Content-Length is served")
        if length > MAX_BODY:
            raise BadRequest(413, f"a body has at most {MAX_BODY} bytes")
        if len(rest) < length:
            return None
        self._buffer = rest[length:]
        return Request(method, path, headers, rest[:length])


def answer(status: int, body: Any, headers: dict[str, str] | None = None) -> bytes:
    """Return an answer with a JSON body."""
    data = msgspec.json.encode(body)
    lines = [
        f"HTTP/1.1 {status} {REASONS[status]}",
        "Content-Type: application/json",
        f"Content-Length: {len(data)}",
        *(f"{name}: {value}" for name, value in (headers or {}).items()),
    ]
    return "\r\n".join(lines).encode("ascii") + b"\r\n\r\n" + data

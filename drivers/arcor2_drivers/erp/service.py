"""Service: a connection to the service for one request at a time, and the data of its answers."""

import contextlib
import email.utils
import ssl
import threading
import time
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

import httpx
import msgspec

from arcor2_hw.data.base import Data
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected, Refused
from arcor2_hw.messages import Message

from .settings import ErpSettings

T = TypeVar("T")

MAX_ANSWER: Final = 1 << 20
MAX_TOKEN: Final = 8192
KEEP_ALIVE: Final = 4.0
"""Time after which an idle connection is not used again, s: many services close it after 5 s."""
RETRIED: Final = (408, 425, 429)
"""HTTP statuses of client errors for which the request is repeated."""
UNAUTHORIZED: Final = (401, 403, 407)
"""HTTP statuses that reject our credentials."""
MAX_RETRY_AFTER: Final = 600.0
"""Longest pause that a service can ask for, s."""


class Answer(NamedTuple):
    """An answer of the service. `retry_after` is the pause that the service asks for, s; 0: none."""

    status: int
    body: bytes
    retry_after: float = 0.0

    @property
    def done(self) -> bool:
        """Return whether the service has executed the request."""
        return self.status in (200, 201)

    @property
    def text(self) -> str:
        """Return the status and the error text of the service."""
        try:
            return f"{self.status}: {msgspec.json.decode(self.body, type=_Error).error[:200]}"
        except (msgspec.MsgspecError, UnicodeDecodeError):
            return f"{self.status}"


class _Error(Data, frozen=True):
    error: str


class Status(Data, frozen=True):
    """Name and version of the service."""

    service: str
    version: str


class Receipt(Data, frozen=True):
    """The confirmation of an accepted message."""

    key: str


class OrderData(Data, frozen=True):
    """An order in the form of the service."""

    id: str
    product: str
    quantity: int


class NextOrder(Data, frozen=True):
    """The answer to a request for an order."""

    key: str
    order: OrderData | None


class Access(NamedTuple):
    """Token and certificates, read from the files in the settings."""

    headers: dict[str, str]
    tls: ssl.SSLContext | bool

    @classmethod
    def of(cls, who: str | Message, settings: ErpSettings) -> "Access":
        """Read token and certificates. Raises NotConnected, which names the setting."""
        headers: dict[str, str] = {}
        what = "token_file"
        try:
            if settings.token_file:
                token = Path(settings.token_file).read_text("ascii").strip()
                if not token.isprintable() or not 0 < len(token) <= MAX_TOKEN or " " in token:
                    raise ValueError("it contains no valid token")
                headers["Authorization"] = f"Bearer {token}"
            if not settings.url.startswith("https"):
                return cls(headers, False)
            what = "ca_file"
            tls = ssl.create_default_context(cafile=settings.ca_file or None)
            what = "client_certificate"
            if settings.client_certificate:
                tls.load_cert_chain(settings.client_certificate, settings.client_key)
        except (OSError, ValueError) as e:  # ssl.SSLError is an OSError, UnicodeDecodeError a ValueError
            raise NotConnected("{device}: {what} cannot be used", str(e), device=who, what=what) from e
        return cls(headers, tls)


class Service:
    """A connection to the service. Any thread may call `close`, also during a request."""

    def __init__(self, who: str | Message, settings: ErpSettings, access: Access) -> None:
        self._who, self._settings, self._access = who, settings, access
        self._one = threading.Lock()
        self._client: httpx.Client | None = None
        self._ended = False

    def request(self, method: str, path: str, key: str = "", body: bytes = b"", timeout: float = 0.0) -> Answer:
        """Send a request and return the answer, also one with an error status.

        Raises:
            NotConnected: The service cannot be reached.
            DeviceTimeout: It did not answer in time.
            ConnectionLost: The connection broke; the service may have executed the request.
        """
        limit = timeout or self._settings.request_timeout
        deadline = time.monotonic() + limit
        if not self._one.acquire(timeout=limit):
            raise DeviceTimeout("{device} is busy with another call", device=self._who)
        try:
            if self._ended:
                raise NotConnected("{device} is not connected", device=self._who)
            return self._request(method, path, key, body, deadline, limit)
        except DeviceError:
            self._drop()
            raise
        finally:
            if self._ended:
                self._drop()
            self._one.release()

    def _request(self, method: str, path: str, key: str, body: bytes, deadline: float, limit: float) -> Answer:
        if self._client is None:
            self._client = httpx.Client(
                base_url=self._settings.url,
                headers=self._access.headers,
                verify=self._access.tls,
                trust_env=False,
                limits=httpx.Limits(max_connections=1, max_keepalive_connections=1, keepalive_expiry=KEEP_ALIVE),
            )
        headers = {"Content-Type": "application/json", "Idempotency-Key": key} if key else {}

        def late(detail: str) -> DeviceTimeout:
            text = "{device} did not answer {method} {path} within {limit:g} s"
            return DeviceTimeout(text, detail, device=self._who, method=method, path=path, limit=limit)

        try:
            with self._client.stream(method, path, content=body or None, headers=headers, timeout=limit) as response:
                data = b""
                for part in response.iter_bytes():
                    data += part
                    if len(data) > MAX_ANSWER:
                        raise ConnectionLost(
                            "{device}: the answer to {method} {path} is too long",
                            device=self._who,
                            method=method,
                            path=path,
                        )
                    if time.monotonic() > deadline:
                        raise late("the answer came too slowly")
                return Answer(response.status_code, data, parse_retry_after(response.headers.get("Retry-After", "")))
        except httpx.ConnectError as e:
            raise NotConnected("{device} cannot be reached", str(e), device=self._who) from e
        except httpx.TimeoutException as e:
            raise late(type(e).__name__) from e
        except (httpx.HTTPError, httpx.InvalidURL, httpx.StreamError) as e:
            raise ConnectionLost(
                "{device}: the connection was lost during {method} {path}",
                str(e),
                device=self._who,
                method=method,
                path=path,
            ) from e

    def close(self) -> None:
        """Close for good. A request that is running ends within its own time limit and closes the connection then."""
        self._ended = True
        if self._one.acquire(blocking=False):
            try:
                self._drop()
            finally:
                self._one.release()

    def _drop(self) -> None:
        if self._client is not None:
            with contextlib.suppress(OSError, httpx.HTTPError):
                self._client.close()
            self._client = None

    # -------------------------------------------------------------------------------- answers
    def status(self, timeout: float = 0.0) -> Status:
        """Read name and version of the service. Raises Refused for bad credentials, DeviceFault for other errors."""
        answer = self.request("GET", "/status", timeout=timeout)
        self.check(answer, "GET /status")
        return self.read(answer, Status, "GET /status")

    def check(self, answer: Answer, operation: str) -> None:
        """Raise Refused or DeviceFault with the text of the service, unless it has executed the request."""
        if answer.done:
            return
        if answer.status in UNAUTHORIZED:
            raise Refused(
                "{device} rejected the credentials. Check token_file and client_certificate.",
                answer.text,
                device=self._who,
            )
        if 400 <= answer.status < 500 and answer.status not in RETRIED:
            raise Refused(
                "{device} refused {what}: {text}", answer.text, device=self._who, what=operation, text=answer.text
            )
        raise DeviceFault(
            "{device} cannot execute {what} now: {text}",
            answer.text,
            answer.status,
            device=self._who,
            what=operation,
            text=answer.text,
        )

    def read(self, answer: Answer, form: type[T], operation: str) -> T:
        """Decode the body of an answer. Raises DeviceFault."""
        try:
            return msgspec.json.decode(answer.body, type=form)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as e:
            raise DeviceFault(
                "{device} sent an invalid answer to {what}",
                f"{e}: {answer.body[:200]!r}",
                "answer",
                device=self._who,
                what=operation,
            ) from e


def parse_retry_after(text: str) -> float:
    """Return the pause in a Retry-After header, s; 0 when invalid. It is a number or a date (RFC 9110, 10.2.3)."""
    try:
        seconds = float(text) if text.isdigit() else email.utils.parsedate_to_datetime(text).timestamp() - time.time()
    except (ValueError, OverflowError):
        return 0.0
    return min(max(seconds, 0.0), MAX_RETRY_AFTER)

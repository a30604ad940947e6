"""Requests to the service: one at a time on one connection, each with a deadline, a cap and a typed error."""

import contextlib
import email.utils
import ssl
import threading
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

import httpx
import msgspec

from arcor2_hw.data.base import Data
from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected, Refused

from .settings import ErpSettings

LONGEST_ANSWER: Final = 1 << 20
LONGEST_TOKEN: Final = 8192
IDLE: Final = 4.0
"""Time an idle connection is used again, s: many services close one after five."""


class Answer(NamedTuple):
    """What came back; `retry_after` in s, 0 when the service did not ask for a pause."""

    status: int
    body: bytes
    retry_after: float = 0.0

    @property
    def done(self) -> bool:
        """Return whether the service did what was asked."""
        return self.status in (200, 201)

    @property
    def told(self) -> str:
        """Return what a service says beside its status."""
        try:
            return f"{self.status}: {msgspec.json.decode(self.body, type=_Error).error[:200]}"
        except (msgspec.MsgspecError, UnicodeDecodeError):
            return f"{self.status}"


class _Error(Data, frozen=True):
    error: str


class Status(Data, frozen=True):
    """Who the service says it is."""

    service: str
    version: str


class Receipt(Data, frozen=True):
    """What the service answers when it has taken something."""

    key: str


class ToldOrder(Data, frozen=True):
    """An order as the service tells it."""

    id: str
    product: str
    quantity: int


class ToldNext(Data, frozen=True):
    """The answer to the question for an order."""

    key: str
    order: ToldOrder | None


class Access(NamedTuple):
    """What the files of the settings hold."""

    headers: dict[str, str]
    tls: ssl.SSLContext | bool

    @classmethod
    def of(cls, who: str, settings: ErpSettings) -> "Access":
        """Read token and certificates. Raises NotConnected naming the setting."""
        headers: dict[str, str] = {}
        what = "token_file"
        try:
            if settings.token_file:
                token = Path(settings.token_file).read_text("ascii").strip()
                if not token.isprintable() or not 0 < len(token) <= LONGEST_TOKEN or " " in token:
                    raise ValueError("it holds no token")
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
    """One connection to the service. `close` may come from any thread, also during a request."""

    def __init__(self, who: str, settings: ErpSettings, access: Access) -> None:
        self._who, self._settings, self._access = who, settings, access
        self._one = threading.Lock()
        self._client: httpx.Client | None = None
        self._ended = False

    def request(self, method: str, path: str, key: str = "", body: bytes = b"", timeout: float = 0.0) -> Answer:
        """Send a request and give the answer, whatever its status.

        Raises NotConnected when nobody is there, DeviceTimeout, ConnectionLost when it broke off: then the service may
        have done what was asked.
        """
        limit = timeout or self._settings.request_timeout
        deadline = time.monotonic() + limit
        if not self._one.acquire(timeout=limit):
            raise DeviceTimeout("{device} is busy with another call", device=self._who)
        try:
            if self._ended:
                raise NotConnected("{device} is not connected", device=self._who)
            return self._request(method, path, key, body, deadline, limit)
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
                limits=httpx.Limits(max_connections=1, max_keepalive_connections=1, keepalive_expiry=IDLE),
            )
        headers = {"Content-Type": "application/json", "Idempotency-Key": key} if key else {}
        late = f"{self._who} did not answer {method} {path} within {limit:g} s"
        try:
            with self._client.stream(method, path, content=body or None, headers=headers, timeout=limit) as response:
                data = b""
                for part in response.iter_bytes():
                    data += part
                    if len(data) > LONGEST_ANSWER:
                        raise ConnectionLost(
                            "{device}: the answer to {method} {path} is too long",
                            device=self._who,
                            method=method,
                            path=path,
                        )
                    if time.monotonic() > deadline:
                        raise DeviceTimeout(late, "the answer came too slowly")
                return Answer(response.status_code, data, _pause(response.headers.get("Retry-After", "")))
        except (ConnectionLost, DeviceTimeout):
            self._drop()
            raise
        except httpx.ConnectError as e:
            self._drop()
            raise NotConnected("{device} cannot be reached", str(e), device=self._who) from e
        except httpx.TimeoutException as e:
            self._drop()
            raise DeviceTimeout(late, type(e).__name__) from e
        except (httpx.HTTPError, httpx.InvalidURL, httpx.StreamError) as e:
            self._drop()
            raise ConnectionLost(
                "{device}: {method} {path} broke off", str(e), device=self._who, method=method, path=path
            ) from e

    def close(self) -> None:
        """Close for good; a request under way ends by its own deadline and closes then."""
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

    # -------------------------------------------------------------------------------- what is asked
    def status(self, timeout: float = 0.0) -> Status:
        """Ask the service who it is. Raises Refused when it does not let us in, DeviceFault for no sensible answer."""
        answer = self.request("GET", "/status", timeout=timeout)
        self.check(answer, "GET /status")
        status: Status = self.read(answer, Status, "GET /status")
        return status

    def check(self, answer: Answer, what: str) -> None:
        """Return when the service did what was asked. Raises Refused or DeviceFault with its words."""
        if answer.done:
            return
        if answer.status in (401, 403, 407):
            raise Refused(
                "{device} does not let us in: token_file or client_certificate is not valid",
                answer.told,
                device=self._who,
            )
        if 400 <= answer.status < 500 and answer.status not in RETRIED:
            raise Refused("{device} refuses {what}: {told}", answer.told, device=self._who, what=what, told=answer.told)
        raise DeviceFault(
            "{device} cannot do {what} now: {told}",
            answer.told,
            answer.status,
            device=self._who,
            what=what,
            told=answer.told,
        )

    def read(self, answer: Answer, form: Any, what: str) -> Any:
        """Read the answer's body. Raises DeviceFault."""
        try:
            return msgspec.json.decode(answer.body, type=form)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as e:
            raise DeviceFault(
                "{device} gave no sensible answer to {what}",
                f"{e}: {answer.body[:200]!r}",
                "answer",
                device=self._who,
                what=what,
            ) from e


RETRIED: Final = (408, 425, 429)
"""Statuses of the 4xx that ask for another attempt."""
LONGEST_RETRY_AFTER: Final = 600.0


def _pause(text: str) -> float:
    """Read Retry-After (RFC 9110, 10.2.3): seconds or a date; 0 for what is neither."""
    try:
        seconds = float(text) if text.isdigit() else email.utils.parsedate_to_datetime(text).timestamp() - time.time()
    except (ValueError, OverflowError):
        return 0.0
    return min(max(seconds, 0.0), LONGEST_RETRY_AFTER)

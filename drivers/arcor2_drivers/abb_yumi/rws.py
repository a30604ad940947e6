"""Client of Robot Web Services 1.0 (RobotWare 6), with digest authentication and the controller's error texts."""

import contextlib
import math
import ssl
import threading
import time
from collections.abc import Iterator
from typing import Any, Final

import httpx

from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, DeviceTimeout, NotConnected, Refused
from arcor2_hw.messages import Message

REQUEST_TIMEOUT: Final = 1.0
"""Time for a request, s: the web server of an IRC5 usually answers within some ten ms, rarely in hundreds."""
FIRST_ANSWER_TIMEOUT: Final = 1.5
"""Time for the first answer of a session, s: digest authentication needs two requests."""

Fields = dict[str, str]

_NO_TLS: Final = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
"""Unused TLS context without certificates. Otherwise every new client loads the system's, which takes 20 ms."""


class Rws:
    """One session. Closing keeps the session at the controller, until `logout`.

    Any thread may close. Each request uses the connection exclusively. If `close` is called during a request, the
    request closes the connection at its end.
    """

    def __init__(self, name: str, host: str, port: int, user: str, password: str) -> None:
        self.name = name
        self.address = f"{host}:{port}"
        self.who = Message.of("{name} (RWS of {address})", name=name, address=self.address)
        self._user, self._password = user, password
        self._cookies = httpx.Cookies()
        self._client: httpx.Client | None = None
        self._lock = threading.Lock()
        self._storing = threading.Lock()
        self._closes = 0
        self._until = math.inf
        self._fresh = True

    @contextlib.contextmanager
    def all_until(self, moment: float) -> Iterator[None]:
        """Set a common deadline (monotonic) for all requests of a block."""
        self._until = moment
        try:
            yield
        finally:
            self._until = math.inf

    def close(self) -> None:
        """Close the connection, but not the session."""
        with self._storing:
            client, self._client = self._client, None
            self._closes += 1
        if client is not None:
            client.close()

    def logout(self, timeout: float = 0.2) -> None:
        """End the session at the controller, if it can be reached; its mastership is released."""
        if not self._fresh:
            with contextlib.suppress(DeviceError):
                self._ask("GET", "/logout", {}, None, timeout)
        self.close()
        self._cookies, self._fresh = httpx.Cookies(), True

    def get(self, path: str, timeout: float = REQUEST_TIMEOUT, **query: str) -> list[Fields]:
        """Return the states of a resource, each with `_type` and `_title`.

        Raises:
            DeviceError: NotConnected, ConnectionLost, DeviceTimeout, or Refused or DeviceFault with the controller's
                text.
        """
        answer = self._ask("GET", path, query, None, timeout)
        try:
            found = answer.json()["_embedded"]["_state"]
            return [{str(key): str(value) for key, value in state.items()} for state in found]
        except (ValueError, KeyError, TypeError, AttributeError):
            raise ConnectionLost(
                "{device} sent an invalid answer to {path}.", answer.text[:200], device=self.who, path=path
            ) from None

    def value(self, path: str, field: str, timeout: float = REQUEST_TIMEOUT) -> str:
        """Return a field of the first state of a resource."""
        states = self.get(path, timeout)
        if not states or field not in states[0]:
            raise ConnectionLost(
                "The answer of {device} to {path} has no field {field}.",
                str(states)[:200],
                device=self.who,
                path=path,
                field=field,
            )
        return states[0][field]

    def act(self, path: str, action: str | None, body: Fields | None = None, timeout: float = REQUEST_TIMEOUT) -> None:
        """Send a command. Raise as `get`."""
        self._ask("POST", path, {"action": action} if action else {}, body or {}, timeout)

    @contextlib.contextmanager
    def _turn(self, timeout: float) -> Iterator[None]:
        if not self._lock.acquire(timeout=timeout):
            raise DeviceTimeout("{device} is busy with another request.", device=self.who)
        try:
            yield
        finally:
            self._lock.release()

    @contextlib.contextmanager
    def _connection(self) -> Iterator[httpx.Client]:
        """Take the stored connection for a request, and store it again with the cookie of the session."""
        with self._storing:
            client, self._client, closes = self._client, None, self._closes
        if client is None:
            client = httpx.Client(
                base_url=f"http://{self.address}",
                auth=httpx.DigestAuth(self._user, self._password),
                cookies=self._cookies,
                trust_env=False,
                verify=_NO_TLS,
            )
        try:
            yield client
        finally:
            with self._storing:
                closed = self._closes != closes
                if not closed:
                    self._client, self._cookies = client, client.cookies
            if closed:
                client.close()

    def _ask(self, method: str, path: str, query: Fields, body: Fields | None, timeout: float) -> httpx.Response:
        if self._fresh:  # digest authentication needs two requests
            timeout = max(timeout, FIRST_ANSWER_TIMEOUT)
        until = min(time.monotonic() + timeout, self._until)
        timeout = max(until - time.monotonic(), 0.01)
        with self._turn(timeout), self._connection() as client:
            try:
                answer = client.request(
                    method, path, params={**query, "json": "1"}, data=body, timeout=max(until - time.monotonic(), 0.01)
                )
            except httpx.ConnectError as e:
                raise NotConnected(
                    "{device} refuses the connection. Is the controller switched on?", str(e), device=self.who
                ) from e
            except httpx.TimeoutException as e:
                raise DeviceTimeout(
                    "{device} did not answer {path} within {timeout:.2g} s.",
                    device=self.who,
                    path=path,
                    timeout=timeout,
                ) from e
            except httpx.HTTPError as e:
                raise ConnectionLost("The connection to {device} broke.", f"{path}: {e}", device=self.who) from e
        self._fresh = False
        if answer.status_code >= 400:
            raise self._refusal(answer, path)
        return answer

    def _refusal(self, answer: httpx.Response, path: str) -> DeviceError:
        """Return the error of an answer, with the controller's number and text."""
        status = answer.status_code
        if status == httpx.codes.UNAUTHORIZED:
            return NotConnected(
                "{device} rejects user {user!r} or the password.", path, device=self.who, user=self._user
            )
        given: Any = {}
        with contextlib.suppress(ValueError, KeyError, TypeError):
            given = answer.json()["_embedded"]["status"]
        code, text = (given.get("code", ""), given.get("msg", "")) if isinstance(given, dict) else ("", "")
        detail = f"{path}: HTTP {status}" + (f", code {code}" if code != "" else "")
        reason = f": {text}" if text else f" with HTTP {status}"
        if status >= 500:
            return DeviceFault("{device} failed{reason}", detail, code or status, device=self.who, reason=reason)
        return Refused("{device} refuses{reason}", detail, device=self.who, reason=reason)

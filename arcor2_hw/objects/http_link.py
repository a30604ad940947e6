"""HttpLink: a connection to a device over HTTP, with one request at a time."""

import threading
from typing import Any

import httpx

from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected, Refused
from arcor2_hw.messages import Message


class HttpLink:
    """A connection for PolledControl.

    Args:
        who: Name and address of the device, for errors.
        url: Address of the device, such as http://192.168.0.7.
        timeout: Time in which the device has to answer a request, s.
    """

    def __init__(self, who: str | Message, url: str, timeout: float = 0.3) -> None:
        self.who = who
        self._url, self._timeout = url, timeout
        self._one_request = threading.Lock()
        self._client: httpx.Client | None = None

    def open(self, timeout: float) -> None:
        """Create the HTTP client. The first request opens the connection."""
        self.close()
        self._client = httpx.Client(
            base_url=self._url,
            timeout=self._timeout,
            trust_env=False,
            verify=self._url.startswith("https:"),  # loading certificates takes 30 ms and is not needed for http
        )

    def close(self) -> None:
        """Close the connection. It does nothing when the connection is closed."""
        client, self._client = self._client, None
        if client is not None:
            with self._one_request:
                client.close()

    def request(self, method: str, path: str, body: Any = None) -> Any:
        """Send a request once and return the JSON of its answer.

        Raises:
            NotConnected: The device cannot be reached.
            DeviceTimeout: It did not answer in time.
            ConnectionLost: The connection broke.
            DeviceFault: The answer is not JSON.
            Refused: The device answered with an error.
        """
        with self._one_request:
            if self._client is None:
                raise ConnectionLost("{device}: the connection is closed", device=self.who)
            try:
                answer = self._client.request(method, path, json=body)
                content = answer.json()
            except httpx.TimeoutException as e:
                raise DeviceTimeout(
                    "{device} did not answer within {timeout:g} s", str(e), device=self.who, timeout=self._timeout
                ) from e
            except httpx.ConnectError as e:
                raise NotConnected(
                    "{device} cannot be reached. Check the address, the cable and the power.", str(e), device=self.who
                ) from e
            except httpx.HTTPError as e:
                raise ConnectionLost("{device}: the connection was lost", str(e), device=self.who) from e
            except ValueError as e:
                raise DeviceFault("{device} sent an answer that is not JSON", str(e), device=self.who) from e
        if answer.is_error:
            why = content.get("error", answer.status_code) if isinstance(content, dict) else answer.status_code
            raise Refused("{device} refused the request: {reason}", device=self.who, reason=why)
        return content

"""REST client of older sources; names and arguments are from general knowledge of such sources.

Bodies and queries are sent in camelCase, results are converted to snake_case. Error messages are those of the service
(`message` of WebApiError in OpenAPI).
"""

import enum
import io
import threading
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, overload

import httpx
import humps
import msgspec

from arcor2_hw.exceptions import DeviceError

if TYPE_CHECKING:
    from PIL import Image

T = TypeVar("T")


class Method(enum.Enum):
    """HTTP method."""

    GET = "GET"
    POST = "POST"
    PUT = "PUT"
    PATCH = "PATCH"
    DELETE = "DELETE"


class Timeout(NamedTuple):
    """Time limits for connecting and for each part of the answer, s."""

    connect: float = 3.05
    read: float = 20.0


class RestException(DeviceError):
    """A service cannot be reached, or its answer is not valid."""

    code = "rest"


class RestHttpException(RestException):
    """A service returned an error. `error_code` is the HTTP status."""

    code = "rest_refused"

    def __init__(self, message: str = "", detail: str = "", error_code: int = 500, **values: object) -> None:
        super().__init__(message, detail, **values)
        self.error_code = error_code


class _Session:
    """One HTTP client for all threads. It keeps connections open, and creating it takes 20 ms."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._client: httpx.Client | None = None

    def client(self) -> httpx.Client:
        with self._lock:
            if self._client is None:
                # Services run in the local network, so proxies of the environment are not used.
                self._client = httpx.Client(trust_env=False, follow_redirects=True)
            return self._client

    def close(self) -> None:
        with self._lock:
            if self._client is not None:
                self._client.close()
            self._client = None


_session = _Session()


def close() -> None:
    """Close all connections."""
    _session.close()


@overload
def call(
    method: Method, url: str, *, return_type: type[T], body: Any = ..., params: Any = ..., timeout: Timeout | None = ...
) -> T: ...
@overload
def call(
    method: Method,
    url: str,
    *,
    list_return_type: type[T],
    body: Any = ...,
    params: Any = ...,
    timeout: Timeout | None = ...,
) -> list[T]: ...
@overload
def call(method: Method, url: str, *, body: Any = ..., params: Any = ..., timeout: Timeout | None = ...) -> None: ...
def call(
    method: Method,
    url: str,
    *,
    return_type: type[Any] | None = None,
    list_return_type: type[Any] | None = None,
    body: Any = None,
    params: Any = None,
    timeout: Timeout | None = None,
) -> Any:
    """Call a service and return its answer as `return_type`, as a list of `list_return_type`, or None.

    body, params: dataclasses, Structs, dictionaries, or lists of them.

    Raises:
        RestException: The service cannot be reached, or its answer is not valid.
        RestHttpException: The service returned an error.
    """
    where = f"{method.value} {url}"
    content = None if body is None else msgspec.json.encode(humps.camelize(_plain(body)))
    query = None if params is None else {k: v for k, v in humps.camelize(_plain(params)).items() if v is not None}
    answer = _request(method, url, query, content, timeout)
    if return_type is None and list_return_type is None:
        return None
    if return_type is bytes:
        return answer.content
    try:
        value = msgspec.json.decode(answer.content)
        if isinstance(value, dict | list):
            value = humps.decamelize(value)
        if list_return_type is None:
            return _read(value, return_type)
        return [_read(each, list_return_type) for each in msgspec.convert(value, list)]
    except (msgspec.MsgspecError, ValueError, TypeError, KeyError) as error:
        raise RestException(
            "{place}: the answer is not valid: {reason}", answer.text[:200], place=where, reason=error
        ) from error


def get_image(url: str, timeout: Timeout | None = None) -> "Image.Image":
    """Fetch a picture. Raises RestException."""
    from PIL import Image, UnidentifiedImageError

    answer = _request(Method.GET, url, None, None, timeout)
    try:
        picture = Image.open(io.BytesIO(answer.content))
        picture.load()
    except (UnidentifiedImageError, OSError) as error:
        raise RestException("GET {url}: the answer is not a picture: {reason}", url=url, reason=error) from error
    return picture


def _request(
    method: Method, url: str, query: dict[str, Any] | None, content: bytes | None, timeout: Timeout | None
) -> httpx.Response:
    where = f"{method.value} {url}"
    within = Timeout() if timeout is None else timeout
    headers = {"accept": "*/*"} | ({} if content is None else {"content-type": "application/json"})
    try:
        answer = _session.client().request(
            method.value,
            url,
            params=query,
            content=content,
            headers=headers,
            timeout=httpx.Timeout(within.read, connect=within.connect),
        )
    except httpx.TimeoutException as error:
        raise RestException("{place}: no answer in time", repr(error), place=where) from error
    except (httpx.HTTPError, httpx.InvalidURL) as error:
        raise RestException(
            "{place}: {reason}", repr(error), place=where, reason=error or type(error).__name__
        ) from error
    if answer.is_error:
        raise RestHttpException(
            "{place}: {answer}", answer.text[:2000], answer.status_code, place=where, answer=_reason(answer)
        )
    return answer


def _reason(answer: httpx.Response) -> str:
    """Return the message of the service, or the HTTP status if there is none."""
    try:
        content = msgspec.json.decode(answer.content, type=dict[str, Any])
    except (msgspec.MsgspecError, UnicodeDecodeError):
        content = {}
    message = content.get("message")
    return message if isinstance(message, str) and message else f"{answer.status_code} {answer.reason_phrase}"


def _plain(value: Any) -> Any:
    """Convert a value to dictionaries, lists and scalars. Members of objects that are None are left out."""
    to_dict = getattr(value, "to_dict", None)
    plain = to_dict() if callable(to_dict) else msgspec.to_builtins(value, enc_hook=_other)
    return _without_none(plain)


def _other(value: Any) -> Any:
    to_dict = getattr(value, "to_dict", None)
    if callable(to_dict):
        return to_dict()
    raise TypeError(f"a {type(value).__name__} has no form in JSON")


def _without_none(value: Any) -> Any:
    match value:
        case dict():
            return {key: _without_none(each) for key, each in value.items() if each is not None}
        case list():
            return [_without_none(each) for each in value]
        case _:
            return value


def _read(value: Any, kind: Any) -> Any:
    from_dict = getattr(kind, "from_dict", None)
    return from_dict(value) if callable(from_dict) else msgspec.convert(value, kind)

"""Calls of REST services as older sources make them; names and arguments from general knowledge of such sources.

Bodies and queries travel in camelCase, results are read back into snake_case, errors are told as the service tells them
(`message` of openapi's WebApiError).
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
    """What is asked of the service."""

    GET = "GET"
    POST = "POST"
    PUT = "PUT"
    PATCH = "PATCH"
    DELETE = "DELETE"


class Timeout(NamedTuple):
    """Seconds for the connection, and for each part of the answer."""

    connect: float = 3.05
    read: float = 20.0


class RestException(DeviceError):
    """A service cannot be reached, or answers what makes no sense."""

    code = "rest"


class RestHttpException(RestException):
    """A service refuses; `error_code` is the HTTP status."""

    code = "rest_refused"

    def __init__(self, message: str = "", detail: str = "", error_code: int = 500, **values: object) -> None:
        super().__init__(message, detail, **values)
        self.error_code = error_code


class _Session:
    """One client for all threads: it keeps connections open, and costs 20 ms to make."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._client: httpx.Client | None = None

    def client(self) -> httpx.Client:
        with self._lock:
            if self._client is None:
                # Devices stand in the local network: no proxy of the environment.
                self._client = httpx.Client(trust_env=False, follow_redirects=True)
            return self._client

    def close(self) -> None:
        with self._lock:
            if self._client is not None:
                self._client.close()
            self._client = None


_session = _Session()


def close() -> None:
    """Close the connections that are kept open."""
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
    """Call a service; gives its answer as `return_type`, or as a list of `list_return_type`, or nothing.

    body, params: dataclasses, our data, dictionaries, or lists of them. RestException names method and address;
    RestHttpException when the service refuses.
    """
    where = f"{method.value} {url}"
    content = None if body is None else msgspec.json.encode(humps.camelize(_plain(body)))
    query = None if params is None else {k: v for k, v in humps.camelize(_plain(params)).items() if v is not None}
    answer = _ask(method, url, query, content, timeout)
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
            "{place}: the answer does not fit: {reason}", answer.text[:200], place=where, reason=error
        ) from error


def get_image(url: str, timeout: Timeout | None = None) -> "Image.Image":
    """Fetch a picture; RestException."""
    from PIL import Image, UnidentifiedImageError

    answer = _ask(Method.GET, url, None, None, timeout)
    try:
        picture = Image.open(io.BytesIO(answer.content))
        picture.load()
    except (UnidentifiedImageError, OSError) as error:
        raise RestException("GET {url}: this is no picture: {reason}", url=url, reason=error) from error
    return picture


def _ask(
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
    """Give what the service says of its refusal."""
    try:
        told = msgspec.json.decode(answer.content, type=dict[str, Any])
    except (msgspec.MsgspecError, UnicodeDecodeError):
        told = {}
    message = told.get("message")
    return message if isinstance(message, str) and message else f"{answer.status_code} {answer.reason_phrase}"


def _plain(value: Any) -> Any:
    """Give a value as JSON has it; what is None is left out of objects."""
    to_dict = getattr(value, "to_dict", None)
    plain = to_dict() if callable(to_dict) else msgspec.to_builtins(value, enc_hook=_other)
    return _without_none(plain)


def _other(value: Any) -> Any:
    to_dict = getattr(value, "to_dict", None)
    if callable(to_dict):
        return to_dict()
    raise NotImplementedError(f"a {type(value).__name__} has no form in JSON")


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

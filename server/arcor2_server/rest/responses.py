"""Responses of routes: JSON by msgspec, errors as the WebApiError of the protocol."""

from typing import Any, Final

import msgspec
from litestar import MediaType, Request, Response
from litestar.exceptions import HTTPException

from arcor2_hw.data.base import Data
from arcor2_hw.exceptions import (
    Arcor2Error,
    Conflict,
    InvalidData,
    InvalidPackage,
    InvalidProject,
    NotFound,
    StorageError,
)
from arcor2_server.storage.assets import TooLarge

SERVICE: Final = "service"
"""The key of a route's `opt` that names the service it belongs to."""
_encode = msgspec.json.Encoder().encode


class WebApiError(Data, frozen=True):
    """What a refused REST request is answered with (openapi/storage.json)."""

    service: str
    message: str
    type: str
    description: str


class InternalError(Arcor2Error):
    """Something nobody foresaw."""

    code = "internal"


class Unsupported(Arcor2Error):
    """The body is of another media type than the route takes."""

    code = "unsupported_media_type"


_STATUS: Final[dict[type[Arcor2Error], tuple[int, str]]] = {
    TooLarge: (413, "Argument"),
    Unsupported: (415, "Argument"),
    StorageError: (500, "General"),
    InternalError: (500, "General"),
    NotFound: (404, "NotFound"),
    InvalidPackage: (400, "InvalidPackage"),
    InvalidData: (400, "Argument"),
    Conflict: (409, "Conflict"),
    InvalidProject: (409, "InvalidProject"),
}
"""Status and `type` of the answer by error class, first match. Existing clients distinguish errors by the type."""
_ABSENT: Final = frozenset({"not_installed", "compute_stopped", "compute_timeout", "compute_busy"})
"""Codes of errors of an unavailable part of the system."""
_BY_CODE: Final = {"calibration_refused": (409, "Invalid")}
_BY_REASON: Final = {"no_marker": (404, "NotFound")}
"""As the original's Calibration service has them (protocol, section 15)."""
_STATES: Final = {"Execution": "PackageRunState"}
"""The type of a state error, for services that define one."""


def answer(content: Any, status: int = 200) -> Response[bytes]:
    """Answer with JSON."""
    return Response(_encode(content), status_code=status, media_type=MediaType.JSON)


def refusal(service: str, error: Arcor2Error) -> Response[bytes]:
    """Answer an error: 404 for a missing item, 400 for an invalid request, 409 for a wrong state."""
    otherwise = (503, "General") if error.code in _ABSENT else (409, _STATES.get(service, "General"))
    otherwise = _BY_REASON.get(getattr(error, "reason", "")) or _BY_CODE.get(error.code, otherwise)
    status, name = next((found for kind, found in _STATUS.items() if isinstance(error, kind)), otherwise)
    return answer(WebApiError(service, _printable(str(error)), name, _printable(error.detail)), status)


def http_refusal(request: Request[Any, Any, Any], error: HTTPException) -> Response[bytes]:
    """Answer a request refused before it reaches a route: no such route, no token, too large."""
    service = "ARCOR2-HW"
    if "route_handler" in request.scope:
        service = request.route_handler.opt.get(SERVICE, service)
    name = {404: "NotFound", 400: "Argument", 413: "Argument", 405: "Argument"}.get(error.status_code, "General")
    refused = answer(WebApiError(service, error.detail, name, ""), error.status_code)
    for header, value in (error.headers or {}).items():
        refused.headers[header] = value
    return refused


def _printable(text: str) -> str:
    """Half a surrogate pair can be read but not sent back."""
    return text if text.isascii() else text.encode(errors="replace").decode()

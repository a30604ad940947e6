"""HTTP responses: JSON encoded by msgspec, and errors as the WebApiError of the protocol."""

from typing import Any, Final

import msgspec
from litestar import MediaType, Request, Response
from litestar.exceptions import HTTPException, ValidationException

from arcor2_hw.data.base import TranslatableData
from arcor2_hw.exceptions import (
    Arcor2Error,
    Conflict,
    DatabaseInUse,
    DatabaseUnreachable,
    InvalidData,
    InvalidPackage,
    InvalidProject,
    NotFound,
    StorageError,
)
from arcor2_hw.messages import Message, translatable
from arcor2_server.storage.assets import TooLarge

SERVICE: Final = "service"
"""Option of a route: the name of its service."""
_PHRASES: Final = translatable(
    {
        "Not Found": "This address does not exist.",
        "Method Not Allowed": "This address does not support the method of the request.",
        "Request Entity Too Large": "The request is too large.",
        "Internal Server Error": "The server failed to answer. Its log has the details.",
    }
)
"""Messages of errors that Litestar raises with the phrase of their status only."""
_encode = msgspec.json.Encoder().encode


class WebApiError(TranslatableData, frozen=True):
    """Body of the response to a refused REST request (openapi/storage.json), with the translation of its message."""

    service: str
    message: str
    type: str
    description: str


class InternalError(Arcor2Error):
    """An unexpected error inside the server."""

    code = "internal"


class Unsupported(Arcor2Error):
    """The route does not accept the media type of the body."""

    code = "unsupported_media_type"


_STATUS: Final[dict[type[Arcor2Error], tuple[int, str]]] = {
    TooLarge: (413, "Argument"),
    Unsupported: (415, "Argument"),
    DatabaseUnreachable: (503, "General"),
    DatabaseInUse: (503, "General"),
    StorageError: (500, "General"),
    InternalError: (500, "General"),
    NotFound: (404, "NotFound"),
    InvalidPackage: (400, "InvalidPackage"),
    InvalidData: (400, "Argument"),
    Conflict: (409, "Conflict"),
    InvalidProject: (409, "InvalidProject"),
}
"""Status and `type` of the answer by error class, first match. Existing clients distinguish errors by the type."""
_UNAVAILABLE: Final = frozenset({"not_installed", "compute_stopped", "compute_timeout", "compute_busy"})
"""Codes of errors of an unavailable part of the system."""
_BY_CODE: Final = {"calibration_refused": (409, "Invalid")}
"""Status and type by error code, as in the Calibration service of ARCOR2 (protocol, section 15)."""
_BY_REASON: Final = {"no_marker": (404, "NotFound")}
"""Status and type by the reason of a refused calibration, as in the Calibration service of ARCOR2."""
_STATES: Final = {"Execution": "PackageRunState"}
"""Type of errors caused by a wrong state, for services that define one."""


def _json_response(content: Any, status: int) -> Response[bytes]:
    return Response(_encode(content), status_code=status, media_type=MediaType.JSON)


def refusal(service: str, error: Arcor2Error) -> Response[bytes]:
    """Return the response for an error: 404 for a missing item, 400 for an invalid request, 409 for a wrong state."""
    otherwise = (503, "General") if error.code in _UNAVAILABLE else (409, _STATES.get(service, "General"))
    otherwise = _BY_REASON.get(getattr(error, "reason", "")) or _BY_CODE.get(error.code, otherwise)
    status, name = next((found for kind, found in _STATUS.items() if isinstance(error, kind)), otherwise)
    text, detail = _printable(str(error)), _printable(error.detail)
    translation = error.message.translation() if text == str(error) else {}
    return _json_response(WebApiError(service, text, name, detail, **translation), status)


def http_refusal(request: Request[Any, Any, Any], error: HTTPException) -> Response[bytes]:
    """Return the response to a request that reached no route: unknown route, missing token, too large."""
    service = "ARCOR2-HW"
    if "route_handler" in request.scope:
        service = request.route_handler.opt.get(SERVICE, service)
    name = {404: "NotFound", 400: "Argument", 413: "Argument", 405: "Argument"}.get(error.status_code, "General")
    text, detail = error.detail, ""
    translation = error.extra if isinstance(error.extra, dict) else {}  # only our own errors have one
    if (message := _of_litestar(error)) is not None:
        text, detail, translation = message.text, error.detail, message.translation()
    refused = _json_response(WebApiError(service, text, name, detail, **translation), error.status_code)
    for header, value in (error.headers or {}).items():
        refused.headers[header] = value
    return refused


def _of_litestar(error: HTTPException) -> Message | None:
    """Return the message for an error that Litestar raised itself, None for our own errors."""
    if isinstance(error, ValidationException):
        faults = error.extra if isinstance(error.extra, list) else []
        names = [fault["key"] for fault in faults if isinstance(fault, dict) and fault.get("key")]
        if not names:
            return Message.of("The request has an invalid or missing parameter.")
        return Message.of("Invalid or missing in the request: {names}.", names=", ".join(names))
    found = _PHRASES.get(error.detail)
    return None if found is None else Message.of(found)


def _printable(text: str) -> str:
    """Return a text without lone surrogates, which JSON can contain but UTF-8 cannot encode."""
    return text if text.isascii() else text.encode(errors="replace").decode()

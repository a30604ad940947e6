"""How a route answers: JSON by msgspec, errors as the protocol's WebApiError, and the key for the least role."""

from typing import Any, Final

import msgspec
from litestar import MediaType, Request, Response

from arcor2_hw.data.base import Data
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound
from arcor2_server.services import Services

ROLE: Final = "role"
"""The key of a route's `opt` under which it declares the least role that may use it."""
OPEN: Final = "open"
"""The key of a route's `opt` that says that it asks nobody for a token: it tells nothing."""

_encode = msgspec.json.Encoder().encode


class WebApiError(Data, frozen=True):
    """What a refused REST request is answered with (openapi/storage.json)."""

    service: str
    message: str
    type: str
    description: str


def services_of(request: Request[Any, Any, Any]) -> Services:
    """Give the parts of the server."""
    services: Services = request.app.state.services
    return services


def answer(content: Any, status: int = 200) -> Response[bytes]:
    """Answer with JSON."""
    return Response(_encode(content), status_code=status, media_type=MediaType.JSON)


def refusal(service: str, error: Arcor2Error) -> Response[bytes]:
    """Answer an error of ours: 404 for what is not there, 400 for what has a wrong form, 409 for the rest."""
    status = 404 if isinstance(error, NotFound) else 400 if isinstance(error, InvalidData) else 409
    kind = {404: "NotFound", 400: "Argument"}.get(status, "General")
    return answer(WebApiError(service, str(error), kind, error.detail), status)

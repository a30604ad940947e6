"""Encoded answers to requests and to invalid messages."""

from typing import Any, Final

import msgspec
from msgspec import UNSET, Struct
from msgspec.structs import replace

from arcor2_hw.data.rpc import Request, Response
from arcor2_hw.messages import Message
from arcor2_server.events import encode

UNREADABLE: Final = "Error"
"""Request name in the answer to an unreadable message."""
MAX_NAME: Final = 200
"""Maximum length of an unknown request name in an answer, characters."""
MAX_REASON: Final = 4000
"""Maximum length of the message of a refusal, characters. It may quote the request."""
_decode_anything = msgspec.json.Decoder().decode


class Head(Struct):
    """Id and name of a message that is refused, as far as they are readable."""

    id: int = 0
    request: str = UNREADABLE


class _CompleteHead(Struct):
    id: int
    request: str


_decode_head = msgspec.json.Decoder(_CompleteHead).decode


def answer(request: Request, data: Any) -> bytes:
    """Return the answer to a successful request."""
    return encode(Response(request.id, request.request, True, data=data))


def refusal(request: "Request | Head", message: Message, code: str = "", data: Any = UNSET) -> bytes:
    """Return the answer to a refused request.

    Args:
        request: The request, or its readable part.
        message: The reason.
        code: The code of the error, for clients that asked for codes.
        data: Results of a request that was done in part.
    """
    name = request.request if len(request.request) <= MAX_NAME else UNREADABLE
    text = shortened(message.text)
    response = Response(request.id, name, False, [text], data)
    if isinstance(request, Request) and request.codes:
        response = replace(response, code=code or UNSET, **_translation(message))
    try:
        return encode(response)
    except UnicodeEncodeError:
        # A name with half a surrogate pair can be read but not sent back.
        return encode(Response(request.id, UNREADABLE, False, [ascii(text)]))


def _translation(message: Message) -> dict[str, Any]:
    """Return key and values of a message that is not shortened."""
    return message.translation() if len(message.text) <= MAX_REASON else {}


def shortened(message: str) -> str:
    """Return a message, cut to `MAX_REASON`."""
    return message if len(message) <= MAX_REASON else message[:MAX_REASON] + " …"


def read_head(text: str) -> Head:
    """Return the id and name of a message that is invalid or too long, as far as they are readable."""
    try:
        readable = _decode_head(text)
    except (msgspec.DecodeError, RecursionError):
        pass
    else:
        return Head(readable.id, readable.request)
    try:
        content = _decode_anything(text)
    except (msgspec.DecodeError, RecursionError):
        return Head()
    if not isinstance(content, dict):
        return Head()
    number, name = content.get("id"), content.get("request")
    if not isinstance(number, int) or isinstance(number, bool):
        return Head()
    return Head(number, name if isinstance(name, str) else UNREADABLE)

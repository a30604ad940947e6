"""JSON functions of older sources."""

from typing import Any, TypeVar

import msgspec

from arcor2_hw.actions.json_values import encode
from arcor2_hw.exceptions import InvalidData

T = TypeVar("T")


class JsonException(InvalidData):
    """A text is not valid JSON, or a value cannot be encoded as JSON."""

    code = "json"


def loads(text: str | bytes) -> Any:
    """Decode JSON. Raises JsonException."""
    try:
        return msgspec.json.decode(text)
    except (msgspec.MsgspecError, UnicodeEncodeError, RecursionError) as error:
        raise JsonException("invalid JSON: {reason}", reason=error) from error


def loads_type(text: str | bytes, kind: type[T]) -> T:
    """Decode JSON whose value must be exactly of a type: 1 is not a float. Raises JsonException."""
    value = loads(text)
    if type(value) is not kind:
        raise JsonException(
            "the JSON value is a {type}, not a {kind_name}", type=type(value).__name__, kind_name=kind.__name__
        )
    return value


def dumps(value: Any) -> str:
    """Encode a value as JSON. Raises JsonException."""
    try:
        return encode(value)
    except InvalidData as error:
        raise JsonException(error.message, error.detail) from error

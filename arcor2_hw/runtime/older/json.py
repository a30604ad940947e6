"""JSON as older sources use it."""

from typing import Any, TypeVar

import msgspec

from arcor2_hw.actions.json_values import encode
from arcor2_hw.exceptions import InvalidData

T = TypeVar("T")


class JsonException(InvalidData):
    """This is no JSON, or cannot be told in JSON."""

    code = "json"


def loads(text: str | bytes) -> Any:
    """Read JSON; JsonException."""
    try:
        return msgspec.json.decode(text)
    except (msgspec.MsgspecError, UnicodeEncodeError, RecursionError) as error:
        raise JsonException("this is no JSON: {reason}", reason=error) from error


def loads_type(text: str | bytes, kind: type[T]) -> T:
    """Read JSON that has to be of a type, exactly: 1 is no float. JsonException."""
    value = loads(text)
    if type(value) is not kind:
        raise JsonException("this is a {type}, not a {kind_name}", type=type(value).__name__, kind_name=kind.__name__)
    return value


def dumps(value: Any) -> str:
    """Write JSON; JsonException."""
    try:
        return encode(value)
    except InvalidData as error:
        raise JsonException(str(error)) from error

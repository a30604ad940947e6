"""Reading of the JSON documents in the folder of a package, for the cell host and the server."""

import contextlib
from pathlib import Path
from typing import TypeVar

import humps
import msgspec

from arcor2_hw.exceptions import InvalidPackage

T = TypeVar("T")


def decode_document(raw: bytes, kind: type[T]) -> T:
    """Decode a JSON document whose keys are in snake_case or camelCase.

    Raises:
        MsgspecError: The document is damaged.
        RecursionError: It is nested too deeply.
    """
    try:
        return msgspec.json.decode(raw, type=kind)
    except (msgspec.MsgspecError, RecursionError):
        with contextlib.suppress(msgspec.MsgspecError, ValueError, RecursionError):
            return msgspec.convert(humps.decamelize(msgspec.json.decode(raw)), kind)
        raise


def read_document(path: Path, kind: type[T]) -> T:
    """Read a JSON document whose keys are in snake_case or camelCase.

    Raises:
        InvalidPackage: The file is missing or damaged. The message names it.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InvalidPackage(
            "{name} of the package is missing or cannot be read", str(error), name=path.name
        ) from error
    try:
        return decode_document(raw, kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InvalidPackage(
            "{name} of the package is damaged: {reason}", str(path), name=path.name, reason=error
        ) from error

"""The documents in a package's folder, as host and server read them."""

from pathlib import Path
from typing import TypeVar

import humps
import msgspec

from arcor2_hw.exceptions import InvalidPackage

T = TypeVar("T")


def read_document(path: Path, kind: type[T]) -> T:
    """Read a JSON document in snake_case or camelCase; InvalidPackage names the file."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InvalidPackage(f"the package has no readable {path.name}", str(error)) from error
    try:
        return msgspec.json.decode(raw, type=kind)
    except msgspec.MsgspecError as error:
        try:
            return msgspec.convert(humps.decamelize(msgspec.json.decode(raw)), kind)
        except (msgspec.MsgspecError, ValueError):
            raise InvalidPackage(f"{path.name} of the package is damaged: {error}", str(path)) from error

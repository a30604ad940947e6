"""The identity of a cell, by which the fleet recognises two servers that use one name."""

import re
import uuid
from pathlib import Path
from typing import Final

from arcor2_hw.exceptions import StorageError
from arcor2_server.files import write_private

FILE: Final = "fleet-identity"
"""File in the data directory."""
_IDENTITY: Final = re.compile(r"[0-9a-f]{32}")


def identity_of(data_dir: Path) -> str:
    """Return the identity of a data directory, and create it if it has none.

    Raises:
        StorageError: the file cannot be read or written.
    """
    file = data_dir / FILE
    try:
        if file.exists() and _IDENTITY.fullmatch(found := file.read_text("ascii", "replace").strip()):
            return found
        created = uuid.uuid4().hex
        write_private(file, f"{created}\n".encode())
    except OSError as error:
        raise StorageError("{file} cannot be used: {reason}.", file=file, reason=error) from error
    return created

"""Which markers stand where in this workplace: from a file that the server was given, or as it was told over REST."""

import asyncio
import os
import tempfile
from pathlib import Path

import msgspec
import structlog

from arcor2_hw.calibration.configuration import CalibrationConfiguration
from arcor2_hw.exceptions import Conflict, StorageError

log = structlog.get_logger(__name__)


class Markers:
    """The configuration in force. What is set is kept in the data directory, at once."""

    def __init__(self, path: Path, given: CalibrationConfiguration | None = None) -> None:
        self._path = path
        self._given = given
        self._kept = CalibrationConfiguration()
        self._changing = asyncio.Lock()

    @property
    def configuration(self) -> CalibrationConfiguration:
        """Give what is in force."""
        return self._kept if self._given is None else self._given

    def load(self) -> None:
        """Read what was kept. StorageError naming the file when that is damaged."""
        try:
            self._kept = msgspec.json.decode(self._path.read_bytes(), type=CalibrationConfiguration)
        except FileNotFoundError:
            return
        except (OSError, msgspec.DecodeError) as error:
            raise StorageError(f"The markers in {self._path} cannot be read: {error}") from error

    async def set(self, configuration: CalibrationConfiguration) -> None:
        """Keep another configuration. Conflict when the server was given a file; StorageError."""
        if self._given is not None:
            raise Conflict("The server was started with a file of markers: change them there.")
        async with self._changing:
            try:
                await asyncio.to_thread(_write, self._path, msgspec.json.format(msgspec.json.encode(configuration)))
            except OSError as error:
                raise StorageError(f"The markers cannot be kept in {self._path}: {error.strerror}") from error
            self._kept = configuration
        log.info("markers set", markers=len(configuration.markers), boards=len(configuration.boards))


def _write(path: Path, content: bytes) -> None:
    """Put a file in its place in one step: a crash leaves the old one or the new one."""
    descriptor, name = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise

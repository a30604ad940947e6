"""Marker configuration of the workplace: from a configured file, or set over REST."""

import asyncio
from pathlib import Path

import msgspec
import structlog

from arcor2_hw.calibration.configuration import CalibrationConfiguration
from arcor2_hw.exceptions import Conflict, StorageError
from arcor2_server.files import write_private
from arcor2_server.storage.damage_notices import DataDamage

log = structlog.get_logger(__name__)


class Markers:
    """The configuration in use. A new configuration is stored in the data directory at once."""

    def __init__(self, path: Path, given: CalibrationConfiguration | None = None) -> None:
        self._path = path
        self._given = given
        self._stored = CalibrationConfiguration()
        self._changing = asyncio.Lock()

    @property
    def configuration(self) -> CalibrationConfiguration:
        """Return what is in force."""
        return self._stored if self._given is None else self._given

    def load(self, damage: DataDamage) -> None:
        """Read what is stored; a damaged file is set aside and reported. StorageError when it cannot be read."""
        try:
            self._stored = msgspec.json.decode(self._path.read_bytes(), type=CalibrationConfiguration)
        except FileNotFoundError:
            return
        except msgspec.DecodeError as error:
            damage.set_aside(self._path, "The positions of the markers are lost: set them again.", error)
        except OSError as error:
            raise StorageError(
                "The markers in {path} cannot be read: {reason}", path=self._path, reason=error
            ) from error

    async def set(self, configuration: CalibrationConfiguration) -> None:
        """Keep another configuration. Conflict when the server was given a file.

        Raise StorageError if that is impossible.
        """
        if self._given is not None:
            raise Conflict("The server was started with a file of markers: change them there.")
        async with self._changing:
            try:
                await asyncio.to_thread(
                    write_private, self._path, msgspec.json.format(msgspec.json.encode(configuration))
                )
            except OSError as error:
                raise StorageError(
                    "The markers cannot be kept in {path}: {reason}", path=self._path, reason=error.strerror
                ) from error
            self._stored = configuration
        log.info("markers set", markers=len(configuration.markers), boards=len(configuration.boards))

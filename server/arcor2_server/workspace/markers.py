"""Marker configuration of the workplace: from a configured file, or set over REST."""

import asyncio
from pathlib import Path

import msgspec
import structlog

from arcor2_hw.calibration.configuration import CalibrationConfiguration
from arcor2_hw.exceptions import Conflict, StorageError
from arcor2_hw.messages import Message
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
        """Return the configuration in use."""
        return self._stored if self._given is None else self._given

    def load(self, damage: DataDamage) -> None:
        """Read the stored configuration; report a damaged file. Raise StorageError if it cannot be read."""
        loss = Message.of("The positions of the markers are lost: set them again.")
        self._stored = damage.read_json(self._path, CalibrationConfiguration, loss) or CalibrationConfiguration()

    async def set(self, configuration: CalibrationConfiguration) -> None:
        """Use and store another configuration.

        Raises:
            Conflict: The server was started with a configuration file.
            StorageError: The file cannot be written.
        """
        if self._given is not None:
            raise Conflict("The server was started with a marker file: change the markers there.")
        async with self._changing:
            try:
                await asyncio.to_thread(
                    write_private, self._path, msgspec.json.format(msgspec.json.encode(configuration))
                )
            except OSError as error:
                raise StorageError(
                    "The markers cannot be stored in {path}: {reason}.", path=self._path, reason=error.strerror
                ) from error
            self._stored = configuration
        log.info("markers set", markers=len(configuration.markers), boards=len(configuration.boards))

"""The declarations of alarms: those of the server, of the drivers, and those that all devices share."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import structlog

from arcor2_hw.analysis import alarms
from arcor2_hw.analysis.templates import LIBRARY
from arcor2_hw.data.alarms import AlarmCategory, AlarmKind, Priority
from arcor2_hw.exceptions import InvalidData

log = structlog.get_logger(__name__)

SERVER: Final = Path(__file__).resolve().parents[1]
UNDECLARED: Final = AlarmKind(9999, "*", Priority.HIGH, AlarmCategory.DEVICE, latching=True, group="device")
"""The kind of an alarm without a declaration. Device and driver state its text."""


class AlarmKinds:
    """Finds the declaration of an alarm.

    Args:
        folder_of: returns the folder of the driver of an object type, None for an uploaded or unknown type.
    """

    def __init__(self, folder_of: Callable[[str], Path | None]) -> None:
        self._folder_of = folder_of
        self._read: dict[Path, list[AlarmKind]] = {}
        self._system = alarms.read(SERVER)

    def of_system(self, code: str) -> AlarmKind:
        """Return the declaration of an alarm of the system or the program."""
        return alarms.kind_of(code, self._system) or UNDECLARED

    def of_device(self, object_type: str, code: str) -> AlarmKind:
        """Return the declaration of an alarm of a device."""
        return alarms.kind_of(code, self._of_type(object_type), alarms.common()) or UNDECLARED

    def declares(self, object_type: str, code: str) -> bool:
        """Return whether the driver of a type declares an alarm itself."""
        return bool(code) and alarms.kind_of(code, self._of_type(object_type)) is not None

    def _of_type(self, object_type: str) -> list[AlarmKind]:
        if (folder := self._folder_of(object_type)) is None:
            return []
        if folder not in self._read:
            try:
                self._read[folder] = alarms.read(folder)
            except InvalidData as error:
                log.warning("declarations of alarms left out", reason=str(error))
                self._read[folder] = []
        return self._read[folder]

    def picture(self, name: str, object_type: str) -> Path | None:
        """Return the file of a picture that the declarations for an object type name; None if they do not name it."""
        folder = self._folder_of(object_type)
        for place, kinds in ((folder, self._of_type(object_type)), (SERVER, self._system), (LIBRARY, alarms.common())):
            if place is not None and any(kind.picture == name for kind in kinds):
                return place / name
        return None

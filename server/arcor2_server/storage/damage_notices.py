"""Notices about damaged files of the data directory, shown until a user has received them."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

import msgspec
import structlog

from arcor2_hw.data.base import now
from arcor2_hw.data.events import Event, NotificationData, NotificationLevel
from arcor2_server.events import make_event
from arcor2_server.files import aside, write_private

if TYPE_CHECKING:
    from arcor2_server.events import EventHub

log = structlog.get_logger(__name__)

FILE: Final = "damage.json"
"""Notices that no client has received yet."""


class DataDamage:
    """Notices about damaged files. All clients receive them until one has received them after a restart."""

    def __init__(self, data_dir: Path, hub: "EventHub") -> None:
        self._path = data_dir / FILE
        self._hub = hub
        self._notices: list[str] = []
        self._waiting = False

    @property
    def notices(self) -> list[str]:
        """What was found damaged, as sentences."""
        return list(self._notices)

    def load(self) -> None:
        """Read the notices that no client has received."""
        try:
            self._notices = msgspec.json.decode(self._path.read_bytes(), type=list[str])
            self._waiting = True
        except FileNotFoundError:
            pass
        except (OSError, msgspec.DecodeError) as error:
            log.error("notices of damaged files cannot be read", file=str(self._path), reason=str(error))

    def report(self, notice: str) -> None:
        """Notify all clients, now and when they connect."""
        log.error("data damaged", notice=notice)
        self._notices.append(notice)
        self._hub.broadcast(_event(notice))
        self._waiting = True
        try:
            write_private(self._path, msgspec.json.encode(self._notices))
        except OSError as error:
            log.error("notices of damaged files cannot be stored", file=str(self._path), reason=str(error))

    def set_aside(self, path: Path, what: str, reason: object) -> Path | None:
        """Rename a damaged file and report it; return the new name, None if it cannot be renamed.

        what: sentences about what is lost and what to do.
        """
        target: Path | None = aside(path, now())
        try:
            path.rename(target)  # type: ignore[arg-type]
        except OSError as error:
            log.error("damaged file cannot be renamed", file=str(path), reason=str(error))
            target = None
        stored = f"The damaged file is stored as {target}." if target else "The damaged file was left in place."
        self.report(f"The file {path} is damaged: {str(reason).rstrip('.')}. {what} {stored}")
        return target

    def greeting(self) -> list[Event]:
        """Return the notices for a client that has just connected."""
        if self._waiting:
            self._waiting = False
            self._path.unlink(missing_ok=True)
        return [_event(notice) for notice in self._notices]


def _event(notice: str) -> Event:
    return make_event("Notification", NotificationData(notice, NotificationLevel.ERROR))

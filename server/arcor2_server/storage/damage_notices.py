"""Notices about damaged files of the data directory, shown until a user has received them."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

import msgspec
import structlog

from arcor2_hw.data.base import now
from arcor2_hw.data.events import Event, NotificationData, NotificationLevel
from arcor2_hw.exceptions import StorageError
from arcor2_hw.messages import Message
from arcor2_server.events import make_event
from arcor2_server.files import damaged_copy_path, write_private

if TYPE_CHECKING:
    from arcor2_server.events import EventHub

log = structlog.get_logger(__name__)

FILE: Final = "damage.json"
"""File with the notices that no client has received yet."""

T = TypeVar("T")


class DataDamage:
    """Notices about damaged files. All clients receive them until one has received them after a restart."""

    def __init__(self, data_dir: Path, hub: "EventHub") -> None:
        self._path = data_dir / FILE
        self._hub = hub
        self._notices: list[Message] = []
        self._waiting = False
        self.on_report: list[Callable[[Message], None]] = []
        """Called with each new notice."""

    @property
    def notices(self) -> list[Message]:
        """All notices, as sentences."""
        return list(self._notices)

    def load(self) -> None:
        """Read the notices that no client has received."""
        try:
            stored = msgspec.json.decode(self._path.read_bytes(), type=list[Message | str])  # older versions: texts
            self._notices = [Message.of(each) if isinstance(each, str) else each for each in stored]
            self._waiting = True
        except FileNotFoundError:
            pass
        except (OSError, msgspec.DecodeError) as error:
            log.error("notices of damaged files cannot be read", file=str(self._path), reason=str(error))

    def report(self, notice: Message) -> None:
        """Notify all clients, now and when they connect."""
        log.error("data damaged", notice=notice.text)
        self._notices.append(notice)
        self._hub.broadcast(_event(notice))
        for notify in self.on_report:
            notify(notice)
        self._waiting = True
        try:
            write_private(self._path, msgspec.json.encode(self._notices))
        except OSError as error:
            log.error("notices of damaged files cannot be stored", file=str(self._path), reason=str(error))

    def read_json(self, path: Path, kind: type[T], loss: Message) -> T | None:
        """Read a JSON file; None if it is missing, or damaged, in which case it is renamed and reported.

        Args:
            path: The file.
            kind: The type of its content.
            loss: Sentences about the loss if it is damaged, and the remedy.

        Raises:
            StorageError: The file cannot be read.
        """
        try:
            return msgspec.json.decode(path.read_bytes(), type=kind)
        except FileNotFoundError:
            return None
        except msgspec.DecodeError as error:
            self.set_aside(path, loss, error)
            return None
        except OSError as error:
            raise StorageError("The file {path} cannot be read: {reason}.", path=path, reason=error) from error

    def set_aside(self, path: Path, loss: Message, reason: object) -> Path | None:
        """Rename a damaged file and report it; return the new name, None if it cannot be renamed.

        Args:
            path: The file.
            loss: Sentences about the loss and the remedy.
            reason: The damage.
        """
        target: Path | None = None
        try:
            target = path.rename(damaged_copy_path(path, now()))
        except OSError as error:
            log.error("damaged file cannot be renamed", file=str(path), reason=str(error))
        notice = (
            Message.of("The damaged file was left in place.")
            if target is None
            else Message.of("The damaged file is stored as {path}.", path=target)
        )
        damage = Message.of("The file {path} is damaged: {reason}.", path=path, reason=str(reason).rstrip("."))
        self.report(Message.joined([damage, loss, notice]))
        return target

    def greeting(self) -> list[Event]:
        """Return the notices for a client that has just connected."""
        if self._waiting:
            self._waiting = False
            self._path.unlink(missing_ok=True)
        return [_event(notice) for notice in self._notices]


def _event(notice: Message) -> Event:
    data = NotificationData(notice.text, NotificationLevel.ERROR, **notice.translation())
    return make_event("Notification", data)

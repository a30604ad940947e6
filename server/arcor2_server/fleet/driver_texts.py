"""The drivers' translations of alarms and units of a cell. The server of the page has only those of its own texts."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import structlog

from arcor2_hw.analysis.translations import FOLDER, is_language, read
from arcor2_hw.data.alarms import AlarmRecord
from arcor2_hw.data.base import Unset
from arcor2_hw.data.units import UnitRecord
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import Message
from arcor2_server.fleet.records import Translations

log = structlog.get_logger(__name__)


class DriverTexts:
    """The translations of drivers. Changed files are read again.

    Args:
        folders: returns the folders of the drivers.
    """

    def __init__(self, folders: Callable[[], Iterable[Path]]) -> None:
        self._folders = folders
        self._files: dict[Path, tuple[int, dict[str, str]]] = {}

    def of(self, messages: Iterable[Message]) -> Translations:
        """Return the translations of messages as far as drivers have them. It reads files."""
        keys = {key for message in messages for key in _keys(message)}
        found: Translations = {}
        for folder in self._folders():
            for file in sorted((folder / FOLDER).glob("*.json")):
                if is_language(file.stem):
                    texts = self._read(file)
                    found.setdefault(file.stem, {}).update((key, texts[key]) for key in keys if key in texts)
        return {language: texts for language, texts in found.items() if texts}

    def of_text(self, alarm: AlarmRecord) -> Translations:
        """Return the translations of the text of an alarm. It reads files."""
        return self.of(texts_of(alarm)[:1])

    def of_alarm(self, alarm: AlarmRecord) -> Translations:
        """Return the translations of all texts of an alarm. It reads files."""
        return self.of(texts_of(alarm))

    def of_unit(self, unit: UnitRecord) -> Translations:
        """Return the translations of the errors of the steps of a unit. It reads files if there are errors."""
        errors = [step.as_message(step.error) for step in unit.steps if not isinstance(step.error, Unset)]
        return self.of(errors) if errors else {}

    def _read(self, file: Path) -> dict[str, str]:
        try:
            changed = file.stat().st_mtime_ns
            known = self._files.get(file)
            if known is None or known[0] != changed:
                self._files[file] = (changed, {})
                self._files[file] = (changed, read(file))
            return self._files[file][1]
        except (InvalidData, OSError) as error:
            log.warning("translations left out", file=str(file), reason=str(error))
            return {}


def texts_of(alarm: AlarmRecord) -> list[Message]:
    """Return the texts of an alarm."""
    text = Message.of(alarm.text) if isinstance(alarm.text_message, Unset) else alarm.text_message
    remedy = Message.of(alarm.remedy) if isinstance(alarm.remedy_message, Unset) else alarm.remedy_message
    return [text, Message.of(alarm.cause), remedy]


def _keys(message: Message) -> Iterator[str]:
    """Yield the keys of a message and of those that are part of it."""
    yield message.key if message.values else message.text
    for value in message.values.values():
        if isinstance(value, Message):
            yield from _keys(value)

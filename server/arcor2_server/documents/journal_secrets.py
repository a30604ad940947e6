"""Moves secrets to the secret store from a journal that an earlier version wrote in plain text."""

from collections.abc import Callable
from typing import Any, Final

from msgspec.structs import replace

from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.journal_records import RecoveredDocument
from arcor2_server.storage.setting_secrets import SettingSecrets

_WITH_SETTINGS: Final = frozenset({Kind.OBJECT, Kind.OVERRIDE})


def hide_in_journal(secrets: SettingSecrets, found: RecoveredDocument) -> RecoveredDocument:
    """Return the content of the journal without secrets, or `found` itself if it has none.

    Raises:
        StorageError: the secret store cannot be written.
    """
    values = [(item.kind, item.value) for item in found.items if item.kind in _WITH_SETTINGS]
    for edit in found.edits:
        for change in edit.changes:
            if change.kind in _WITH_SETTINGS:
                values += [(change.kind, change.before), (change.kind, change.after)]
    objects = {value.id: value for kind, value in values if kind is Kind.OBJECT and value is not None}

    def hidden(kind: Kind, value: Any) -> Any:
        if value is None or kind not in _WITH_SETTINGS:
            return value
        if kind is Kind.OBJECT:
            return secrets.hide_in_object(value)
        return secrets.hide_in_overrides([value], objects)[0]

    with secrets.migrating():
        if all(hidden(kind, value) == value for kind, value in values):
            return found
        items = [replace(item, value=hidden(item.kind, item.value)) for item in found.items]
        edits = [replace(edit, changes=[_hidden(each, hidden) for each in edit.changes]) for edit in found.edits]
    secrets.store.save()
    return replace(found, items=items, edits=edits)


def _hidden(change: Change, hidden: Callable[[Kind, Any], Any]) -> Change:
    return replace(change, before=hidden(change.kind, change.before), after=hidden(change.kind, change.after))

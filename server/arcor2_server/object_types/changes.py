"""Changes of object types of which clients have not been notified yet."""

from collections.abc import Mapping

from msgspec import Struct

from arcor2_hw.data.object_type import ObjectTypeMeta


class Changes(Struct, frozen=True):
    """Types for the events ChangedObjectTypes with the change types remove, update and add."""

    removed: list[ObjectTypeMeta] = []
    updated: list[ObjectTypeMeta] = []
    added: list[ObjectTypeMeta] = []

    def __bool__(self) -> bool:
        return bool(self.removed or self.updated or self.added)


class PendingChanges:
    """The differences between the known object types and those of which clients were notified."""

    def __init__(self) -> None:
        self.changes = Changes()
        self._current: Mapping[str, ObjectTypeMeta] = {}
        self._sent: Mapping[str, ObjectTypeMeta] = {}

    def set_current(self, metas: Mapping[str, ObjectTypeMeta]) -> None:
        """Set the present object types."""
        self._current = metas
        self._compare()

    def take(self) -> Changes:
        """Return the changes; the caller notifies the clients of all of them."""
        changes, self.changes = self.changes, Changes()
        self._sent = self._current
        return changes

    def skip(self, name: str) -> None:
        """Remove a type from the changes, because the caller notifies the clients."""
        sent = {key: meta for key, meta in self._sent.items() if key != name}
        if (meta := self._current.get(name)) is not None:
            sent[name] = meta
        self._sent = sent
        self._compare()

    def _compare(self) -> None:
        before, after = self._sent, self._current
        self.changes = Changes(
            [meta for name, meta in before.items() if name not in after],
            [meta for name, meta in after.items() if before.get(name, meta) != meta],
            [meta for name, meta in after.items() if name not in before],
        )

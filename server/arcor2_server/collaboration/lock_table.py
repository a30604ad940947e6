"""The table of locks on items, which form trees with a root (protocol, section 6)."""

import asyncio
import contextlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, Protocol

from arcor2_hw.exceptions import NotFound
from arcor2_hw.messages import Message, translatable
from arcor2_server.errors import RequestRefused

SCENE: Final = "SCENE"
PROJECT: Final = "PROJECT"
ACTION: Final = "ACTION"
ADDING_OBJECT: Final = "ADDING_OBJECT"
SERVER: Final = "SERVER"
"""The pseudo user that holds locks while a scene is started or stopped."""

OWN_ROOTS: Final = frozenset({SCENE, PROJECT, ACTION, ADDING_OBJECT, "START", "END"})
"""Ids that are each the root of a tree of their own."""


_NAMES: Final = translatable(
    {
        SCENE: "The scene",
        PROJECT: "The project",
        ACTION: "The execution of actions",
        ADDING_OBJECT: "The list of object types",
        "START": "The start of the program",
        "END": "The end of the program",
    }
)
"""Names, for refusals, of ids that do not belong to an item."""


class Locked(RequestRefused):
    """Another user holds a lock on the item."""

    code = "locked"


class LockTree(Protocol):
    """The trees of items, as the open document provides them."""

    def root_of(self, item: str) -> str:
        """Return the root of the tree that an id belongs to. Raise NotFound if the id is unknown."""

    def tree_of(self, root: str) -> Iterable[str]:
        """Return the ids below a root; empty if it is not a root."""

    def name_of(self, item: str) -> str:
        """Return the name of an item; empty if it has none."""


@dataclass(slots=True)
class _Root:
    """The locks of one tree. `readers` has per id the number of read locks of each user."""

    readers: dict[str, dict[str, int]] = field(default_factory=dict)
    writers: dict[str, str] = field(default_factory=dict)
    tree: bool = False

    @property
    def free(self) -> bool:
        return not self.readers and not self.writers


class LockTable:
    """The locks of all users. Its methods do not wait, so each change is atomic.

    Args:
        tree: The open document.
    """

    def __init__(self, tree: LockTree) -> None:
        self._tree = tree
        self._roots: dict[str, _Root] = {}
        self._root_ids: dict[str, str] = {}
        self._announced: dict[str, dict[str, set[str]]] = {}
        self._reads: dict[str, list[str]] = {}
        self._since: dict[tuple[str, str], str] = {}
        """The time at which a client locked an id, by user and id."""
        self._stored_names: dict[str, str] = {}
        """Names of saved scenes and projects for which a lock was requested, by id."""
        self._changed: asyncio.Event = asyncio.Event()

    # ------------------------------------------------------------------------------------------------ queries
    def holds(self, user: str, item: str, *, tree: bool = False) -> bool:
        """Return whether the user holds the write lock of an id; with `tree`, of its tree."""
        root = self._locked_root(item)
        if root is None:
            return False
        if root.writers.get(item) == user:
            return root.tree or not tree
        return root.tree and bool(root.writers) and all(writer == user for writer in root.writers.values())

    def require_held(self, user: str, item: str, *, tree: bool = False) -> None:
        """Raise Locked unless the user holds the write lock of an id (`held(x)`); with `tree`, of its tree."""
        if not self.holds(user, item, tree=tree):
            text = (
                "{user} does not hold the write lock of the tree of {item}."
                if tree
                else "{user} does not hold the write lock of {item}."
            )
            raise Locked(text, user=user, item=self._name(item))

    def holds_read(self, user: str, item: str) -> bool:
        """Return whether the user holds a read lock of an id."""
        root = self._roots.get(self._root_ids.get(item, ""))
        return root is not None and user in root.readers.get(item, ())

    def locked_roots(self, excluding: Iterable[str] = ()) -> list[str]:
        """Return the roots of trees with locks, except the given ones."""
        skipped = set(excluding)
        return [name for name in self._roots if name not in skipped]

    def write_locked_roots(self, excluding: Iterable[str] = ()) -> list[str]:
        """Return the roots of trees with write locks, except the given ones."""
        skipped = set(excluding)
        return [name for name, root in self._roots.items() if root.writers and name not in skipped]

    def writer_of(self, item: str) -> str | None:
        """Return the user who may write an item: its writer, or the holder of its tree."""
        root = self._locked_root(item)
        if root is None:
            return None
        if root.tree:
            return next(iter(root.writers.values()), None)
        return root.writers.get(item)

    def holders_of(self, item: str) -> set[str]:
        """Return the users who may write an item, or hold a read lock on it."""
        root = self._locked_root(item)
        writer = self.writer_of(item)
        return set(root.readers.get(item, ()) if root else ()) | ({writer} if writer else set())

    def announced(self) -> dict[str, list[str]]:
        """Return the ids that were announced as locked, by owner."""
        found = {user: sorted(set().union(*ids.values())) for user, ids in self._announced.items()}
        return {user: ids for user, ids in found.items() if ids}

    def write_locked_by(self, user: str) -> list[str]:
        """Return the ids on which the user's client holds write locks, without the other ids of a locked tree."""
        return list(self._announced.get(user, ()))

    def read_locked_by(self, user: str) -> list[str]:
        """Return the ids on which the user's client holds read locks."""
        return list(dict.fromkeys(self._reads.get(user, ())))

    def owners(self) -> list[str]:
        """Return the users whose clients hold write or read locks."""
        return sorted({user for held in (self._announced, self._reads) for user, ids in held.items() if ids})

    def locked_at(self, user: str, item: str) -> str:
        """Return the time at which the user's client locked an id."""
        return self._since[user, item]

    def could_lock_tree(self, user: str, item: str) -> bool:
        """Return whether the user holds the tree of an id, or could lock it now (for dry runs)."""
        if self.holds(user, item, tree=True):
            return True
        root = self._locked_root(item)
        if root is None or root.free:
            return True
        return not root.readers and not root.tree and set(root.writers.items()) <= {(item, user)}

    # ------------------------------------------------------------------------------------------------ changes
    def release_announced(self, user: str, ids: Iterable[str]) -> list[str]:
        """Release the user's locks among `ids`; return the ids for ObjectsUnlocked."""
        freed: set[str] = set()
        for item in ids:
            if item in self._announced.get(user, ()):
                freed |= self._remove_write(user, item)
        return sorted(freed)

    def drop(self, ids: Iterable[str]) -> dict[str, list[str]]:
        """Remove all locks on removed items. Their removal event implies that they are unlocked.

        Return the other ids that this unlocks, by owner: the rest of a tree that was locked through a removed item.
        """
        ids = list(ids)
        freed: dict[str, set[str]] = {}
        for item in ids:
            root_id = self._root_ids.pop(item, None)
            for user, reads in list(self._reads.items()):
                self._since.pop((user, item), None)
                if item in reads:
                    self._reads[user] = [read for read in reads if read != item]
            for user, held in self._announced.items():
                self._since.pop((user, item), None)
                freed.setdefault(user, set()).update(held.pop(item, ()))
                for covered in held.values():
                    covered.discard(item)
            if root_id is not None and (root := self._roots.get(root_id)) is not None:
                root.readers.pop(item, None)
                if root.writers.pop(item, None) is not None:
                    root.tree = root.tree and bool(root.writers)
                self._remove_unused(root_id)
        self._notify()
        rest = {user: found.difference(ids, *self._announced[user].values()) for user, found in freed.items()}
        return {user: sorted(found) for user, found in rest.items() if found}

    def move_root(self, ids: Iterable[str], new_root: str) -> None:
        """Move the locks of ids (an action point and all below it) to the tree that they now belong to."""
        for item in ids:
            old_id = self._root_ids.get(item)
            if old_id is None or old_id == new_root:
                continue
            old, new = self._roots[old_id], self._roots.setdefault(new_root, _Root())
            if (readers := old.readers.pop(item, None)) is not None:
                new.readers[item] = readers
            if (writer := old.writers.pop(item, None)) is not None:
                new.writers[item] = writer
                # A lock of the whole old tree covers the new one, unless others hold locks in it.
                new.tree = new.tree or (old.tree and len(new.writers) == 1 and not new.readers)
                old.tree = old.tree and bool(old.writers)
            self._root_ids[item] = new_root
            self._remove_unused(old_id)
        self._notify()

    def release_all(self, user: str) -> list[str]:
        """Release all locks of a user who left; return the announced ids."""
        for item in self._reads.pop(user, []):
            self._since.pop((user, item), None)
            self._remove_read(user, item)
        return self.release_announced(user, list(self._announced.get(user, ())))

    def clear(self) -> None:
        """Remove all locks, since the document is closed."""
        self._roots.clear()
        self._root_ids.clear()
        self._announced.clear()
        self._reads.clear()
        self._since.clear()
        self._notify()

    # ------------------------------------------------------------------------------------------------ internals
    def _name(self, item: str) -> str | Message:
        """Return the name of an item for a refusal; its id if it has no name."""
        if item in _NAMES:
            return Message.of(_NAMES[item])
        return self._tree.name_of(item) or self._stored_names.get(item, item)

    def _locked_root(self, item: str) -> _Root | None:
        """Return the locks of the tree that an id belongs to, None if there are none."""
        if (root_id := self._root_ids.get(item)) is None:
            root_id = item
            if item not in OWN_ROOTS:
                with contextlib.suppress(NotFound):
                    root_id = self._tree.root_of(item)
        return self._roots.get(root_id)

    def _is_writer(self, user: str, item: str) -> bool:
        root = self._roots.get(self._root_ids.get(item, ""))
        return root is not None and root.writers.get(item) == user

    def _is_announced(self, user: str, root_id: str, item: str) -> bool:
        """Return whether a client holds the lock that covers an id, and not a request that is being handled."""
        announced = self._announced.get(user, {})
        return item in announced or any(writer in announced for writer in self._roots[root_id].writers)

    def _refuse_write(self, root: _Root | None, item: str, tree: bool) -> None:
        if root is None:
            return
        if root.tree or item in root.writers or root.readers.get(item):
            raise Locked("{item} is locked by {blockers}.", item=self._name(item), blockers=self._blockers(root, item))
        if tree and not root.free:
            raise Locked(
                "An item in the tree of {item} is locked by {blockers}.",
                item=self._name(item),
                blockers=self._blockers(root, ""),
            )

    def _refuse_read(self, root: _Root | None, item: str) -> None:
        if root is not None and (root.tree or item in root.writers):
            raise Locked("{item} is locked by {blockers}.", item=self._name(item), blockers=self._blockers(root, item))

    @staticmethod
    def _blockers(root: _Root, item: str) -> str:
        writer = root.writers.get(item)
        users = {writer} if writer else set(root.readers.get(item, ())) or set(root.writers.values())
        return ", ".join(sorted(users or {user for readers in root.readers.values() for user in readers}))

    def _add_write(self, user: str, root_id: str, item: str, tree: bool = False) -> None:
        self._refuse_write(self._roots.get(root_id), item, tree)
        root = self._roots.setdefault(root_id, _Root())
        root.writers[item] = user
        root.tree = tree
        self._root_ids[item] = root_id

    def _add_writes(self, user: str, root_ids: dict[str, str]) -> None:
        for item, root_id in root_ids.items():
            self._refuse_write(self._roots.get(root_id), item, tree=False)
        for item, root_id in root_ids.items():
            self._add_write(user, root_id, item)

    def _add_read(self, user: str, root_id: str, item: str) -> None:
        self._refuse_read(self._roots.get(root_id), item)
        readers = self._roots.setdefault(root_id, _Root()).readers.setdefault(item, {})
        readers[user] = readers.get(user, 0) + 1
        self._root_ids[item] = root_id

    def _add_reads(self, user: str, root_ids: dict[str, str]) -> None:
        for item, root_id in root_ids.items():
            self._refuse_read(self._roots.get(root_id), item)
        for item, root_id in root_ids.items():
            self._add_read(user, root_id, item)

    def _remove_write(self, user: str, item: str) -> set[str]:
        freed = self._announced.get(user, {}).pop(item, None) or {item}
        self._since.pop((user, item), None)
        if user in self._announced and not self._announced[user]:
            del self._announced[user]
        root_id = self._root_ids.get(item)
        if root_id is not None and (root := self._roots.get(root_id)) is not None:
            root.writers.pop(item, None)
            if root.tree:
                freed |= {root_id, *self._tree.tree_of(root_id)}
                root.tree = False
            self._remove_unused(root_id, item)
        self._notify()
        return freed

    def _remove_read(self, user: str, item: str) -> None:
        root_id = self._root_ids.get(item)
        if root_id is None or (root := self._roots.get(root_id)) is None:
            return
        readers = root.readers.get(item, {})
        if readers.get(user, 0) > 1:
            readers[user] -= 1
        else:
            readers.pop(user, None)
        if not readers:
            root.readers.pop(item, None)
        self._remove_unused(root_id, item)
        self._notify()

    def _forget_read(self, user: str, item: str) -> None:
        self._reads[user].remove(item)
        if item not in self._reads[user]:
            self._since.pop((user, item), None)
        if not self._reads[user]:
            del self._reads[user]

    def _remove_unused(self, root_id: str, item: str | None = None) -> None:
        root = self._roots.get(root_id)
        if root is None:
            return
        if item is not None and item not in root.writers and item not in root.readers:
            self._root_ids.pop(item, None)
        if root.free:
            del self._roots[root_id]

    def _notify(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()

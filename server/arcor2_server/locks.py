"""Who may change what: locks on ids, in trees that are known by their root (protocol, section 6)."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from arcor2_hw.exceptions import NotFound
from arcor2_server.rpc.registry import RequestRefused

SCENE: Final = "SCENE"
PROJECT: Final = "PROJECT"
ACTION: Final = "ACTION"
ADDING_OBJECT: Final = "ADDING_OBJECT"
SERVER: Final = "SERVER"
"""The pseudo user under whose locks a scene is started and stopped."""

_OWN_ROOTS: Final = frozenset({SCENE, PROJECT, ACTION, ADDING_OBJECT, "START", "END"})
EXCLUSIVE_LIMIT: Final = 30.0
"""Seconds for which a lock operation waits for the end of an exclusive one before it is refused."""


class Locked(RequestRefused):
    """Somebody else holds a lock on what was named."""

    code = "locked"


class LockTree(Protocol):
    """How ids hang together; the open document knows it."""

    def root_of(self, item: str) -> str:
        """Give the root of the tree that an id belongs to; NotFound for an id it does not know."""

    def tree_of(self, root: str) -> Iterable[str]:
        """Give the ids of everything below a root; nothing when it is none."""


class _Nothing:
    """The tree while no document is open."""

    def root_of(self, item: str) -> str:
        raise NotFound(f"{item!r} is not known.")

    def tree_of(self, root: str) -> Iterable[str]:  # noqa: ARG002
        return ()


async def _nothing_stored(item: str) -> bool:  # noqa: ARG001
    return False


@dataclass(slots=True)
class _Root:
    """The locks of one tree. `readers` counts per id how often each user reads it."""

    readers: dict[str, dict[str, int]] = field(default_factory=dict)
    writers: dict[str, str] = field(default_factory=dict)
    tree: bool = False

    @property
    def free(self) -> bool:
        return not self.readers and not self.writers


class Locks:
    """The table of locks. One event loop, so what is done between two awaits is atomic.

    A lock is announced when a client asked for it (write_lock); those that the server takes for the duration of a
    request are silent. `tree` and `stored` are set when the server is put together: the open document, and whether
    an id is that of a stored scene or project or the name of an object type.
    """

    def __init__(self, retries: int = 13, retry_wait: float = 0.15) -> None:
        self.tree: LockTree = _Nothing()
        self.stored: Callable[[str], Awaitable[bool]] = _nothing_stored
        self._patience = retries * retry_wait
        self._roots: dict[str, _Root] = {}
        self._where: dict[str, str] = {}
        self._announced: dict[str, dict[str, set[str]]] = {}
        self._reads: dict[str, list[str]] = {}
        self._changed: asyncio.Event = asyncio.Event()
        self._exclusive: asyncio.Task[Any] | None = None

    # ------------------------------------------------------------------------------------------------ what is held
    def holds(self, user: str, item: str, *, tree: bool = False) -> bool:
        """Tell whether the user holds the write lock of an id; with `tree`, of its tree."""
        root = self._roots.get(self._where.get(item) or self._known_root(item))
        if root is None:
            return False
        if root.writers.get(item) == user:
            return root.tree or not tree
        return root.tree and bool(root.writers) and all(writer == user for writer in root.writers.values())

    def require_held(self, user: str, item: str, *, tree: bool = False) -> None:
        """Refuse unless the user holds the write lock of an id (`held(x)`); with `tree`, of its tree."""
        if not self.holds(user, item, tree=tree):
            what = "tree of " if tree else ""
            raise Locked(f"{user} does not hold the write lock of the {what}{item!r}.")

    def holds_read(self, user: str, item: str) -> bool:
        """Tell whether the user holds a read lock of an id."""
        root = self._roots.get(self._where.get(item, ""))
        return root is not None and user in root.readers.get(item, ())

    def locked_roots(self, besides: Iterable[str] = ()) -> list[str]:
        """Give the roots in whose trees anything is locked, without the ones named."""
        skipped = set(besides)
        return [name for name in self._roots if name not in skipped]

    def write_locked_roots(self, besides: Iterable[str] = ()) -> list[str]:
        """Give the roots in whose trees anything is write-locked, without the ones named."""
        skipped = set(besides)
        return [name for name, root in self._roots.items() if root.writers and name not in skipped]

    def writer_of(self, item: str) -> str | None:
        """Give who may write an id: its writer, or the holder of the tree it is in."""
        root = self._roots.get(self._where.get(item) or self._known_root(item))
        if root is None:
            return None
        if root.tree:
            return next(iter(root.writers.values()), None)
        return root.writers.get(item)

    def announced(self) -> dict[str, list[str]]:
        """Give the ids that were announced as locked, by owner."""
        found = {user: sorted(set().union(*ids.values())) for user, ids in self._announced.items()}
        return {user: ids for user, ids in found.items() if ids}

    def written_by(self, user: str) -> list[str]:
        """Give exactly the ids on which the user holds announced write locks, without those locked by a tree."""
        return list(self._announced.get(user, ()))

    def could_lock_tree(self, user: str, item: str) -> bool:
        """Tell whether the user holds the tree of an id, or could lock it now (a dry run asks this)."""
        if self.holds(user, item, tree=True):
            return True
        root = self._roots.get(self._where.get(item) or self._known_root(item))
        if root is None or root.free:
            return True
        return not root.readers and not root.tree and set(root.writers.items()) <= {(item, user)}

    # ------------------------------------------------------------------------------------------------ of clients
    async def write_lock(self, user: str, item: str, tree: bool = False) -> list[str]:
        """Lock for a client. Gives the ids to announce, none when he holds it already. Locked, NotFound."""
        root_id = (await self._enter([item]))[item]
        if self.holds(user, item, tree=tree) and self._is_announced(user, root_id, item):
            return []
        self._take_write(user, root_id, item, tree)
        ids = {item}
        if tree:
            ids |= {root_id, *self.tree.tree_of(root_id)}
        self._announced.setdefault(user, {})[item] = ids
        return sorted(ids)

    async def write_unlock(self, user: str, item: str) -> list[str]:
        """Unlock for a client. Gives the ids to announce as free. Locked when he does not hold exactly this lock."""
        await self._pass()
        if not self._is_writer(user, item):
            raise Locked(f"{user} does not hold a write lock of {item!r}.")
        return sorted(self._free_write(user, item))

    async def read_lock(self, user: str, item: str) -> None:
        """Lock for reading, for a client. Locked, NotFound."""
        self._take_read(user, (await self._enter([item]))[item], item)
        self._reads.setdefault(user, []).append(item)

    async def read_unlock(self, user: str, item: str) -> None:
        """Unlock for reading, for a client. Locked when he holds none."""
        await self._pass()
        if item not in self._reads.get(user, ()):
            raise Locked(f"{user} does not hold a read lock of {item!r}.")
        self._forget_read(user, item)
        self._free_read(user, item)

    async def update_lock(self, user: str, item: str, tree: bool) -> list[str]:
        """Widen a lock to its tree, or narrow it. Gives the ids to announce: as locked (widened) or as free."""
        await self._pass()
        if not self._is_writer(user, item):
            raise Locked(f"{user} does not hold a write lock of {item!r}.")
        root_id = self._where[item]
        root = self._roots[root_id]
        if root.tree is tree:
            raise Locked(f"The lock of {item!r} is of that type already.")
        whole = {root_id, *self.tree.tree_of(root_id)} - {item}
        announced = self._announced.setdefault(user, {})
        if tree:
            if len(root.writers) > 1:
                raise Locked(f"Other locks are held in the tree of {item!r}.")
            root.tree = True
            announced[item] = whole | {item}
        else:
            whole |= announced.get(item, set()) - {item}
            root.tree = False
            announced[item] = {item}
            self._notify()
        return sorted(whole)

    # ------------------------------------------------------------------------------------------------ of the server
    async def acquire(self, user: str, *ids: str) -> None:
        """Take silent write locks on all ids at once, for longer than a request; free them by `release`.

        Busy ones are waited for (13 x 0.15 s); then Locked. NotFound for an unknown item.
        """
        await self._eventually(lambda root_ids: self._take_all(user, root_ids), ids)

    def release(self, user: str, *ids: str) -> None:
        """Free what `acquire` took; an id that was removed meanwhile is passed over."""
        for item in ids:
            if self._is_writer(user, item):
                self._free_write(user, item)

    @asynccontextmanager
    async def auto(self, user: str, *ids: str) -> AsyncIterator[None]:
        """Hold silent write locks on all ids meanwhile (`auto`). Locked also when the user holds one of them."""
        await self.acquire(user, *ids)
        try:
            yield
        finally:
            self.release(user, *ids)

    @asynccontextmanager
    async def auto_skip_held(self, user: str, *ids: str) -> AsyncIterator[None]:
        """Hold silent write locks on the ids that the user does not hold already (`auto*`)."""
        await self._pass()
        missing = [item for item in dict.fromkeys(ids) if not self.holds(user, item)]
        async with self.auto(user, *missing):
            yield

    @asynccontextmanager
    async def read(self, user: str, *ids: str) -> AsyncIterator[None]:
        """Hold read locks on the ids that the user neither reads nor writes already (`autoR`)."""
        await self._pass()
        missing = [i for i in dict.fromkeys(ids) if not self.holds(user, i) and not self.holds_read(user, i)]
        await self._eventually(lambda root_ids: self._read_all(user, root_ids), missing)
        try:
            yield
        finally:
            for item in missing:
                self._free_read(user, item)

    @asynccontextmanager
    async def exclusive(self) -> AsyncIterator[None]:
        """Keep all lock operations of others out (`global`).

        Locked at once while anybody holds an announced lock, and when silent ones do not end in time.
        """
        self._refuse_announced()
        deadline = asyncio.get_running_loop().time() + self._patience
        while self._exclusive is not None or self.write_locked_roots():
            await self._wait_for_change(deadline, "Something is being changed: try again.")
            self._refuse_announced()
        self._exclusive = asyncio.current_task()
        try:
            yield
        finally:
            self._exclusive = None
            self._notify()

    def release_announced(self, user: str, ids: Iterable[str]) -> list[str]:
        """Free the client's locks among `ids`; gives what ObjectsUnlocked has to name, empty when he held none."""
        freed: set[str] = set()
        for item in ids:
            if item in self._announced.get(user, ()):
                freed |= self._free_write(user, item)
        return sorted(freed)

    def drop(self, ids: Iterable[str]) -> None:
        """Forget all locks on ids that were removed; the event that removes them implies it."""
        for item in ids:
            root_id = self._where.pop(item, None)
            for user, reads in list(self._reads.items()):
                if item in reads:
                    self._reads[user] = [read for read in reads if read != item]
            for held in self._announced.values():
                held.pop(item, None)
                for covered in held.values():
                    covered.discard(item)
            if root_id is not None and (root := self._roots.get(root_id)) is not None:
                root.readers.pop(item, None)
                if root.writers.pop(item, None) is not None:
                    root.tree = root.tree and bool(root.writers)
                self._tidy(root_id)
        self._notify()

    def move_root(self, ids: Iterable[str], new_root: str) -> None:
        """Move the locks of ids (an action point and all below it) to the tree that they now belong to."""
        for item in ids:
            old_id = self._where.get(item)
            if old_id is None or old_id == new_root:
                continue
            old, new = self._roots[old_id], self._roots.setdefault(new_root, _Root())
            if (readers := old.readers.pop(item, None)) is not None:
                new.readers[item] = readers
            if (writer := old.writers.pop(item, None)) is not None:
                new.writers[item] = writer
                # A lock of the whole old tree becomes one of the point alone where others hold parts of the new one.
                new.tree = new.tree or (old.tree and len(new.writers) == 1 and not new.readers)
                old.tree = old.tree and bool(old.writers)
            self._where[item] = new_root
            self._tidy(old_id)
        self._notify()

    def release_all(self, user: str) -> list[str]:
        """Free all that a client locked, for one who does not come back; gives the announced ids."""
        for item in self._reads.pop(user, []):
            self._free_read(user, item)
        return self.release_announced(user, list(self._announced.get(user, ())))

    def clear(self) -> None:
        """Forget everything (nothing is open any more)."""
        self._roots.clear()
        self._where.clear()
        self._announced.clear()
        self._reads.clear()
        self._notify()

    # ------------------------------------------------------------------------------------------------ inside
    def _known_root(self, item: str) -> str:
        if item in _OWN_ROOTS:
            return item
        try:
            return self.tree.root_of(item)
        except NotFound:
            return item

    async def _root_of(self, item: str) -> str:
        if (root := self._where.get(item)) is not None:
            return root
        if item in _OWN_ROOTS:
            return item
        try:
            return self.tree.root_of(item)
        except NotFound:
            if await self.stored(item):
                return item
            raise

    def _is_writer(self, user: str, item: str) -> bool:
        root = self._roots.get(self._where.get(item, ""))
        return root is not None and root.writers.get(item) == user

    def _is_announced(self, user: str, root_id: str, item: str) -> bool:
        """Tell whether a client asked for the lock that covers an id; one that a request holds will not last."""
        announced = self._announced.get(user, {})
        return item in announced or any(writer in announced for writer in self._roots[root_id].writers)

    def _refuse_write(self, root: _Root | None, item: str, tree: bool) -> None:
        if root is None:
            return
        if root.tree or item in root.writers or root.readers.get(item):
            raise Locked(f"{item!r} is locked by {self._blockers(root, item)}.")
        if tree and not root.free:
            raise Locked(f"Something in the tree of {item!r} is locked by {self._blockers(root, '')}.")

    @staticmethod
    def _blockers(root: _Root, item: str) -> str:
        writer = root.writers.get(item)
        users = {writer} if writer else set(root.readers.get(item, ())) or set(root.writers.values())
        return ", ".join(sorted(users or {user for readers in root.readers.values() for user in readers}))

    def _take_write(self, user: str, root_id: str, item: str, tree: bool = False) -> None:
        self._refuse_write(self._roots.get(root_id), item, tree)
        root = self._roots.setdefault(root_id, _Root())
        root.writers[item] = user
        root.tree = tree
        self._where[item] = root_id

    def _take_all(self, user: str, root_ids: dict[str, str]) -> None:
        for item, root_id in root_ids.items():
            self._refuse_write(self._roots.get(root_id), item, tree=False)
        for item, root_id in root_ids.items():
            self._take_write(user, root_id, item)

    def _take_read(self, user: str, root_id: str, item: str) -> None:
        root = self._roots.setdefault(root_id, _Root())
        if root.tree or item in root.writers:
            raise Locked(f"{item!r} is locked by {self._blockers(root, item)}.")
        readers = root.readers.setdefault(item, {})
        readers[user] = readers.get(user, 0) + 1
        self._where[item] = root_id

    def _read_all(self, user: str, root_ids: dict[str, str]) -> None:
        for item, root_id in root_ids.items():
            if (root := self._roots.get(root_id)) is not None and (root.tree or item in root.writers):
                raise Locked(f"{item!r} is locked by {self._blockers(root, item)}.")
        for item, root_id in root_ids.items():
            self._take_read(user, root_id, item)

    def _free_write(self, user: str, item: str) -> set[str]:
        freed = self._announced.get(user, {}).pop(item, None) or {item}
        if user in self._announced and not self._announced[user]:
            del self._announced[user]
        root_id = self._where.get(item)
        if root_id is not None and (root := self._roots.get(root_id)) is not None:
            root.writers.pop(item, None)
            if root.tree:
                freed |= {root_id, *self.tree.tree_of(root_id)}
                root.tree = False
            self._tidy(root_id, item)
        self._notify()
        return freed

    def _free_read(self, user: str, item: str) -> None:
        root_id = self._where.get(item)
        if root_id is None or (root := self._roots.get(root_id)) is None:
            return
        readers = root.readers.get(item, {})
        if readers.get(user, 0) > 1:
            readers[user] -= 1
        else:
            readers.pop(user, None)
        if not readers:
            root.readers.pop(item, None)
        self._tidy(root_id, item)
        self._notify()

    def _forget_read(self, user: str, item: str) -> None:
        self._reads[user].remove(item)
        if not self._reads[user]:
            del self._reads[user]

    def _tidy(self, root_id: str, item: str | None = None) -> None:
        root = self._roots.get(root_id)
        if root is None:
            return
        if item is not None and item not in root.writers and item not in root.readers:
            self._where.pop(item, None)
        if root.free:
            del self._roots[root_id]

    def _refuse_announced(self) -> None:
        if found := self.announced():
            raise Locked(f"Something is locked by {', '.join(sorted(found))}.")

    async def _eventually(self, take: Callable[[dict[str, str]], None], items: Iterable[str]) -> None:
        deadline = asyncio.get_running_loop().time() + self._patience
        while True:
            # Looked up anew each time: what is waited for may be removed or moved meanwhile.
            root_ids = await self._enter(items)
            try:
                take(root_ids)
            except Locked as error:
                await self._wait_for_change(deadline, str(error))
            else:
                return

    async def _enter(self, items: Iterable[str]) -> dict[str, str]:
        """Wait for the end of an exclusive operation; give the roots, valid until the caller next awaits."""
        while True:
            await self._pass()
            root_ids = {item: await self._root_of(item) for item in dict.fromkeys(items)}
            if self._exclusive is None or self._exclusive is asyncio.current_task():
                return root_ids

    async def _pass(self) -> None:
        """Wait while somebody else works under `exclusive`."""
        if self._exclusive is None or self._exclusive is asyncio.current_task():
            return
        deadline = asyncio.get_running_loop().time() + EXCLUSIVE_LIMIT
        while self._exclusive is not None:
            await self._wait_for_change(deadline, "The scene or project is being opened, saved or closed.")

    async def _wait_for_change(self, deadline: float, refusal: str) -> None:
        changed = self._changed
        try:
            async with asyncio.timeout_at(deadline):
                await changed.wait()
        except TimeoutError:
            raise Locked(refusal) from None

    def _notify(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()

"""Acquires and releases locks for clients and requests, and waits for busy ones (protocol, section 6)."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import asynccontextmanager
from typing import Any, Final

from arcor2_hw.data.base import now
from arcor2_hw.exceptions import NotFound
from arcor2_hw.messages import Message
from arcor2_server.collaboration.lock_table import (
    ACTION,
    ADDING_OBJECT,
    OWN_ROOTS,
    PROJECT,
    SCENE,
    SERVER,
    Locked,
    LockTable,
    LockTree,
)

__all__ = ["ACTION", "ADDING_OBJECT", "PROJECT", "SCENE", "SERVER", "LockTree", "Locked", "Locks"]

EXCLUSIVE_LIMIT: Final = 30.0
"""Time limit for the end of an exclusive operation before another lock operation is refused, s."""


class Locks(LockTable):
    """The locks of the server. All run in one event loop, so what a method does between two awaits is atomic.

    Locks that a client requests (write_lock) are announced to other clients. Locks that the server takes for the
    duration of a request are silent.

    Args:
        tree: The open document.
        stored_name: Returns the name of an object type, or of a saved scene or project, by id; None if it is unknown.
        retries: Number of further attempts to acquire a busy lock.
        retry_wait: Time between two attempts, s.
    """

    def __init__(
        self,
        tree: LockTree,
        stored_name: Callable[[str], Awaitable[str | None]],
        retries: int = 13,
        retry_wait: float = 0.15,
    ) -> None:
        super().__init__(tree)
        self._stored_name = stored_name
        self._wait_limit = retries * retry_wait
        self._exclusive: asyncio.Task[Any] | None = None

    # ------------------------------------------------------------------------------------------------ for clients
    async def write_lock(self, user: str, item: str, tree: bool = False) -> list[str]:
        """Lock an item for a client. Return the ids to announce, empty if the user holds the lock already.

        Raises:
            Locked: Another user holds a lock.
            NotFound: The item does not exist.
        """
        root_id = (await self._find_roots([item]))[item]
        if self.holds(user, item, tree=tree) and self._is_announced(user, root_id, item):
            return []
        self._add_write(user, root_id, item, tree)
        ids = {item}
        if tree:
            ids |= {root_id, *self._tree.tree_of(root_id)}
        self._announced.setdefault(user, {})[item] = ids
        self._since[user, item] = now()
        return sorted(ids)

    async def write_unlock(self, user: str, item: str) -> list[str]:
        """Unlock an item for a client; return the ids to announce. Raise Locked if the user does not hold this lock."""
        await self._wait_for_exclusive()
        if not self._is_writer(user, item):
            raise Locked("{user} does not hold a write lock of {item}.", user=user, item=self._name(item))
        return sorted(self._remove_write(user, item))

    async def read_lock(self, user: str, item: str) -> None:
        """Take a read lock for a client. Raise Locked if the item is locked, or NotFound if it does not exist."""
        self._add_read(user, (await self._find_roots([item]))[item], item)
        self._reads.setdefault(user, []).append(item)
        self._since.setdefault((user, item), now())

    async def read_unlock(self, user: str, item: str) -> None:
        """Release a read lock of a client. Raise Locked if the user does not hold it."""
        await self._wait_for_exclusive()
        if item not in self._reads.get(user, ()):
            raise Locked("{user} does not hold a read lock of {item}.", user=user, item=self._name(item))
        self._forget_read(user, item)
        self._remove_read(user, item)

    async def update_lock(self, user: str, item: str, tree: bool) -> list[str]:
        """Extend a lock to its tree, or reduce it to the item. Return the ids to announce as locked or unlocked."""
        await self._wait_for_exclusive()
        if not self._is_writer(user, item):
            raise Locked("{user} does not hold a write lock of {item}.", user=user, item=self._name(item))
        root_id = self._root_ids[item]
        root = self._roots[root_id]
        if root.tree is tree:
            raise Locked("The lock of {item} is of that type already.", item=self._name(item))
        whole = {root_id, *self._tree.tree_of(root_id)} - {item}
        announced = self._announced.setdefault(user, {})
        self._since.setdefault((user, item), now())
        if tree:
            if len(root.writers) > 1:
                raise Locked("Other locks are held in the tree of {item}.", item=self._name(item))
            root.tree = True
            announced[item] = whole | {item}
        else:
            whole |= announced.get(item, set()) - {item}
            root.tree = False
            announced[item] = {item}
            self._notify()
        return sorted(whole)

    # ------------------------------------------------------------------------------------------------ for requests
    async def acquire(self, user: str, *ids: str) -> None:
        """Take silent write locks on all ids at once, for longer than a request. `release` frees them.

        Raises:
            Locked: An item is still locked after the time limit.
            NotFound: An item does not exist.
        """
        await self._retry(lambda root_ids: self._add_writes(user, root_ids), ids)

    def release(self, user: str, *ids: str) -> None:
        """Release the locks that `acquire` took. Ids that were removed meanwhile are ignored."""
        for item in ids:
            if self._is_writer(user, item):
                self._remove_write(user, item)

    @asynccontextmanager
    async def auto(self, user: str, *ids: str) -> AsyncIterator[None]:
        """Hold silent write locks on all ids (`auto`). Raise Locked also if the user holds one of them already."""
        await self.acquire(user, *ids)
        try:
            yield
        finally:
            self.release(user, *ids)

    @asynccontextmanager
    async def auto_skip_held(self, user: str, *ids: str) -> AsyncIterator[None]:
        """Hold silent write locks on the ids that the user does not hold already (`auto*`)."""
        await self._wait_for_exclusive()
        missing = [item for item in dict.fromkeys(ids) if not self.holds(user, item)]
        async with self.auto(user, *missing):
            yield

    @asynccontextmanager
    async def read(self, user: str, *ids: str) -> AsyncIterator[None]:
        """Hold read locks on the ids that the user neither reads nor writes already (`autoR`)."""
        await self._wait_for_exclusive()
        missing = [i for i in dict.fromkeys(ids) if not self.holds(user, i) and not self.holds_read(user, i)]
        await self._retry(lambda root_ids: self._add_reads(user, root_ids), missing)
        try:
            yield
        finally:
            for item in missing:
                self._remove_read(user, item)

    @asynccontextmanager
    async def exclusive(self) -> AsyncIterator[None]:
        """Prevent all lock operations of others (`global`).

        Raises:
            Locked: A client holds a lock, or a request holds one for longer than the time limit.
        """
        self._refuse_announced()
        deadline = asyncio.get_running_loop().time() + self._wait_limit
        while self._exclusive is not None or self.write_locked_roots():
            await self._wait_for_change(deadline, "An edit is in progress. Try again.")
            self._refuse_announced()
        self._exclusive = asyncio.current_task()
        try:
            yield
        finally:
            self._exclusive = None
            self._notify()

    # ------------------------------------------------------------------------------------------------ internals
    async def _root_of(self, item: str) -> str:
        if (root := self._root_ids.get(item)) is not None:
            return root
        if item in OWN_ROOTS:
            return item
        try:
            return self._tree.root_of(item)
        except NotFound:
            if (name := await self._stored_name(item)) is None:
                raise
            self._stored_names[item] = name
            return item

    def _refuse_announced(self) -> None:
        if found := self.announced():
            raise Locked("Items are locked by {found}.", found=", ".join(sorted(found)))

    async def _retry(self, lock: Callable[[dict[str, str]], None], items: Iterable[str]) -> None:
        deadline = asyncio.get_running_loop().time() + self._wait_limit
        while True:
            # Each attempt finds the roots again, since items may be removed or moved meanwhile.
            root_ids = await self._find_roots(items)
            try:
                lock(root_ids)
            except Locked as error:
                await self._wait_for_change(deadline, error.message)
            else:
                return

    async def _find_roots(self, items: Iterable[str]) -> dict[str, str]:
        """Wait for the end of an exclusive operation; return the roots of items, valid until the next await."""
        while True:
            await self._wait_for_exclusive()
            root_ids = {item: await self._root_of(item) for item in dict.fromkeys(items)}
            if self._exclusive is None or self._exclusive is asyncio.current_task():
                return root_ids

    async def _wait_for_exclusive(self) -> None:
        """Wait while another task holds `exclusive`."""
        if self._exclusive is None or self._exclusive is asyncio.current_task():
            return
        deadline = asyncio.get_running_loop().time() + EXCLUSIVE_LIMIT
        while self._exclusive is not None:
            await self._wait_for_change(deadline, "The scene or project is being opened, saved or closed.")

    async def _wait_for_change(self, deadline: float, refusal: str | Message) -> None:
        changed = self._changed
        try:
            async with asyncio.timeout_at(deadline):
                await changed.wait()
        except TimeoutError:
            raise Locked(refusal) from None

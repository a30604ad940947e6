"""Locks as clients and requests acquire, wait for and release them (protocol, section 6)."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from typing import Any, Final

from arcor2_hw.data.base import now
from arcor2_hw.exceptions import NotFound
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
"""Seconds for which a lock operation waits for the end of an exclusive one before it is refused."""


class Locks(LockTable):
    """The locks of the server. One event loop, so what is done between two awaits is atomic.

    A lock is announced when a client asked for it (write_lock); those that the server takes for the duration of a
    request are silent.
    """

    def __init__(self, retries: int = 13, retry_wait: float = 0.15) -> None:
        super().__init__()
        self._patience = retries * retry_wait
        self._exclusive: asyncio.Task[Any] | None = None

    # ------------------------------------------------------------------------------------------------ of clients
    async def write_lock(self, user: str, item: str, tree: bool = False) -> list[str]:
        """Lock an item for a client. Return the ids to announce, empty if the user holds the lock already.

        Raise Locked or NotFound if that is impossible.
        """
        root_id = (await self._enter([item]))[item]
        if self.holds(user, item, tree=tree) and self._is_announced(user, root_id, item):
            return []
        self._take_write(user, root_id, item, tree)
        ids = {item}
        if tree:
            ids |= {root_id, *self.tree.tree_of(root_id)}
        self._announced.setdefault(user, {})[item] = ids
        self._since[user, item] = now()
        return sorted(ids)

    async def write_unlock(self, user: str, item: str) -> list[str]:
        """Unlock an item for a client. Return the ids to announce. Raise Locked if the user does not hold this lock."""
        await self._pass()
        if not self._is_writer(user, item):
            raise Locked("{user} does not hold a write lock of {item!r}.", user=user, item=item)
        return sorted(self._free_write(user, item))

    async def read_lock(self, user: str, item: str) -> None:
        """Lock for reading, for a client. Raise Locked or NotFound if that is impossible."""
        self._take_read(user, (await self._enter([item]))[item], item)
        self._reads.setdefault(user, []).append(item)
        self._since.setdefault((user, item), now())

    async def read_unlock(self, user: str, item: str) -> None:
        """Release a read lock of a client. Raise Locked if there is none."""
        await self._pass()
        if item not in self._reads.get(user, ()):
            raise Locked("{user} does not hold a read lock of {item!r}.", user=user, item=item)
        self._forget_read(user, item)
        self._free_read(user, item)

    async def update_lock(self, user: str, item: str, tree: bool) -> list[str]:
        """Widen a lock to its tree, or narrow it. Gives the ids to announce: as locked (widened) or as free."""
        await self._pass()
        if not self._is_writer(user, item):
            raise Locked("{user} does not hold a write lock of {item!r}.", user=user, item=item)
        root_id = self._where[item]
        root = self._roots[root_id]
        if root.tree is tree:
            raise Locked("The lock of {item!r} is of that type already.", item=item)
        whole = {root_id, *self.tree.tree_of(root_id)} - {item}
        announced = self._announced.setdefault(user, {})
        self._since.setdefault((user, item), now())
        if tree:
            if len(root.writers) > 1:
                raise Locked("Other locks are held in the tree of {item!r}.", item=item)
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

    # ------------------------------------------------------------------------------------------------ waiting
    async def _root_of(self, item: str) -> str:
        if (root := self._where.get(item)) is not None:
            return root
        if item in OWN_ROOTS:
            return item
        try:
            return self.tree.root_of(item)
        except NotFound:
            if await self.stored(item):
                return item
            raise

    def _refuse_announced(self) -> None:
        if found := self.announced():
            raise Locked("Something is locked by {found}.", found=", ".join(sorted(found)))

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
        """Wait while another task holds `exclusive`."""
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

"""Locks of the open project: widened to a tree, narrowed, and released when their user's connection is lost."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from tests.server.session.session_server import Person, Refused, open_server
from tests.server.session.work import Work


def lock_events(person: Person) -> list[tuple[str, set[str], str]]:
    """Return the lock events since the last time."""
    return [(e["event"], set(e["data"]["object_ids"]), e["data"]["owner"]) for e in person.events()]


async def test_update_lock_widens_to_the_tree_and_narrows_to_the_object(alice: Person, bob: Person) -> None:
    work = Work(alice)
    await work.project("parent")
    parent = work.point("parent")
    child = await work.add_point("child", parent)
    orientation = await work.add_orientation(child)

    async def update(person: Person, kind: str) -> None:
        await person.ask("UpdateLock", object_id=parent, new_type=kind)

    for person in (alice, bob):
        with pytest.raises(Refused):  # nobody holds the lock
            await update(person, "TREE")
    await alice.lock(parent)
    with pytest.raises(Refused):  # another user holds it
        await update(bob, "TREE")
    with pytest.raises(Refused):  # the lock does not cover a tree
        await update(alice, "OBJECT")
    await bob.lock(child)
    with pytest.raises(Refused):  # another user holds a part of the tree
        await update(alice, "TREE")
    await bob.ask("WriteUnlock", object_id=child)
    alice.take(), bob.take()

    await update(alice, "TREE")
    rest = {child, orientation}
    assert lock_events(bob) == lock_events(alice) == [("ObjectsLocked", rest, "alice")]
    with pytest.raises(Refused):
        await bob.lock(child)
    with pytest.raises(Refused):  # the lock covers a tree already
        await update(alice, "TREE")
    bob.take()

    await update(alice, "OBJECT")
    assert lock_events(bob) == [("ObjectsUnlocked", rest, "alice")]
    await bob.lock(child)
    with pytest.raises(Refused):
        await bob.lock(parent)
    await bob.ask("WriteUnlock", object_id=child)
    await alice.ask("WriteUnlock", object_id=parent)
    assert lock_events(bob)[-1] == ("ObjectsUnlocked", {parent}, "alice")


async def test_all_locks_of_a_disconnected_user_are_released(tmp_path: Path) -> None:
    async with open_server(tmp_path, lock_timeout=0.2) as server:
        alice, bob = await server.person("alice"), await server.person("bob")
        work = Work(alice)
        await work.project("parent", "other")
        child = await work.add_point("child", work.point("parent"))
        orientation = await work.add_orientation(child)
        tree = work.point("other")
        below = await work.add_point("below", tree)
        # Parts of trees, which the original keeps locked for ever, and a whole tree.
        await alice.lock(child)
        await alice.lock(orientation)
        await alice.lock(tree, tree=True)
        await alice.ask("ReadLock", object_id=work.point("parent"))
        bob.take()
        with pytest.raises(Refused):
            await bob.ask("SaveProject")
        await alice.leave()
        server._people.remove(alice)
        released: list[Any] = []
        async with asyncio.timeout(30):
            while not released:
                released = lock_events(bob)
                await asyncio.sleep(0.01)
        assert released == [("ObjectsUnlocked", {child, orientation, tree, below}, "alice")]
        for item in (child, orientation, below, work.point("parent")):
            await bob.lock(item)
            await bob.ask("WriteUnlock", object_id=item)
        await bob.ask("SaveProject")

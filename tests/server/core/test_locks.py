"""Locks, rule by rule, without a server (protocol, section 6)."""

import asyncio

import pytest

from arcor2_hw.exceptions import NotFound
from arcor2_server.collaboration.locks import Locked, Locks

PARENTS = {"ap1": "box", "ap2": "ap1", "ori": "ap1", "act": "ap2", "free": "", "ori2": "free", "box": "", "robot": ""}


class Tree:
    def __init__(self) -> None:
        self.parents = dict(PARENTS)

    def root_of(self, id: str) -> str:  # noqa: A002
        if id not in self.parents:
            raise NotFound(f"{id} unknown")
        while parent := self.parents[id]:
            id = parent  # noqa: A001
        return id

    def tree_of(self, root: str) -> list[str]:
        return [item for item in self.parents if item != root and self.root_of(item) == root]

    def name_of(self, id: str) -> str:  # noqa: A002
        return f"name of {id}" if id in self.parents else ""


@pytest.fixture
def tree() -> Tree:
    return Tree()


async def stored_name(item: str) -> str | None:
    return "stored" if item == "scn_stored" else None


@pytest.fixture
def locks(tree: Tree) -> Locks:
    return Locks(tree, stored_name, retries=3, retry_wait=0.05)


WHOLE = {"box", "ap1", "ap2", "ori", "act"}


async def test_a_write_lock_is_announced_once_and_excludes_others(locks: Locks) -> None:
    assert await locks.write_lock("ann", "ap1") == ["ap1"]
    assert await locks.write_lock("ann", "ap1") == []
    assert locks.holds("ann", "ap1")
    assert not locks.holds("ann", "ap2")
    assert not locks.holds("ann", "ap1", tree=True)
    with pytest.raises(Locked):
        await locks.write_lock("bob", "ap1")
    # Another id of the same tree may have another writer.
    assert await locks.write_lock("bob", "ap2") == ["ap2"]
    with pytest.raises(Locked):
        await locks.write_unlock("bob", "ap1")
    assert await locks.write_unlock("ann", "ap1") == ["ap1"]
    with pytest.raises(Locked):
        await locks.write_unlock("ann", "ap1")


async def test_unknown_id_is_refused_unless_stored(locks: Locks) -> None:
    with pytest.raises(NotFound):
        await locks.write_lock("ann", "nothing")

    assert await locks.write_lock("ann", "scn_stored") == ["scn_stored"]
    assert locks.holds("ann", "scn_stored")
    for special in ("SCENE", "PROJECT", "ACTION", "ADDING_OBJECT", "START", "END"):
        assert await locks.write_lock("ann", special) == [special]


async def test_tree_lock_covers_the_whole_tree_of_the_root(locks: Locks) -> None:
    assert set(await locks.write_lock("ann", "ap2", tree=True)) == WHOLE
    for item in WHOLE:
        assert locks.holds("ann", item)
        assert locks.writer_of(item) == "ann"
        with pytest.raises(Locked):
            await locks.write_lock("bob", item)
        with pytest.raises(Locked):
            await locks.read_lock("ann", item)
    assert locks.holds("ann", "ap2", tree=True)
    assert await locks.write_lock("ann", "act") == []
    # Unlocking needs the same id that was locked.
    with pytest.raises(Locked):
        await locks.write_unlock("ann", "ap1")
    assert set(await locks.write_unlock("ann", "ap2")) == WHOLE
    assert locks.locked_roots() == []


@pytest.mark.parametrize("other", ["ap1", "act", "box"])
async def test_tree_lock_is_refused_while_anything_in_it_is_locked(locks: Locks, other: str) -> None:
    await locks.read_lock("ann", other)
    with pytest.raises(Locked):
        await locks.write_lock("ann", "ap2", tree=True)
    await locks.read_unlock("ann", other)
    await locks.write_lock("bob", other)
    with pytest.raises(Locked):
        await locks.write_lock("ann", "ap2", tree=True)
    await locks.write_unlock("bob", other)
    assert set(await locks.write_lock("ann", "ap2", tree=True)) == WHOLE


async def test_read_and_write_locks_exclude_each_other(locks: Locks) -> None:
    await locks.read_lock("ann", "ap1")
    await locks.read_lock("bob", "ap1")
    with pytest.raises(Locked):
        await locks.write_lock("ann", "ap1")
    await locks.read_unlock("ann", "ap1")
    with pytest.raises(Locked):
        await locks.read_unlock("ann", "ap1")
    with pytest.raises(Locked):
        await locks.write_lock("ann", "ap1")
    await locks.read_unlock("bob", "ap1")
    assert await locks.write_lock("ann", "ap1") == ["ap1"]
    with pytest.raises(Locked):
        await locks.read_lock("ann", "ap1")


async def test_update_lock_widens_and_narrows(locks: Locks) -> None:
    with pytest.raises(Locked):
        await locks.update_lock("ann", "ap1", tree=True)
    await locks.write_lock("ann", "ap1")
    with pytest.raises(Locked):
        await locks.update_lock("ann", "ap1", tree=False)
    assert set(await locks.update_lock("ann", "ap1", tree=True)) == WHOLE - {"ap1"}
    assert locks.announced() == {"ann": sorted(WHOLE)}
    assert set(await locks.update_lock("ann", "ap1", tree=False)) == WHOLE - {"ap1"}
    assert locks.announced() == {"ann": ["ap1"]}
    await locks.write_lock("bob", "act")
    with pytest.raises(Locked):
        await locks.update_lock("ann", "ap1", tree=True)


async def test_auto_waits_for_the_lock_then_gives_up(locks: Locks) -> None:
    loop = asyncio.get_running_loop()
    await locks.write_lock("ann", "robot")
    start = loop.time()
    with pytest.raises(Locked):
        async with locks.auto("bob", "SCENE", "robot"):
            pass
    assert loop.time() - start >= 0.14
    assert locks.locked_roots() == ["robot"], "nothing of a refused set stays locked"
    # Refused also if the same user holds the lock.
    with pytest.raises(Locked):
        async with locks.auto("ann", "robot"):
            pass
    loop.call_later(0.05, lambda: locks.release_announced("ann", ["robot"]))
    async with locks.auto("bob", "SCENE", "robot"):
        assert locks.holds("bob", "robot")
        assert locks.announced() == {}
    assert locks.locked_roots() == []


async def test_auto_releases_when_the_request_fails(locks: Locks) -> None:
    with pytest.raises(ZeroDivisionError):
        async with locks.auto("ann", "box"):
            raise ZeroDivisionError
    assert locks.locked_roots() == []


async def test_auto_skip_held_keeps_the_locks_of_the_client(locks: Locks) -> None:
    await locks.write_lock("ann", "act")
    async with locks.auto_skip_held("ann", "act", "robot"):
        assert locks.holds("ann", "robot")
    assert locks.holds("ann", "act")
    assert not locks.holds("ann", "robot")
    await locks.write_unlock("ann", "act")
    await locks.write_lock("ann", "box", tree=True)
    async with locks.auto_skip_held("ann", "act"):
        pass
    assert locks.holds("ann", "box", tree=True)


async def test_read_skips_ids_that_the_user_has_locked(locks: Locks) -> None:
    await locks.write_lock("ann", "robot")
    async with locks.read("ann", "robot", "box"):
        assert locks.holds_read("ann", "box")
        with pytest.raises(Locked):
            async with locks.auto("bob", "box"):
                pass
    assert not locks.holds_read("ann", "box")
    with pytest.raises(Locked):
        async with locks.read("bob", "robot"):
            pass
    await locks.read_lock("ann", "box")
    async with locks.read("ann", "box"):
        pass
    assert locks.holds_read("ann", "box"), "the client's own read lock outlives the request's"


async def test_a_client_cannot_get_a_lock_that_its_request_holds(locks: Locks) -> None:
    async with locks.auto("ann", "robot"):
        with pytest.raises(Locked):
            await locks.write_lock("ann", "robot")
    assert await locks.write_lock("ann", "robot") == ["robot"]


async def test_exclusive_is_refused_at_once_while_a_client_holds_a_lock(tree: Tree) -> None:
    locks = Locks(tree, stored_name, retries=1, retry_wait=3600.0)
    await locks.write_lock("ann", "box")
    with pytest.raises(Locked):
        async with asyncio.timeout(30), locks.exclusive():
            pass


async def test_exclusive_waits_for_silent_locks_and_blocks_others(locks: Locks) -> None:
    order: list[str] = []
    entered, saving = asyncio.Event(), asyncio.Event()

    async def edit() -> None:
        async with locks.auto("ann", "box"):
            entered.set()
            await asyncio.sleep(0.05)
            order.append("edited")

    async def save() -> None:
        async with locks.exclusive():
            order.append("saving")
            saving.set()
            await asyncio.sleep(0.05)
            # The code inside may use locks itself.
            async with locks.auto("ann", "SCENE"):
                pass
            order.append("saved")

    async def lock() -> None:
        await saving.wait()
        assert await locks.write_lock("bob", "robot") == ["robot"]
        order.append("locked")

    edited = asyncio.create_task(edit())
    await entered.wait()
    await asyncio.gather(edited, save(), lock())
    assert order == ["edited", "saving", "saved", "locked"]

    with pytest.raises(Locked):
        async with locks.exclusive():
            pass


async def test_exclusive_times_out_on_a_lasting_silent_lock(locks: Locks) -> None:
    await locks.acquire("SERVER", "SCENE")
    with pytest.raises(Locked):
        async with locks.exclusive():
            pass
    locks.release("SERVER", "SCENE")
    async with locks.exclusive():
        pass


async def test_release_announced_returns_the_ids_to_announce(locks: Locks) -> None:
    await locks.write_lock("ann", "ap1", tree=True)
    assert locks.release_announced("bob", ["ap1"]) == []
    assert set(locks.release_announced("ann", ["ap1", "robot"])) == WHOLE
    assert locks.release_announced("ann", ["ap1"]) == []


async def test_drop_removes_locks_silently(locks: Locks, tree: Tree) -> None:
    await locks.write_lock("ann", "ap2", tree=True)
    for item in ("ap2", "act"):
        del tree.parents[item]
    locks.drop(["ap2", "act"])
    assert locks.announced() == {}
    assert locks.locked_roots() == []
    assert await locks.write_lock("bob", "ap1") == ["ap1"]

    async with locks.auto("ann", "robot"):
        del tree.parents["robot"]
        locks.drop(["robot"])
    assert locks.locked_roots() == ["box"]


async def test_locks_move_with_a_new_parent(locks: Locks, tree: Tree) -> None:
    await locks.write_lock("ann", "free")
    await locks.write_lock("bob", "act")
    tree.parents["free"] = "box"
    locks.move_root(["free", "ori2"], "box")
    assert locks.locked_roots() == ["box"]
    assert locks.holds("ann", "free")
    with pytest.raises(Locked):
        await locks.write_lock("bob", "box", tree=True)
    assert locks.release_announced("ann", ["free"]) == ["free"]
    assert locks.holds("bob", "act")
    await locks.write_unlock("bob", "act")
    assert locks.locked_roots() == []


async def test_tree_lock_of_a_moved_point_is_released_completely(locks: Locks, tree: Tree) -> None:
    assert set(await locks.write_lock("ann", "free", tree=True)) == {"free", "ori2"}
    tree.parents["free"] = "box"
    locks.move_root(["free", "ori2"], "box")
    assert {"free", "ori2"} <= set(locks.release_announced("ann", ["free"]))
    assert locks.locked_roots() == []


async def test_a_dry_run_reports_whether_the_tree_can_be_locked(locks: Locks) -> None:
    assert locks.could_lock_tree("ann", "ap1")
    await locks.write_lock("ann", "ap1")
    assert locks.could_lock_tree("ann", "ap1")
    assert not locks.could_lock_tree("bob", "ap1")
    await locks.write_lock("bob", "act")
    assert not locks.could_lock_tree("ann", "ap1")


async def test_release_all_covers_children_too(locks: Locks) -> None:
    """A lock on an item that is not its own root is released as well (the protocol's quirk Q19)."""
    await locks.write_lock("ann", "act")
    await locks.write_lock("ann", "ori2")
    await locks.read_lock("ann", "robot")
    await locks.write_lock("bob", "ap1")
    assert locks.release_all("ann") == ["act", "ori2"]
    assert set(locks.locked_roots()) == {"box"}
    assert await locks.write_lock("bob", "robot") == ["robot"]


async def test_waiting_for_a_removed_item_ends(locks: Locks, tree: Tree) -> None:
    await locks.write_lock("ann", "robot")

    def remove() -> None:
        del tree.parents["robot"]
        locks.drop(["robot"])

    asyncio.get_running_loop().call_later(0.03, remove)
    with pytest.raises(NotFound):
        async with locks.auto("bob", "robot"):
            pass


async def test_the_table_lists_locks_and_holders(locks: Locks) -> None:
    await locks.write_lock("ann", "ap2", tree=True)
    await locks.write_lock("bob", "robot")
    await locks.read_lock("bob", "free")
    await locks.read_lock("bob", "free")
    assert locks.write_locked_by("ann") == ["ap2"]
    assert locks.write_locked_by("eve") == []
    assert locks.read_locked_by("bob") == ["free"]
    assert locks.read_locked_by("ann") == []
    assert locks.owners() == ["ann", "bob"]
    assert locks.announced() == {"ann": sorted(WHOLE), "bob": ["robot"]}
    assert locks.locked_roots() == ["box", "robot", "free"]
    assert locks.locked_roots(excluding=["box"]) == ["robot", "free"]
    assert locks.write_locked_roots() == ["box", "robot"]
    assert locks.write_locked_roots(excluding=["robot"]) == ["box"]
    assert locks.locked_at("ann", "ap2") <= locks.locked_at("bob", "free")
    assert [locks.writer_of(item) for item in ("act", "robot", "free", "ori2")] == ["ann", "bob", None, None]
    assert [locks.holders_of(item) for item in ("act", "robot", "free", "ori2")] == [{"ann"}, {"bob"}, {"bob"}, set()]
    assert locks.holds_read("bob", "free")
    assert not locks.holds_read("ann", "free")
    await locks.read_unlock("bob", "free")
    assert locks.holds_read("bob", "free")
    assert locks.locked_at("bob", "free")
    await locks.read_unlock("bob", "free")
    assert not locks.holds_read("bob", "free")
    assert locks.locked_roots() == ["box", "robot"]
    with pytest.raises(KeyError):
        locks.locked_at("bob", "free")
    locks.clear()
    assert locks.owners() == []
    assert locks.locked_roots() == []
    assert not locks.holds("ann", "ap2")
    with pytest.raises(KeyError):
        locks.locked_at("ann", "ap2")


async def test_a_refusal_names_the_item_and_the_holders(locks: Locks) -> None:
    await locks.read_lock("eve", "ap1")
    await locks.read_lock("bob", "ap1")
    with pytest.raises(Locked, match=r"name of ap1 is locked by bob, eve"):
        await locks.write_lock("ann", "ap1")
    with pytest.raises(Locked, match=r"in the tree of name of ap2 is locked by bob, eve"):
        await locks.write_lock("ann", "ap2", tree=True)
    await locks.write_lock("ann", "act")
    with pytest.raises(Locked, match=r"name of act is locked by ann"):
        await locks.read_lock("bob", "act")
    with pytest.raises(Locked, match=r"in the tree of name of ap2 is locked by ann"):
        await locks.write_lock("bob", "ap2", tree=True)
    await locks.write_lock("ann", "free", tree=True)
    with pytest.raises(Locked, match=r"name of ori2 is locked by ann"):
        await locks.read_lock("bob", "ori2")
    with pytest.raises(Locked, match=r"name of robot is locked by ann"):
        async with locks.auto("ann", "robot"), locks.auto("bob", "robot"):
            pass
    with pytest.raises(Locked, match=r"bob does not hold the write lock"):
        locks.require_held("bob", "act")
    with pytest.raises(Locked, match=r"tree of name of act"):
        locks.require_held("ann", "act", tree=True)
    locks.require_held("ann", "act")
    locks.require_held("ann", "ori2", tree=True)
    await locks.write_lock("ann", "scn_stored")
    with pytest.raises(Locked, match=r"^stored is locked by ann"):
        await locks.write_lock("bob", "scn_stored")
    await locks.write_lock("ann", "PROJECT")
    with pytest.raises(Locked, match=r"^The project is locked by ann"):
        await locks.write_lock("bob", "PROJECT")


async def test_removing_a_locked_item_frees_the_rest_of_its_tree(locks: Locks, tree: Tree) -> None:
    await locks.write_lock("ann", "ap2", tree=True)
    await locks.read_lock("bob", "robot")
    await locks.write_lock("bob", "free")
    for item in ("ap2", "act"):
        del tree.parents[item]
    assert locks.drop(["ap2", "act"]) == {"ann": ["ap1", "box", "ori"]}
    with pytest.raises(KeyError):
        locks.locked_at("ann", "ap2")
    assert await locks.write_lock("bob", "box", tree=True) == ["ap1", "box", "ori"]
    del tree.parents["robot"]
    assert locks.drop(["robot"]) == {}
    assert locks.read_locked_by("bob") == []
    with pytest.raises(KeyError):
        locks.locked_at("bob", "robot")
    assert locks.write_locked_by("bob") == ["free", "box"]
    assert locks.locked_roots() == ["free", "box"]


async def test_removing_an_item_of_a_locked_tree_keeps_the_lock_of_the_rest(locks: Locks, tree: Tree) -> None:
    await locks.write_lock("ann", "ap1", tree=True)
    del tree.parents["act"]
    assert locks.drop(["act"]) == {}
    assert locks.announced() == {"ann": ["ap1", "ap2", "box", "ori"]}
    assert locks.holds("ann", "ap2", tree=True)
    assert locks.release_announced("ann", ["ap1"]) == ["ap1", "ap2", "box", "ori"]


async def test_removing_one_writer_leaves_the_others(locks: Locks, tree: Tree) -> None:
    await locks.write_lock("ann", "ap1")
    await locks.write_lock("bob", "act")
    await locks.read_lock("eve", "ori")
    del tree.parents["act"]
    assert locks.drop(["act"]) == {}
    assert locks.holds("ann", "ap1")
    assert locks.holds_read("eve", "ori")
    assert not locks.holds("bob", "act")
    assert locks.locked_roots() == ["box"]


async def test_a_moved_reader_keeps_its_lock(locks: Locks, tree: Tree) -> None:
    await locks.read_lock("ann", "free")
    await locks.write_lock("bob", "ori2")
    tree.parents["free"] = "box"
    locks.move_root(["free", "ori2", "unlocked"], "box")
    assert locks.locked_roots() == ["box"]
    assert locks.holds_read("ann", "free")
    assert locks.holds("bob", "ori2")
    assert not locks.holds("bob", "ori2", tree=True)
    with pytest.raises(Locked):
        await locks.write_lock("ann", "ap1", tree=True)
    locks.move_root(["free"], "box")
    assert locks.holds_read("ann", "free")


async def test_a_moved_tree_lock_covers_the_new_tree_only_while_it_is_alone_there(locks: Locks, tree: Tree) -> None:
    await locks.write_lock("ann", "free", tree=True)
    tree.parents["free"] = "box"
    locks.move_root(["free", "ori2"], "box")
    assert locks.holds("ann", "act", tree=True)
    locks.clear()

    tree.parents["free"] = ""
    await locks.write_lock("ann", "free", tree=True)
    await locks.write_lock("bob", "act")
    tree.parents["free"] = "box"
    locks.move_root(["free", "ori2"], "box")
    assert locks.holds("ann", "free")
    assert not locks.holds("ann", "ap1")
    assert locks.holds("bob", "act")
    locks.clear()

    tree.parents["free"] = ""
    await locks.write_lock("ann", "free", tree=True)
    await locks.read_lock("bob", "act")
    tree.parents["free"] = "box"
    locks.move_root(["free", "ori2"], "box")
    assert not locks.holds("ann", "ap1")


async def test_a_tree_with_several_writers_has_no_owner(locks: Locks) -> None:
    await locks.write_lock("ann", "ap1")
    await locks.write_lock("bob", "ap2")
    assert not locks.holds("ann", "ap2")
    assert locks.writer_of("act") is None
    assert not locks.could_lock_tree("ann", "ap1")
    locks.release_announced("bob", ["ap2"])
    assert locks.could_lock_tree("ann", "ap1")
    assert not locks.could_lock_tree("ann", "ap2")
    await locks.read_lock("bob", "ap2")
    assert not locks.could_lock_tree("ann", "ap1")
    locks.clear()
    await locks.write_lock("ann", "ap1", tree=True)
    assert locks.could_lock_tree("ann", "act")
    assert not locks.could_lock_tree("bob", "act")


async def test_a_refused_set_of_locks_takes_none_of_them(locks: Locks) -> None:
    await locks.write_lock("ann", "robot")
    with pytest.raises(Locked):
        async with locks.auto("bob", "act", "robot"):
            pass
    assert locks.locked_roots() == ["robot"]
    with pytest.raises(Locked):
        async with locks.read("bob", "act", "robot"):
            pass
    assert locks.locked_roots() == ["robot"]
    async with locks.auto("bob", "act", "ori"):
        assert locks.writer_of("act") == locks.writer_of("ori") == "bob"
        assert locks.owners() == ["ann"]
    assert locks.locked_roots() == ["robot"]


async def test_a_tree_lock_that_a_request_holds_is_announced_when_its_client_asks(locks: Locks) -> None:
    await locks.write_lock("ann", "ap1", tree=True)
    assert await locks.write_lock("ann", "act") == []
    await locks.acquire("bob", "free")
    with pytest.raises(Locked):
        await locks.write_lock("bob", "free")
    locks.release("bob", "free", "robot")
    assert await locks.write_lock("bob", "free") == ["free"]
    assert locks.release_all("bob") == ["free"]
    assert locks.release_all("bob") == []


async def test_without_a_document_only_fixed_and_stored_ids_can_be_locked() -> None:
    empty = Tree()
    empty.parents.clear()
    locks = Locks(empty, stored_name, retries=1, retry_wait=0.01)
    with pytest.raises(NotFound, match="box unknown"):
        await locks.write_lock("ann", "box")
    assert await locks.write_lock("ann", "SCENE", tree=True) == ["SCENE"]
    assert not locks.holds("ann", "box")
    assert locks.writer_of("box") is None
    assert locks.holders_of("box") == set()
    assert locks.could_lock_tree("ann", "box")

"""Undo while other users edit: refusals, the users they name, and locks."""

import asyncio

import pytest

from arcor2_hw.data.role import Role
from tests.server.session.edits import apply_edit, refused
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.work import ORIGIN, Work


@pytest.fixture
def work(alice: Person) -> Work:
    return Work(alice)


async def test_undo_reverts_only_own_edits(server: SessionServer, alice: Person, bob: Person, work: Work) -> None:
    await work.project("a", "b")
    a, b = work.point("a"), work.point("b")
    await apply_edit(alice, ("RenameActionPoint", {"action_point_id": a, "new_name": "a2"}, a, False), {})
    await bob.lock(b)
    await bob.ask("RenameActionPoint", action_point_id=b, new_name="b2")
    await alice.ask("Undo")
    assert {work.point("a"), work.point("b2")} == {a, b}
    await bob.ask("Undo")
    assert {work.point("a"), work.point("b")} == {a, b}
    # Edits of other users do not affect what a user can redo. A new edit by this user does.
    await bob.ask("AddActionPoint", name="c", position=ORIGIN)
    await alice.ask("Redo")
    assert work.point("a2") == a
    await alice.ask("Undo")
    await alice.ask("AddActionPoint", name="d", position=ORIGIN)
    with pytest.raises(Refused, match="nothing"):
        await alice.ask("Redo")
    with pytest.raises(Refused, match="bob"):
        await alice.ask("Undo", number=server.session.revision - 3)


async def test_undo_is_refused_with_the_name_of_the_later_author(alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    p = work.point("p")
    await apply_edit(alice, ("RenameActionPoint", {"action_point_id": p, "new_name": "q"}, p, False), {})
    await bob.lock(p, tree=True)
    await bob.ask("UpdateActionPointPosition", action_point_id=p, new_position={"x": 9.0, "y": 0.0, "z": 0.0})
    await bob.ask("WriteUnlock", object_id=p)
    assert "bob" in (text := await refused(alice))
    assert "UpdateActionPointPosition" in text
    # Once that edit is undone too, the undo is allowed.
    await bob.ask("Undo")
    await alice.ask("Undo")
    assert work.point("p") == p


async def test_undo_is_refused_when_others_use_the_item(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    await work.project()
    builder = Work(bob)
    p = await work.add_point("p")
    below = await builder.add_point("below", p)
    assert "bob" in await refused(alice)
    await bob.ask("RemoveActionPoint", id=below)
    action = await builder.add_action(p, "act")
    assert "bob" in await refused(alice)
    await bob.ask("RemoveAction", id=action)
    await alice.ask("Undo")
    # Another point has the name.
    await builder.add_point("p")
    assert "bob" in await refused(alice, "Redo")
    await bob.ask("Undo")
    await alice.ask("Redo")
    # A connection to an action, or a result that is used.
    one = await work.add_action(p, "one")
    await bob.ask("AddLogicItem", start="START", end=one)
    assert "bob" in await refused(alice)
    await alice.lock(one)
    await alice.ask("WriteUnlock", object_id=one)
    await bob.ask("Undo")
    await alice.ask("Undo")
    # The parent was removed.
    await bob.ask("RemoveActionPoint", id=p)
    assert "bob" in await refused(alice, "Redo")


async def test_undo_is_refused_when_the_logic_would_be_invalid(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    await work.project("p")
    p = work.point("p")
    a, b, c = [await work.add_action(p, name) for name in ("a", "b", "c")]
    await alice.ask("AddLogicItem", start=a, end=b)
    await alice.ask("RemoveLogicItem", logic_item_id=server.session.document.outgoing(a)[0].id)
    await bob.ask("AddLogicItem", start=b, end=c)
    await bob.ask("AddLogicItem", start=c, end=a)
    text = await refused(alice)
    assert "loop" in text
    assert "bob" in text
    await bob.ask("Undo")
    await bob.ask("AddLogicItem", start=a, end=c)
    text = await refused(alice)
    assert "condition" in text
    assert "bob" in text
    await bob.ask("UpdateProjectHasLogic", project_id=server.session.require_project().id, new_has_logic=False)
    assert "bob" in await refused(alice)


async def test_undo_is_refused_while_others_hold_locks(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    await work.project("p")
    p = work.point("p")
    below = await work.add_point("below", p)
    await apply_edit(alice, ("RenameActionPoint", {"action_point_id": p, "new_name": "q"}, p, False), {})
    await bob.lock(p)
    assert "bob" in await refused(alice)
    await bob.ask("WriteUnlock", object_id=p)
    # A new name moves nothing: the point's children may be locked. A move includes them.
    await bob.lock(below)
    await alice.ask("Undo")
    await bob.ask("WriteUnlock", object_id=below)
    await alice.lock(p, tree=True)
    await alice.ask("UpdateActionPointPosition", action_point_id=p, new_position={"x": 1.0, "y": 0.0, "z": 0.0})
    await alice.ask("WriteUnlock", object_id=p)
    await bob.lock(below)
    assert "bob" in await refused(alice)
    assert "bob" in await refused(alice, "RestoreRevision", revision=server.session.revision - 1)
    await bob.ask("WriteUnlock", object_id=below)
    await bob.ask("ReadLock", object_id=below)
    assert "bob" in await refused(alice)
    await bob.ask("ReadUnlock", object_id=below)
    # Locks of the same user do not prevent an undo, and are not released.
    await alice.lock(p, tree=True)
    await alice.ask("Undo")
    assert server.services.locks.write_locked_by("alice") == [p]
    await alice.ask("WriteUnlock", object_id=p)
    assert server.services.locks.locked_roots() == []


async def test_locks_follow_removed_and_moved_items(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    await work.project("a", "b")
    a, b = work.point("a"), work.point("b")
    await apply_edit(
        alice, ("UpdateActionPointParent", {"action_point_id": a, "new_parent_id": b}, a, False), {}
    )  # fmt: skip
    await alice.lock(a)
    await alice.ask("Undo")
    await bob.lock(b, tree=True)  # its former children are no longer below it
    with pytest.raises(Refused, match="alice"):
        await bob.ask("WriteLock", object_id=a)
    await bob.ask("WriteUnlock", object_id=b)
    p = await work.add_point("p")
    await alice.lock(p)
    await alice.ask("Undo")
    assert server.services.locks.write_locked_by("alice") == [a]
    await alice.ask("WriteUnlock", object_id=a)
    await alice.ask("SaveProject")


async def test_two_simultaneous_undos_revert_two_edits(server: SessionServer, alice: Person, work: Work) -> None:
    await work.project("p")
    p = work.point("p")
    for name in ("q", "r", "s"):
        await apply_edit(alice, ("RenameActionPoint", {"action_point_id": p, "new_name": name}, p, False), {})
    answers = await asyncio.gather(alice.ask("Undo"), alice.ask("Undo"))
    assert answers[0]["number"] == answers[1]["number"] + 1
    assert work.point("q") == p


async def test_undo_needs_a_registered_user(alice: Person, stranger: Person, work: Work) -> None:
    with pytest.raises(Refused, match="open"):
        await alice.ask("Undo")
    await work.project("p")
    for request, args in (("Undo", {}), ("Redo", {}), ("RestoreRevision", {"revision": 0})):
        with pytest.raises(Refused, match="logged in"):
            await stranger.ask(request, **args)
    assert (await stranger.ask("History"))["revision"] == 1


async def test_undo_needs_the_role_of_the_edit(server: SessionServer, alice: Person, bob: Person, work: Work) -> None:
    await work.project("p")
    await alice.ask("AddProjectParameter", name="x", type="double", value="0.5")
    (client,) = [client for client in server.services.hub.clients if client.user == "alice"]
    client.ceiling = Role.STANDARD_USER
    assert "advanced user" in (await refused(alice)).replace("_", " ")
    assert "advanced user" in (await refused(alice, "RestoreRevision", revision=0)).replace("_", " ")
    await alice.ask("Undo", number=server.session.revision - 1)

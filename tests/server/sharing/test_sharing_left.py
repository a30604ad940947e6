"""Locks and open documents of users who left: events, takeover, and the start of programs."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.role import Role
from tests.server.protocol.in_process_server import Actor, Stage, open_stage, until, until_event
from tests.server.protocol.test_protocol_temporary import project
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.work import ORIGIN, Work

MOVED = {"x": 1.0, "y": 0.0, "z": 0.0}


async def leave(person: Person) -> None:
    """Close the connection."""
    await person.leave()
    person.server._people.remove(person)


def set_role_of_bob(person: Person, role: Role) -> None:
    client = person.server.services.users.client_of("bob")
    assert client is not None
    client.ceiling = role


async def test_locks_of_a_user_who_left_are_listed_and_taken_over(
    server: SessionServer, alice: Person, bob: Person, stranger: Person
) -> None:
    work = Work(alice)
    await work.project("p", "q")
    p, q, scale = work.point("p"), work.point("q"), work.object("scale")
    await alice.lock(p, tree=True)
    await alice.lock(q)
    await alice.ask("ReadLock", object_id=scale)
    (holder,) = await stranger.ask("ListLocks")
    assert (holder["user"], "left" in holder) == ("alice", False)
    assert [(lock["object_id"], lock["name"], lock.get("type")) for lock in holder["locks"]] == [
        (scale, "scale", None),
        (p, "p", "TREE"),
        (q, "q", "OBJECT"),
    ]
    bob.take()
    with pytest.raises(Refused, match="alice is connected"):
        await bob.ask("TakeOverLocks", user="alice")
    await leave(alice)
    (holder,) = await bob.ask("ListLocks")
    assert max(lock["since"] for lock in holder["locks"]) < holder["left"]
    for person, role, reason in ((stranger, None, "RegisterUser"), (bob, Role.OPERATOR, "standard user")):
        if role is not None:
            set_role_of_bob(bob, role)
        with pytest.raises(Refused, match=reason):
            await person.ask("TakeOverLocks", user="alice")
    set_role_of_bob(bob, Role.STANDARD_USER)
    await bob.ask("TakeOverLocks", user="alice", dry_run=True)
    assert server.services.locks.owners() == ["alice"]
    bob.take()
    assert await bob.ask("TakeOverLocks", user="alice") == {"locks": holder["locks"]}
    (unlocked,) = bob.events()
    assert (unlocked["event"], unlocked["data"]["owner"]) == ("ObjectsUnlocked", "alice")
    assert set(unlocked["data"]["object_ids"]) >= {p, q}
    assert await bob.ask("ListLocks") == []
    assert server.services.locks._since == {}
    with pytest.raises(Refused, match="alice holds no locks"):
        await bob.ask("TakeOverLocks", user="alice")
    await bob.lock(p, tree=True)
    await bob.ask("UpdateActionPointPosition", action_point_id=p, new_position=MOVED)
    # The user who lost the locks is notified once, on returning.
    for expected in (["bob released your locks", "scale, p, q"], []):
        again = Person(server)
        server._people.append(again)
        await again.ask("RegisterUser", user_name="alice")
        await again.ask("SystemInfo")
        notices = [e["data"]["message"] for e in again.events() if e["event"] == "Notification"]
        assert len(notices) == bool(expected)
        assert all(part in notices[0] for part in expected)
        with pytest.raises(Refused, match="does not hold"):
            await again.ask("UpdateActionPointPosition", action_point_id=p, new_position=ORIGIN)
        await leave(again)


async def test_a_user_who_returns_in_time_keeps_the_locks(server: SessionServer, alice: Person, bob: Person) -> None:
    work = Work(alice)
    await work.project("p")
    await alice.lock(work.point("p"))
    await leave(alice)
    again = await server.person("alice")
    with pytest.raises(Refused, match="alice is connected"):
        await bob.ask("TakeOverLocks", user="alice")
    (holder,) = await bob.ask("ListLocks")
    assert "left" not in holder
    await again.ask("WriteUnlock", object_id=work.point("p"))


@pytest.mark.parametrize(
    ("presence", "role", "used"),
    [
        (None, Role.STANDARD_USER, True),  # an existing client does not send its screen
        (None, Role.OPERATOR, False),
        ({"document": "", "view": "operator"}, Role.PROGRAMMER, False),
        ({"document": "@", "view": "3d"}, Role.OPERATOR, True),
    ],
)
async def test_users_of_an_open_project_are_listed(
    server: SessionServer, alice: Person, bob: Person, presence: Any, role: Role, used: bool
) -> None:
    key = await Work(alice).project("p")
    await leave(alice)
    set_role_of_bob(bob, role)
    if presence is not None:
        await bob.ask("UpdatePresence", **{name: value.replace("@", key) for name, value in presence.items()})
    assert server.services.presence.users_of([key]) == (["bob"] if used else [])


# ---------------------------------------------------------------------------------------------- running a package
async def package(stage: Stage, actor: Actor) -> str:
    """Build a package of a project that waits in a loop, and leave the project open."""
    await project(stage, actor)
    key = stage.services.session.require_project().id
    built = await actor.ask("BuildProject", project_id=key, package_name="package")
    return str(built["package_id"])


async def operator_client(stage: Stage) -> Actor:
    """Connect a client that shows the operator's screen."""
    olga = await stage.person("olga")
    await olga.ask("UpdatePresence", view="operator")
    return olga


async def test_a_project_that_was_left_open_does_not_block_a_program(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        session, locks = stage.services.session, stage.services.locks
        alice, olga = await stage.person("alice"), await operator_client(stage)
        key = await package(stage, alice)
        await alice.ask("AddActionPoint", name="unsaved", position=ORIGIN)
        point = session.require_project().action_points[0].id
        await stage.start(alice)
        await alice.lock(point, tree=True)
        olga.take()
        with pytest.raises(Refused, match="online"):
            await olga.ask("RunPackage", id=key)
        await leave(alice)
        opened, history = session.project, list(session.history)
        with pytest.raises(Refused, match="no_such"):
            await olga.ask("RunPackage", id="no_such")
        assert (session.project, locks.owners()) == (opened, ["alice"]), "a package that cannot run changes nothing"
        olga.take()
        await olga.ask("RunPackage", id=key)
        assert locks.owners() == []
        assert session.project is None
        await until_event(olga, "PackageState", state="running")
        assert (
            await _refusal(olga, "OpenProject", id=opened.id if opened else "")
            == "A program is running. Stop it first."
        )
        await olga.ask("StopPackage")
        again = await until_event(olga, "OpenProject")
        assert [each["name"] for each in again["project"]["action_points"]] == ["ap", "unsaved"]
        assert (session.project, list(session.history), session.has_changes) == (opened, history, True)
        (run,) = (await olga.ask("ListRuns"))["runs"]
        assert (run["end"], run["temporary"], run["started_by"]) == ("stopped", False, "olga")
        names = [message["event"] for message in olga.events()]
        assert "ShowMainScreen" not in names
        assert names.index("ProjectClosed") < names.index("PackageInfo") < names.index("OpenProject")
        # Again, without any user; the owner then finds the project unchanged.
        await olga.ask("RunPackage", id=key)
        await until_event(olga, "PackageState", state="running")
        await olga.ask("StopPackage")
        await until_event(olga, "OpenProject")
        returned = await stage.newcomer()
        await returned.ask("RegisterUser", user_name="alice")
        notice = await until_event(returned, "Notification", level="Warn")
        assert notice["message"].startswith("olga released your locks")
        await returned.ask("Undo")
        assert [each.name for each in session.require_project().action_points] == ["ap"]


async def _refusal(person: Actor, request: str, **args: Any) -> str:
    with pytest.raises(Refused) as refused:
        await person.ask(request, **args)
    return str(refused.value)


async def test_a_restart_during_a_temporary_run_reopens_the_project(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice, olga = await stage.person("alice"), await operator_client(stage)
        key = await package(stage, alice)
        await alice.ask("AddActionPoint", name="unsaved", position=ORIGIN)
        await leave(alice)
        await olga.ask("RunPackage", id=key)
        await until_event(olga, "PackageState", state="running")
        assert stage.services.session.project is None
    async with open_stage(tmp_path) as stage:
        points = stage.services.session.require_project().action_points
        assert [point.name for point in points] == ["ap", "unsaved"]
        assert stage.services.session.has_changes


async def test_a_project_in_use_stays_open(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice, olga = await stage.person("alice"), await operator_client(stage)
        key = await package(stage, alice)
        await olga.ask("RunPackage", id=key)  # the offline object is not an obstacle
        await until_event(olga, "PackageState", state="running")
        assert stage.services.session.project is not None
        await olga.ask("StopPackage")
        await until(lambda: stage.services.execution.state.value == "stopped")
        await asyncio.sleep(0)
        assert "ProjectClosed" not in [message["event"] for message in olga.events()]

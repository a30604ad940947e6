"""Presence and previews: recipients, rate and end."""

import asyncio
import time
from typing import Any

import pytest

from arcor2_hw.data.role import Role
from arcor2_server.collaboration import presence, previews
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.work import ORIGIN, UPRIGHT, Work
from tests.server.sharing.conftest import expect, subscribed

POSE = {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": UPRIGHT}


# ---------------------------------------------------------------------------------------------- presence
async def test_presence_of_users_is_announced(server: SessionServer, alice: Person, stranger: Person) -> None:
    await stranger.ask("SubscribeEvents", events=["UserPresence"])
    assert (await expect(stranger, "UserPresence")) == {"user": "alice", "online": True, "role": "programmer"}
    bob = await server.person("bob")
    assert (await expect(stranger, "UserPresence"))["user"] == "bob"
    sent: dict[str, Any] = {
        "document": "pro_1",
        "selected": ["acp_1"],
        "editing": "act_1",
        "view": "Flow",
        "camera": POSE,
    }
    await bob.ask("UpdatePresence", **sent)
    event = await expect(stranger, "UserPresence", lambda data: "presence" in data)
    assert (event["user"], event["presence"]) == ("bob", sent)
    late = await server.person("carol")
    await late.ask("SubscribeEvents", events=["UserPresence"])
    everybody = {e["data"]["user"]: e["data"].get("presence") for e in late.events()}
    assert everybody == {"alice": None, "bob": sent, "carol": None}
    await bob.ask("RegisterUser", user_name="rob")
    assert (await expect(stranger, "UserPresence", lambda data: data["user"] == "bob"))["online"] is False
    assert "presence" not in await expect(stranger, "UserPresence", lambda data: data["user"] == "rob")
    await late.leave()
    server._people.remove(late)
    assert (await expect(stranger, "UserPresence", lambda data: not data["online"]))["user"] == "carol"


async def test_presence_needs_a_user_and_is_limited(alice: Person, stranger: Person) -> None:
    with pytest.raises(Refused, match="RegisterUser"):
        await stranger.ask("UpdatePresence", view="3D")
    with pytest.raises(Refused, match="selected"):
        await alice.ask("UpdatePresence", selected=["a"] * 51)
    with pytest.raises(Refused, match="view"):
        await alice.ask("UpdatePresence", view="x" * 51)


async def test_fast_updates_are_reduced_to_the_newest(
    monkeypatch: pytest.MonkeyPatch, alice: Person, bob: Person
) -> None:
    await subscribed(bob, "UserPresence")
    began = time.monotonic()
    for number in range(300):
        await alice.ask("UpdatePresence", view=str(number))
    events = [await expect(bob, "UserPresence", lambda data: data["user"] == "alice")]
    while events[-1]["presence"]["view"] != "299":
        events.append(await expect(bob, "UserPresence"))
    assert len(events) <= 2 + (time.monotonic() - began) / presence.PERIOD


# ---------------------------------------------------------------------------------------------- previews
@pytest.fixture
async def work(alice: Person) -> Work:
    work = Work(alice)
    await work.project("p", "q")
    await work.add_orientation(work.point("p"))
    alice.take()
    return work


async def drag(person: Person, item: str, x: float) -> None:
    await person.ask("PreviewMove", id=item, position={"x": x, "y": 0.0, "z": 0.0})


def is_over(data: Any) -> bool:
    return set(data) == {"id", "user"}


async def test_a_drag_is_sent_to_others_until_it_ends(alice: Person, bob: Person, work: Work) -> None:
    point = work.point("p")
    await subscribed(bob, "MovePreview")
    await subscribed(alice, "MovePreview")
    await alice.lock(point, tree=True)
    await drag(alice, point, 0.25)
    event = await expect(bob, "MovePreview")
    assert event == {"id": point, "user": "alice", "position": {"x": 0.25, "y": 0.0, "z": 0.0}}
    # The end of a drag is sent after the resulting change, so that nothing jumps back.
    await alice.ask("UpdateActionPointPosition", action_point_id=point, new_position={"x": 0.5, "y": 0.0, "z": 0.0})
    await expect(bob, "ActionPointChanged")
    assert await expect(bob, "MovePreview") == {"id": point, "user": "alice"}
    await drag(alice, point, 0.75)
    await alice.ask("PreviewMove", id=point)
    await expect(bob, "MovePreview", is_over)
    assert "MovePreview" not in alice.names()
    assert work.session.document.action_point(point).position.x == 0.5
    assert (await alice.ask("History"))["revision"] == work.session.revision


async def test_a_drag_ends_with_its_lock_or_its_user(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    point = work.point("p")
    await subscribed(bob, "MovePreview")
    await alice.lock(point, tree=True)
    await drag(alice, point, 1.0)
    await expect(bob, "MovePreview")
    await alice.ask("WriteUnlock", object_id=point)
    assert is_over(await expect(bob, "MovePreview"))
    carol = await server.person("carol")
    await carol.lock(point, tree=True)
    await drag(carol, point, 2.0)
    await expect(bob, "MovePreview")
    await carol.leave()
    server._people.remove(carol)
    assert await expect(bob, "MovePreview") == {"id": point, "user": "carol"}
    assert server.services.previews._dragged == {}


async def test_invalid_drags_are_refused(
    server: SessionServer, alice: Person, bob: Person, stranger: Person, work: Work
) -> None:
    point, robot = work.point("p"), work.object("robot")
    orientation = work.session.require_project().action_points[0].orientations[0].id
    await alice.lock(point)
    for person, reason in ((bob, "bob does not hold"), (stranger, "RegisterUser")):
        with pytest.raises(Refused, match=reason):
            await drag(person, point, 1.0)
    with pytest.raises(Refused, match="no_such"):
        await drag(alice, "no_such", 1.0)
    with pytest.raises(Refused, match="no joints"):
        await alice.ask("PreviewMove", id=point, joints=[])
    await alice.ask("PreviewMove", id=orientation, orientation=UPRIGHT)  # the lock of its point is sufficient
    with pytest.raises(Refused, match="does not hold"):
        await drag(alice, robot, 1.0)
    client = server.services.users.client_of("alice")
    assert client is not None
    client.ceiling = Role.STANDARD_USER
    with pytest.raises(Refused, match="technician"):
        await drag(alice, robot, 1.0)


async def test_a_fast_drag_is_sent_at_most_thirty_times_a_second(alice: Person, bob: Person, work: Work) -> None:
    point = work.point("p")
    await subscribed(bob, "MovePreview")
    await alice.lock(point)
    began = time.monotonic()
    for number in range(300):
        await drag(alice, point, float(number))
    seen: list[float] = []
    while not seen or seen[-1] < 299:
        seen.append((await expect(bob, "MovePreview"))["position"]["x"])
    assert seen == sorted(seen)
    assert seen[0] == 0
    assert len(seen) <= 2 + (time.monotonic() - began) / previews.PERIOD


async def test_clients_without_subscription_receive_nothing(alice: Person, bob: Person, work: Work) -> None:
    point = work.point("p")
    await alice.lock(point, tree=True)
    bob.take()
    await drag(alice, point, 1.0)
    await alice.ask("UpdatePresence", view="3D")
    await alice.ask("SetViewState", scope="shared", values={"a": 1})
    await alice.ask("SetBreakpoints", add=[point])
    await alice.ask("UpdateActionPointPosition", action_point_id=point, new_position=ORIGIN)
    await asyncio.sleep(0.05)
    assert bob.names() == ["ActionPointChanged/update_base"]

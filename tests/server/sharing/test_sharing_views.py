"""View states: owners, events, refusals, and their state after a restart."""

from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.role import Role
from arcor2_server.collaboration import view_states
from tests.server.session.session_server import Person, Refused, SessionServer, open_server
from tests.server.session.work import Work
from tests.server.sharing.conftest import expect, subscribed


async def view(person: Person, scope: str = "user", **more: Any) -> Any:
    return await person.ask("GetViewState", scope=scope, **more)


async def test_view_states_are_stored_by_user_document_and_key(alice: Person, bob: Person) -> None:
    first = await alice.ask("SetViewState", scope="user", values={"stars": ["scn_1"], "opacity": {"obj_1": 0.5}})
    second = await alice.ask("SetViewState", scope="user", document="pro_1", values={"stars": 1})
    assert second["revision"] > first["revision"]
    await alice.ask("SetViewState", scope="user", values={"stars": None, "filters": 7})
    mine = await view(alice)
    assert mine["values"] == {"opacity": {"obj_1": 0.5}, "filters": 7}
    assert (mine["user"], mine["document"], mine["scope"]) == ("alice", "", "user")
    assert (await view(alice, document="pro_1"))["values"] == {"stars": 1}
    assert (await view(bob))["values"] == {}
    assert (await view(bob, user="alice"))["values"] == mine["values"]
    assert (await view(bob, "shared"))["values"] == {}


async def test_shared_view_states_are_announced(
    server: SessionServer, alice: Person, bob: Person, stranger: Person
) -> None:
    screen = await subscribed(stranger, "ViewStateChanged", users=["alice"])
    for person in (alice, bob):
        await subscribed(person, "ViewStateChanged")
    await alice.ask("SetViewState", scope="user", document="pro_1", values={"a": 1, "b": None})
    event = await expect(screen, "ViewStateChanged")
    assert event["values"] == {"a": 1, "b": None}
    assert (event["user"], event["document"], event["scope"]) == ("alice", "pro_1", "user")
    answer = await bob.ask("SetViewState", scope="shared", document="pro_1", values={"place/START": [0, 1, 2]})
    for person in (alice, screen):
        event = await expect(person, "ViewStateChanged")
        assert (event["scope"], event["revision"], event["values"]) == (
            "shared",
            answer["revision"],
            {"place/START": [0, 1, 2]},
        )
        assert "user" not in event
    assert bob.events() == []
    await stranger.ask("SubscribeEvents", events=[], users=["alice"], send=False)
    await alice.ask("SetViewState", scope="user", values={"a": 2})
    assert screen.events() == bob.events() == []


async def test_invalid_view_states_are_refused(
    monkeypatch: pytest.MonkeyPatch, alice: Person, stranger: Person
) -> None:
    with pytest.raises(Refused, match="RegisterUser"):
        await stranger.ask("SetViewState", scope="user", values={"a": 1})
    with pytest.raises(Refused, match="RegisterUser"):
        await view(stranger)
    with pytest.raises(Refused, match="shared view state"):
        await view(alice, "shared", user="alice")
    with pytest.raises(Refused, match="scope"):
        await view(alice, "everybody")
    with pytest.raises(Refused, match="values"):
        await alice.ask("SetViewState", scope="user", values={})
    with pytest.raises(Refused, match="length"):
        await alice.ask("SetViewState", scope="user", values={"k" * 201: 1})
    with pytest.raises(Refused, match=r"'a'.*bytes"):
        await alice.ask("SetViewState", scope="user", values={"b": 1, "a": "x" * view_states.MAX_VALUE})
    assert (await view(alice))["values"] == {}  # a refused request stores nothing
    monkeypatch.setattr(view_states, "MAX_KEYS", 3)
    await alice.ask("SetViewState", scope="user", values={"a": 1, "b": 2, "c": 3})
    with pytest.raises(Refused, match="keys"):
        await alice.ask("SetViewState", scope="user", values={"d": 4})
    await alice.ask("SetViewState", scope="user", values={"d": 4, "a": None})
    monkeypatch.setattr(view_states, "MAX_VIEW", 100)
    with pytest.raises(Refused, match="bytes"):
        await alice.ask("SetViewState", scope="user", values={"b": "x" * 100})
    assert (await view(alice))["values"] == {"b": 2, "c": 3, "d": 4}


async def test_an_operator_changes_only_own_view_states(alice: Person, server: SessionServer) -> None:
    client = server.services.users.client_of("alice")
    assert client is not None
    client.ceiling = Role.OPERATOR
    await alice.ask("SetViewState", scope="user", values={"stars": []})
    with pytest.raises(Refused, match="standard_user"):
        await alice.ask("SetViewState", scope="shared", values={"place/END": 1})


async def test_only_the_newest_documents_are_kept(monkeypatch: pytest.MonkeyPatch, alice: Person) -> None:
    monkeypatch.setattr(view_states, "MAX_DOCUMENTS", 3)
    monkeypatch.setattr(view_states, "MAX_CACHED", 2)
    for number in range(3):
        await alice.ask("SetViewState", scope="user", document=f"pro_{number}", values={"a": number})
    await alice.ask("SetViewState", scope="user", document="pro_0", values={"b": 1})
    await alice.ask("SetViewState", scope="user", document="pro_3", values={"a": 3})
    stored = [(await view(alice, document=f"pro_{number}"))["values"] for number in range(4)]
    assert stored == [{"a": 0, "b": 1}, {}, {"a": 2}, {"a": 3}]


async def test_view_states_survive_a_restart_and_end_with_their_document(tmp_path: Path) -> None:
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        project = await Work(alice).project("p")
        await alice.ask("SaveProject")
        await alice.ask("CloseProject")
        for scope in ("user", "shared"):
            await alice.ask("SetViewState", scope=scope, document=project, values={"a": [1, {"b": None}]})
        before = await alice.ask("SetViewState", scope="user", values={"stars": [project]})
    async with open_server(tmp_path) as server:
        alice = await server.person("alice")
        for scope in ("user", "shared"):
            assert (await view(alice, scope, document=project))["values"] == {"a": [1, {"b": None}]}
        lists = server.services.storage.revision
        after = await alice.ask("SetViewState", scope="user", values={"x": 1})
        assert after["revision"] > before["revision"]
        assert server.services.storage.revision == lists  # cached lists of documents stay valid
        await alice.ask("DeleteProject", id=project)
        for scope in ("user", "shared"):
            assert (await view(alice, scope, document=project))["values"] == {}
        assert (await view(alice))["values"] == {"stars": [project], "x": 1}

"""The script of the open project: read, checked and imported, also while other users edit."""

import pytest

from arcor2_hw.data.role import Role
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.work import Work

STORED = {"flows": [{"type": "default", "outputs": ["lucky"]}]}


@pytest.fixture
async def work(alice: Person) -> Work:
    """Create a program: sleep, then draw, followed by another pause or by the end."""
    work = Work(alice)
    await work.project("here")
    point = work.point("here")
    probability = {"name": "probability", "type": "double", "value": "0.5"}
    await work.add_action(point, "pause")
    await work.add_action(point, "draw", "rnd/random_bool", probability, **STORED)
    await work.add_action(point, "again")
    steps = [("START", "pause"), ("pause", "draw"), ("again", "END")]
    for start, end in steps:
        await connect(work, start, end)
    for value, end in (("true", "again"), ("false", "END")):
        await connect(work, "draw", end, {"what": f"{work.action('draw').id}/default/0", "value": value})
    alice.take()
    return work


async def connect(work: Work, start: str, end: str, condition: dict[str, str] | None = None) -> None:
    ends = [each if each in ("START", "END") else work.action(each).id for each in (start, end)]
    given = {} if condition is None else {"condition": condition}
    await work.person.ask("AddLogicItem", start=ends[0], end=ends[1], **given)


def line_of(script: str, text: str) -> int:
    return 1 + next(number for number, line in enumerate(script.splitlines()) if text in line)


async def test_script_of_unsaved_changes_is_imported_as_one_step_of_undo(
    server: SessionServer, alice: Person, work: Work
) -> None:
    loaded = await alice.ask("ProjectScript")
    assert loaded["editable"]
    assert loaded["revision"] == server.session.revision
    script = loaded["script"]
    before = server.session.require_project()
    same = await alice.ask("CheckScript", script=script, revision=loaded["revision"])
    assert (same["problems"], same["changes"]) == ([], [])
    assert (await alice.ask("ImportScript", script=script, revision=loaded["revision"]))["changes"] == []
    assert server.session.revision == loaded["revision"], "an import without changes is not an edit"

    edited = script.replace('0.5, an="pause"', '2.5, an="pause"').replace(
        "        if lucky == True:\n", '        time.say("rolled", an="shout")\n        if lucky == True:\n'
    )
    assert edited.count("shout") == 1, script
    checked = await alice.ask("CheckScript", script=edited, revision=loaded["revision"])
    assert checked["problems"] == []
    changes = {(each["kind"], each["name"], each["change"]) for each in checked["changes"]}
    assert {("action", "pause", "update"), ("action", "shout", "add"), ("logic", "draw → shout", "add")} <= changes
    assert server.session.revision == loaded["revision"], "a check changes nothing"
    alice.take()
    done = await alice.ask("ImportScript", script=edited, revision=loaded["revision"])
    assert done["revision"] == loaded["revision"] + 1 == server.session.revision
    assert done["changes"] == [
        each | {"id": new["id"]} for each, new in zip(checked["changes"], done["changes"], strict=True)
    ]
    assert work.action("pause").parameters[0].value == "2.5"
    assert {"ActionChanged/add", "ActionChanged/update", "LogicItemChanged/add"} <= set(alice.names())
    reloaded = await alice.ask("ProjectScript")
    assert 'time.say("rolled", an="shout")' in reloaded["script"]
    await alice.ask("Undo")
    after = server.session.require_project()
    assert (after.action_points, after.logic) == (before.action_points, before.logic)


async def test_problems_name_line_and_column(alice: Person, work: Work) -> None:
    loaded = await alice.ask("ProjectScript")
    script, revision = loaded["script"], loaded["revision"]
    line = line_of(script, 'an="pause"')
    for wrong, column, text in (
        ("        while lucky:\n            pass", 9, "the loop contains only calls"),
        ("        time.dance()", 9, "has no action dance"),
        ("        time.sleep(", 19, "was never closed"),
    ):
        lines = script.splitlines()
        lines[line - 1] = wrong
        broken = "\n".join(lines) + "\n"
        found = await alice.ask("CheckScript", script=broken, revision=revision)
        [problem] = found["problems"]
        assert (problem["line"], problem["column"]) == (line, column), problem
        assert text in problem["message"]
        assert "line" not in problem["message"]
        with pytest.raises(Refused, match=f"line {line}"):
            await alice.ask("ImportScript", script=broken, revision=revision)
    # Problems that concern no line, and the translation for clients that request it.
    found = await alice.ask("CheckScript", codes=True, script=script, revision=revision + 1)
    assert "line" not in found["problems"][0]


async def test_comments_of_a_script_survive_edits_on_a_tablet(
    server: SessionServer, alice: Person, bob: Person, work: Work
) -> None:
    loaded = await alice.ask("ProjectScript")
    commented = loaded["script"].replace(
        '        time.sleep(0.5, an="pause")\n',
        "        # Let the paint dry.\n        time.sleep(0.5, an='pause')  # seconds\n",
    )
    assert commented != loaded["script"]
    checked = await alice.ask("CheckScript", script=commented, revision=loaded["revision"])
    assert (checked["problems"], [each["kind"] for each in checked["changes"]]) == ([], ["project"])
    alice.take()
    await alice.ask("ImportScript", script=commented, revision=loaded["revision"])
    events = alice.events()
    assert not any("Let the paint dry" in str(event) for event in events), "legacy clients receive the text"
    assert any(event["event"] == "ProjectChanged" for event in events)
    imported = await alice.ask("ProjectScript")
    assert imported["script"] == commented
    again = await alice.ask("CheckScript", script=commented, revision=imported["revision"])
    assert again["changes"] == []

    await bob.lock(pause := work.action("pause").id)
    seconds = {"name": "seconds", "type": "double", "value": "9.0"}
    await bob.ask("UpdateAction", action_id=pause, parameters=[seconds])
    await bob.ask("WriteUnlock", object_id=pause)
    edited = (await alice.ask("ProjectScript"))["script"]
    assert edited == commented.replace("time.sleep(0.5, an='pause')", 'time.sleep(9.0, an="pause")')
    assert server.session.require_project().script == commented, "the stored text changes only by an import"
    await alice.ask("Undo")
    assert (await alice.ask("ProjectScript"))["script"] == loaded["script"].replace("sleep(0.5", "sleep(9.0", 1)


async def test_edits_of_others_since_the_script_was_loaded_survive(alice: Person, bob: Person, work: Work) -> None:
    loaded = await alice.ask("ProjectScript")
    script, revision = loaded["script"], loaded["revision"]
    edited = script.replace('0.5, an="pause"', '2.5, an="pause"')
    other = Work(bob)
    await bob.lock(again := work.action("again").id)
    await bob.ask("RenameAction", action_id=again, new_name="later")
    await other.add_action(work.point("here"), "extra")
    done = await alice.ask("ImportScript", script=edited, revision=revision)
    assert [(each["name"], each["change"]) for each in done["changes"]] == [("pause", "update")]
    assert work.action("pause").parameters[0].value == "2.5"
    assert work.action("later").id == again
    assert work.action("extra")
    # Both edited the same action: the import is refused with the name of the other user, and changes nothing.
    revision = (await alice.ask("ProjectScript"))["revision"]
    script = (await alice.ask("ProjectScript"))["script"]
    pause = work.action("pause").id
    await bob.lock(pause)
    with pytest.raises(Refused, match="bob"):
        await alice.ask("ImportScript", script=script.replace('2.5, an="pause"', '3.0, an="pause"'), revision=revision)
    seconds = {"name": "seconds", "type": "double", "value": "9.0"}
    await bob.ask("UpdateAction", action_id=pause, parameters=[seconds])
    await bob.ask("WriteUnlock", object_id=pause)
    conflicting = script.replace('2.5, an="pause"', '3.0, an="pause"')
    found = await alice.ask("CheckScript", script=conflicting, revision=revision)
    assert "was changed since by bob" in found["problems"][0]["message"]
    with pytest.raises(Refused, match="was changed since by bob"):
        await alice.ask("ImportScript", script=conflicting, revision=revision)
    assert work.action("pause").parameters[0].value == "9.0"


async def test_import_needs_the_role_of_the_changes(server: SessionServer, alice: Person, work: Work) -> None:
    loaded = await alice.ask("ProjectScript")
    with_parameter = loaded["script"].replace("\n\n    while True:\n", "\n    speed = 3\n\n    while True:\n")
    checked = await alice.ask("CheckScript", script=with_parameter, revision=loaded["revision"])
    assert [(each["kind"], each["name"]) for each in checked["changes"]] == [("parameter", "speed")]
    [client] = [each for each in server.services.hub.clients if each.user == "alice"]
    client.ceiling = Role.STANDARD_USER
    found = await alice.ask("CheckScript", script=with_parameter, revision=loaded["revision"])
    assert "advanced" in found["problems"][0]["message"]
    client.ceiling = Role.OPERATOR
    assert (await alice.ask("ProjectScript"))["script"] == loaded["script"]
    with pytest.raises(Refused):
        await alice.ask("ImportScript", script=loaded["script"], revision=loaded["revision"])

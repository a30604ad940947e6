"""Functions of the open project: creation, changes, dissolving, undo, and import into another project."""

import json
from typing import Any

import pytest
from msgspec.structs import replace

from arcor2_hw.data.project import Project, ProjectFunction
from arcor2_server.documents.document import UNTIMED, Document
from arcor2_server.documents.extensions import keep_extensions
from tests.server.session.session_server import Person, Refused, SessionServer
from tests.server.session.test_session_scripts import STORED, connect
from tests.server.session.work import Work

SHOUT = {"name": "text", "type": "string", "value": '"won"'}


@pytest.fixture
async def work(alice: Person) -> Work:
    """A program: draw, pause for the time in a project parameter, and pause again if the draw was lucky."""
    work = Work(alice)
    await work.project("here")
    point = work.point("here")
    await alice.ask("AddProjectParameter", name="wait", type="double", value="0.5")
    wait = json.dumps(work.session.document.named("parameter", "wait"))
    await work.add_action(
        point, "draw", "rnd/random_bool", {"name": "probability", "type": "double", "value": "0.5"}, **STORED
    )
    await work.add_action(point, "pause", "time/sleep", {"name": "seconds", "type": "project_parameter", "value": wait})
    await work.add_action(point, "again", "time/sleep", {"name": "seconds", "type": "double", "value": "0.1"})
    for start, end in (("START", "draw"), ("draw", "pause"), ("again", "END")):
        await connect(work, start, end)
    for value, end in (("true", "again"), ("false", "END")):
        await connect(work, "pause", end, {"what": f"{work.action('draw').id}/default/0", "value": value})
    alice.take()
    return work


def project_of(work: Work) -> Project:
    return replace(work.session.require_project(), **UNTIMED)


def function_of(work: Work, name: str) -> ProjectFunction:
    return next(each for each in project_of(work).functions if each.name == name)


async def make_function(work: Work, name: str = "try_luck", *names: str) -> dict[str, str]:
    answer: dict[str, str] = await work.person.ask(
        "MakeFunction", name=name, action_ids=[work.action(each).id for each in names or ("draw", "pause")]
    )
    return answer


async def test_actions_become_a_function_and_return(server: SessionServer, alice: Person, work: Work) -> None:
    before = project_of(work)
    with pytest.raises(Refused, match="lead to again, END"):
        await make_function(work)
    # With the action `again`, the selection has one exit.
    wanted = [work.action(name).id for name in ("draw", "pause", "again")]
    assert project_of(work) == before, "a refusal changes nothing"
    await alice.ask("MakeFunction", dry_run=True, name="try_luck", action_ids=wanted)
    assert project_of(work) == before, "neither does a dry run"

    bob = await server.person("bob")
    await bob.ask("SubscribeEvents", events=["FunctionChanged"])
    alice.take()
    bob.take()
    answer = await alice.ask("MakeFunction", name="try_luck", action_ids=wanted)
    function, call = function_of(work, "try_luck"), work.action("try_luck")
    assert (answer["function_id"], answer["action_id"]) == (function.id, call.id)
    assert [action.name for action in function.actions] == ["draw", "pause", "again"]
    assert [(each.name, each.type) for each in function.parameters] == [("wait", "double")]
    assert [(each.name, each.type) for each in call.parameters] == [("wait", "project_parameter")]
    assert [(item.start, item.end) for item in project_of(work).logic] == [("START", call.id), (call.id, "END")]
    assert Document.of(server.session.require_scene(), project_of(work)).project is not None
    assert "FunctionChanged" not in alice.names(), "only subscribers get the event"
    [changed] = [event for event in bob.events() if event["event"] == "FunctionChanged"]
    assert changed["change_type"] == "add"
    assert [action["name"] for action in changed["data"]["actions"]] == ["draw", "pause", "again"]

    with_function = project_of(work)
    await alice.ask("Undo")
    assert project_of(work) == before
    await alice.ask("Redo")
    assert project_of(work) == with_function
    await alice.ask("DissolveCall", action_id=call.id, remove_function=True)
    assert project_of(work).functions == []
    assert {action.name for action in project_of(work).all_actions()} == {"draw", "pause", "again"}
    await alice.ask("Undo")
    assert project_of(work) == with_function


async def test_a_refused_function_states_the_reason_as_a_code(alice: Person, work: Work) -> None:
    await work.add_action(work.point("here"), "lone")
    reasons = {
        ("draw", "again"): "several_entries",
        ("draw", "pause"): "several_exits",
        ("draw", "lone"): "not_connected",
        ("pause", "again"): "no_function",  # a condition uses a result from outside
    }
    for names, code in reasons.items():
        args = {"name": "f", "action_ids": [work.action(name).id for name in names]}
        answer = await alice.send({"id": 1, "request": "MakeFunction", "args": args, "codes": True})
        assert (answer["result"], answer["code"]) == (False, code), answer


async def test_parameters_and_results_change_with_all_calls(alice: Person, work: Work) -> None:
    ask = alice.ask
    await make_function(work, "try_luck", "draw")
    function, call = function_of(work, "try_luck"), work.action("try_luck")
    assert call.outputs() == ["lucky"], "the condition uses it"
    [draw] = function.actions
    number = {"name": "", "type": "double", "value": "0.25"}
    with pytest.raises(Refused, match="state the value of the new parameter"):
        await ask("AddFunctionParameter", function_id=function.id, name="chance", type="double")
    await ask("AddFunctionParameter", function_id=function.id, name="chance", type="double", value=number)
    await alice.lock(draw.id)
    passed = {"name": "probability", "type": "function_parameter", "value": '"chance"'}
    await ask("UpdateAction", action_id=draw.id, parameters=[passed])
    with pytest.raises(Refused, match="draw uses the parameter chance"):
        await ask("RemoveFunctionParameter", function_id=function.id, name="chance")
    await alice.lock(call.id)
    with pytest.raises(Refused, match="chance"):
        await ask("UpdateAction", action_id=call.id, parameters=[SHOUT | {"name": "chance"}])
    await ask("UpdateFunctionParameter", function_id=function.id, name="chance", new_name="odds")
    assert [each.name for each in work.action("try_luck").parameters] == ["odds"]
    assert function_of(work, "try_luck").actions[0].parameters[0].value == '"odds"'

    with pytest.raises(Refused, match="is used by"):
        await ask("RemoveFunctionResult", function_id=function.id, index=0)
    await ask("AddFunctionResult", function_id=function.id, link=f"{draw.id}/default/0")
    assert work.action("try_luck").outputs() == ["lucky", "lucky_2"]
    with pytest.raises(Refused, match="no named result number 3"):
        await ask("UpdateFunctionResult", function_id=function.id, index=1, link=f"{draw.id}/default/3")
    await ask("RemoveFunctionResult", function_id=function.id, index=1)
    assert work.action("try_luck").outputs() == ["lucky"]
    with pytest.raises(Refused, match="calls the function"):
        await ask("RemoveFunction", id=function.id)


async def test_a_function_has_its_own_actions_and_logic(server: SessionServer, alice: Person, work: Work) -> None:
    ask = alice.ask
    function = (await ask("AddFunction", name="greet"))["id"]
    with pytest.raises(Refused, match="name greet"):
        await ask("AddFunction", name="greet")
    first = {
        "action_point_id": function,
        "name": "first",
        "type": f"{work.object('time')}/sleep",
        "flows": [{"outputs": []}],
    }
    await ask("AddAction", **first, parameters=[{"name": "seconds", "type": "double", "value": "0.1"}])
    [inner] = function_of(work, "greet").actions
    for start, end in (("START", inner.id), (inner.id, "END")):
        await ask("AddLogicItem", start=start, end=end)
    assert len(function_of(work, "greet").logic) == 2
    with pytest.raises(Refused, match="not actions of the same function"):
        await ask("AddLogicItem", start=inner.id, end=work.action("again").id)
    link = {"name": "seconds", "type": "link", "value": json.dumps(f"{work.action('draw').id}/default/0")}
    await alice.lock(inner.id)
    with pytest.raises(Refused, match="an action of another function, or of the program"):
        await ask("UpdateAction", action_id=inner.id, parameters=[link])
    with pytest.raises(Refused, match="cannot call itself"):
        await ask("AddAction", **first | {"name": "again_and_again", "type": f"{function}/call"})
    # The same rules hold for another user who holds a lock.
    bob = await server.person("bob")
    await bob.lock(function)
    with pytest.raises(Refused, match="bob"):
        await ask("RenameFunction", function_id=function, new_name="welcome")
    await bob.ask("WriteUnlock", object_id=function)
    await ask("RemoveAction", id=inner.id, with_steps=True)
    assert (function_of(work, "greet").actions, function_of(work, "greet").logic) == ([], [])
    await ask("RemoveFunction", id=function)
    assert project_of(work).functions == []


async def test_a_function_moves_to_another_project_of_the_scene(alice: Person, work: Work) -> None:
    ask = alice.ask
    await work.add_orientation(work.point("here"), "o")
    answer = await make_function(work, "inner", "draw")
    # `inner` becomes part of `outer`, so it is exported with `outer`.
    await ask("MakeFunction", name="outer", action_ids=[work.action(n).id for n in ("inner", "pause", "again")])
    outer = function_of(work, "outer")
    exported: dict[str, Any] = await ask("ExportFunction", id=outer.id)
    assert [each["name"] for each in exported["functions"]] == ["inner", "outer"]
    assert {(each["kind"], each["name"]) for each in exported["references"]} == {("object", "rnd"), ("object", "time")}
    before = project_of(work)
    ids = (await ask("ImportFunction", function=exported))["ids"]
    # The project contains `inner`, which the copy calls.
    assert [each.name for each in project_of(work).functions] == ["inner", "outer", "outer_2"]
    copied = function_of(work, "outer_2")
    assert [copied.id] == ids
    assert next(action.type for action in copied.actions) == f"{function_of(work, 'inner').id}/call"
    await ask("Undo")
    assert project_of(work) == before
    # A called function that has changed since the export is added, too.
    await ask("RenameFunction", function_id=function_of(work, "inner").id, new_name="deep")
    ids = (await ask("ImportFunction", function=exported))["ids"]
    assert [each.name for each in project_of(work).functions] == ["deep", "outer", "inner", "outer_2"]
    copied = function_of(work, "outer_2")
    assert copied.id == ids[-1]
    assert next(action.type for action in copied.actions) == f"{function_of(work, 'inner').id}/call"
    await ask("Undo")
    await ask("Undo")
    assert project_of(work) == before

    scene = work.session.require_scene()
    point = {"kind": "position", "id": "acp_gone", "name": "there", "point_id": "acp_gone", "point": "there"}
    damaged = exported | {"references": [*exported["references"], point]}
    with pytest.raises(Refused, match="The project lacks: the action point there"):
        await ask("ImportFunction", function=damaged)
    await ask("ImportFunction", function=damaged, points={"there": "here"})
    with pytest.raises(Refused, match="damaged"):
        await ask("ImportFunction", function=exported | {"references": []})
    assert scene == work.session.require_scene()
    assert answer["function_id"]


async def test_a_function_is_changed_in_the_script(alice: Person, work: Work) -> None:
    await make_function(work, "try_luck", "draw", "pause", "again")
    before = project_of(work)
    [function] = before.functions
    loaded = await alice.ask("ProjectScript")
    script: str = loaded["script"]
    assert "    def try_luck(wait: float, *, an: str) -> None:\n" in script
    edited = script.replace("def try_luck(", "def play(").replace("        try_luck(", "        play(")
    edited = edited.replace('0.1, an="again"', '0.2, an="again"')
    edited = edited.replace(
        '        time.sleep(wait, an="pause")\n',
        '        time.sleep(wait, an="pause")\n        time.sleep(1.0, an="more")\n',
    )
    given = {"script": edited, "revision": loaded["revision"]}
    checked = await alice.ask("CheckScript", **given)
    assert checked["problems"] == []
    await alice.ask("ImportScript", **given)
    [changed] = project_of(work).functions
    assert (changed.id, changed.name) == (function.id, "play")
    assert [action.name for action in changed.actions] == ["draw", "pause", "again", "more"]
    assert [action.id for action in changed.actions][:3] == [action.id for action in function.actions]
    await alice.ask("Undo")
    assert project_of(work) == before

    moved = script.replace(
        "    while True:\n", '    while True:\n        try_luck(wait, an="twice")\n        continue\n'
    )
    for wrong, reason in (
        (moved, "never reached"),
        (script.replace("    @res.function\n", ""), "needs the decorator @res.function"),
        (script.replace("wait: float", "wait"), "the parameter wait needs a type hint"),
        (script.replace("wait: float", "wait: list"), "list cannot be the type of the parameter wait"),
        (
            script.replace('        time.sleep(wait, an="pause")', '        try_luck(wait, an="pause")'),
            "must be defined above",
        ),
        (script.replace("        draw", "        draw") + "\n\ndef f(): pass\n", "contains only imports, main"),
    ):
        problems = (await alice.ask("CheckScript", script=wrong, revision=loaded["revision"]))["problems"]
        assert [reason in problem["message"] for problem in problems] == [True], (reason, problems)


async def test_clients_that_do_not_know_functions_are_notified(
    server: SessionServer, alice: Person, work: Work
) -> None:
    await make_function(work, "try_luck", "draw")
    await alice.ask("AddProjectParameter", name="count", type="integer", value="0", variable=True)
    await alice.ask("SaveProject")
    await alice.ask("CloseProject")
    bob = await server.person("bob")
    await bob.ask("SubscribeEvents", events=["FunctionChanged"])
    await alice.ask("OpenProject", id=(await alice.ask("ListProjects"))[0]["id"])
    notices = [[e["data"]["message"] for e in each.events() if e["event"] == "Notification"] for each in (alice, bob)]
    assert notices == [
        [
            "This project contains functions, variables. "
            "Your client cannot show or edit them. They are kept when it saves."
        ],
        [],
    ]


async def test_functions_survive_a_client_that_does_not_know_them(work: Work) -> None:
    await make_function(work, "try_luck", "draw")
    stored = project_of(work)
    assert keep_extensions(replace(stored, functions=[]), stored) == stored
    [function] = stored.functions
    renamed = replace(function, name="other")
    assert keep_extensions(replace(stored, functions=[renamed]), stored).functions == [renamed]

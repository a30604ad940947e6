"""Parallel work of the open project: creation, changes, dissolving, undo, and older clients."""

from typing import Any

import pytest
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.project import PARALLEL, Action, Project
from arcor2_server.documents.document import UNTIMED
from arcor2_server.documents.extensions import keep_extensions
from tests.server.session.session_server import Person, Refused
from tests.server.session.test_session_scripts import STORED, connect
from tests.server.session.work import NO_RESULTS, Work


@pytest.fixture
async def work(alice: Person) -> Work:
    """A program: draw, then sleep, then draw again. Draw and sleep are calls of functions."""
    work = Work(alice)
    await work.project("here")
    point = work.point("here")
    probability = {"name": "probability", "type": "double", "value": "0.5"}
    await work.add_action(point, "draw", "rnd/random_bool", probability, **STORED)
    await work.add_action(point, "pause", "time/sleep", {"name": "seconds", "type": "double", "value": "0.1"})
    await work.add_action(point, "again", "rnd/random_bool", probability)
    for start, end in (("START", "draw"), ("draw", "pause"), ("pause", "again"), ("again", "END")):
        await connect(work, start, end)
    for name in ("draw", "pause"):
        await alice.ask("MakeFunction", name=f"do_{name}", action_ids=[work.action(name).id])
    alice.take()
    return work


def project_of(work: Work) -> Project:
    return replace(work.session.require_project(), **UNTIMED)


def steps_of(work: Work) -> set[tuple[str, str]]:
    names = {action.id: action.name for action in project_of(work).all_actions()}
    return {(names.get(item.start, item.start), names.get(item.end, item.end)) for item in project_of(work).logic}


async def make_parallel(work: Work, *names: str) -> Any:
    ids = [work.action(name).id for name in names or ("do_draw", "do_pause")]
    return await work.person.ask("MakeParallel", name="both", action_ids=ids)


async def test_calls_run_in_parallel_and_return(alice: Person, work: Work) -> None:
    before = project_of(work)
    with pytest.raises(Refused, match="again does not call a function"):
        await make_parallel(work, "do_pause", "again")
    answer = await make_parallel(work, "do_pause", "do_draw")
    parallel = work.action("both")
    assert (parallel.id, parallel.type) == (answer["action_id"], PARALLEL)
    assert parallel.branches == [work.action("do_draw").id, work.action("do_pause").id], "in the order of the program"
    assert steps_of(work) == {("START", "both"), ("both", "again"), ("again", "END")}
    script = await alice.ask("ProjectScript")
    assert 'res.parallel(lambda: do_draw(an="do_draw"), lambda: do_pause(an="do_pause"), an="both")' in script["script"]

    with pytest.raises(Refused, match="both runs do_draw in parallel: connect both"):
        await alice.ask("AddLogicItem", start=work.action("again").id, end=work.action("do_draw").id)
    with pytest.raises(Refused, match="both runs do_draw in parallel"):
        await alice.ask("RemoveAction", id=work.action("do_draw").id)
    with pytest.raises(Refused, match="both runs do_draw in parallel"):
        await alice.ask("DissolveCall", action_id=work.action("do_draw").id)
    with pytest.raises(Refused, match="again is not a call of a function"):
        await alice.ask(
            "UpdateParallel", action_id=parallel.id, branches=[work.action(name).id for name in ("again", "do_draw")]
        )
    swapped = [work.action(name).id for name in ("do_pause", "do_draw")]
    await alice.ask("UpdateParallel", action_id=parallel.id, branches=swapped)
    assert work.action("both").branches == swapped
    await alice.ask("Undo")
    await alice.ask("DissolveParallel", action_id=parallel.id)
    assert steps_of(work) == {
        ("START", "do_draw"),
        ("do_draw", "do_pause"),
        ("do_pause", "again"),
        ("again", "END"),
    }
    for _ in range(2):
        await alice.ask("Undo")
    assert project_of(work) == before


async def test_a_branch_whose_result_is_used_cannot_be_removed(alice: Person, work: Work) -> None:
    call = work.action("do_pause")
    await alice.ask(
        "AddAction", action_point_id=work.point("here"), name="third", type=call.type, parameters=[], flows=NO_RESULTS
    )
    await make_parallel(work)
    parallel, drawn = work.action("both"), work.action("do_draw")
    [draw] = [each for each in project_of(work).functions if each.name == "do_draw"]
    await alice.ask("AddFunctionResult", function_id=draw.id, link=f"{draw.actions[0].id}/default/0")
    everything = [*(parallel.branches or ()), work.action("third").id]
    await alice.ask("UpdateParallel", action_id=parallel.id, branches=everything)
    leaving = next(item for item in project_of(work).logic if item.start == parallel.id)
    when = {"comparisons": [{"what": f"{drawn.id}/default/0", "operator": "==", "value": "true"}], "match": "all"}
    step = {"logic_item_id": leaving.id, "start": leaving.start, "end": leaving.end}
    await alice.ask("UpdateLogicItem", **step, when=when)
    before = project_of(work)
    with pytest.raises(Refused, match=r"A result of do_draw is used by a condition of the logic\."):
        await alice.ask("UpdateParallel", action_id=parallel.id, branches=everything[1:])
    assert project_of(work) == before

    # The connection with the condition is removed together with the parallel action and its calls.
    await alice.ask("RemoveAction", id=parallel.id, with_steps=True)
    assert {action.name for action in project_of(work).all_actions()} == {"draw", "pause", "again"}
    await alice.ask("Undo")
    assert project_of(work) == before
    await alice.ask("UpdateLogicItem", **step, when={"comparisons": [], "match": "all"})
    await alice.ask("UpdateParallel", action_id=parallel.id, branches=everything[1:])
    assert work.action("both").branches == everything[1:]


async def test_a_function_contains_parallel_work(alice: Person, work: Work) -> None:
    await make_parallel(work)
    with pytest.raises(Refused, match="both runs do_draw in parallel"):
        await alice.ask("MakeFunction", name="everything", action_ids=[work.action("do_draw").id])
    ids = [work.action(name).id for name in ("both", "again")]
    await alice.ask("MakeFunction", name="everything", action_ids=ids)
    [function] = [each for each in project_of(work).functions if each.name == "everything"]
    names = {action.id: action.name for action in function.actions}
    [parallel] = [action for action in function.actions if action.is_parallel]
    assert [names[key] for key in parallel.branches or ()] == ["do_draw", "do_pause"]
    await alice.ask("DissolveCall", action_id=work.action("everything").id, remove_function=True)
    assert steps_of(work) == {("START", "both"), ("both", "again"), ("again", "END")}
    assert work.action("both").branches == [work.action("do_draw").id, work.action("do_pause").id]


async def test_parallel_work_survives_a_client_that_does_not_know_it(work: Work) -> None:
    await make_parallel(work)
    stored = project_of(work)

    def without(action: Action) -> Action:
        return replace(action, branches=UNSET)

    points = [replace(one, actions=list(map(without, one.actions))) for one in stored.action_points]
    sent = replace(stored, action_points=points, functions=[])
    assert keep_extensions(sent, stored) == stored

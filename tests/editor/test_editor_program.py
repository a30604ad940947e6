"""Writing a program: actions, parameters, steps and branches, faults, code."""

import asyncio
import math
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import msgspec
import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, expect

from arcor2_hw.data import rpc
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import ActionParameter, Flow, FlowTypes
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.programming import Work, project_on_screen
from tests.editor.screen import VIEWPORTS

pytestmark = pytest.mark.asyncio(loop_scope="session")


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def opened(module_cell: Cell, browser: Browser) -> AsyncIterator[Work]:
    """One project for all tests of this module. Each test adds the actions it edits."""
    async with project_on_screen(module_cell, browser, ("counter", "CounterActions")) as open_project:
        yield open_project


@pytest_asyncio.fixture(loop_scope="session")
async def work(opened: Work) -> Work:
    """The project is open in the 3D view, with all panels closed."""
    await opened.start()
    return opened


def number(value: int) -> ActionParameter:
    return ActionParameter("number", "integer", str(value))


def reference(parameter: Any) -> str:
    return str(msgspec.json.decode(parameter.value))


async def test_action_at_the_crosshair_takes_at_most_three_taps(work: Work) -> None:
    """The taps add the point, its orientation and the action."""
    screen = work.screen
    work.taps = 0
    await work.tool(texts.PROGRAM)
    await work.mode("Add")
    await screen.page.locator(".crosshair").wait_for()
    aimed = await screen.page.evaluate(
        """() => {
            const box = document.querySelector(".view").getBoundingClientRect();
            const hit = __engine.pick(box.width / 2, box.height / 2, 0).find((each) => each.normal);
            return hit && [hit.point, hit.normal].map(({ x, y, z }) => [x, y, z]);
        }"""
    )
    assert aimed, "no body is in the middle of the view"
    place, normal = aimed
    await work.tap_button("move Move the TCP to a pose.")
    assert work.taps <= 3
    point = (await work.next_event("ActionPointChanged")).data
    orientation = (await work.next_event("OrientationChanged")).data
    action = (await work.next_event("ActionChanged")).data
    assert math.dist(tuple(point.position), place) < 1e-6
    # The tool faces the body, whichever side of it the camera shows: its z axis is opposite to the surface normal.
    x, y, z, w = orientation.orientation
    axis = (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y))
    assert math.dist(axis, [-each for each in normal]) < 1e-3
    assert action.type == f"{work.object('robot')}/move"
    parameters = await work.parameters(action.id)
    assert reference(parameters["pose"]) == orientation.id
    assert parameters["speed"].value == "0.25", "the default is not set"
    # The action is shown and selected; the panel stays open for the next action.
    await work.tap_button("Set parameters")
    assert (await screen.item(action.id))["kind"] == "action"
    await work.panel.get_by_role("heading", name=action.name, exact=True).wait_for()
    await work.panel.get_by_label("speed", exact=True).wait_for()
    await screen.picture("program action")


async def test_values_are_validated_by_field_and_server(work: Work) -> None:
    action = await work.add("probe", "robot/get_digital_input", "feeder", "probed", number=number(1))
    await work.select("probe")
    field = work.panel.get_by_label("number", exact=True)
    await field.fill("1.5")
    await field.press("Enter")
    await expect(work.panel.get_by_role("alert")).to_have_text("Enter a whole number.")
    await field.fill("3")
    await field.press("Enter")
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.UPDATE)
    assert (await work.parameters(action))["number"] == number(3)
    # If another user holds the lock, the field shows the refusal and the typed text stays.
    await work.client.call("WriteLock", rpc.WriteLockArgs(action))
    await field.fill("4")
    await field.press("Enter")
    await expect(work.panel.get_by_role("alert")).to_contain_text("colleague")
    await expect(field).to_have_value("4")
    await field.press("Escape")
    await expect(field).to_have_value("3")
    await work.client.call("WriteUnlock", rpc.WriteUnlockArgs(action))
    # The value becomes a new project parameter.
    await work.panel.get_by_role("radiogroup", name="Source of number").get_by_text("Project").click()
    await field.select_option(label="New variable…")
    created = (await work.next_event("ProjectParameterChanged")).data
    assert (created.name, created.type, created.value) == ("number", "integer", "3")
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.UPDATE)
    linked = (await work.parameters(action))["number"]
    assert (linked.type, reference(linked)) == ("project_parameter", created.id)
    await work.tool(texts.PROGRAM)
    await work.mode(texts.VARIABLES)
    constant = work.panel.get_by_role("region", name="number")
    await constant.get_by_role("button", name="probe", exact=True).wait_for()
    # A parameter in use cannot be removed; the message names the action that uses it.
    await constant.get_by_role("button", name="Remove number").click(force=True)
    await work.screen.sees("Used by probe.")


async def test_only_results_of_earlier_actions_can_be_used(work: Work) -> None:
    first = await work.add("count_up", "counter/increment", "feeder", "so_many")
    second = await work.add("take_off", "counter/decrement", "feeder", "left_over")
    await work.client.call("AddLogicItem", rpc.AddLogicItemArgs(first, second))
    await work.next_event("LogicItemChanged")
    await work.select("count_up")
    await work.panel.get_by_role("radiogroup", name="Source of by").get_by_text("Project").wait_for()
    assert await work.panel.get_by_text("Result", exact=True).count() == 0
    await work.select("take_off")
    await work.panel.get_by_role("radiogroup", name="Source of by").get_by_text("Result").click()
    await work.panel.get_by_label("by", exact=True).select_option(label="so_many of count_up")
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.UPDATE)
    linked = (await work.parameters(second))["by"]
    assert (linked.type, reference(linked)) == ("link", f"{first}/default/0")


async def test_branch_takes_at_most_five_taps_and_a_step_two(work: Work) -> None:
    """Count the taps in the graph. A changed step keeps its id."""
    screen, page = work.screen, work.screen.page
    check = await work.add("check_input", "robot/get_digital_input", "good", "there", number=number(1))
    yes = await work.add("on_yes", "flow/wait", "good")
    no = await work.add("on_no", "flow/wait", "bad")
    await work.screen.close_panels()
    await work.mode("Flow")
    graph = page.get_by_role("region", name=texts.GRAPH)
    await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()

    async def node(name: str) -> None:
        work.taps += 1
        await graph.locator(f'.react-flow__node[aria-label^="{name},"] .flow-name').click()

    work.taps = 0
    await work.tap_button("check_input: yes", graph)
    await page.get_by_role("status").filter(has_text="Tap the step that follows check_input").wait_for()
    await node("on_yes")
    step = (await work.next_event("LogicItemChanged")).data
    await work.tap_button("check_input: no", graph)
    await node("on_no")
    other = (await work.next_event("LogicItemChanged")).data
    assert work.taps <= 5
    assert [(each.start, each.end, each.condition.what, each.condition.value) for each in (step, other)] == [
        (check, yes, f"{check}/default/0", "true"),
        (check, no, f"{check}/default/0", "false"),
    ]
    work.taps = 0
    await work.tap_button("on_yes: next", graph)
    await node("on_no")
    joined = (await work.next_event("LogicItemChanged")).data
    assert work.taps == 2
    assert (joined.start, joined.end, joined.condition) == (yes, no, UNSET)
    # A loop is refused without a request.
    await work.tap_button("on_no: next", graph)
    await node("check_input")
    await screen.sees("This connection would create a loop.")
    # Branches differ by their dash pattern, not only by colour.
    await screen.until(
        """ids => {
            const lines = ids.map((id) => document.querySelector(`.react-flow__edge[data-id="${id}"] path`));
            if (!lines.every(Boolean)) return false;
            return new Set(lines.map((each) => getComputedStyle(each).strokeDasharray)).size === 3;
        }""",
        [step.id, other.id, joined.id],
    )
    # Redirecting a step keeps its id.
    await graph.locator(f"[data-id='{joined.id}'] .react-flow__edge-interaction").click(force=True)
    await work.tap_button("Change target", work.panel)
    await page.get_by_role("status").filter(has_text="Tap the step that follows on_yes").wait_for()
    await graph.locator('.react-flow__node[data-id="END"] .flow-name').click()
    moved = await work.next_event("LogicItemChanged")
    assert (moved.change_type, moved.data.id, moved.data.end) == (ChangeType.UPDATE, joined.id, "END")
    await screen.picture("program graph")
    await work.mode("3D")


async def test_error_exit_is_added_in_the_graph_and_its_error_used(work: Work) -> None:
    """Two taps add the exit. It handles every error until the user selects kinds of errors."""
    screen, page = work.screen, work.screen.page
    grab = await work.add("grab", "robot/get_digital_input", "good", number=number(1))
    notify = await work.add("notify", "flow/show_message", "bad", text=ActionParameter("text", "string", '""'))
    await screen.close_panels()
    await work.mode("Flow")
    graph = page.get_by_role("region", name=texts.GRAPH)
    await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()
    await graph.locator('.react-flow__node[aria-label^="grab,"] .flow-name').click()
    work.taps = 0
    await work.tap_button("grab: On error", graph)
    await page.get_by_role("status").filter(has_text="Tap the step that follows if grab fails").wait_for()
    await graph.locator('.react-flow__node[aria-label^="notify,"] .flow-name').click()
    exit_ = (await work.next_event("LogicItemChanged")).data
    assert (exit_.start, exit_.end, exit_.error_kinds) == (grab, notify, ["error"])
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.UPDATE)
    await work.panel.get_by_label("Name of the error").wait_for()
    await page.get_by_role("button", name=re.compile("^Undo")).click()
    removed = await work.next_event("LogicItemChanged")
    assert (removed.change_type, removed.data.id) == (ChangeType.REMOVE, exit_.id)
    await page.get_by_role("button", name=re.compile("^Redo")).click()
    await work.next_event("LogicItemChanged")
    named = next(each for point in (await work.saved()).action_points for each in point.actions if each.id == grab)
    assert named.error_output == "get_digital_input_error"
    await graph.locator('.react-flow__node[aria-label^="grab,"] .flow-name').click()
    await work.panel.locator(".next-step", has_text="on error").click()
    # The user selects kinds of errors by name, and the edge shows their number.
    for kind in ("Refused", "Timeout"):
        await work.panel.locator(".kinds .chip", has_text=kind).click()
        changed = (await work.next_event("LogicItemChanged")).data
    assert changed.error_kinds == ["refused", "device_timeout"]
    await graph.get_by_text("on error: 2 kinds").wait_for()
    await screen.picture("program error exit")
    # Fields of the error are offered to the actions on the error path.
    await graph.locator('.react-flow__node[aria-label^="notify,"] .flow-name').click()
    await work.panel.get_by_role("radiogroup", name="Source of text").get_by_text("Result").click()
    await work.panel.get_by_label("text", exact=True).select_option(label="text of the error of grab")
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.UPDATE)
    assert reference((await work.parameters(notify))["text"]) == f"{grab}/error/2"
    assert await screen.faults() == []
    await work.mode("3D")
    assert (await screen.item(exit_.id))["kind"] == "logic"


async def test_action_is_moved_in_the_list_and_back_by_one_undo(work: Work) -> None:
    page = work.screen.page
    first, second, third = [await work.add(name, "flow/wait", "good") for name in ("one", "two", "three")]
    start = (await work.saved()).logic[0]
    for pair in ((start.start, first), (first, second), (second, third), (third, start.end)):
        if pair[0] == "START":
            await work.client.call("UpdateLogicItem", rpc.UpdateLogicItemArgs(start.id, *pair))
        else:
            await work.client.call("AddLogicItem", rpc.AddLogicItemArgs(*pair))

    async def order() -> list[str]:
        steps = {item.start: item.end for item in (await work.saved()).logic if not item.condition}
        return [first, *(steps[each] for each in (first, steps.get(first, "")) if each in steps)]

    await work.tool(texts.PROGRAM)
    await work.mode("Actions")
    await work.tap_button("Move three")
    await work.tap_button("Move three up")
    await until(lambda: _equals(order(), [first, third, second]), "the action is moved", 20)
    await work.screen.picture("program list")
    assert await work.screen.faults() == []
    await page.get_by_role("button", name=re.compile("^Undo")).click()
    await until(lambda: _equals(order(), [first, second, third]), "the move is undone", 20)


async def _equals(found: Awaitable[list[str]], wanted: list[str]) -> bool:
    return await found == wanted


async def wait_until_still(shown: Locator) -> None:
    """Wait until an element has not moved for longer than the graph takes to move to another view."""

    async def is_still() -> bool:
        before = await shown.bounding_box()
        await asyncio.sleep(0.3)
        return await shown.bounding_box() == before

    await until(is_still, "the graph has stopped moving")


async def test_graph_does_not_move_under_a_tap(work: Work) -> None:
    """Additions of other users are laid out after the release."""
    screen, page = work.screen, work.screen.page
    await work.add("surely", "robot/get_digital_input", "good", "sure", number=number(2))
    await work.screen.close_panels()
    await work.mode("Flow")
    graph = page.get_by_role("region", name=texts.GRAPH)
    await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()
    output = graph.get_by_role("button", name="surely: yes", exact=True)
    await wait_until_still(output)
    await output.hover()
    await page.mouse.down()
    at = await output.bounding_box()
    meanwhile = await work.add("meanwhile", "flow/wait", "bad")
    await screen.item(meanwhile)
    await screen.settle()
    assert await output.bounding_box() == at
    await page.mouse.up()
    await page.get_by_role("status").filter(has_text="Tap the step that follows surely").wait_for()
    await graph.locator('.react-flow__node[aria-label^="meanwhile,"]').wait_for()
    await page.keyboard.press("Escape")


async def test_straight_sequences_are_folded_except_around_the_selection(work: Work) -> None:
    screen, page = work.screen, work.screen.page
    names = ("first", "second", "third")
    first, second, third = [await work.add(name, "flow/wait", "good") for name in names]
    lead = await work.add("lead", "flow/wait", "bad")
    head = work.action("into_bad_box").id
    last = next(each for each in work.project.logic if each.start == head)
    connections = [(first, second), (second, third), (third, "END")]
    for start, end in connections:
        await work.client.call("AddLogicItem", rpc.AddLogicItemArgs(start, end))
    await work.client.call("UpdateLogicItem", rpc.UpdateLogicItemArgs(last.id, last.start, first))
    await work.mode("Flow")
    graph = page.get_by_role("region", name=texts.GRAPH)
    await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()
    await graph.locator('.react-flow__node[aria-label^="second,"] .flow-name').click()
    await work.tap_button("Fold 4 actions in the graph", work.panel)
    folded = graph.locator('.react-flow__node[aria-label="4 actions, folded, into_bad_box, first, second, third"]')
    await folded.wait_for()
    inner = graph.locator('.react-flow__node[aria-label^="second,"]')
    await expect(inner).to_have_count(0)
    await screen.picture("program folded")
    # A selected action is unfolded, and folded again when deselected.
    await work.select("second")
    await inner.wait_for()
    await expect(folded).to_have_count(0)
    await work.screen.close_panels()
    await folded.wait_for()
    # A connection to the folded sequence leads to its first action.
    await work.tap_button("lead: next", graph)
    await folded.locator(".flow-name").click()
    step = await work.next_event("LogicItemChanged", lambda event: event.data.start == lead)
    assert step.data.end == head
    # A sequence with a fault is unfolded as well. Here the fault is a removed step.
    out = next(each for each in (await work.saved()).logic if each.start == third)
    await work.client.call("RemoveLogicItem", rpc.RemoveLogicItemArgs(out.id))
    await work.screen.close_panels()
    await inner.wait_for()
    await work.client.call("AddLogicItem", rpc.AddLogicItemArgs(third, "END"))
    await folded.wait_for()
    # The folding is stored per user until it is switched off.
    await work.mode("3D")
    await work.mode("Flow")
    await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()
    await folded.locator(".flow-name").click()
    await inner.wait_for()
    await work.mode("3D")


async def test_action_is_renamed_and_duplicated(work: Work) -> None:
    page = work.screen.page
    source = await work.add("look_there", "robot/get_digital_input", "good", "seen", number=number(3))
    await work.select("look_there")
    await work.tap_button("Rename", work.panel)
    name = work.panel.get_by_label("New name")
    await name.fill("scan")
    await name.press("Enter")
    await expect(work.panel.get_by_role("alert")).to_contain_text("already an action called scan")
    await name.fill("look_here")
    await name.press("Enter")
    renamed = await work.next_event("ActionChanged", lambda event: event.data.name == "look_here")
    assert renamed.change_type is ChangeType.UPDATE_BASE
    await work.panel.get_by_role("heading", name="look_here", exact=True).wait_for()
    await work.tap_button(texts.DUPLICATE, work.panel)
    copy = (await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.ADD)).data
    saved = {each.id: each for point in (await work.saved()).action_points for each in point.actions}
    assert (saved[copy.id].type, saved[copy.id].parameters) == (saved[source].type, [number(3)])
    assert saved[copy.id].flows[0].outputs not in ([], ["seen"]), "the result has no new name"
    await work.panel.get_by_role("heading", name=copy.name, exact=True).wait_for()
    await work.tap_button(texts.REMOVE, work.panel)
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.REMOVE)
    await expect(page.get_by_role("option", name=f"{copy.name} Action")).to_have_count(0)


async def test_removed_action_is_bridged_and_restored_by_one_undo(work: Work) -> None:
    """Until then, the steps to the removed action lead to its successor."""
    page = work.screen.page
    before = await work.saved()
    close, test, after = (work.action(name).id for name in ("close", "test", "open_again"))
    await work.select("test")
    await work.tap_button(texts.REMOVE, work.panel)
    # An action whose result a condition uses is not removed. The message names the action.
    await work.screen.sees("A result of test is used by a condition of the logic")
    assert (await work.saved()).logic == before.logic
    await work.select("close")
    work.taps = 0
    await work.tap_button(texts.REMOVE, work.panel)
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.REMOVE)
    now = await work.saved()
    assert {(each.start, each.end) for each in now.logic if each.end == test} == {(work.action("insert").id, test)}
    assert not [each for each in now.logic if close in (each.start, each.end)]
    await page.get_by_role("button", name="Undo removing the action close").click()
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.ADD)

    async def restored() -> bool:
        return bool((await work.saved()).logic == before.logic)

    await until(restored, "one undo restores the action and its steps")
    assert after in {each.end for each in before.logic}


async def test_steps_in_the_view_can_be_hidden(work: Work) -> None:
    step = work.project.logic[0].id
    await work.screen.item(step)
    await work.tool(texts.PROGRAM)
    await work.mode("Actions")
    drawn = work.panel.get_by_label("Show steps in the 3D view")
    await drawn.click()
    await work.screen.until("id => window.__engine.item(id) === undefined", step)
    await work.screen.item(work.action("scan").id)
    await drawn.click()
    await work.screen.item(step)


async def test_steps_added_in_the_3d_view_get_a_number_condition_and_an_else(work: Work) -> None:
    screen, page = work.screen, work.screen.page
    await work.mode("3D")
    count = await work.add("how_many", "counter/value", "bad", "many")
    three = await work.add("at_three", "flow/wait", "good")
    rest = await work.add("otherwise", "flow/wait", "fixture")
    await work.select("how_many")
    await work.tap_button("Connect", work.panel)
    await page.get_by_role("status").filter(has_text=texts.TAP_NEXT_STEP).wait_for()
    await page.keyboard.press("Escape")
    await expect(page.get_by_role("status").filter(has_text=texts.TAP_NEXT_STEP)).to_have_count(0)
    await work.tap_button("Connect", work.panel)
    await page.evaluate("id => __engine.focus(id)", rest)
    await screen.tap(rest)
    plain = (await work.next_event("LogicItemChanged")).data
    assert (plain.start, plain.end, plain.condition) == (count, rest, UNSET)
    # A second step gets a condition, and the first one becomes the else branch.
    await work.select("how_many")
    await work.tap_button("Connect", work.panel)
    await work.tap_button("at_three", work.panel)
    conditional = (await work.next_event("LogicItemChanged")).data
    assert (conditional.end, conditional.condition.value) == (three, "0")
    value = work.panel.get_by_label("Value of many")
    await value.fill("3")
    await value.press("Enter")
    changed = await work.next_event("LogicItemChanged")
    assert (changed.change_type, changed.data.id) == (ChangeType.UPDATE, conditional.id)
    assert (changed.data.condition.what, changed.data.condition.value) == (f"{count}/default/0", "3")
    await work.select("how_many")
    await work.panel.get_by_text("many = 3").wait_for()
    await work.panel.get_by_text("else").wait_for()


async def test_a_condition_combines_several_comparisons(work: Work) -> None:
    """Combine a range of a number and a result of an earlier action in the panel of the connection."""
    page = work.screen.page
    check = await work.add("check_door", "robot/get_digital_input", "good", "closed", number=number(1))
    count = await work.add("how_many_parts", "counter/value", "bad", "parts")
    few = await work.add("few", "flow/wait", "good")
    rest = await work.add("all_others", "flow/wait", "fixture")
    for start, end in ((check, count), (count, rest), (count, few)):
        condition = rpc.ProjectLogicIf(f"{count}/default/0", "0") if end == few else UNSET
        await work.client.call("AddLogicItem", rpc.AddLogicItemArgs(start, end, condition))
    step = (await work.next_event("LogicItemChanged", lambda event: event.data.end == few)).data
    await work.select("how_many_parts")
    await work.panel.get_by_role("button", name="few").first.click()

    async def changed(holds: Callable[[Any], bool]) -> Any:
        event = await work.next_event(
            "LogicItemChanged", lambda event: event.data.id == step.id and holds(event.data.when)
        )
        return event.data.when

    await work.panel.get_by_label("Comparison", exact=True).select_option(label="from … to below …")
    await changed(lambda when: when.comparisons[0].upper == "1")
    for label, text, name in (("To", "7", "upper"), ("From", "3", "value")):
        field = work.panel.get_by_label(label, exact=True)
        await field.fill(text)
        await field.press("Enter")
        await changed(lambda when, name=name, text=text: getattr(when.comparisons[0], name) == text)
    await work.tap_button("Add a comparison", work.panel)
    await changed(lambda when: len(when.comparisons) == 2)
    second = work.panel.get_by_role("group", name="Comparison 2")
    await second.get_by_label("Comparison 2", exact=True).select_option(label="closed of check_door")
    when = await changed(lambda when: when.comparisons[1].what == f"{check}/default/0")
    assert [(one.what, one.operator, one.value, one.upper) for one in when.comparisons] == [
        (f"{count}/default/0", "[)", "3", "7"),
        (f"{check}/default/0", "==", "true", UNSET),
    ]
    # An empty range is refused at the field.
    field = work.panel.get_by_label("To", exact=True)
    await field.fill("3")
    await field.press("Enter")
    await expect(work.panel.get_by_role("alert").first).to_have_text("the range of parts from 3 to 3 is empty.")
    await field.press("Escape")
    await work.screen.picture("program condition")
    await work.panel.get_by_label("True if").select_option(label="at least one is true")
    await changed(lambda when: when.match == "any")
    await work.select("how_many_parts")
    await work.panel.get_by_text("3 ≤ parts < 7 or closed = yes").wait_for()
    await work.panel.get_by_text("else").wait_for()
    await work.screen.close_panels()
    await work.mode("Flow")
    await page.get_by_role("region", name=texts.GRAPH).get_by_text("3 ≤ parts < 7 or closed = yes").wait_for()
    await work.screen.picture("program condition in the graph")


async def test_program_fault_is_listed_and_leads_to_its_action(work: Work) -> None:
    lonely = await work.add("lonely", "flow/wait", "bad")
    await work.tool(texts.PROGRAM)
    await work.mode("Check")
    fault = work.panel.get_by_role("button", name="lonely is never run: no step leads to it.")
    await fault.click()
    await work.panel.get_by_role("heading", name="lonely", exact=True).wait_for()
    assert (await work.screen.page.evaluate("id => __engine.item(id).visible", lonely)) is True
    await work.tap_button(texts.REMOVE, work.panel)
    removed = await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.REMOVE)
    assert removed.data.id == lonely
    await work.tool(texts.PROGRAM)
    await expect(fault).to_have_count(0)


async def test_device_setting_is_overridden_in_one_project(work: Work) -> None:
    await work.tool(texts.PROGRAM)
    await work.mode(texts.VARIABLES)
    settings = work.panel.get_by_role("region", name="Device settings")
    await settings.get_by_label("Device").select_option(label="tester")
    field = settings.get_by_label("port", exact=True)
    scene_value = await field.input_value()
    await field.fill("1502")
    await field.press("Enter")
    replaced = await work.next_event("OverrideUpdated")
    assert (replaced.change_type, replaced.parent_id) == (ChangeType.ADD, work.object("tester"))
    assert (replaced.data.name, replaced.data.value) == ("port", "1502")
    await settings.get_by_text(f"In the scene: {scene_value}").wait_for()
    await settings.get_by_role("button", name="Reset port to the scene").click()
    assert (await work.next_event("OverrideUpdated")).change_type is ChangeType.REMOVE
    await expect(field).to_have_value(scene_value)


async def test_dragged_start_is_stored_for_all_users(work: Work) -> None:
    page = work.screen.page
    await work.mode("3D")
    await page.evaluate("__engine.focus('START')")
    await work.screen.tap("START")
    await work.panel.get_by_role("heading", name="Start", exact=True).wait_for()
    before = (await work.screen.item("START"))["pose"]["position"]
    box = await page.locator(".view canvas").bounding_box()
    at = (await work.screen.item("START"))["screen"]
    assert box is not None
    await page.mouse.move(box["x"] + at["x"], box["y"] + at["y"])
    await page.mouse.down()
    await page.mouse.move(box["x"] + at["x"] + 60, box["y"] + at["y"] + 30, steps=4)
    await page.mouse.up()
    after = (await work.screen.item("START"))["pose"]["position"]
    assert after["z"] == pytest.approx(before["z"])
    assert math.dist(before.values(), after.values()) > 0.02
    state = await work.client.call("GetViewState", rpc.GetViewStateArgs("shared", work.project.id))  # type: ignore[arg-type]
    assert math.dist(state.values["place/START"].values(), after.values()) < 1e-6


async def test_code_is_edited_and_imported(work: Work) -> None:
    """Errors are shown at their line. The changes are reviewed and imported as one step of undo."""
    page, screen = work.screen.page, work.screen
    await screen.close_panels()
    await work.mode("Code")
    code = page.get_by_role("region", name="Python program")
    await code.get_by_text("def main(res: Resources)").wait_for()
    assert await code.get_by_text("obj_").count() == 0, "ids are shown as names"
    line = code.locator(".cm-line", has_text="reader.scan(")
    await line.click()
    await work.panel.get_by_role("heading", name="scan", exact=True).wait_for()
    await expect(line).to_have_attribute("data-selected", "true")
    await screen.close_panels()
    # A breakpoint at the line.
    box = await line.bounding_box()
    gutter = await code.locator(".cm-breakpoints").bounding_box()
    assert box
    assert gutter
    await page.mouse.click(gutter["x"] + gutter["width"] / 2, box["y"] + box["height"] / 2)
    await expect(code.locator(".breakpoint-dot[data-on=true]")).to_have_count(1)
    shared = await work.client.call("GetBreakpoints")
    assert shared.ids == {work.action("scan").id}  # type: ignore[attr-defined]
    await screen.picture("program code")
    # An error at its line.
    await line.click(position={"x": 60, "y": 5})
    await screen.close_panels()
    await line.click(position={"x": 60, "y": 5})
    await page.keyboard.press("End")
    await page.keyboard.type("\nreader.dance()")
    await code.get_by_role("alert").get_by_text(re.compile("has no action dance")).wait_for()
    await code.locator(".cm-lintRange-error").wait_for()
    for name in ("tablet", "phone"):
        await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
        await screen.settle()
        assert await screen.faults() == []
        await screen.picture(f"program code error {name}")
    await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
    # The draft survives a change of the view. A corrected draft can be imported.
    await work.mode("3D")
    await work.mode("Code")
    wrong = code.locator(".cm-line", has_text="reader.dance()")
    await wrong.click()
    await page.keyboard.press("End")
    for _ in "reader.dance()":
        await page.keyboard.press("Backspace")
    # A completion inserts the call with fields, and the signature is shown while the user types.
    await page.keyboard.type("flow.wa")
    await code.get_by_role("option", name="wait").click()
    await expect(code.locator(".cm-signature strong")).to_contain_text("seconds")
    await page.keyboard.type("0.5")
    await page.keyboard.press("Tab")
    await page.keyboard.type("rest")
    await page.keyboard.press("End")
    await page.keyboard.type("  # until the board is cold")
    await code.get_by_text(re.compile("changes to import")).wait_for()
    await code.get_by_role("button", name="Review and import").click()
    await code.get_by_role("heading", name="Changes in the project").wait_for()
    assert await code.locator("li", has_text="rest").count() >= 1
    await code.locator("li", has_text="Comments and formatting").wait_for()
    for name in ("tablet", "phone"):
        await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
        await screen.settle()
        assert await screen.faults() == []
        await screen.picture(f"program code review {name}")
    await page.emulate_media(color_scheme="dark")
    await screen.picture("program code review dark")
    await page.emulate_media(color_scheme="light")
    await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
    await code.get_by_role("button", name="Import", exact=True).click()
    added = await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.ADD)
    assert added.data.name == "rest"
    await screen.sees("Imported. Undo reverts it in one step.")
    # The comment stays in the generated program.
    comment = code.locator(".cm-line", has_text="# until the board is cold")
    await expect(code.get_by_role("button", name="Review and import")).to_have_count(0)
    await expect(comment).to_contain_text('an="rest"')
    await screen.picture("program code with a comment")
    await page.get_by_role("button", name="Undo").first.click()
    await work.next_event("ActionChanged", lambda event: event.change_type is ChangeType.REMOVE)
    await work.mode("3D")


async def test_program_panel_has_no_layout_faults(work: Work) -> None:
    page, screen = work.screen.page, work.screen
    found: dict[str, list[str]] = {}
    for tab in ("Add", "Actions", "Check", "Variables"):
        await work.tool(texts.PROGRAM)
        await work.mode(tab)
        for name, size in (("tablet", (1280, 800)), ("phone", (390, 844))):
            await page.set_viewport_size({"width": size[0], "height": size[1]})
            await screen.settle()
            if faults := await screen.faults():
                found[f"{tab}, {name}"] = faults
            await screen.picture(f"program {tab} {name}")
    assert found == {}


async def test_messages_cover_no_control(work: Work) -> None:
    """Check the panels and all views on tablets and on a phone."""
    page, screen = work.screen.page, work.screen
    found: dict[str, list[str]] = {}

    async def check(view: str) -> None:
        for name in ("tablet", "ipad", "phone"):
            await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
            await screen.settle()
            if faults := await screen.faults():
                found[f"{view}, {name}"] = faults
            await screen.picture(f"messages {view} {name}")
        await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]

    await work.select("test")
    for _ in range(4):  # refused each time
        await work.tap_button(texts.REMOVE, work.panel)
    messages = page.get_by_role("region", name=texts.MESSAGE_BAR)
    await messages.get_by_text("A result of test is used by a condition of the logic").wait_for()
    await messages.get_by_text(re.compile(r"^\+[3-9]$")).wait_for()
    await check("action")
    await work.tool(texts.PROGRAM)
    await work.mode("Add")
    await check("program")
    await work.tool(texts.ROBOT)
    await check("robot")
    await screen.close_panels()
    for mode in ("3D", "Flow", "Split", "Code"):
        await work.mode(mode)
        await check(mode)
    await work.mode("3D")
    assert found == {}


async def test_project_without_logic_has_no_program(work: Work) -> None:
    """Its actions are executed one by one or by a script; the editor does not require steps."""
    page = work.screen.page
    await work.client.call("CloseProject")
    await work.client.call("NewProject", rpc.NewProjectArgs(work.scene.id, "Loose actions", has_logic=False))
    await page.get_by_role("heading", name="Loose actions").wait_for()
    await work.client.call("AddActionPoint", rpc.AddActionPointArgs("here", Position(0.4, 0.0, 0.2)))
    point = (await work.next_event("ActionPointChanged")).data.id
    flows = [Flow(FlowTypes.DEFAULT, [])]
    args = rpc.AddActionArgs(point, "alone", f"{work.object('flow')}/wait", [], flows)
    await work.client.call("AddAction", args)
    alone = (await work.next_event("ActionChanged")).data.id
    await work.screen.item(alone)
    assert await page.evaluate("['START', 'END'].map((id) => __engine.item(id) ?? null)") == [None, None]
    modes = page.get_by_role("radiogroup", name="View mode").get_by_role("radio")
    assert await modes.all_inner_texts() == ["3D", "Code"]
    await work.select("alone")
    assert await work.panel.get_by_text(texts.NEXT_STEP, exact=True).count() == 0
    await work.panel.get_by_role("button", name="Run to here").click(force=True)
    await work.screen.sees("The project has no program.")
    await work.tool(texts.PROGRAM)
    await work.mode("Check")
    await work.panel.get_by_text(texts.NO_PROBLEMS).wait_for()

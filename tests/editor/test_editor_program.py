"""A program is written in Chromium on the real server: actions, values, steps and branches, faults, code."""

import math
from collections.abc import AsyncIterator
from typing import Any

import msgspec
import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.data import rpc
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.project import ActionParameter
from tests.e2e.harness import Cell
from tests.editor.programming import Work, at_work

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.timeout(180)]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def work(cell: Cell, browser: Browser) -> AsyncIterator[Work]:
    """One project for all tests of the module; each works on actions of its own."""
    async with at_work(cell, browser, ("counter", "CounterActions")) as open_project:
        yield open_project


def number(value: int) -> ActionParameter:
    return ActionParameter("number", "integer", str(value))


def reference(parameter: Any) -> str:
    return str(msgspec.json.decode(parameter.value))


async def test_an_action_where_the_cross_is_takes_two_taps(work: Work) -> None:
    """U-04, X6: the point, its orientation and the action, of which nothing was there."""
    screen = work.screen
    work.taps = 0
    await work.tool("Program")
    await work.mode("Add")
    await screen.page.locator(".crosshair").wait_for()
    aimed = await screen.page.evaluate(
        """() => {
            const box = document.querySelector(".view").getBoundingClientRect();
            const hit = __engine.pick(box.width / 2, box.height / 2, 0).find((each) => each.normal);
            return hit && [hit.point.x, hit.point.y, hit.point.z];
        }"""
    )
    assert aimed, "the view shows the table in its middle"
    await work.tap_button("move Move the TCP to a pose.")
    assert work.taps <= 3
    point = (await work.told("ActionPointChanged")).data
    orientation = (await work.told("OrientationChanged")).data
    action = (await work.told("ActionChanged")).data
    assert math.dist(tuple(point.position), aimed) < 1e-6
    # A tool that stands on the table: its z against the surface's normal.
    assert abs(orientation.orientation.x) == pytest.approx(1, abs=1e-3)
    assert action.type == f"{work.object('robot')}/move"
    given = await work.parameters(action.id)
    assert reference(given["pose"]) == orientation.id
    assert given["speed"].value == "0.25", "what has a default gets it"
    # It is shown, selected, with what it is told beside it.
    assert (await screen.item(action.id))["kind"] == "action"
    await work.panel.get_by_role("heading", name=action.name, exact=True).wait_for()
    await work.panel.get_by_label("speed", exact=True).wait_for()
    await screen.picture("program action")


async def test_values_are_checked_where_they_are_typed_and_by_the_server(work: Work) -> None:
    action = await work.add("probe", "robot/get_digital_input", "feeder", "probed", number=number(1))
    await work.select("probe")
    field = work.panel.get_by_label("number", exact=True)
    await field.fill("1.5")
    await field.press("Enter")
    await expect(work.panel.get_by_role("alert")).to_have_text("Type a whole number.")
    await field.fill("3")
    await field.press("Enter")
    await work.told("ActionChanged", lambda event: event.change_type is ChangeType.UPDATE)
    assert (await work.parameters(action))["number"] == number(3)
    # Somebody else has it in hand: refused, said at the field, and what was typed stays.
    await work.client.call("WriteLock", rpc.WriteLockArgs(action))
    await field.fill("4")
    await field.press("Enter")
    await expect(work.panel.get_by_role("alert")).to_contain_text("colleague")
    await expect(field).to_have_value("4")
    await field.press("Escape")
    await expect(field).to_have_value("3")
    await work.client.call("WriteUnlock", rpc.WriteUnlockArgs(action))
    # From now on a value of the whole program, made on the spot.
    await work.panel.get_by_role("radiogroup", name="Where number comes from").get_by_text("Project").click()
    await field.select_option(label="New, with the present value…")
    made = (await work.told("ProjectParameterChanged")).data
    assert (made.name, made.type, made.value) == ("number", "integer", "3")
    await work.told("ActionChanged", lambda event: event.change_type is ChangeType.UPDATE)
    linked = (await work.parameters(action))["number"]
    assert (linked.type, reference(linked)) == ("project_parameter", made.id)
    await work.tool("Program")
    await work.mode("Values")
    constant = work.panel.get_by_role("region", name="number")
    await constant.get_by_role("button", name="probe", exact=True).wait_for()
    # What is used cannot go, and says by whom.
    await constant.get_by_role("button", name="Remove number").click(force=True)
    await work.screen.sees("It is used by probe.")


async def test_a_result_of_an_earlier_action_can_be_used_and_of_a_later_one_not(work: Work) -> None:
    first = await work.add("count_up", "counter/increment", "feeder", "so_many")
    second = await work.add("take_off", "counter/decrement", "feeder", "left_over")
    await work.client.call("AddLogicItem", rpc.AddLogicItemArgs(first, second))
    await work.told("LogicItemChanged")
    await work.select("count_up")
    await work.panel.get_by_role("radiogroup", name="Where by comes from").get_by_text("Project").wait_for()
    assert await work.panel.get_by_text("Result", exact=True).count() == 0
    await work.select("take_off")
    await work.panel.get_by_role("radiogroup", name="Where by comes from").get_by_text("Result").click()
    await work.panel.get_by_label("by", exact=True).select_option(label="so_many of count_up")
    await work.told("ActionChanged", lambda event: event.change_type is ChangeType.UPDATE)
    linked = (await work.parameters(second))["by"]
    assert (linked.type, reference(linked)) == ("link", f"{first}/default/0")


async def test_a_branch_takes_four_taps_and_a_step_two(work: Work) -> None:
    """U-05, U-06: in the graph; the step that is changed stays the same one."""
    screen, page = work.screen, work.screen.page
    check = await work.add("check_input", "robot/get_digital_input", "good", "there", number=number(1))
    yes = await work.add("on_yes", "flow/wait", "good")
    no = await work.add("on_no", "flow/wait", "bad")
    await page.get_by_role("button", name="Close the panel").click()
    await work.mode("Flow")
    graph = page.get_by_role("region", name="The program as a graph")

    async def node(name: str) -> None:
        work.taps += 1
        await graph.locator(f'.react-flow__node[aria-label^="{name},"] .flow-name').click()

    work.taps = 0
    await work.tap_button("check_input: yes", graph)
    await page.get_by_role("status").filter(has_text="Tap what follows check_input").wait_for()
    await node("on_yes")
    step = (await work.told("LogicItemChanged")).data
    await work.tap_button("check_input: no", graph)
    await node("on_no")
    other = (await work.told("LogicItemChanged")).data
    assert work.taps <= 5
    assert [(each.start, each.end, each.condition.what, each.condition.value) for each in (step, other)] == [
        (check, yes, f"{check}/default/0", "true"),
        (check, no, f"{check}/default/0", "false"),
    ]
    work.taps = 0
    await work.tap_button("on_yes: next", graph)
    await node("on_no")
    joined = (await work.told("LogicItemChanged")).data
    assert work.taps == 2
    assert (joined.start, joined.end, joined.condition) == (yes, no, UNSET)
    # What leads nowhere good is refused in words, and nothing is asked of the server.
    await work.tap_button("on_no: next", graph)
    await node("check_input")
    await screen.sees("It would close a loop.")
    # In grey print, too, the branches look different.
    await screen.until(
        """ids => {
            const lines = ids.map((id) => document.querySelector(`.react-flow__edge[data-id="${id}"] path`));
            if (!lines.every(Boolean)) return false;
            return new Set(lines.map((each) => getComputedStyle(each).strokeDasharray)).size === 3;
        }""",
        [step.id, other.id, joined.id],
    )
    # Lead the step elsewhere: the same one, never gone meanwhile.
    await graph.locator(f"[data-id='{joined.id}'] .react-flow__edge-interaction").click(force=True)
    await work.tap_button("Lead elsewhere", work.panel)
    await graph.locator('.react-flow__node[data-id="END"] .flow-name').click()
    moved = await work.told("LogicItemChanged")
    assert (moved.change_type, moved.data.id, moved.data.end) == (ChangeType.UPDATE, joined.id, "END")
    await screen.picture("program graph")
    await work.mode("3D")


async def test_a_step_in_the_view_and_a_condition_on_an_integer_with_else(work: Work) -> None:
    screen, page = work.screen, work.screen.page
    await work.mode("3D")
    count = await work.add("how_many", "counter/value", "bad", "many")
    three = await work.add("at_three", "flow/wait", "good")
    rest = await work.add("otherwise", "flow/wait", "fixture")
    await work.select("how_many")
    await work.tap_button("Connect", work.panel)
    await page.get_by_role("status").filter(has_text="Tap what follows").wait_for()
    await page.keyboard.press("Escape")
    await expect(page.get_by_role("status").filter(has_text="Tap what follows")).to_have_count(0)
    await work.tap_button("Connect", work.panel)
    await page.evaluate("id => __engine.focus(id)", rest)
    await screen.tap(rest)
    plain = (await work.told("LogicItemChanged")).data
    assert (plain.start, plain.end, plain.condition) == (count, rest, UNSET)
    # Beside it one that asks for a number: the first one becomes what is done otherwise.
    await work.select("how_many")
    await work.tap_button("Connect", work.panel)
    await work.tap_button("at_three", work.panel)
    asked = (await work.told("LogicItemChanged")).data
    assert (asked.end, asked.condition.value) == (three, "0")
    value = work.panel.get_by_label("and is taken when many is")
    await value.fill("3")
    await value.press("Enter")
    changed = await work.told("LogicItemChanged")
    assert (changed.change_type, changed.data.id) == (ChangeType.UPDATE, asked.id)
    assert (changed.data.condition.what, changed.data.condition.value) == (f"{count}/default/0", "3")
    await work.select("how_many")
    await work.panel.get_by_text("many = 3").wait_for()
    await work.panel.get_by_text("else").wait_for()


async def test_a_fault_is_listed_and_leads_to_where_it_is(work: Work) -> None:
    lonely = await work.add("lonely", "flow/wait", "bad")
    await work.tool("Program")
    await work.mode("Check")
    fault = work.panel.get_by_role("button", name="lonely is never run: nothing leads to it.")
    await fault.click()
    await work.panel.get_by_role("heading", name="lonely", exact=True).wait_for()
    assert (await work.screen.page.evaluate("id => __engine.item(id).visible", lonely)) is True
    await work.tap_button("Remove", work.panel)
    gone = await work.told("ActionChanged", lambda event: event.change_type is ChangeType.REMOVE)
    assert gone.data.id == lonely
    await work.tool("Program")
    await expect(fault).to_have_count(0)


async def test_a_setting_of_a_device_is_replaced_in_this_project_alone(work: Work) -> None:
    await work.tool("Program")
    await work.mode("Values")
    settings = work.panel.get_by_role("region", name="Settings of devices in this project")
    await settings.get_by_label("Device").select_option(label="tester")
    field = settings.get_by_label("port", exact=True)
    scenes = await field.input_value()
    await field.fill("1502")
    await field.press("Enter")
    replaced = await work.told("OverrideUpdated")
    assert (replaced.change_type, replaced.parent_id) == (ChangeType.ADD, work.object("tester"))
    assert (replaced.data.name, replaced.data.value) == ("port", "1502")
    await settings.get_by_text(f"instead of {scenes} in the scene").wait_for()
    await settings.get_by_role("button", name="port as in the scene").click()
    assert (await work.told("OverrideUpdated")).change_type is ChangeType.REMOVE
    await expect(field).to_have_value(scenes)


async def test_start_stands_where_somebody_puts_it_for_all(work: Work) -> None:
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
    kept = await work.client.call("GetViewState", rpc.GetViewStateArgs("shared", work.project.id))  # type: ignore[arg-type]
    assert math.dist(kept.values["place/START"].values(), after.values()) < 1e-6


async def test_the_code_is_what_the_server_builds_and_knows_the_actions(work: Work) -> None:
    """E-15: of what is saved, which is said while it is older than what is shown."""
    page = work.screen.page
    await work.add("newer", "flow/wait", "bad")
    await page.get_by_role("button", name="Close the panel").click()
    await work.mode("Code")
    code = page.get_by_role("region", name="The program as Python")
    await code.get_by_text("This is the program as it was saved.").wait_for()
    await code.get_by_text("def main(res: Resources)").wait_for()
    line = code.locator("li", has_text="reader.scan(")
    await line.click()
    await work.panel.get_by_role("heading", name="scan", exact=True).wait_for()
    await expect(line).to_have_attribute("data-selected", "true")
    await work.screen.picture("program code")
    await work.mode("3D")


async def test_nothing_of_it_is_too_small_covered_or_off_the_screen(work: Work) -> None:
    page, screen = work.screen.page, work.screen
    found: dict[str, list[str]] = {}
    for tab in ("Add", "Actions", "Check", "Values"):
        await work.tool("Program")
        await work.mode(tab)
        for name, size in (("tablet", (1280, 800)), ("phone", (390, 844))):
            await page.set_viewport_size({"width": size[0], "height": size[1]})
            await screen.settle()
            if faults := await screen.faults():
                found[f"{tab}, {name}"] = faults
            await screen.picture(f"program {tab} {name}")
    assert found == {}

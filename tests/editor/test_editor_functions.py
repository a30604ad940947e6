"""Functions: made from selected actions, called again with another value, opened, and run with a breakpoint inside."""

import json
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.data import rpc
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.project import ActionParameter, Flow, Project
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.programming import Work, project_on_screen

pytestmark = pytest.mark.asyncio(loop_scope="session")

START_TIMEOUT = 60_000
"""Timeout for a program to start, ms. On a busy machine, building it and starting its host take long."""


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def opened(module_cell: Cell, browser: Browser) -> AsyncIterator[Work]:
    async with project_on_screen(module_cell, browser) as open_project:
        yield open_project


@pytest_asyncio.fixture(loop_scope="session")
async def work(opened: Work) -> Work:
    """The project is open and offline, in the 3D view, with all panels closed."""
    await opened.start()
    return opened


async def _skip_scan(work: Work) -> None:
    """Let the program skip the reader, which has no code in front of it."""
    first = next(item for item in work.project.logic if item.end == work.action("scan").id)
    args = rpc.UpdateLogicItemArgs(first.id, first.start, work.action("open").id, first.condition)
    await work.client.call("UpdateLogicItem", args)


def _functions(project: Project) -> dict[str, list[str]]:
    return {each.name: [action.name for action in each.actions] for each in project.functions}


async def test_selected_actions_become_a_function_that_is_called_again(work: Work, tmp_path: Path) -> None:
    screen, page, panel = work.screen, work.screen.page, work.panel
    await _skip_scan(work)
    await work.mode("Flow")
    graph = page.get_by_role("region", name=texts.GRAPH)

    def node(name: str) -> str:
        return f'.react-flow__node:is([aria-label^="{name},"], [aria-label="{name}"])'

    async def tap(name: str) -> None:
        await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()
        await screen.settle()
        await graph.locator(node(name)).click()

    # The first and the last action select those between.
    await graph.get_by_role("button", name=texts.SELECT_SEVERAL).click()
    await graph.locator(node("open")).click()
    await graph.locator(node("test")).click()
    banner = page.get_by_role("group", name="Make a function")
    await banner.get_by_text("5 actions selected").wait_for()
    await screen.picture("function selected")
    assert await screen.faults() == []
    await banner.get_by_role("button", name="Make a function").click()
    dialog = page.get_by_role("dialog")
    assert await dialog.get_by_label("Name of the function").input_value() == "do_open_to_test"
    await dialog.get_by_label("Name of the function").fill("check_board")
    await dialog.get_by_role("button", name="Make a function").click()
    call = graph.locator(node("check_board"))
    await expect(call).to_contain_text("function check_board")
    await panel.get_by_role("button", name="Open function").wait_for()
    stored = await work.saved()
    assert _functions(stored) == {"check_board": ["open", "pick", "insert", "close", "test"]}

    # One step of undo.
    await page.keyboard.press("Control+z")
    await graph.locator(node("insert")).wait_for()
    await expect(call).to_have_count(0)
    assert _functions(await work.saved()) == {}
    await page.keyboard.press("Control+Shift+z")
    await call.wait_for()
    await tap("check_board")

    # Open the function: a value becomes a parameter.
    await panel.get_by_role("button", name="Open function").click()
    crumbs = page.get_by_role("navigation", name="Open function")
    await expect(crumbs).to_contain_text("check_board")
    await expect(graph.locator(".react-flow__node")).to_have_count(7)
    await tap("test")
    await panel.get_by_role("radiogroup", name="Source of program").get_by_text("Parameter").click()
    await panel.get_by_label("program", exact=True).select_option("New parameter…")
    await expect(graph.locator(node("test"))).to_contain_text("program program")
    await screen.picture("function open")
    assert await screen.faults() == []
    test = next(action for action in (await work.saved()).functions[0].actions if action.name == "test")
    assert [(each.type, each.value) for each in test.parameters] == [("function_parameter", '"program"')]

    # Its start shows the parameters, its end the results.
    await tap("Start")
    await expect(panel.get_by_role("region", name="Parameters of the function")).to_contain_text("Used by")
    await tap("End")
    await expect(panel.get_by_role("region", name="Results of the function")).to_contain_text("passed of test")

    # Call it again with another value.
    await crumbs.get_by_role("button", name="Program").tap()
    await call.wait_for()
    await tap("check_board")
    await expect(panel.get_by_label("program", exact=True)).to_have_value("1")
    await work.tool(texts.PROGRAM)
    await work.mode("Add")
    await panel.get_by_label("Follows").select_option("check_board")
    await panel.get_by_role("region", name="Functions").locator(".offer").click()
    await panel.get_by_role("button", name="Set parameters").click()
    await panel.get_by_label("program", exact=True).fill("2")
    await panel.get_by_label("program", exact=True).press("Enter")
    second_call = graph.locator(node("check_board_2"))
    await expect(second_call).to_contain_text("program 2")
    calls = [each for each in (await work.saved()).all_actions() if each.name.startswith("check_board")]
    assert sorted(each.parameters[0].value for each in calls) == ["1", "2"]

    # The 3D view shows the value at the puck, where it can be changed.
    await work.mode("3D")
    values = page.get_by_role("group", name="Values of check_board_2")
    await values.get_by_role("button", name="program 2").tap()
    await values.get_by_label("program", exact=True).fill("3")
    await values.get_by_label("program", exact=True).press("Enter")
    await expect(panel.get_by_label("program", exact=True)).to_have_value("3")
    await screen.picture("function values")
    assert await screen.faults() == []
    await values.get_by_label("program", exact=True).fill("2")
    await values.get_by_label("program", exact=True).press("Enter")
    await values.get_by_role("button", name="Close the values").tap()
    await expect(values).to_contain_text("program 2")
    await work.mode("Flow")

    # Another user renames it.
    function_id = (await work.saved()).functions[0].id
    await work.client.call("RenameFunction", rpc.RenameFunctionArgs(function_id, "check"))
    await expect(second_call).to_contain_text("function check")

    # Export, and import as a copy.
    menu = panel.get_by_role("button", name="Function check", exact=True)
    await menu.click()
    async with page.expect_download() as download:
        await page.get_by_role("menuitem", name="Export to a file").click()
    path = tmp_path / "check.json"
    await (await download.value).save_as(path)
    assert [each["name"] for each in json.loads(path.read_text())["functions"]] == ["check"]
    await work.tool(texts.PROGRAM)
    async with page.expect_file_chooser() as chooser:
        await panel.get_by_role("button", name="Import a function").click()
    await (await chooser.value).set_files(path)
    await expect(crumbs).to_contain_text("check_2")
    assert sorted(_functions(await work.saved())) == ["check", "check_2"]

    # The menu of the copy. A parameter takes the enumeration of an action.
    async def choose(function: str, item: str) -> None:
        await crumbs.get_by_role("button", name=f"Function {function}", exact=True).click()
        await page.get_by_role("menuitem", name=item).click()

    await choose("check_2", "Rename")
    await dialog.get_by_role("textbox").fill("other")
    await dialog.get_by_role("button", name="Rename").click()
    await expect(crumbs).to_contain_text("other")
    await choose("other", "Duplicate")
    await expect(crumbs).to_contain_text("other_2")
    other = next(each for each in (await work.saved()).functions if each.name == "other_2")
    orientation = work.project.action_points[0].orientations[0].id
    move = [
        ActionParameter("pose", "pose", json.dumps(orientation)),
        ActionParameter("move_type", "string_enum", '"linear"'),
        ActionParameter("speed", "double", "0.5"),
        ActionParameter("acceleration", "double", "0.5"),
    ]
    kind = f"{work.object('robot')}/move"
    await work.client.call("AddAction", rpc.AddActionArgs(other.id, "approach", kind, move, [Flow()]))
    await choose("other_2", "Parameters")
    await panel.get_by_role("button", name="Add a parameter").click()
    added = panel.get_by_role("region", name="value", exact=True)
    await added.get_by_label("Type").select_option("choice: move type of approach")
    await added.get_by_role("button", name="approach").wait_for()
    other = next(each for each in (await work.saved()).functions if each.id == other.id)
    assert [(each.name, each.type) for each in other.parameters][-1] == ("value", "string_enum")
    assert ActionParameter("move_type", "function_parameter", '"value"') in other.actions[-1].parameters
    await screen.picture("function enumeration")
    await choose("other_2", "Remove")
    await expect(crumbs).to_have_count(0)
    assert sorted(_functions(await work.saved())) == ["check", "other"]

    # The program pauses at a breakpoint inside the function. The call is shown as running.
    await tap("check_board")
    await panel.get_by_role("button", name="Open function").click()
    await graph.locator(node("open")).wait_for()
    await tap("open")
    await work.tap_button("Run to here", panel)
    bar = page.get_by_role("group", name=texts.PROGRAM_STATE)
    await expect(bar).to_contain_text("before check_board › open", timeout=START_TIMEOUT)
    await work.next_event("PackageState", lambda event: event.data.state is PackageStateEnum.PAUSED)
    await expect(graph.locator(node("open"))).to_contain_text("next")
    await bar.get_by_role("button", name="Step out").wait_for()
    await screen.picture("function paused")
    await crumbs.get_by_role("button", name="Back").click()
    await expect(graph.locator('.flow-node.call[data-running="true"]')).to_have_count(1)
    await bar.get_by_role("button", name="Show", exact=True).click()
    await expect(crumbs).to_contain_text("check")
    await bar.get_by_role("button", name=texts.STOP).click()

    async def stopped() -> bool:
        return await bar.count() == 0

    await until(stopped, "the program has stopped")

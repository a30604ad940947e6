"""Parallel calls: two calls run at once, shown as one node with branches, and stepped branch by branch."""

import re
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.data import rpc
from arcor2_hw.data.package import PackageStateEnum
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.programming import Work, project_on_screen
from tests.editor.screen import VIEWPORTS
from tests.editor.test_editor_functions import START_TIMEOUT, _skip_scan

pytestmark = pytest.mark.asyncio(loop_scope="session")


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def opened(module_cell: Cell, browser: Browser) -> AsyncIterator[Work]:
    async with project_on_screen(module_cell, browser) as open_project:
        yield open_project


@pytest_asyncio.fixture(loop_scope="session")
async def work(opened: Work) -> Work:
    """The project is open and offline; open, pick and insert are calls of functions."""
    await opened.start()
    await _skip_scan(opened)
    for name, action in (("open_lid", "open"), ("fetch", "pick"), ("put_in", "insert")):
        await opened.client.call("MakeFunction", rpc.MakeFunctionArgs(name, [opened.action(action).id]))
    return opened


async def test_parallel_calls_are_shown_and_stepped_branch_by_branch(work: Work) -> None:
    screen, page, panel = work.screen, work.screen.page, work.panel
    await work.mode("Flow")
    graph = page.get_by_role("region", name=texts.GRAPH)

    def node(name: str) -> str:
        return f'.react-flow__node:is([aria-label^="{name},"], [aria-label="{name}"])'

    async def show_whole_program() -> None:
        await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()
        await screen.settle()

    # Calls that use the same device are refused at the selection.
    await graph.locator(node("put_in")).wait_for()
    await graph.get_by_role("button", name=texts.SELECT_SEVERAL).click()
    await graph.locator(node("fetch")).click()
    await graph.locator(node("put_in")).click()
    banner = page.get_by_role("group", name="Make a function")
    await expect(banner).to_contain_text("fetch and put_in both use")
    await expect(banner.get_by_role("button", name=re.compile("^Run in parallel"))).to_have_attribute(
        "aria-disabled", "true"
    )

    # Other calls become one node with two branches.
    await graph.locator(node("put_in")).click()
    await graph.locator(node("open_lid")).click()
    await banner.get_by_text("2 actions selected").wait_for()
    await screen.picture("parallel selected")
    assert await screen.faults() == []
    await banner.get_by_role("button", name="Run in parallel", exact=True).click()
    dialog = page.get_by_role("dialog")
    await dialog.get_by_role("textbox").fill("prepare")
    await dialog.get_by_role("button", name="Run in parallel").click()
    both = graph.locator(node("prepare"))
    await expect(both.locator(".flow-lane")).to_have_count(2)
    await expect(graph.locator(node("fetch"))).to_have_count(0)
    branches = panel.get_by_role("region", name="Branches")
    await expect(branches.get_by_role("listitem")).to_have_count(2)
    await show_whole_program()
    await screen.picture("parallel node")
    assert await screen.faults() == []
    stored = await work.saved()
    calls = {each.id: each.name for each in stored.all_actions()}
    prepare = next(each for each in stored.all_actions() if each.name == "prepare")
    assert [calls[each] for each in prepare.branches or []] == ["open_lid", "fetch"]
    await screen.item(prepare.id)
    assert not await page.evaluate("(id) => Boolean(__engine.item(id))", prepare.branches[0])  # type: ignore[index]

    # The panel offers functions of other devices only, and changes the branches by one step of undo each.
    await work.client.call("MakeFunction", rpc.MakeFunctionArgs("grip", [work.action("close").id]))
    offer = branches.get_by_label("Add a branch")
    await expect(offer.locator("option")).to_have_count(1)
    timer = await work.client.call("AddFunction", rpc.AddFunctionArgs("wait"))
    await offer.select_option("wait")
    await expect(both.locator(".flow-lane")).to_have_count(3)
    await branches.get_by_role("button", name="Remove wait").click()
    await expect(both.locator(".flow-lane")).to_have_count(2)
    assert timer.id in {each.id for each in (await work.saved()).functions}
    assert [each.name for each in (await work.saved()).all_actions() if each.name == "wait"] == []

    # On a phone, nothing covers the buttons of the graph below the 3D view.
    await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
    await work.mode("Split")
    await screen.settle()
    await screen.picture("parallel phone")
    assert await screen.faults() == []
    await work.mode("Flow")
    await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]

    # The list shows the branches below the parallel action.
    await work.tool(texts.PROGRAM)
    await work.mode("Actions")
    await expect(panel.locator("li[data-lane] .step-name")).to_have_text(["open_lid", "fetch"])
    await screen.picture("parallel list")
    assert await screen.faults() == []

    # A breakpoint in one branch pauses both; a step continues one.
    await both.locator(".flow-lane").first.click()
    await panel.get_by_role("button", name="Branch of prepare", exact=True).wait_for()
    await panel.get_by_role("button", name="Open function").click()
    await graph.locator(node("open")).click()
    await work.tap_button("Run to here", panel)
    lanes = page.get_by_role("list", name="Branches")
    await expect(lanes.get_by_role("listitem", name="open_lid")).to_contain_text("before open", timeout=START_TIMEOUT)
    await expect(lanes.get_by_role("listitem", name="fetch")).to_contain_text(re.compile("waiting|before pick"))
    await work.next_event("PackageState", lambda event: event.data.state is PackageStateEnum.PAUSED)
    await page.get_by_role("navigation", name="Open function").get_by_role("button", name="Back").click()
    await expect(both.locator('.flow-lane[data-running="true"]')).to_have_count(2)
    await screen.settle()
    await screen.picture("parallel paused")
    assert await screen.faults() == []
    await lanes.get_by_role("button", name="Step open_lid").click()
    await expect(lanes.get_by_role("listitem")).to_have_count(1, timeout=START_TIMEOUT)
    await expect(lanes.get_by_role("listitem", name="fetch")).to_contain_text(re.compile("waiting|before pick"))
    bar = page.get_by_role("group", name=texts.PROGRAM_STATE)
    await bar.get_by_role("button", name=texts.STOP).click()

    async def stopped() -> bool:
        return await bar.count() == 0

    await until(stopped, "the program has stopped")
    # Make the calls run one after the other again.
    await both.locator(".flow-title").first.click()
    await panel.get_by_role("button", name="Run one after the other").click()
    await graph.locator(node("fetch")).wait_for()
    await expect(both).to_have_count(0)

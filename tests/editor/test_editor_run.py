"""Running a program: breakpoints, steps, failures, users who join meanwhile."""

from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.project import ActionParameter
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.programming import Work, project_on_screen
from tests.editor.screen import screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

START_TIMEOUT = 60_000
"""Timeout for a program to start, ms. On a busy machine, building it and starting its host take long."""


STORE = '''
from arcor2_hw.actions import action
from arcor2_hw.objects import Generic


class Store(Generic):
    """Shelves whose contents only the device knows."""

    _ABSTRACT = False
    DYNAMIC_PARAMS = {"shelf": ("shelves", set()), "board": ("boards", {"shelf"})}

    def shelves(self) -> set[str]:
        return {"upper", "lower", "cellar"}

    def boards(self, shelf: str) -> set[str]:
        return {f"{shelf} board {number}" for number in range(4)}

    @action
    def fetch(self, shelf: str, board: str, *, an: str | None = None) -> None:
        """Fetch a board."""
'''


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def opened(module_cell: Cell, browser: Browser) -> AsyncIterator[Work]:
    async with httpx.AsyncClient(timeout=60, base_url=module_cell.url.replace("ws", "http", 1)) as rest:
        answer = await rest.put("/object-types", json={"id": "Store", "name": "Store", "source": STORE})
        assert answer.status_code == 200, answer.text
    async with project_on_screen(module_cell, browser, ("store", "Store")) as open_project:
        yield open_project


@pytest_asyncio.fixture(loop_scope="session")
async def work(opened: Work) -> Work:
    """The project is open and offline, in the 3D view, with all panels closed."""
    await opened.start()
    return opened


async def go_online(work: Work) -> None:
    await work.screen.press(texts.GO_ONLINE)
    await work.screen.page.get_by_role("button", name=texts.STOP_MOTION).wait_for()


async def go_offline(work: Work) -> None:
    await work.screen.press(texts.GO_OFFLINE)
    await work.screen.page.get_by_role("button", name=texts.GO_ONLINE, exact=True).wait_for()


async def wait_for_state(work: Work, wanted: PackageStateEnum) -> None:
    await work.next_event("PackageState", lambda event: event.data.state is wanted)


async def has_breakpoints(work: Work, *ids: str) -> bool:
    breakpoints = await work.client.call("GetBreakpoints", rpc.GetBreakpointsArgs(work.project.id))
    return list(breakpoints.ids) == list(ids)


async def test_run_stops_before_an_action_and_a_step_shows_its_failure(work: Work, browser: Browser) -> None:
    """There is no code in front of the reader: the scan fails, and the user sees why."""
    screen, page = work.screen, work.screen.page
    scan = work.action("scan").id
    # In the graph next to the view, a sequence is folded until one of its actions runs.
    await work.mode("Split")
    graph = page.get_by_role("region", name=texts.GRAPH)
    await graph.get_by_role("button", name="Fold sequences").click()
    await graph.locator('.react-flow__node[aria-label^="8 actions, folded, scan, open"]').wait_for()
    await work.select("scan")
    camera_position = await page.evaluate("__engine.view.camera.position.toArray()")
    work.taps = 1  # the tap that selected it
    await work.tap_button("Run to here", work.panel)
    assert work.taps <= 2
    bar = page.get_by_role("group", name=texts.PROGRAM_STATE)
    await bar.get_by_text("before scan").wait_for(timeout=START_TIMEOUT)
    await wait_for_state(work, PackageStateEnum.PAUSED)
    await until(lambda: has_breakpoints(work, scan), "all users have the breakpoint")
    assert await page.evaluate("__engine.view.camera.position.toArray()") == camera_position, "the view has moved"
    await work.tool(texts.RUN)
    trace = work.panel.get_by_role("region", name="Trace")
    await trace.get_by_role("button", name="more_boards").click()
    # Parameters and results.
    await expect(trace).to_contain_text("times")
    await expect(trace).to_contain_text("boards_left")
    await expect(trace.get_by_role("button", name="scan")).to_contain_text("waiting")
    for _ in ("tool", "selection"):
        await page.get_by_role("button", name=texts.CLOSE_PANEL).click()
    scan_node = graph.locator('.react-flow__node[aria-label^="scan,"]')
    await expect(scan_node).to_contain_text("next")
    # The graph shows the running action at a readable size.
    await expect(scan_node).to_be_in_viewport(ratio=1)
    box = await scan_node.bounding_box()
    assert box is not None
    assert box["width"] > 200
    await screen.picture("run paused")
    await work.tool(texts.RUN)

    # A user who joins now sees the same.
    async with screen_of(browser, work.cell.url) as other:
        await other.join("Bert")
        await other.page.get_by_role("group", name=texts.PROGRAM_STATE).get_by_text("before scan").wait_for()
        await other.page.get_by_role("navigation").get_by_role("button", name=texts.RUN, exact=True).click()
        seen = other.page.get_by_role("complementary")
        await seen.get_by_role("button", name="more_boards").wait_for()
        await seen.get_by_role("button", name="Remove breakpoint at scan").wait_for()
        await seen.get_by_role("button", name="Remove breakpoint at scan").click()
        await until(lambda: has_breakpoints(work), "the breakpoint is removed for all users")
    await expect(work.panel.get_by_role("button", name="Remove breakpoint at scan")).to_have_count(0)

    await work.tap_button(texts.STEP, bar)
    card = page.get_by_role("region", name="The program is held")
    await expect(card).to_contain_text("no code was read")
    await expect(bar).to_contain_text("Held")
    await screen.picture("run held")
    await work.tap_button("End the program", card)
    fault = work.panel.get_by_role("region", name="Last run").filter(has_text="Run failed in scan")
    await fault.wait_for()
    await expect(fault).to_contain_text("no code was read")
    await wait_for_state(work, PackageStateEnum.STOPPED)
    await screen.sees("failed")
    assert await page.evaluate("__engine.view.camera.position.toArray()") == camera_position
    await graph.locator('.react-flow__node[aria-label^="8 actions, folded"]').wait_for()
    await screen.picture("run failed")
    # The result stays and leads to the action.
    await work.tap_button("Show scan", fault)
    await work.panel.get_by_role("heading", name="scan", exact=True).wait_for()


async def test_stop_ends_the_run_and_editing_is_possible_again(work: Work) -> None:
    page = work.screen.page
    await work.tool(texts.RUN)
    await work.tap_button(texts.START_PAUSED, work.panel)
    bar = page.get_by_role("group", name=texts.PROGRAM_STATE)
    await bar.get_by_role("button", name=texts.STOP, exact=True).wait_for(timeout=START_TIMEOUT)
    await bar.get_by_text("before more_boards").wait_for()
    # Meanwhile editing is refused with the reason.
    await work.select("test")
    await work.panel.get_by_role("button", name=texts.DUPLICATE).click(force=True)
    await work.screen.sees("Stop the program first.")
    await work.tap_button(texts.STOP, bar)
    assert await page.get_by_role("alertdialog").count() == 0, "a confirmation is requested"
    await wait_for_state(work, PackageStateEnum.STOPPED)
    await bar.wait_for(state="hidden")
    await work.panel.get_by_role("heading", name="test", exact=True).wait_for()
    await expect(work.panel.get_by_role("button", name=texts.DUPLICATE, exact=True)).to_be_enabled()


async def test_single_action_is_executed_and_another_cancelled(work: Work) -> None:
    await go_online(work)
    present = await work.add("look_for_board", "tester/board_present", "fixture", "is_there")
    await work.select("look_for_board")
    await work.tap_button("Try", work.panel)
    result: Any = (await work.next_event("ActionResult")).data
    assert (result.action_id, result.results) == (present, ["false"])
    outcome = work.panel.get_by_role("status").filter(has_text="Done")
    await expect(outcome).to_contain_text("is_there")
    await expect(outcome).to_contain_text("no")
    await work.add("wait_long", "flow/wait", "fixture", seconds=ActionParameter("seconds", "double", "30.0"))
    await work.select("wait_long")
    await work.tap_button("Try", work.panel)
    await work.tap_button(texts.CANCEL, work.panel)
    await work.next_event("ActionCancelled")
    await work.panel.get_by_role("button", name="Try").wait_for()
    await go_offline(work)


async def test_choices_come_from_the_device_and_stay_when_it_is_offline(work: Work) -> None:
    """The second choice depends on the first one."""
    await go_online(work)
    fetch = await work.add(
        "fetch_one",
        "store/fetch",
        "fixture",
        shelf=ActionParameter("shelf", "string", '"upper"'),
        board=ActionParameter("board", "string", '""'),
    )
    await work.select("fetch_one")
    shelf = work.panel.get_by_label("shelf", exact=True)
    board = work.panel.get_by_role("combobox", name="board", exact=True)  # a text field until the choices arrive
    await shelf.get_by_text("lower").click()
    await work.next_event("ActionChanged", lambda event: event.data.name == "fetch_one")
    await board.select_option(label="lower board 2")
    await work.next_event("ActionChanged", lambda event: event.data.name == "fetch_one")
    stored = await work.parameters(fetch)
    assert (stored["shelf"].value, stored["board"].value) == ('"lower"', '"lower board 2"')
    await go_offline(work)
    await expect(work.panel.get_by_text("Last known choices.")).to_have_count(2)
    assert await board.locator("option").all_inner_texts() == [f"lower board {number}" for number in range(4)]
    # The boards of another shelf are not known.
    await shelf.get_by_text("cellar").click()
    await work.panel.get_by_text("Go online to load the choices.").wait_for()


async def test_package_is_built_under_the_proposed_name(work: Work) -> None:
    """Unsaved changes are saved first, as the button says."""
    await work.add("late", "flow/finish", "bad")
    await work.tool(texts.RUN)
    await work.tap_button("Build…", work.panel)
    dialog = work.screen.page.get_by_role("dialog")
    await expect(dialog.get_by_label("Name")).to_have_value(work.project.name)
    await dialog.get_by_role("button", name="Save and build").click()
    await work.screen.sees(f"Package {work.project.name} created.")
    (package,) = await work.client.call("ListPackages")
    assert package.package_meta.name == work.project.name


async def test_a_dry_run_predicts_the_cycle_and_shows_the_failing_action(work: Work) -> None:
    """Nothing moves and the scene stays offline."""
    screen, page = work.screen, work.screen.page
    await work.tool(texts.RUN)
    predicted = work.panel.get_by_role("region", name="Dry run", exact=True)
    await work.tap_button("Dry run", predicted)
    await predicted.get_by_text("No problems found.").wait_for(timeout=START_TIMEOUT)
    await expect(predicted).to_contain_text("Bottleneck")
    chart = predicted.get_by_role("region", name="Chart: Dry run 1")
    robot = chart.get_by_role("img", name="robot: busy for")
    await robot.locator("rect").first.click()
    await predicted.get_by_role("button", name="Show pick").wait_for()
    await work.screen.picture("dry run")

    # An edit makes the result outdated.
    await work.client.write_lock(work.point("good"), lock_tree=True)
    await work.client.update_action_point_position(
        action_point_id=work.point("good"), new_position=Position(0.0, 3.0, 0.1)
    )
    await work.client.write_unlock(work.point("good"))
    await predicted.get_by_text("The program was edited since.").wait_for()
    await work.tap_button("Dry run", predicted)
    problem = predicted.get_by_role("alert")
    await expect(problem).to_contain_text("into_good_box would fail", timeout=START_TIMEOUT)
    await expect(problem).to_contain_text("reaches at most")
    await predicted.get_by_label("Compare with").select_option("dry 1")
    await predicted.get_by_role("table").get_by_text("into_good_box").wait_for()
    await problem.get_by_role("button", name="Show into_good_box").click()
    await page.get_by_role("complementary").get_by_role("heading", name="into_good_box", exact=True).wait_for()

    # On request, the dry run starts at the selected action and takes another branch.
    await work.panel.get_by_role("button", name="Dry run from here").click()
    await predicted.get_by_role("button", name="Dry run from into_good_box").wait_for(timeout=START_TIMEOUT)
    await predicted.get_by_text("Branches", exact=True).click()
    await predicted.get_by_label("take_out").select_option("passed = no → into_bad_box")
    await screen.picture("dry run from here")
    assert await screen.faults() == []
    await work.tap_button("Dry run", predicted)
    await predicted.get_by_text("No problems found.").wait_for(timeout=START_TIMEOUT)

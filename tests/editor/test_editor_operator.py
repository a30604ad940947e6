"""The operator's screen: packages, start, pause, stop and results of runs."""

import contextlib
import json
import re
from collections.abc import AsyncIterator, Iterable, Iterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Error, Locator, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.cell_state import CellAuthority
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.package import PackageStateEnum, PackageSummary
from arcor2_hw.data.project import START, ActionParameter, Flow, Project
from arcor2_hw.data.role import Role
from arcor2_hw.data.scene import Scene
from arcor2_server.access.tokens import TokenFile
from tests.e2e.harness import Cell
from tests.editor import texts
from tests.editor.screen import VIEWPORTS, Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

START_TIMEOUT = 60_000
"""Time until a started program is shown, ms."""


@pytest_asyncio.fixture(loop_scope="session")
async def colleague(cell: Cell) -> AsyncIterator[Client]:
    yield await cell.client("colleague")


async def join_as_operator(screen: Screen, kiosk: bool = False, token: str = "") -> None:
    await screen.join("Olga", f"/?{token and f'token={token}&'}q=low#/operator{'?kiosk' if kiosk else ''}")


@pytest.fixture
def token(cell: Cell, colleague: Client) -> Iterator[str]:
    """Return a token of the role operator. Connected clients do not need it."""
    tokens = TokenFile(cell.data_dir)
    secret = tokens.add("tablet", Role.OPERATOR)[1]
    yield secret
    for each in tokens.all():
        tokens.revoke(each.id)


async def start_with_message(client: Client, scene: Scene, project: Project, method: str, text: str) -> None:
    """Let the open project start with a message or an alarm."""
    flow = next(each.id for each in scene.objects if each.type == "FlowActions")
    first = next(each for each in project.logic if each.start == START)
    point, parameters = project.action_points[0].id, [ActionParameter("text", "string", json.dumps(text))]
    if method == "raise_alarm":
        parameters.append(ActionParameter("level", "string_enum", '"error"'))
    await client.call("AddAction", rpc.AddActionArgs(point, "message", f"{flow}/{method}", parameters, [Flow()]))
    await client.call("SaveProject")
    points = (await client.get_project(project.id)).action_points
    message = next(action.id for each in points for action in each.actions if action.name == "message")
    await client.call("UpdateLogicItem", rpc.UpdateLogicItemArgs(first.id, START, message))
    await client.call("AddLogicItem", rpc.AddLogicItemArgs(message, first.end))
    await client.call("SaveProject")


async def build_package(
    cell: Cell, colleague: Client, message: str = "", method: str = "show_message"
) -> PackageSummary:
    """Build the package of the project and close the project."""
    scene, project = await cell.open(colleague)
    if message:
        await start_with_message(colleague, scene, project, method, message)
    package_id = await cell.build(colleague, project)
    return next(each for each in await colleague.list_packages() if each.id == package_id)


async def check_authority_dialog(screen: Screen, technician: Client, sizes: Iterable[str]) -> None:
    """Open the dialog from the note on the screen. An operator can only read it. It shows changes by a technician."""
    start = screen.page.get_by_role("button", name=re.compile("^Start"))
    await technician.call("SetCellAuthority", rpc.SetCellAuthorityArgs(CellAuthority.NOBODY))
    await expect(start).to_have_attribute("aria-disabled", "true")
    await screen.sees("No program starts until a technician gives the authority")
    await check_layout(screen, "operator, nobody commands", sizes)
    await screen.press("Nobody commands this cell.")
    dialog = screen.page.get_by_role("dialog", name="Mode and authority")
    hub = dialog.get_by_role("button", name=re.compile("^This server"))
    await expect(hub).to_have_attribute("aria-disabled", "true")
    await expect(hub).to_have_attribute("aria-pressed", "false")
    await expect(dialog).to_contain_text("Your role does not allow this.")
    await technician.call("SetCellAuthority", rpc.SetCellAuthorityArgs(CellAuthority.HUB))
    await expect(hub).to_have_attribute("aria-pressed", "true")
    await dialog.get_by_role("button", name="Close").click()
    await expect(screen.page.get_by_role("button", name="Nobody commands this cell.")).to_have_count(0)
    await expect(start).not_to_have_attribute("aria-disabled", "true")


async def test_package_appears_runs_and_its_error_is_shown(
    cell: Cell, colleague: Client, browser: Browser, token: str, sizes: list[str]
) -> None:
    async with screen_of(browser, cell.url, touch=True) as screen:
        page = screen.page
        await join_as_operator(screen, kiosk=True, token=token)
        await screen.sees("No packages yet.")
        assert await page.get_by_role("button", name="Open the editor").count() == 0
        # A package built by another user appears by itself.
        _, project = await cell.open(colleague)
        await cell.build(colleague, project)
        await page.get_by_role("radio", name=project.name).wait_for()
        await check_authority_dialog(screen, colleague, sizes)
        await screen.press("Start")
        await page.get_by_role("button", name=texts.STOP_MOTION).wait_for(timeout=START_TIMEOUT)
        # Without a board, the reader finds no code. The operator enters it.
        card = page.get_by_role("region", name="The program is held")
        await expect(card).to_contain_text("Held at scan", timeout=START_TIMEOUT)
        await expect(card).to_contain_text("no code was read")
        state = page.get_by_role("status", name="State")
        await expect(state).to_have_count(0)
        await expect(page.get_by_role("button", name=texts.RESUME)).to_have_count(0)
        await check_layout(screen, "held", sizes)
        await card.get_by_role("button", name="Enter the result").click()
        code = card.get_by_label("code")
        await code.fill("B-1")
        await check_layout(screen, "held, result", sizes)
        await screen.press("Continue with this result")
        # Nothing can be picked in this cell. The retry asks first and fails again; then the operator ends the program.
        for _ in ("pick", "pick again"):
            await expect(card).to_contain_text("Held at pick", timeout=START_TIMEOUT)
            await card.evaluate("card => { card.dataset.decided = ''; }")
            await card.get_by_role("button", name="Try again").click()
            asked = page.get_by_role("alertdialog", name="Try pick again?")
            await expect(asked).to_contain_text("It may have been executed partly.")
            await asked.get_by_role("button", name="Try again").click()
            await expect(page.locator("[data-decided]")).to_have_count(0)  # the next fault has a new card
        await expect(card).to_contain_text("Held at pick", timeout=START_TIMEOUT)
        # The robot goes into a protective stop, which the operator acknowledges in the card.
        await cell.command_fake("robot", "protective_stop")
        acknowledge = card.get_by_role("button", name="Acknowledge")
        await expect(card).to_contain_text("Find out why the arm was stopped, then acknowledge the protective stop.")
        await check_layout(screen, "held, protective stop", sizes, scrolled="phone")
        while await acknowledge.count():  # the controller refuses for 5 s
            with contextlib.suppress(Error):  # the button is replaced meanwhile
                await acknowledge.click(timeout=2000)
            await screen.settle()
        assert (await cell.command_fake("robot", "truth"))["safety"] == "NORMAL"
        await screen.press("End the program")
        await expect(state).to_contain_text("Run failed in pick")
        await expect(card).to_have_count(0)
        assert [each.end.value for each in (await colleague.call("ListRuns")).runs] == ["failed"]
        await check_layout(screen, "operator", sizes)


async def check_layout(screen: Screen, name: str, sizes: Iterable[str], scrolled: str = "") -> None:
    """Check the layout in these sizes, and take pictures. In the size `scrolled`, faults are allowed."""
    for device in sizes:
        await screen.page.set_viewport_size(VIEWPORTS[device])  # type: ignore[arg-type]
        await screen.settle()
        await screen.picture(f"{name} {device}")
        if device != scrolled:
            assert await screen.faults() == [], device


async def test_failed_run_is_shown_on_every_screen_until_it_is_dismissed(
    cell: Cell, colleague: Client, browser: Browser
) -> None:
    package = await build_package(cell, colleague)
    async with screen_of(browser, cell.url) as watcher, screen_of(browser, cell.url) as operator:
        # A user of the editor watches a run of another user until the server shows the lists again.
        await watcher.join("Wendy")
        await colleague.call("RunPackage", rpc.RunPackageArgs(package.id, start_paused=True))
        await watcher.page.get_by_text("before more_boards").wait_for(timeout=START_TIMEOUT)
        await colleague.call("ResumePackage")
        await watcher.page.get_by_role("heading", name=texts.HOME_HEADING).wait_for()
        banner = watcher.page.get_by_role("alert").filter(has_text="Run failed in scan")
        await expect(banner).to_contain_text("no code was read")
        await expect(banner).to_contain_text(package.package_meta.name)
        await watcher.sees(re.compile(rf"last run {texts.AGO}: failed"))
        await watcher.picture("run failed, lists")

        # An operator who comes later does not see "Ready" either, nor after a reload, until they dismiss the result.
        state = operator.page.get_by_role("status", name="State")
        await join_as_operator(operator)
        for _ in ("first", "reloaded"):
            await expect(state).to_contain_text("Run failed in scan")
            await expect(state).not_to_contain_text("Ready")
            await operator.page.reload()
        # The press counts even if a card that appears meanwhile moves the button away.
        await state.get_by_role("button", name=texts.DISMISS).hover()
        await operator.page.mouse.down()
        await state.evaluate("section => (section.style.marginTop = '300px')")
        await operator.settle()
        await operator.page.mouse.up()
        for _ in ("dismissed", "reloaded"):
            await expect(state).to_contain_text("Ready")
            await expect(state).to_contain_text("failed")
            await operator.page.reload()

        # Each user dismisses it for themselves. The open project still shows the result of its last run.
        await expect(banner).to_be_visible()
        await colleague.call("OpenProject", rpc.IdArgs((await colleague.call("ListProjects"))[0].id))
        await watcher.page.get_by_role("navigation").get_by_role("button", name=texts.RUN, exact=True).click()
        last = watcher.page.get_by_role("region", name="Last run")
        await expect(last).to_contain_text("Run failed in scan")
        await watcher.picture("run failed, project")
        await watcher.press("Dismiss the result")
        await expect(banner).to_have_count(0)
        await watcher.page.reload()
        await watcher.page.get_by_role("navigation").get_by_role("button", name=texts.RUN, exact=True).click()
        await expect(last).to_contain_text("no code was read")
        await expect(banner).to_have_count(0)
        await colleague.call("CloseProject")


async def test_operator_steps_and_stops_a_run_that_another_user_started_paused(
    cell: Cell, colleague: Client, browser: Browser
) -> None:
    package = await build_package(cell, colleague, "Refill the labels.")
    async with screen_of(browser, cell.url) as screen:
        page = screen.page
        await join_as_operator(screen)
        # A run that another user has started paused can be stepped and stopped from here.
        await colleague.call("RunPackage", rpc.RunPackageArgs(package.id, start_paused=True))
        await page.get_by_text("before message").wait_for(timeout=START_TIMEOUT)
        await screen.press(texts.STEP)
        await page.get_by_text("before more_boards").wait_for()
        await page.get_by_text("Refill the labels.").wait_for()
        await screen.picture("operator message")
        await screen.press(texts.STEP)
        await page.get_by_text("before scan").wait_for()
        # The next action is described in words, next to a view of the cell and the counts of this run.
        state = page.get_by_role("status", name="State")
        await expect(state).to_contain_text("reader: Read the code in front of the reader")
        await expect(state).to_contain_text("Press Resume to continue, or Step for one action.")
        numbers = page.get_by_role("region", name="This run")
        await expect(numbers).to_contain_text("Good0Bad0Cycles0")
        shown = await screen.until("window.__engine?.ids().length > 0 && __engine.ids()")
        assert all(each.startswith("obj_") for each in shown), "the view shows only objects"
        for name in ("tablet", "ipad", "phone"):
            await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
            await screen.settle()
            assert await screen.faults() == [], name
            await screen.picture(f"operator, paused {name}")
        await screen.press(texts.STOP)
        while (await colleague.next_event("PackageState")).data.state is not PackageStateEnum.STOPPED:
            pass
        await page.get_by_role("button", name="Start", exact=True).wait_for()
        await screen.sees("Run stopped by Olga")
        await expect(page.get_by_text("Refill the labels.")).to_be_hidden()
        run = (await colleague.call("ListRuns")).runs[0]
        assert (run.end.value, run.stopped_by) == ("stopped", "Olga")
        await screen.press("Open the editor")
        await page.get_by_role("heading", name=texts.HOME_HEADING).wait_for()


async def check_recording(screen: Screen, alarms: Locator, sizes: Iterable[str]) -> None:
    """Open the recording of an alarm, read values, and zoom."""
    page = screen.page
    await alarms.get_by_role("button", name="Recording").first.click()
    window = page.get_by_role("dialog", name="Recording of")
    await expect(window).to_contain_text("The box for bad parts is full.")
    actions = window.get_by_role("region", name="Actions")
    band = actions.get_by_title("message", exact=True)
    await expect(band).to_have_count(1)
    await window.get_by_role("slider", name="Values at").press("ArrowLeft")
    await expect(window).to_contain_text(re.compile(r"−0\.0[12]\ss"))  # at the previous value
    everything = await band.get_attribute("style")
    assert everything is not None
    await window.get_by_role("button", name="Zoom in").click()
    await expect(band).not_to_have_attribute("style", everything)
    for name in sizes:
        await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
        await screen.settle()
        assert await screen.faults() == [], name
        await screen.picture(f"recording {name}")
    assert await screen.barriers() == []
    async with page.expect_download() as download:
        await window.get_by_role("button", name="Export CSV").click()
    exported = await (await download.value).path()
    assert "The box for bad parts is full." in Path(exported).read_text()
    await window.get_by_role("button", name="Close").click()
    await expect(window).to_have_count(0)


async def test_alarm_is_acknowledged_during_a_run(
    cell: Cell, colleague: Client, browser: Browser, token: str, sizes: list[str]
) -> None:
    text = "The box for bad parts is full."
    package = await build_package(cell, colleague, text, "raise_alarm")
    async with screen_of(browser, cell.url, touch=True) as screen:
        page = screen.page
        await join_as_operator(screen, kiosk=True, token=token)
        await colleague.call("RunPackage", rpc.RunPackageArgs(package.id, start_paused=True))
        await page.get_by_text("before message").wait_for(timeout=START_TIMEOUT)
        await screen.press(texts.STEP)
        card = page.get_by_role("region", name="Alarm", exact=True)
        await expect(card.get_by_role("heading", name=text)).to_be_visible()
        await expect(card).to_contain_text("Do what the text says")
        for name in sizes:
            await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
            await screen.settle()
            assert await screen.faults() == [], name
            await screen.picture(f"operator, alarm {name}")
        await card.get_by_role("button", name="Acknowledge").click()
        await expect(card).to_contain_text("acknowledged by Olga")
        await expect(card.get_by_role("button", name="Acknowledge")).to_have_count(0)
        state = page.get_by_role("status", name="State")
        await expect(state).to_contain_text("Paused")
        await screen.press("All alarms")
        everything = page.get_by_role("complementary", name="All alarms")
        await expect(everything).to_contain_text(text)
        await screen.settle()
        assert await screen.faults() == []
        await screen.picture("operator, all alarms")
        # The alarm ends with the program, and is then only in the history.
        await colleague.call("StopPackage")
        await expect(everything).to_contain_text("No alarms.")
        await screen.press("All alarms")
        await page.get_by_role("button", name="Start", exact=True).wait_for()
        await expect(card).to_have_count(0)
        await screen.press("All alarms")
        await everything.get_by_role("radio", name="History").check(force=True)
        await expect(everything).to_contain_text("acknowledged by Olga")
        await check_recording(screen, everything, sizes)
        await everything.get_by_role("radio", name="Statistics").check(force=True)
        await expect(everything).to_contain_text("Most frequent in 7 days")
    # A technician finds the same list in the workplace.
    await cell.open(colleague)
    async with screen_of(browser, cell.url) as screen:
        await screen.join("Theo", f"/?token={TokenFile(cell.data_dir).add('desk', Role.TECHNICIAN)[1]}&q=low")
        await screen.press(texts.DEVICES)
        await screen.page.get_by_text("All alarms", exact=True).click()
        listed = screen.page.get_by_role("group", name="All alarms")
        await listed.get_by_role("radio", name="History").check(force=True)
        await expect(listed).to_contain_text("acknowledged by Olga")
        for name in sizes:
            await screen.page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
            await screen.settle()
            assert await screen.faults() == [], name
            await screen.picture(f"workplace, all alarms {name}")


async def test_operator_takes_over_a_project_left_open_and_locked(
    cell: Cell, colleague: Client, browser: Browser, sizes: list[str]
) -> None:
    await colleague.update_presence(view="test")  # shows no project
    await build_package(cell, colleague)
    async with screen_of(browser, cell.url, touch=True) as screen:
        page = screen.page
        await join_as_operator(screen)
        async with Client(cell.url, "Wendy", reconnect=False) as wendy:
            _, project = await cell.open(wendy)
            point = project.action_points[0]
            await wendy.call("AddActionPoint", rpc.AddActionPointArgs("unsaved", Position()))
            await wendy.call("WriteLock", rpc.WriteLockArgs(point.id))
            start = page.get_by_role("button", name="Start")
            reason = re.compile(rf"not available: {project.name} is open in the editor \(Wendy\)")
            await expect(start).to_have_accessible_name(reason)
        await screen.sees(f"{project.name} is open in the editor. It is closed during the run")
        gone = page.get_by_role("button", name="Wendy left and still holds locks")
        await gone.wait_for()
        asked = page.get_by_role("alertdialog", name="Take over from Wendy?")
        for name in sizes:
            await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
            await screen.settle()
            assert await screen.faults() == [], name
            await screen.picture(f"left open {name}")
            await gone.click()
            await expect(asked).to_contain_text(
                re.compile(rf"lost the connection .* holds:{point.name}, since \d\d:\d\d")
            )
            await screen.settle()
            assert await screen.faults() == [], name
            await screen.picture(f"take over {name}")
            await asked.get_by_role("button", name=texts.CANCEL).click()
        await gone.click()
        await asked.get_by_role("button", name="Take over").click()
        await screen.sees(f"You took over from Wendy: {point.name}.")
        await expect(gone).to_have_count(0)
        await screen.press("Start")
        await page.get_by_role("button", name=texts.STOP, exact=True).click(timeout=START_TIMEOUT)
        await screen.sees(f"{project.name} is open in the editor. It is closed during the run")
        async with Client(cell.url, "Wendy", reconnect=False) as wendy:
            opened = (await wendy.next_event("OpenProject")).data.project
            assert "unsaved" in [each.name for each in opened.action_points]
            notice = (await wendy.next_event("Notification")).data.message
            assert notice.startswith("Olga released your locks")

"""The first day of a new user on the demo workplace, from joining to a disconnected cable."""

import asyncio
import re
from collections.abc import AsyncIterator
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, expect

from tests.demo.running import Run, demo
from tests.e2e.harness import until
from tests.editor import texts
from tests.editor.screen import Screen, screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="session"), pytest.mark.timeout(400)]

SPEED = "2"
"""Speed, % of the maximum."""
SEED = 3
"""Seed of a good board. The robot ends at a position with free space around it."""

SHOWS = "() => document.querySelector('.home') ? 'home' : window.__engine?.frames > 0 && 'workplace'"
"""The screen after joining: the demo may have left its project open."""


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def workplace(tmp_path_factory: pytest.TempPathFactory, built_editor: object) -> AsyncIterator[Run]:
    """`make run` after its program has ended."""
    async with demo(tmp_path_factory.mktemp("demo"), "--boards", "1", "--seed", str(SEED)) as run:
        await until(
            lambda: "The server runs at" in run.output or run.process.returncode is not None, "the cycle to end", 200
        )
        assert run.at() is not None, run.output
        yield run


class User:
    def __init__(self, screen: Screen, workplace: Run) -> None:
        self.screen, self.page, self.workplace = screen, screen.page, workplace

    @property
    def panel(self) -> Locator:
        return self.page.get_by_role("complementary")

    async def tool(self, name: str) -> None:
        await self.page.get_by_role("navigation").get_by_role("button", name=name, exact=True).click()
        await self.panel.get_by_role("heading", name=name, exact=True).wait_for()

    async def mode(self, name: str) -> None:
        await self.page.get_by_role("radio", name=re.compile(rf"^{name}( \d+)?$")).click()

    async def title(self) -> str:
        return await self.panel.get_by_role("heading", level=2).inner_text()

    async def robot(self) -> dict[str, Any]:
        truth: dict[str, Any] = await self.workplace.command_fake("robot", "truth")
        return truth

    async def is_moving(self) -> bool:
        return bool((await self.robot())["moving"])

    async def is_still(self) -> bool:
        return not await self.is_moving()

    async def is_at_height(self, wanted: float) -> bool:
        height: float = (await self.robot())["tcp_pose"][2]
        return abs(height - wanted) < 1e-3

    async def go_online(self) -> None:
        await self.screen.press(texts.GO_ONLINE)
        await self.page.get_by_role("button", name=texts.STOP_MOTION).wait_for(timeout=40_000)

    async def add_action(self, offer: str, follows: str = "") -> str:
        """Add an action to the selected point, after the selected action or in `follows`, and return its name."""
        await self.tool(texts.PROGRAM)
        await self.mode("Add")
        if follows:
            await self.panel.get_by_label("Follows").select_option(label=follows)
        await self.panel.get_by_role("radio", name=re.compile("^On ")).click()
        await self.panel.get_by_role("region", name="robot", exact=True).get_by_role("button", name=offer).first.click()
        await self.panel.get_by_role("button", name="Set parameters").click()
        await self.panel.get_by_role("region", name=texts.PARAMETERS).wait_for()
        return await self.title()


async def test_view_of_the_demo_is_within_the_draw_limits_of_a_tablet(workplace: Run, browser: Browser) -> None:
    at = workplace.at()
    assert at is not None
    async with screen_of(browser, at["url"]) as screen:
        await screen.join("Viewer", "/?q=high")
        if await screen.until(SHOWS) == "home":
            await screen.page.get_by_role("radio", name=texts.PROJECTS).click()
            await screen.page.get_by_role("button", name=re.compile("^Open ")).first.click()
        loaded = """() => {
            const items = window.__engine?.ids().map((id) => window.__engine.item(id)) ?? [];
            return items.length > 30 && items.some((each) => each.kind === "robot" && each.triangles > 1000);
        }"""
        await screen.until(loaded)
        await screen.settle()
        drawn = await screen.drawn()
        assert 1000 < drawn["triangles"] <= 150_000, drawn
        assert 10 < drawn["calls"] <= 120, drawn
        await screen.picture("demo")


async def test_a_new_user_teaches_programs_and_runs_the_robot(workplace: Run, browser: Browser) -> None:
    at = workplace.at()
    assert at is not None
    async with screen_of(browser, at["url"], touch=True) as screen:
        user = User(screen, workplace)
        page = screen.page

        # Join, create a project and go online.
        await screen.join("Newcomer")
        if await screen.until(SHOWS) == "workplace":
            await screen.press(texts.CLOSE_DOCUMENT)
        await page.get_by_role("radio", name=texts.PROJECTS).click()
        await screen.press(texts.NEW_PROJECT)
        await page.get_by_role("dialog").get_by_label("Name").fill("First day")
        await screen.press(texts.CREATE)
        await user.go_online()
        await user.tool(texts.ROBOT)
        await user.panel.get_by_role("radiogroup", name="Step, mm").get_by_text("100", exact=True).click()

        # Add a point at the robot, then move the robot away, on the screen and in the simulation.
        await user.tool(texts.POINTS)
        await screen.press("At the robot")
        await user.panel.get_by_role("region", name="Orientations").wait_for()
        point = await user.title()
        # The position is that of the configured tool, known once control is taken.
        taught = await screen.until(
            """() => {
                const items = window.__engine.ids().map((id) => window.__engine.item(id));
                const points = items.filter((one) => one.kind === "point");
                return points.length === 1 && points[0].pose.position.z;
            }"""
        )
        await user.tool(texts.ROBOT)
        await screen.press("Move along +Z")
        await until(lambda: user.is_at_height(taught + 0.1), "the arm is 100 mm higher", 20)
        shown = """z => __engine.ids().map((id) => __engine.item(id)).some(({ kind, endEffectors }) =>
            kind === "robot" && endEffectors?.some((tool) => Math.abs(tool.position.z - z) < 0.3))"""
        await screen.until(shown, taught + 0.1)

        # Two actions and a branch.
        await page.get_by_role("radio", name="3D", exact=True).click()
        await user.tool(texts.OBJECTS)
        await page.get_by_role("row", name=f"{point} Action point").click()
        check = await user.add_action("get digital input")
        number = user.panel.get_by_label("number", exact=True)
        # With gloves: the keys of the number pad, whose first digit replaces the value.
        await user.panel.get_by_role("button", name="Number pad for number").click()
        pad = user.panel.get_by_role("group", name="Type number")
        for key in ("3", "Delete the last character", "1", "Set"):
            await pad.get_by_role("button", name=key, exact=True).click()
        await expect(number).to_have_value("1")
        move = await user.add_action("move Move the TCP to a pose.", f"{check}: if no")
        speed = user.panel.get_by_label("speed", exact=True)
        await speed.fill(SPEED)
        await speed.press("Enter")
        await screen.press(texts.CLOSE_PANEL)
        await user.mode("Flow")
        graph = page.get_by_role("region", name=texts.GRAPH)
        await graph.get_by_role("button", name=texts.WHOLE_PROGRAM).click()

        # Run with a breakpoint; stop the arm in mid-move.
        await graph.locator(f'.react-flow__node[aria-label^="{move}"] .flow-name').click()
        await user.panel.get_by_role("button", name="Pause before this action").click()
        await user.mode("3D")
        await user.tool(texts.RUN)
        await screen.press("Save and run")
        bar = page.get_by_role("group", name=texts.PROGRAM_STATE)
        await expect(bar).to_contain_text(f"before {move}", timeout=60_000)
        await screen.picture("story paused")
        await bar.get_by_role("button", name=texts.RESUME).click()
        await until(user.is_moving, "the arm moves")
        await page.get_by_role("button", name=texts.STOP_MOTION).click()
        await until(user.is_still, "the arm has stopped", 2)
        assert (await user.robot())["tcp_pose"][2] > taught + 0.005, "the arm has completed the motion"
        await expect(bar).to_be_hidden()
        joints = (await user.robot())["q"]

        # Undo a removal.
        await user.tool(texts.OBJECTS)
        await page.get_by_role("row", name=f"{move} Action").click()
        await user.panel.get_by_role("button", name=texts.REMOVE, exact=True).click()
        undo = page.get_by_role("button", name=re.compile(f"^Undo .*{move}"))
        await undo.click()
        await user.tool(texts.OBJECTS)
        await page.get_by_role("row", name=f"{move} Action").wait_for()

        # Disconnect a cable: the message names the device.
        if await page.get_by_role("button", name=texts.GO_ONLINE).is_visible():
            await user.go_online()
        await user.tool(texts.DEVICES)
        row = user.panel.get_by_role("listitem").filter(has_text="robot").filter(has_text="online")
        await row.wait_for()
        await workplace.command_fake("robot", "silence")
        lost = user.panel.get_by_role("listitem").filter(has_text="connection lost")
        await expect(lost).to_contain_text("robot")
        await screen.picture("story cable")
        await workplace.command_fake("robot", "heal")
        await user.panel.get_by_role("listitem").filter(has_text="robot").filter(has_text="online").wait_for()
        await asyncio.sleep(0.3)
        assert (await user.robot())["q"] == pytest.approx(joints, abs=1e-3), "the arm has moved by itself"

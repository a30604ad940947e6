"""A new user gets from an empty server to a stepped program. Every tap is counted."""

import re
from functools import partial
from typing import Final

import pytest
from playwright.async_api import Browser, Locator, Page, expect

from arcor2_hw.client import Client
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.reset import START
from tests.editor.screen import Screen, screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="session"), pytest.mark.timeout(400)]

MAX_TAPS: Final = 60
"""Largest number of taps. Before one form added a device and actions were connected automatically, it was 141."""


class CountedUser:
    """A user whose taps and keys are counted.

    A tap on a control, a drag, and a key of the number pad count one each. Digits in a number field count one each as
    well. A text, such as an address, counts one for the field and one for the typing.
    """

    def __init__(self, screen: Screen) -> None:
        self.screen, self.page = screen, screen.page
        self.taps = 0

    @property
    def panel(self) -> Locator:
        return self.page.get_by_role("complementary")

    async def tap(self, control: Locator) -> None:
        self.taps += 1
        await control.click()

    async def button(self, name: str, within: Locator | Page | None = None) -> None:
        await self.tap((within or self.page).get_by_role("button", name=name, exact=True).first)

    async def tool(self, name: str) -> None:
        await self.button(name, self.page.get_by_role("navigation"))
        await self.panel.get_by_role("heading", name=name, exact=True).wait_for()

    async def add(self) -> None:
        await self.tool(texts.OBJECTS)
        await self.button("Add object", self.panel)
        await self.panel.get_by_role("heading", name=texts.ADD, exact=True).wait_for()

    async def text(self, label: str, text: str) -> None:
        """Type a text. The first field of a form has the focus already."""
        field = self.panel.get_by_label(label, exact=True)
        if not await field.evaluate("field => field === document.activeElement"):
            await self.tap(field)
        self.taps += 1
        await field.fill(text)

    async def number(self, label: str, digits: str) -> None:
        await self.tap(self.panel.get_by_label(label, exact=True))
        self.taps += len(digits)
        await self.panel.get_by_label(label, exact=True).fill(digits)

    async def device(self, kind: str, name: str) -> None:
        """Test the connection and add the device."""
        await self.button("Test connection", self.panel)
        await self.panel.get_by_text("Connected", exact=True).wait_for()
        await self.button(texts.ADD, self.panel)
        await self.panel.get_by_role("heading", name=name, exact=True).wait_for()

    async def choose(self, kind: str) -> None:
        await self.tap(self.panel.locator(".kind").filter(has_text=kind).first)

    async def offer(self, name: str, group: str, added: str) -> None:
        region = self.panel.get_by_role("region", name=group, exact=True)
        await self.tap(region.locator(".offer").filter(has=self.page.get_by_text(name, exact=True)))
        await self.panel.get_by_role("status").filter(has_text=f"Added {added}.").wait_for()


async def test_a_new_user_steps_a_first_program_within_the_tap_limit(cell: Cell, browser: Browser) -> None:
    await cell.renew_robot()  # the height that it reports includes the tool that an earlier test has set
    await cell.command_fake("robot", "place", q=START)
    addresses = cell.addresses()
    async with screen_of(browser, cell.url, "ipad", touch=True) as screen:
        user, page = CountedUser(screen), screen.page
        await screen.join("Newcomer")
        user.taps += 2
        await user.button("Start here")
        await page.get_by_role("heading", name="Program", exact=True).wait_for()

        # A table of 1500 mm, moved by a step.
        await user.add()
        await user.button("Table", user.panel)
        await user.panel.get_by_role("heading", name="table", exact=True).wait_for()
        await user.button("Increase X by 1 cm", user.panel)
        await user.tap(user.panel.get_by_text("Size", exact=True))
        await user.tap(user.panel.get_by_role("button", name=re.compile("^X 1200 mm")))
        for key in "1500":
            await user.button(key, user.panel.get_by_role("form", name="Type X"))
        await user.button("Set", user.panel)

        # The devices: their connection is tested before they are added.
        await user.add()
        await user.choose("UR5e")
        await user.text("host", str(addresses["robot"]))
        await user.number("payload mass", "1.2")
        await user.device("UR5e", "ur5e")
        await user.add()
        await user.choose("Functional tester")
        await user.text("host", str(addresses["tester_host"]))
        await user.number("port", str(addresses["tester_port"]))
        await user.device("Functional tester", "functional_tester")
        await user.button(texts.GO_ONLINE)
        await page.get_by_role("button", name=texts.STOP_MOTION).wait_for(timeout=40_000)

        # Four points, without leaving the jog panel.
        await user.tool(texts.ROBOT)
        for name in ("point", "point_2", "point_3", "point_4"):
            height = await tool_height(cell)
            await user.button("Move along +Z")
            await until(partial(is_at, cell, height + 0.01), "the arm is one step higher")
            await user.button("Save the robot pose as a point")
            await page.get_by_text(f"Saved {name}.", exact=True).wait_for()
        await screen.picture("first hour jog")
        # Four actions and a branch: nothing is connected by hand.
        await user.tool(texts.PROGRAM)
        await user.offer("move", "ur5e", "move")
        await user.offer("board present", "functional_tester", "board_present")
        await user.offer("move", "ur5e", "move_2")
        user.taps += 2
        await user.panel.get_by_label("Follows").select_option(label="board_present: if no")
        await user.offer("wait", "Program flow", "wait")
        await screen.picture("first hour program")
        client = await cell.client("observer")
        await user.button(texts.SAVE)
        await until(partial(is_saved, client), "the project is saved")
        (listed,) = await client.list_projects()
        project = await client.get_project(listed.id)
        names = {action.id: action.name for point in project.action_points for action in point.actions}
        steps = {
            (names.get(each.start.partition("/")[0], each.start), names.get(each.end, each.end)): getattr(
                each.condition, "value", None
            )
            for each in project.logic
        }
        first, second = sorted(name for name in names.values() if name.startswith("move"))
        wanted = {
            ("START", first): None,
            (first, "board_present"): None,
            ("board_present", second): "true",
            ("board_present", "wait"): "false",
            (second, "END"): None,
            ("wait", "END"): None,
        }
        assert {key: value if isinstance(value, str) else None for key, value in steps.items()} == wanted
        at = {action.name: point.name for point in project.action_points for action in point.actions}
        assert (at[first], at[second]) == ("point", "point_2"), "moves use the taught points in order"

        await user.tool(texts.RUN)
        await user.button("Run", user.panel)
        bar = page.get_by_role("group", name=texts.PROGRAM_STATE)
        await user.tap(bar.get_by_role("button", name="Pause", exact=True))
        await expect(bar.get_by_role("button", name=texts.STEP)).to_be_enabled(timeout=60_000)
        trace = user.panel.get_by_role("region", name="Trace").get_by_role("listitem")
        before = await trace.count()
        await user.tap(bar.get_by_role("button", name=texts.STEP))
        await expect(trace).not_to_have_count(before)
        await expect(bar).to_contain_text("Paused")
        await screen.picture("first hour paused")
        assert user.taps <= MAX_TAPS

        # Undo survives saving and running; an action and its connections are one step.
        await bar.get_by_role("button", name=texts.STOP, exact=True).click()
        await page.get_by_role("button", name=texts.undo("adding the action wait")).click(timeout=30_000)
        await page.get_by_role("button", name="Redo adding the action wait").wait_for()
        remaining = await client.get_project(listed.id)
        assert len(remaining.logic) == len(project.logic), "the saved project is unchanged"
        # The object of the wait was added online, so adding it is a separate step: it cannot be removed online.
        await page.get_by_role("button", name=texts.undo("adding the object flow")).wait_for()
        await page.get_by_role("button", name="Redo adding the action wait").click()
        await page.get_by_role("button", name=texts.undo("adding the action wait")).wait_for()


async def test_a_missing_payload_is_named_and_set(cell: Cell, browser: Browser) -> None:
    """Check this on a phone. Typed values survive closing the panel, and serial ports are searched for devices."""
    async with screen_of(browser, cell.url, "phone", dark=True, touch=True) as screen:
        user, page = CountedUser(screen), screen.page
        await screen.join("Observer")
        await user.button("Start here")
        await user.add()
        await user.choose("Barcode reader")
        await user.button("Find serial ports", user.panel)
        await (
            user.panel.get_by_text("Nothing found.")
            .or_(user.panel.get_by_role("list", name="Found devices"))
            .wait_for()
        )
        await screen.picture("first hour search")
        await user.button("← All types", user.panel)
        await user.choose("UR5e")
        await user.text("host", str(cell.addresses()["robot"]))
        await user.button(texts.CLOSE_PANEL)
        await user.add()
        await user.choose("UR5e")
        await expect(user.panel.get_by_label("host", exact=True)).to_have_value(str(cell.addresses()["robot"]))
        await user.panel.get_by_text("Not set: payload mass.").wait_for()
        await user.device("UR5e", "ur5e")
        await user.button(texts.GO_ONLINE)
        await screen.sees("payload mass is not set")
        await expect(user.panel.locator(".tag", has_text="online")).to_have_class("tag warn")
        await screen.picture("first hour payload")
        await user.button("Go offline and set it")
        mass = user.panel.get_by_label("payload mass", exact=True)
        await expect(mass).to_be_enabled()
        await mass.fill("1.2")
        await user.button(texts.SAVE_SETTINGS, user.panel)
        await expect(user.panel.get_by_text("Not set: payload mass.")).to_be_hidden()
        await user.button(texts.GO_ONLINE)
        await page.get_by_role("button", name=texts.STOP_MOTION).wait_for(timeout=40_000)
        await expect(page.get_by_text("payload mass is not set")).to_be_hidden()


async def tool_height(cell: Cell) -> float:
    height: float = (await cell.command_fake("robot", "truth"))["tcp_pose"][2]
    return height


async def is_at(cell: Cell, height: float) -> bool:
    return abs(await tool_height(cell) - height) < 1e-4 and not (await cell.command_fake("robot", "truth"))["moving"]


async def is_saved(client: Client) -> bool:
    return len(await client.list_projects()) == 1

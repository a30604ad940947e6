"""Take the pictures of an operator who resolves faults of the demo cell.

`python -m tests.editor.operator_pictures [DIRECTORY]` writes `recover-*.png` into docs/pictures or the directory.
Every fault is resolved by the buttons of the screen, and by hand at the simulated cell.
"""

import asyncio
import contextlib
import re
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from playwright.async_api import Error, expect

from arcor2_hw.client import Client
from arcor2_hw.exceptions import DeviceTimeout
from benchmarks.parts.cell import Cell
from benchmarks.parts.places import NAMES
from tests.e2e.harness import until
from tests.editor.screen import Screen, running_browser, screen_of

BOARDS, SEED = 12, 3
STEP_TIMEOUT: Final = 40.0
"""Time limit of each step, s."""


class Operator:
    """An operator at a tablet next to the simulated cell."""

    def __init__(self, cell: Cell, client: Client, screen: Screen, to: Path) -> None:
        self._cell, self._client, self._screen, self._to = cell, client, screen, to
        self._parts = screen.page.get_by_role("region", name="Parts in the cell")
        self._names: dict[str, str] = {}
        """Action names by id."""
        self._held = screen.page.get_by_role("region", name="The program is held")

    async def all(self) -> None:
        """Run the program, and resolve one fault after the other."""
        await self._start()
        await self._labels_out()
        await self._protective_stop()
        await self._door_open()
        await self._killed_in_mid_pick()
        await self._nest_occupied()

    async def _labels_out(self) -> None:
        await self._wait_for_action("into_nest")
        await self._cell.command("printer", "media", labels=0)
        await self._wait_until_held()
        await self._screenshot("labels-out")
        await self._cell.command("printer", "media", labels=100)
        await self._try_again()

    async def _protective_stop(self) -> None:
        await self._wait_for_action("insert")
        await self._cell.command("robot", "protective_stop")
        await self._wait_until_held()
        await expect(self._held.get_by_role("button", name="Acknowledge")).to_be_visible()
        await self._screenshot("protective-stop")
        await self._acknowledge()
        await self._try_again()

    async def _door_open(self) -> None:
        await self._wait_for_action("test")
        await self._wait_for_tester("Execute")
        await self._cell.command("tester", "push_door", opening=True)
        await self._wait_until_held()
        await expect(self._held.get_by_role("button", name="Acknowledge")).to_be_visible()
        await self._screenshot("door-open")
        await self._cell.command("tester", "push_door", opening=False)
        await self._acknowledge()
        await self._try_again()

    async def _killed_in_mid_pick(self) -> None:
        await self._wait_for_action("pick")
        await self._cell.kill("host")
        await expect(self._parts).to_contain_text("Where is part")
        await self._screenshot("killed")
        await self._confirm_parts()
        await self._parts.get_by_role("button", name="Do not continue").click()

    async def _nest_occupied(self) -> None:
        """Start the program from its beginning, with a board in the nest."""
        if "tester" not in {board["place"] for board in await self._cell.boards()}:
            await self._start()
            await self._wait_for_action("test")
            await self._screen.press("Stop")
            await expect(self._screen.page.get_by_role("button", name="Start", exact=True)).to_be_visible()
        await self._start()
        await self._wait_until_held("is occupied")
        await self._screenshot("nest-occupied")

    # -------------------------------------------------------------------------------- steps
    async def _start(self) -> None:
        await self._screen.press("Start")
        await expect(self._screen.page.get_by_role("button", name="Stop", exact=True)).to_be_visible()

    async def _confirm_parts(self) -> None:
        """Answer where each part is. Take out a part that is in the gripper."""
        await self._screen.settle()
        while question := re.search(
            r"Where is part (\S+)\?", await self._parts.inner_text() if await self._parts.count() else ""
        ):
            boards = {board["code"]: board["place"] for board in await self._cell.boards()}
            place = boards.get(question[1]) or "stop"  # a part whose code has not been read has none
            answer = NAMES[place]
            if place == "gripper":
                await self._cell.command("world", "remove_board", code=question[1])
                answer = "I have taken it out of the cell"
            await self._parts.get_by_role("button", name=answer, exact=True).click()
            await expect(self._parts.get_by_text(question[0])).to_have_count(0)

    async def _wait_for_action(self, action: str) -> None:
        """Discard the events received so far, and wait until the program starts an action."""
        with contextlib.suppress(DeviceTimeout):
            while event := await self._client.next_event(timeout=0.05):
                self._read_action_names(event)
        async with asyncio.timeout(3.0 * STEP_TIMEOUT):
            while True:
                with contextlib.suppress(DeviceTimeout):
                    event = await self._client.next_event(timeout=1.0)
                    self._read_action_names(event)
                    if event.event == "ActionStateBefore" and self._names.get(event.data.action_id) == action:
                        return
                if await self._held.count():  # another effect of the last fault
                    await self._acknowledge()
                    await self._try_again()

    def _read_action_names(self, event: Any) -> None:
        if event.event == "PackageInfo":
            self._names = {each.id: each.name for each in event.data.project.all_actions()}

    async def _wait_for_tester(self, wanted: str) -> None:
        async def reached() -> bool:
            return bool((await self._cell.command("tester", "truth"))["state"] == wanted)

        await until(reached, f"the tester to be in {wanted}", STEP_TIMEOUT)

    async def _wait_until_held(self, text: str = "") -> None:
        await expect(self._held).to_contain_text(text or "Held", timeout=STEP_TIMEOUT * 1000)

    async def _acknowledge(self) -> None:
        """Acknowledge all alarms of the held device. Skip those that end meanwhile."""
        button = self._held.get_by_role("button", name="Acknowledge").first
        async with asyncio.timeout(STEP_TIMEOUT):
            while await button.count():
                with contextlib.suppress(Error):
                    await button.click(timeout=3000)
                await asyncio.sleep(0.5)

    async def _try_again(self) -> None:
        """Press the button until the server accepts. It refuses until the device is connected again."""
        page = self._screen.page
        dialog = page.get_by_role("alertdialog").or_(page.get_by_role("dialog"))
        async with asyncio.timeout(STEP_TIMEOUT):
            while True:
                await self._dismiss_notices()
                await self._held.get_by_role("button", name=re.compile("^(Try again|Continue)$")).click()
                await self._wait_for_answer()
                if await dialog.count():
                    await dialog.get_by_role("button", name="Try again").click()
                    await self._wait_for_answer()
                if not await page.locator(".notice.error").count():
                    break
                await asyncio.sleep(0.5)

    async def _wait_for_answer(self) -> None:
        """Wait until the screen asks, the decision is refused, or the program continues."""
        answered = "() => document.querySelector('[role$=dialog], .notice.error') || !document.querySelector('.held')"
        with contextlib.suppress(Error):  # another effect of the fault may hold the program at once
            await self._screen.page.wait_for_function(answered, timeout=3000)

    async def _dismiss_notices(self) -> None:
        for each in await self._screen.page.locator(".notices").get_by_role("button", name="Dismiss").all():
            with contextlib.suppress(Error):  # it has disappeared by itself
                await each.click(timeout=1000)

    async def _screenshot(self, name: str) -> None:
        await expect(self._screen.page.get_by_text("for the editor")).to_have_count(0)  # models are prepared
        await self._dismiss_notices()
        await self._screen.page.mouse.move(0, 0)  # away from the buttons, which are highlighted under the pointer
        await self._screen.settle()
        (self._to / f"recover-{name}.png").write_bytes(await self._screen.page.screenshot())


async def main(to: Path) -> None:
    """Start the cell, and take the pictures."""
    to.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-pictures-") as name:
        cell = Cell(Path(name), BOARDS, SEED)
        await cell.start()
        try:
            async with (
                running_browser(low_priority=True) as browser,
                Client(cell.url, "Ada", reconnect=False) as client,
                screen_of(browser, cell.url, "ipad", touch=True, drawn=True) as screen,
            ):
                await client.subscribe_events({"Held", "ProgramPosition"})
                screen.page.set_default_timeout(STEP_TIMEOUT * 1000)
                await screen.join("Olga", "/?q=low#/operator?kiosk")
                await Operator(cell, client, screen, to).all()
        finally:
            await cell.stop()


if __name__ == "__main__":
    pictures = Path(__file__).resolve().parents[2] / "docs" / "pictures"
    asyncio.run(main(Path(sys.argv[1]) if len(sys.argv) > 1 else pictures))

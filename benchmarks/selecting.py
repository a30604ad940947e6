"""Measure how long it takes to select an item: with the crosshair, by a tap in the view, and in the list of objects.

A script acts as soon as the editor has answered. The times are therefore comparable, but do not include the time
for aiming and reading.
"""

import re
import time
from collections.abc import Awaitable, Callable
from typing import Final

from benchmarks.metrics import Metric, Report, median
from tests.editor import texts
from tests.editor.screen import Screen

MAX_CANDIDATES: Final = 8
"""Largest number of candidates at the crosshair."""
SELECTED: Final = 12
"""Number of items selected with each method."""
_AIM: Final = """(id) => {
    const { x, y, z } = __engine.item(id).pose.position;
    __engine.view.set([x - 0.4, y - 0.4, z + 0.4], [x, y, z]);
}"""
_POINTS: Final = """(count) => {
    const aim = AIM, { clientWidth: w, clientHeight: h } = document.querySelector(".view");
    const seen = (id) => {
        aim(id);
        return __engine.pick(w / 2, h / 2)[0]?.id === id;
    };
    return __engine.ids().map((id) => [id, __engine.item(id).name])
        .filter(([id, name]) => /^p[0-9]+$/.test(name) && seen(id)).slice(0, count);
}""".replace("AIM", _AIM)
"""Return points that nothing hides from the camera that looks at them."""


async def selecting(report: Report, screen: Screen) -> None:
    """Select points without actions, which other points surround."""
    page = screen.page
    panel = page.get_by_role("complementary")
    points: list[tuple[str, str]] = await page.evaluate(_POINTS, SELECTED)
    bar = page.get_by_role("group", name=texts.AT_CROSSHAIR)
    tools = page.get_by_role("navigation")

    nexts = 0

    async def crosshair(name: str) -> None:
        nonlocal nexts
        await bar.get_by_role("button", name=re.compile("^Select ")).wait_for()
        wanted = bar.get_by_role("button", name=f"Select {name}", exact=True)
        for _ in range(MAX_CANDIDATES):
            if await wanted.count():
                break
            await bar.get_by_role("button", name=re.compile("^Next ")).click()
            nexts += 1
        await wanted.click()

    async def tap(name: str) -> None:
        await screen.tap({each: item for item, each in points}[name])

    async def listed(name: str) -> None:
        await tools.get_by_role("button", name=texts.OBJECTS, exact=True).click()
        await page.get_by_role("searchbox").fill(name)
        await page.get_by_role("row", name=f"{name} Action point", exact=True).click()

    async def measured(method: str, note: Callable[[], str], select: Callable[[str], Awaitable[None]]) -> None:
        took = []
        for item, name in points:
            await screen.close_panels()
            await page.evaluate(_AIM, item)
            await screen.settle()
            begin = time.perf_counter()
            await select(name)
            await panel.get_by_role("heading", name=name, exact=True).wait_for()
            took.append((time.perf_counter() - begin) * 1e3)
        report.add(Metric(f"select_{method}_ms", median(took), len(took), f"{note()}; worst {max(took):.0f} ms"))

    await page.keyboard.press("x")
    await measured("crosshair", lambda: f"{1 + nexts / SELECTED:.2g} taps on average", crosshair)
    await page.keyboard.press("x")
    await measured("tap", lambda: "1 tap", tap)
    await measured("list", lambda: "3 taps and typing the name", listed)
    await screen.close_panels()

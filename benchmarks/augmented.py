"""Measure augmented reality with a fake camera that moves around two markers, for `make bench-editor`."""

import asyncio
import json
import re
import time
from pathlib import Path
from typing import Any, Final

from arcor2_server.web.editor import FILES
from benchmarks.metrics import Metric, Report, median, percentile
from tests.editor import texts
from tests.editor.ar_probe import overlay_errors
from tests.editor.camera_video import CAMERA_ARGUMENTS, MIDDLE, marker_table, write_video
from tests.editor.screen import Screen, running_browser, screen_of
from tests.editor.test_editor_ar import DARKEN
from tests.editor.test_editor_size import AR_MODES, ar_size

STARTS: Final = 3
PICTURES: Final = 60
ASIDE: Final = [(0.69, 0.025, 0.0), (-0.31, 0.025, 0.0), (0.19, 0.525, 0.0), (0.19, 0.025, 0.3)]
"""Points half a metre from the middle of the markers, m, and one above it."""
LENS_WITHIN: Final = 60.0
"""Time in which the focal length must be found, s."""


SELECTED: Final = 10
"""Number of items selected with each method."""
_IN_VIEW: Final = """(n) => {
    const { left, top, width, height } = document.querySelector(".view canvas").getBoundingClientRect();
    const free = ({ x, y }) => document.elementFromPoint(left + x, top + y)?.matches(".view canvas");
    const found = __engine.ids().map((id) => __engine.item(id)).filter(({ visible, screen: at }) => (
        visible && at && at.x > 0 && at.y > 0 && at.x < width && at.y < height && free(at)));
    const at = found[n % found.length]?.screen;
    return at && [left + at.x, top + at.y];
}"""
"""Return the page position of one of the visible items."""


def size(report: Report) -> None:
    """Measure the size of the files that each AR mode loads when it starts, compressed with gzip."""
    manifest = json.loads((FILES / ".vite" / "manifest.json").read_text())
    sizes = {mode: ar_size(FILES, manifest, mode) for mode in AR_MODES}
    note = "most that a device loads; " + ", ".join(f"{mode} {total / 1e3:.1f} kB" for mode, total in sizes.items())
    report.add(Metric("ar_size_kb", max(sizes.values()) / 1e3, len(sizes), note))


async def augmented(report: Report, directory: Path, url: str) -> None:
    """Measure registration, accuracy and latency in a separate browser; the project stays open."""
    video = directory / "camera.mjpeg"
    shots = write_video(video)
    table = json.dumps(marker_table())
    starts = []
    async with running_browser(*CAMERA_ARGUMENTS, f"--use-file-for-fake-video-capture={video}") as browser:
        for number in range(STARTS):
            async with screen_of(browser, url, "ipad", drawn=True) as screen:
                await screen.page.route("**/api/calibration/markers", lambda route: route.fulfill(body=table))
                await screen.join(f"AR {number}")
                await screen.until("() => window.__engine?.ids().length > 0")
                await screen.page.get_by_role("button", name="AR", exact=True).click()
                start = screen.page.get_by_role("button", name="Start AR")
                await start.wait_for()
                began = time.perf_counter()
                await start.click()
                await screen.until("() => window.__engine.view.measured")
                starts.append(time.perf_counter() - began)
                if number < STARTS - 1:
                    continue
                near, aside, took = [], [], []
                async with asyncio.timeout(LENS_WITHIN):
                    await screen.until("() => window.__ar?.shown.found.checked")
                for _ in range(PICTURES):
                    shown = await _next_picture(screen)
                    near += await overlay_errors(screen, shots, [MIDDLE])
                    aside += await overlay_errors(screen, shots, ASIDE)
                    took.append(shown["latency"])
                selected = await _select(screen)
                regained = [await _regain(screen) for _ in range(STARTS)]
    report.add(Metric("ar_registration_s", max(starts), STARTS, "worst, with an unknown lens"))
    report.add(Metric("ar_regained_s", max(regained), STARTS, "worst, after dark pictures"))
    for method, times in selected.items():
        report.add(Metric(f"select_ar_{method}_ms", median(times), len(times), f"1 tap; worst {max(times):.0f} ms"))
    for name, errors in (("near", near), ("aside", aside)):
        note = f"p95; p50 {1e3 * median(errors):.2f} mm"
        report.add(Metric(f"ar_{name}_mm", 1e3 * percentile(errors, 95), len(errors), note))
    report.add(Metric("ar_picture_ms", percentile(took, 95), PICTURES, f"p95; p50 {median(took):.0f} ms"))


async def _select(screen: Screen) -> dict[str, list[float]]:
    """Select items while the camera moves; return the times from a tap until the panel of the item is shown, ms."""
    page = screen.page
    heading = page.get_by_role("complementary").get_by_role("heading").first
    select = page.get_by_role("group", name=texts.AT_CROSSHAIR).get_by_role("button", name=re.compile("^Select ."))
    took: dict[str, list[float]] = {"crosshair": [], "tap": []}
    for number in range(SELECTED):
        for method, times in took.items():
            await screen.close_panels()
            await select.wait_for()
            x, y = await screen.until(_IN_VIEW, number)
            began = time.perf_counter()
            if method == "tap":
                await page.mouse.click(x, y)
            else:
                await select.click()
            await heading.wait_for()
            times.append((time.perf_counter() - began) * 1e3)
    await screen.close_panels()
    return took


async def _regain(screen: Screen) -> float:
    """Cover the camera until the registration is lost, and return the time until it is regained, s."""
    await screen.page.evaluate(DARKEN)
    await screen.until("() => __ar.phase === 'lost'")
    began = time.perf_counter()
    await screen.page.evaluate("() => { __ar.video.srcObject = __camera; __ar.video.play(); }")
    await screen.until("() => __ar.phase === 'registered'")
    return time.perf_counter() - began


async def _next_picture(screen: Screen) -> dict[str, Any]:
    count = await screen.page.evaluate("window.__ar.shown.count")
    after = "(count) => __ar.shown.count > count && { latency: __ar.shown.latency }"
    found: dict[str, Any] = await screen.until(after, count)
    return found

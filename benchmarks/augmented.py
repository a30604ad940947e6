"""Measure augmented reality with a fake camera that moves around two markers, for `make bench-editor`."""

import asyncio
import json
import time
from pathlib import Path
from typing import Any, Final

from arcor2_server.web.editor import FILES
from benchmarks.metrics import Metric, Report, median, percentile
from tests.editor.ar_probe import overlay_errors
from tests.editor.camera_video import CAMERA, MIDDLE, marker_table, write_video
from tests.editor.screen import Screen, running_browser, screen_of
from tests.editor.test_editor_ar import DARKEN
from tests.editor.test_editor_size import needed

STARTS: Final = 3
PICTURES: Final = 60
ASIDE: Final = [(0.69, 0.025, 0.0), (-0.31, 0.025, 0.0), (0.19, 0.525, 0.0), (0.19, 0.025, 0.3)]
"""Points half a metre from the middle of the markers, m, and one above it."""
LENS_WITHIN: Final = 60.0
"""Time in which the focal length must be found, s."""


START: Final = {"src/ui/ar/StartAr.tsx", "src/ui/ar/ArView.tsx"}
CAMERA_FILES: Final = {"src/ar/arSession.ts"}
TABLET_FILES: Final = {"src/ar/xrSession.ts"}
HEADSET_FILES: Final = TABLET_FILES | {"src/ar/headset.ts", "src/ui/ar/HeadsetPanel.tsx"}


def size(report: Report) -> None:
    """Measure the size of the files that each way of AR loads when it starts, compressed with gzip."""
    sizes = {"camera": _size(CAMERA_FILES), "tablet": _size(TABLET_FILES), "headset": _size(HEADSET_FILES)}
    note = "most that a device loads; " + ", ".join(f"{way} {total / 1e3:.1f} kB" for way, total in sizes.items())
    report.add(Metric("ar_size_kb", max(sizes.values()) / 1e3, len(sizes), note))


def _size(way: set[str]) -> int:
    """Return the size of the files that a way of AR loads, without parts that others load, too, bytes."""
    manifest = json.loads((FILES / ".vite" / "manifest.json").read_text())
    loaded = {name for name, chunk in manifest.items() if chunk.get("isEntry") or chunk.get("isDynamicEntry")}
    files = needed(manifest, *START, *way) - needed(manifest, *(loaded - START - CAMERA_FILES - HEADSET_FILES))
    if way != HEADSET_FILES:  # headsets give pages no pictures
        files |= {str(file.relative_to(FILES)) for file in (FILES / "assets").glob("worker-*.js")}
    return sum((FILES / f"{name}.gz").stat().st_size for name in files)


async def augmented(report: Report, directory: Path, url: str) -> None:
    """Measure registration, accuracy and latency in a browser of its own; the project stays open."""
    video = directory / "camera.mjpeg"
    shots = write_video(video)
    table = json.dumps(marker_table())
    starts = []
    async with running_browser(*CAMERA, f"--use-file-for-fake-video-capture={video}") as browser:
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
                regained = [await _regain(screen) for _ in range(STARTS)]
    report.add(Metric("ar_registration_s", max(starts), STARTS, "worst, with an unknown lens"))
    report.add(Metric("ar_regained_s", max(regained), STARTS, "worst, after dark pictures"))
    for name, errors in (("near", near), ("aside", aside)):
        note = f"p95; p50 {1e3 * median(errors):.2f} mm"
        report.add(Metric(f"ar_{name}_mm", 1e3 * percentile(errors, 95), len(errors), note))
    report.add(Metric("ar_picture_ms", percentile(took, 95), PICTURES, f"p95; p50 {median(took):.0f} ms"))


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

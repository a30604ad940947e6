"""Measure the editor in headless Chromium with software rendering, the server and fakes (`make bench-editor`).

The page runs with `q=low`. Each function describes what it measures; the goals are in `benchmarks/metrics.py`. If the
page reports an error, nothing is measured.
"""

import asyncio
import contextlib
import json
import re
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from playwright.async_api import Browser

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import ActionParameter, Flow, Project
from arcor2_server.web.editor import FILES
from benchmarks import augmented
from benchmarks.metrics import Metric, Report, median, percentile
from benchmarks.selecting import selecting
from benchmarks.task import task
from tests.e2e.harness import Cell, running_cell, scene_state, until
from tests.editor import texts
from tests.editor.screen import Screen, running_browser, screen_of
from tests.editor.test_editor_size import needed

LOADS: Final = 7
POINTS: Final = 100
MOVING_S: Final = 8.0
IDLE_S: Final = 5.0
SETTLED_S: Final = 1.0
"""Time without a frame and a message after which the page has settled, s."""
SETTLINGS: Final = 30
"""Number of such periods after which frames are counted even if the page has not settled."""
EDITS: Final = 60
STOPS: Final = 10
RESTARTS: Final = 3
ATTEMPTS: Final = 4
SLOW: Final = 0.015
"""Fraction of the robot's speed."""
LARGE_POINTS: Final = 300
LARGE_ACTIONS: Final = 400
ORBITED: Final = 40
"""Number of frames drawn around the workplace."""
_ORBIT: Final = """async (frames) => {
    const engine = window.__engine, took = [];
    const { position, target } = engine.view.viewpoint;
    const pixel = new Uint8Array(4), gl = engine.renderer.getContext();
    for (let n = 0; n < frames; n++) {
        const a = 0.03 * (n + 1), [x, y] = [position[0] - target[0], position[1] - target[1]];
        const to = [target[0] + x * Math.cos(a) - y * Math.sin(a), target[1] + x * Math.sin(a) + y * Math.cos(a)];
        engine.view.set([...to, position[2]], target);
        const begin = performance.now();
        engine.render();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);  // waits until the frame is drawn
        took.push(performance.now() - begin);
        await new Promise(requestAnimationFrame);
    }
    return took;
}"""
_EMPTY: Final = """() => {
    for (const each of window.__engine.scene.children) if (!each.isLight) each.visible = false;
}"""
_PROBE: Final = Path(__file__).with_suffix(".js").read_text()


def size(report: Report) -> None:
    """Measure the size of the files loaded until the workplace is shown, compressed with gzip."""
    manifest = json.loads((FILES / ".vite" / "manifest.json").read_text())
    files = needed(manifest, "index.html", "src/engine/engine.ts")
    total = sum((FILES / f"{name}.gz").stat().st_size for name in files)
    report.add(Metric("editor_size_kb", total / 1e3, len(files), "files of shell and 3D"))


async def _observed(screen: Screen) -> dict[str, Any]:
    found: dict[str, Any] = await screen.page.evaluate("() => window.__bench")
    return found


async def loading(report: Report, browser: Browser, cell: Cell) -> None:
    """Measure loading the page without a cache while a project is open: first paint, items, robot model."""
    paints, items, robots = [], [], []
    for number in range(LOADS):
        async with screen_of(browser, cell.url, drawn=True) as screen:
            await screen.page.add_init_script(f"localStorage.setItem('arcor2-hw.name', 'bench {number}')")
            await screen.page.add_init_script(_PROBE)
            await screen.page.goto(f"{screen.url}/?q=low")
            await screen.until("() => window.__bench.robot > 0")
            paint = "() => performance.getEntriesByName('first-contentful-paint')[0].startTime"
            paints.append(float(await screen.page.evaluate(paint)))
            seen = await _observed(screen)
            items.append(seen["items"])
            robots.append(seen["robot"])
    for name, samples in (("paint", paints), ("usable", items), ("robot", robots)):
        note = f"from opening the address; worst {max(samples):.0f} ms"
        report.add(Metric(f"editor_{name}_s", median(samples) / 1e3, len(samples), note))


async def _move(client: Client, robot: str, height: float) -> None:
    (tool,) = await client.call("GetEndEffectors", rpc.GetEndEffectorsArgs(robot))
    at: Pose = await client.call("GetEndEffectorPose", rpc.GetEndEffectorPoseArgs(robot, tool))
    to = Position(at.position.x, at.position.y, at.position.z + height)
    await client.call("MoveToPose", rpc.MoveToPoseArgs(robot, tool, SLOW, to, at.orientation, safe=False))


async def _moving(client: Client, cell: Cell, robot: str, height: float) -> None:
    """Start a motion; repeat it if the robot's watchdog ended it, as can happen on a busy machine."""
    for _ in range(ATTEMPTS):
        await _move(client, robot, height)
        with contextlib.suppress(AssertionError):
            await until(lambda: _not(_at_rest(cell)), "the robot moves", 3)
            return
    raise AssertionError("The robot does not move.")


async def _at_rest(cell: Cell) -> bool:
    return not (await cell.command_fake("robot", "truth"))["moving"]


async def drawing(report: Report, screen: Screen, client: Client, cell: Cell, robot: str) -> None:
    """Measure the frame rate while the robot moves slowly, and the time from its event to pixels."""
    for attempt in range(ATTEMPTS):
        await _moving(client, cell, robot, 0.2 if attempt % 2 else -0.2)
        await asyncio.sleep(0.5)
        await screen.page.evaluate("() => { window.__bench.joints = []; }")
        begin, frames = time.perf_counter(), await screen.frames()
        await asyncio.sleep(MOVING_S)
        rate = (await screen.frames() - frames) / (time.perf_counter() - begin)
        if not await _at_rest(cell):
            break
    else:
        raise AssertionError("The robot did not move continuously; its watchdog ends motions on a busy machine.")
    joints = (await _observed(screen))["joints"]
    report.add(Metric("editor_frames_per_s", rate, round(rate * MOVING_S), f"one robot moves, {POINTS} points"))
    note = f"p50 {median(joints):.0f} ms, {len(joints) / MOVING_S:.0f} events/s"
    report.add(Metric("editor_event_to_pixels_ms", percentile(joints, 95), len(joints), f"p95; {note}"))
    await client.call("StopRobot", rpc.StopRobotArgs(robot))
    await until(lambda: _at_rest(cell), "the robot is at standstill")


async def _idle(screen: Screen) -> int:
    """Return the number of frames drawn while nothing moves.

    A cold browser first loads all parts. Then messages pass, such as that of a prepared robot model; each changes the
    height of the view.
    """
    await screen.page.wait_for_load_state("networkidle")
    messages = screen.page.locator(".notice, .task")
    frames, shown = -1, 1
    for _ in range(SETTLINGS):
        before = frames, shown
        frames, shown = await screen.frames(), await messages.count()
        if not shown and (frames, shown) == before:
            break
        await asyncio.sleep(SETTLED_S)
    await asyncio.sleep(IDLE_S)
    return await screen.frames() - frames


async def _not(answer: Any) -> bool:
    return not await answer


async def stopping(report: Report, screen: Screen, client: Client, cell: Cell, robot: str) -> None:
    """Measure from touching Stop motion to the stop at the robot's controller, which timestamps it."""
    took = []
    button = screen.page.get_by_role("button", name=texts.STOP_MOTION)
    note_time = "window.__tap = performance.timeOrigin + performance.now();"
    await screen.page.evaluate(f"() => addEventListener('pointerdown', () => {{ {note_time} }}, true)")
    for number in range(STOPS):
        await _moving(client, cell, robot, 0.1 if number % 2 else -0.1)
        offset = time.time() - time.monotonic()
        await button.click()
        await until(lambda: _at_rest(cell), "the robot is at standstill")
        truth = await cell.command_fake("robot", "truth")
        tapped = await screen.page.evaluate("() => window.__tap") / 1e3
        took.append((truth["last_stop"]["t"] + offset - tapped) * 1e3)
    note = f"median {median(took):.0f} ms; at the controller, through server and driver"
    report.add(Metric("editor_stop_ms", max(took), len(took), f"worst; {note}"))


async def editing(report: Report, browser: Browser, one: Screen, cell: Cell, project: Project) -> None:
    """Measure from a typed number to its event on another screen, and from a step to its preview there."""
    point = project.action_points[0]
    async with screen_of(browser, cell.url, "small tablet", drawn=True) as two:
        await two.page.add_init_script(_PROBE)
        await two.join("observer")
        await two.item(point.id)
        await one.press(texts.OBJECTS)
        await one.page.get_by_role("searchbox").fill(point.name)  # the list draws only the rows in view
        await one.page.get_by_role("row", name=f"{point.name} Action point").click()

        async def latencies(effects: str, inputs: str, act: Callable[[int], Awaitable[None]]) -> list[float]:
            took = []
            for number in range(EDITS):
                before = len((await _observed(two))[effects])
                await act(number)
                entered = (await _observed(one))[inputs][-1]
                await two.until("([name, before]) => window.__bench[name].length > before", [effects, before])
                took.append((await _observed(two))[effects][before] - entered)
                await asyncio.sleep(0.05)
            return took

        async def type_it(number: int) -> None:
            await one.page.get_by_role("button", name=re.compile("^Z .*enter a value")).click()
            await one.page.get_by_label("Z to").fill(f"{100 + number % 7 * 10}mm")
            await one.page.keyboard.press("Enter")

        async def step(number: int) -> None:
            await one.page.get_by_role("button", name=f"{'Decrease' if number % 3 else 'Increase'} Z by 1 cm").click()

        took = await latencies("edits", "enters", type_it)
        note = f"p50 {median(took):.0f} ms; including the lock and the journal"
        report.add(Metric("editor_edit_ms", percentile(took, 95), len(took), f"p95; {note}"))
        edits = len((await _observed(two))["edits"])
        took = await latencies("previews", "taps", step)
        await two.until("edits => window.__bench.edits.length > edits", edits)
        note = f"p50 {median(took):.0f} ms; the edit itself is sent after the last step"
        report.add(Metric("editor_step_ms", percentile(took, 95), len(took), f"p95; {note}"))


async def returning(report: Report, screen: Screen, cell: Cell) -> None:
    """Measure from `ready` of a restarted server until the same page can edit again."""
    took = []
    port = urlsplit(cell.url).port
    assert port is not None
    screen.expected_errors = ("WebSocket connection to", "ERR_CONNECTION_REFUSED")
    for _ in range(RESTARTS):
        await cell.kill("server")
        await screen.sees(texts.NO_CONNECTION)
        await cell.start_server(port)
        begin = time.perf_counter()
        await screen.until("() => !document.querySelector('.lost')")
        took.append(time.perf_counter() - begin)
    note = f"worst; median {median(took):.2f} s after the server is ready"
    report.add(Metric("editor_back_s", max(took), len(took), note))


async def large(report: Report, browser: Browser, cell: Cell, client: Client, project: Project) -> None:
    """Measure a project with 300 points and 400 actions: opening it, orbiting, and the list of objects."""
    known = await client.get_project(project.id)
    scene = await client.get_scene(known.scene_id)
    flow = next(each.id for each in scene.objects if each.type == "FlowActions")
    points = [point.id for point in known.action_points]
    for number in range(LARGE_POINTS - len(points)):
        place = Position(-0.5 + 0.06 * (number % 17), -0.5 + 0.06 * (number // 17), 0.05)
        await client.call("AddActionPoint", rpc.AddActionPointArgs(f"large_{number}", place))
        points.append((await client.next_event("ActionPointChanged")).data.id)
    before = "START"
    for number in range(LARGE_ACTIONS):
        point = points[number % len(points)]
        seconds = [ActionParameter("seconds", "double", "1.0")]
        action = rpc.AddActionArgs(point, f"step_{number}", f"{flow}/wait", seconds, [Flow()])
        await client.call("AddAction", action)
        added: str = (await client.next_event("ActionChanged")).data.id
        if before != "START":
            await client.call("AddLogicItem", rpc.AddLogicItemArgs(before, added))
        before = added
    async with screen_of(browser, cell.url, drawn=True) as screen:
        await screen.page.add_init_script("localStorage.setItem('arcor2-hw.name', 'large')")
        await screen.page.add_init_script(_PROBE)
        await screen.page.goto(f"{screen.url}/?q=low")
        await screen.until("() => window.__bench.items > 0")
        usable = float((await _observed(screen))["items"]) / 1e3
        report.add(Metric("editor_large_usable_s", usable, 1, f"{LARGE_POINTS} points, {LARGE_ACTIONS} actions"))
        await _idle(screen)
        took: list[float] = await screen.page.evaluate(_ORBIT, ORBITED)
        drawn: dict[str, int] = await screen.page.evaluate("() => window.__engine.renderer.info.render")
        note = f"p95 {percentile(took, 95):.0f} ms; {drawn['calls']} draws, {drawn['triangles']} triangles"
        report.add(Metric("editor_large_frame_ms", median(took), ORBITED, note))
        begin = time.perf_counter()
        await screen.press(texts.OBJECTS)
        await screen.page.get_by_role("row").first.wait_for()
        rows = await screen.page.get_by_role("row").count()
        report.add(Metric("editor_large_list_s", time.perf_counter() - begin, 1, f"{rows} rows rendered"))
        await screen.page.evaluate(_EMPTY)
        empty: list[float] = await screen.page.evaluate(_ORBIT, ORBITED)
        report.add(Metric("editor_empty_frame_ms", median(empty), ORBITED, "the same with nothing to draw"))


async def measure(report: Report, directory: Path) -> None:
    """Measure everything in this group."""
    size(report)
    augmented.size(report)
    async with running_cell(directory) as cell, running_browser() as browser:
        client = await cell.client("colleague")
        scene, project = await cell.open(client)
        robot = next(each.id for each in scene.objects if each.name == "robot")
        for number in range(POINTS - len(project.action_points)):
            place = Position(-0.4 + 0.08 * (number % 10), -0.4 + 0.08 * (number // 10), 0.05)
            await client.call("AddActionPoint", rpc.AddActionPointArgs(f"p{number}", place))
        async with screen_of(browser, cell.url, drawn=True) as screen:
            await screen.join("Eva")
            await screen.item(robot)
            offline = await _idle(screen)
            await selecting(report, screen)
        await client.call("StartScene")
        await scene_state(client, SceneStateEnum.STARTED, 30)
        await loading(report, browser, cell)
        await augmented.augmented(report, directory, cell.url)
        async with screen_of(browser, cell.url, drawn=True) as screen:
            await screen.page.add_init_script(_PROBE)
            await screen.join("Eva")
            await screen.until("id => window.__engine?.item(id)?.endEffectors.length > 0", robot)
            await drawing(report, screen, client, cell, robot)
            online = await _idle(screen)
            note = f"in {IDLE_S:g} s each: offline {offline}, online with the arm stopped {online}"
            report.add(Metric("editor_idle_frames", offline + online, 2, note))
            await stopping(report, screen, client, cell, robot)
            await editing(report, browser, screen, cell, project)
            await returning(report, screen, cell)
        # The first connection ended with the server, and the scene is offline since then.
        await large(report, browser, cell, await cell.client("colleague"), project)
    await task(report, directory)


async def main() -> int:
    """Measure and print; return 1 if something could not be measured."""
    report = Report()
    broken = False
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-bench-", ignore_cleanup_errors=True) as name:
        try:
            await measure(report, Path(name))
        except (AssertionError, RequestFailed) as error:
            broken = True
            sys.stderr.write(f"The measurement failed: {error}\n")
    report.table()
    return int(broken)


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))

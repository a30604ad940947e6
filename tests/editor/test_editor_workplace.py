"""The workplace: join, open the project, see the robot move, stop it, locks, devices."""

import math
import re
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.editor import ViewScope
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.screen import FONTS, VIEWPORTS, Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")

SLOW = 0.05
"""Speed fraction at which a motion of 0.3 m lasts long enough to be stopped."""


@dataclass
class Workplace:
    """A closed project, and a second client."""

    cell: Cell
    client: Client
    scene: Scene
    project: Project
    robot: str


@pytest_asyncio.fixture(loop_scope="session")
async def workplace(cell: Cell) -> AsyncIterator[Workplace]:
    """The project, saved and closed, and a second client, "colleague"."""
    client = await cell.client("colleague")
    scene, project = await cell.open(client)
    await client.call("CloseProject")
    robot = next(each.id for each in scene.objects if each.name == "robot")
    yield Workplace(cell, client, scene, project, robot)


async def _succeeds(client: Client, request: str, args: Any = None, **options: Any) -> bool:
    try:
        await client.call(request, args, **options)
    except Exception:
        return False
    return True


def distance(a: dict[str, Any], b: dict[str, Any]) -> float:
    return math.dist(a["position"].values(), b["position"].values())


async def tcp(screen: Screen, robot: str) -> dict[str, Any]:
    await screen.until("id => window.__engine?.item(id)?.endEffectors.length > 0", robot)
    pose: dict[str, Any] = (await screen.item(robot))["endEffectors"][0]
    return pose


async def goal(client: Client, robot: str, down: float) -> rpc.MoveToPoseArgs:
    (tool,) = await client.call("GetEndEffectors", rpc.GetEndEffectorsArgs(robot))
    now: Pose = await client.call("GetEndEffectorPose", rpc.GetEndEffectorPoseArgs(robot, tool))
    now.position.z -= down
    return rpc.MoveToPoseArgs(robot, tool, 1.0, now.position, now.orientation, safe=False)


async def open_and_go_online(screen: Screen, workplace: Workplace) -> None:
    await screen.join("Eva")
    await screen.press(texts.open_document(workplace.project.name))
    await screen.item(workplace.robot)
    await screen.press(texts.GO_ONLINE)
    await screen.page.get_by_role("button", name=texts.STOP_MOTION).wait_for()


async def test_view_follows_the_robot_and_draws_nothing_at_standstill(workplace: Workplace, browser: Browser) -> None:
    client = workplace.client
    async with screen_of(browser, workplace.cell.url, drawn=True) as screen:
        await screen.join("Eva")
        await screen.sees("on PCB testing")
        await screen.press(texts.open_document(workplace.project.name))
        shown = await screen.item(workplace.robot)
        assert (shown["kind"], shown["name"], shown["endEffectors"]) == ("robot", "robot", [])
        # Opening changes nothing.
        assert texts.NOT_SAVED not in (await screen.page.locator(".document").text_content() or "")
        actions = [action for point in workplace.project.action_points for action in point.actions]
        ids = set(await screen.page.evaluate("window.__engine.ids()"))
        assert {action.id for action in actions} | {item.id for item in workplace.project.logic} <= ids
        # A point is drawn relative to its parent.
        point = workplace.project.action_points[0]
        drawn = (await screen.item(point.id))["pose"]["position"]
        parent = next((each for each in workplace.scene.objects if each.id == point.parent), None)
        expected = point.position if parent is None else (parent.pose * Pose(point.position)).position  # type: ignore[operator]
        assert math.dist(drawn.values(), tuple(expected)) < 1e-6

        await _wait_until_still(screen)
        await screen.press(texts.GO_ONLINE)
        await screen.page.get_by_role("button", name=texts.STOP_MOTION).wait_for()
        before = await tcp(screen, workplace.robot)
        await _wait_until_still(screen)
        await _check_reports_cause_no_frames(screen, workplace.robot)
        await client.call("MoveToPose", await goal(client, workplace.robot, 0.1))
        await screen.until(
            "([id, z]) => Math.abs(window.__engine.item(id).endEffectors[0].position.z - (z - 0.1)) < 0.001",
            [workplace.robot, before["position"]["z"]],
        )
        moved = await tcp(screen, workplace.robot)
        assert distance(before, moved) == pytest.approx(0.1, abs=0.002)

        await _wait_until_still(screen)
        await _check_reports_cause_no_frames(screen, workplace.robot)


async def _wait_until_still(screen: Screen) -> None:
    """Wait until nothing has been drawn for half a second."""
    await screen.until(
        """() => {
            const now = performance.now(), last = window.lastDrawn;
            if (last?.frames !== __engine.frames) window.lastDrawn = { frames: __engine.frames, since: now };
            return last?.frames === __engine.frames && now - last.since > 500;
        }"""
    )


async def _check_reports_cause_no_frames(screen: Screen, robot: str) -> None:
    """Check that forty joint reports of a robot at standstill draw no frame, and that a requested frame draws no other.

    If a busy machine delays a report by 0.4 s or more, the view shows the robot without a signal. Then check again.
    """
    for _ in range(10):
        drawn, asked, pause = await screen.page.evaluate(
            """async robot => {
                const { telemetry } = __engine.options, { frames } = __engine;
                let last = telemetry.latest(robot).at, reports = 0, asked = 0, pause = 0;
                await new Promise((done) => {
                    const end = telemetry.subscribe((id) => {
                        const { at } = telemetry.latest(robot);
                        if (id !== robot || at === last) return;
                        pause = Math.max(pause, at - last);
                        last = at;
                        if (++reports > 40) done(end());
                        else if (reports > 20 && reports < 35 && reports % 4 === 0) asked++, __engine.invalidate();
                    });
                });
                return [__engine.frames - frames, asked, pause];
            }""",
            robot,
        )
        if pause < 0.4:
            break
    assert pause < 0.4
    assert 0 < drawn <= asked


async def test_stop_motion_stops_a_motion_of_another_user(workplace: Workplace, browser: Browser) -> None:
    client = workplace.client
    async with screen_of(browser, workplace.cell.url) as screen:
        await open_and_go_online(screen, workplace)
        start = await tcp(screen, workplace.robot)
        arguments = await goal(client, workplace.robot, 0.2)
        await client.call("MoveToPose", _slowly(arguments))
        await screen.until(
            "([id, z]) => window.__engine.item(id).endEffectors[0].position.z < z - 0.005",
            [workplace.robot, start["position"]["z"]],
        )
        await screen.page.get_by_role("button", name=texts.STOP_MOTION).click()
        ended = await client.next_event("RobotMoveToPose")
        while ended.data.move_event_type.value == "start":
            ended = await client.next_event("RobotMoveToPose")
        rest = await client.call(
            "GetEndEffectorPose", rpc.GetEndEffectorPoseArgs(workplace.robot, arguments.end_effector_id)
        )
        assert rest.position.z > start["position"]["z"] - 0.15, "the robot has completed the motion"


def _slowly(to: rpc.MoveToPoseArgs) -> rpc.MoveToPoseArgs:
    return rpc.MoveToPoseArgs(to.robot_id, to.end_effector_id, SLOW, to.position, to.orientation, safe=False)


async def test_edits_and_locks_of_another_user_are_shown(workplace: Workplace, browser: Browser) -> None:
    client = workplace.client
    async with screen_of(browser, workplace.cell.url) as screen:
        await screen.join("Eva")
        await screen.press(texts.open_document(workplace.project.name))
        await screen.item(workplace.robot)
        await client.call("AddActionPoint", rpc.AddActionPointArgs("lonely", Pose().position))
        added = await client.next_event("ActionPointChanged")
        new = added.data.id
        assert (await screen.item(new))["pose"]["position"] == {"x": 0, "y": 0, "z": 0}
        await screen.sees(texts.NOT_SAVED)
        await client.call("WriteLock", rpc.WriteLockArgs(new))
        await screen.until("id => window.__engine.item(id).badge === 'in use by colleague'", new)
        await client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"ViewStateChanged"}))
        await _tool(screen, texts.OBJECTS)
        await screen.page.get_by_role("row", name="lonely In use by colleague").click()
        # The panel shows who holds the lock, since when, and a button to ask for it.
        about = screen.page.get_by_role("region", name="About", exact=True)
        await about.get_by_text(re.compile(rf"{texts.AGO}\. Available when colleague has finished")).wait_for()
        await screen.press("Ask colleague for it")
        asked = await client.next_event("ViewStateChanged")
        assert (asked.data.scope, asked.data.values[f"asked/{new}"]["by"]) == (ViewScope.SHARED, "Eva")
        await about.get_by_text("Request sent to colleague").wait_for()
        lock = workplace.project.action_points[0].id
        await screen.page.evaluate("id => window.__engine.focus(id)", lock)
        await screen.tap(lock)
        panel = screen.page.get_by_role("complementary")
        await panel.get_by_role("heading", name=workplace.project.action_points[0].name).wait_for()
        await client.call("WriteUnlock", rpc.WriteUnlockArgs(new))
        await screen.until("id => window.__engine.item(id).badge === ''", new)
        await screen.sees("lonely is free now.")


async def test_locks_of_a_lost_page_are_released_when_the_user_returns(workplace: Workplace, browser: Browser) -> None:
    client = workplace.client
    await client.call("OpenProject", rpc.IdArgs(workplace.project.id))
    point = rpc.WriteLockArgs(workplace.project.action_points[0].id)
    async with Client(workplace.cell.url, "Kim", reconnect=False) as before:
        await before.call("WriteLock", point)
    with pytest.raises(RequestFailed, match="Kim"):
        await client.call("WriteLock", point)
    async with screen_of(browser, workplace.cell.url) as screen:
        await screen.join("Kim")
        await screen.item(workplace.robot)
        await until(lambda: _succeeds(client, "WriteLock", point), "the lock is released")
        await client.call("WriteUnlock", rpc.WriteUnlockArgs(point.object_id))


async def test_workplace_goes_online_without_a_device_and_retries_it(workplace: Workplace, browser: Browser) -> None:
    async with screen_of(browser, workplace.cell.url) as screen:
        page = screen.page
        await screen.join("Rita")
        await screen.press(texts.open_document(workplace.project.name))
        await screen.item(workplace.robot)
        await _tool(screen, texts.DEVICES)
        await screen.sees("The workplace is offline.")
        await workplace.cell.command_fake("tester", "refuse")
        try:
            await screen.press(texts.GO_ONLINE)
            tester = page.get_by_role("listitem").filter(has=page.get_by_text("tester", exact=True))
            await expect(tester).to_contain_text("not reachable", timeout=40_000)
            # The other devices are online; the failed one is listed first, with the reason.
            robot = page.get_by_role("listitem").filter(has=page.get_by_text("robot", exact=True))
            await expect(robot).to_contain_text("online", timeout=40_000)
            await page.get_by_role("button", name="Online. 1 device fault. Press to go offline").wait_for()
            listed = await page.get_by_role("list").get_by_role("listitem").all_inner_texts()
            assert [text.split()[0] for text in listed] == ["tester", "flow", "reader", "robot"]  # boxes are not listed
            assert workplace.cell.at["tester"]["modbus"].split(":")[0] in await tester.inner_text()
            # The switch now has its longest text.
            await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
            await screen.settle()
            assert not await screen.faults_with(FONTS)
            await screen.picture("device fault phone")
            await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
        finally:
            await workplace.cell.command_fake("tester", "heal")
        await screen.press("Retry tester")
        await expect(tester).not_to_contain_text("not reachable", timeout=40_000)
        await page.get_by_role("button", name=texts.GO_OFFLINE).wait_for()
        await screen.picture("devices")

        # Past notices are listed with their time.
        await screen.press(texts.SETTINGS)
        await page.get_by_role("menuitem", name="Messages").click()
        messages = page.get_by_role("dialog", name="Messages").get_by_role("listitem")
        started = messages.filter(has_text="Starting the scene")
        await expect(started).to_have_text(re.compile(r"^\d\d:\d\d:\d\dnote: .*: finished\. Not connected: tester\.$"))
        assert not await screen.faults()
        assert not await screen.barriers()
        await screen.picture("messages")
        await page.keyboard.press("Escape")
        await screen.press(texts.SETTINGS)
        await page.get_by_role("menuitem", name="Audit trail").click()
        trail = page.get_by_role("dialog", name="Audit trail")
        await trail.get_by_placeholder("User, request, item or address").fill("retryobject")
        await trail.get_by_role("listitem").filter(has_text="done").first.wait_for()
        await trail.get_by_placeholder("User, request, item or address").fill("")
        await trail.get_by_text("What changed").first.click()
        await trail.get_by_role("button", name="Check for edits").click()
        await trail.get_by_role("status").filter(has_text="Nothing was edited or removed").wait_for()
        assert not await screen.faults()
        assert not await screen.barriers()
        await screen.picture("audit trail")
        await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
        await screen.settle()
        assert not await screen.faults_with(FONTS)
        await screen.picture("audit trail phone")


async def _tool(screen: Screen, name: str) -> None:
    await screen.page.get_by_role("navigation").get_by_role("button").filter(has_text=name).click()


_OUTSIDE = """() => {
    const { clientWidth: width, clientHeight: height } = document.querySelector(".view canvas");
    const off = ({ x, y }) => x < 0 || y < 0 || x > width || y > height;
    const at = __engine.ids().filter((id) => __engine.item(id).kind === "action").map((id) => __engine.item(id).screen);
    const xs = at.map(({ x }) => x);
    return { off: at.filter(off).length, share: (Math.max(...xs) - Math.min(...xs)) / width };
}"""


async def test_camera_fits_the_cell_until_it_is_moved(workplace: Workplace, browser: Browser) -> None:
    """All actions are in the view, also next to a panel, and a moved camera stays where it is."""
    await workplace.client.call("OpenProject", rpc.IdArgs(workplace.project.id))
    async with screen_of(browser, workplace.cell.url) as screen:
        page = screen.page
        await screen.join("Eva")
        await screen.item(workplace.project.action_points[0].id)
        await screen.settle()
        for tool in ("", texts.POINTS):
            if tool:
                await page.get_by_role("navigation").get_by_role("button", name=tool, exact=True).click()
                await page.get_by_role("complementary").get_by_role("heading", name=tool, exact=True).wait_for()
            await screen.until(f"() => ({_OUTSIDE})().off === 0")
            assert (await page.evaluate(_OUTSIDE))["share"] > 0.3
        await page.evaluate("__engine.view.set([2, 0.5, 1], [0, 0, 0])")
        width = await page.evaluate("__engine.width")
        await screen.close_panels()
        await screen.until("width => __engine.width > width", width)
        assert await page.evaluate("__engine.view.camera.position.toArray()") == pytest.approx([2, 0.5, 1])

"""Jogging the robot: steps, hold-to-move, previews, goals, stop, hand guiding."""

import asyncio
import contextlib
import itertools
import math
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, expect

from arcor2_hw.client import Client
from arcor2_hw.client.errors import LockedByOther
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import DeviceTimeout
from tests.e2e.harness import Cell, scene_state, until
from tests.editor import texts
from tests.editor.reset import place_robot
from tests.editor.screen import Screen, screen_of
from tests.editor.xr import Controller, emulate

pytestmark = pytest.mark.asyncio(loop_scope="session")

STANDSTILL_DISTANCE = 1e-4
"""Largest distance between two readings of a robot at standstill, m."""


@dataclass
class Workplace:
    """An open project whose scene is online. The user at the screen is Eva."""

    cell: Cell
    client: Client
    scene: Scene
    project: Project
    robot: str
    screen: Screen

    async def tool(self) -> Position:
        """Return the tool position that the screen shows. A locked robot does not answer other clients."""
        at: dict[str, float] = (await self.screen.item(self.robot))["endEffectors"][0]["position"]
        return Position(**at)

    async def wait_for_standstill(self) -> Position:
        """Wait for standstill and return the tool position."""

        async def standstill() -> Position | None:
            before = await self.tool()
            await asyncio.sleep(0.4)  # several joint reports
            after = await self.tool()
            return after if math.dist(tuple(before), tuple(after)) < STANDSTILL_DISTANCE else None

        position: Position = await until(standstill, "the arm has stopped")
        return position

    async def robot_panel(self, mode: str) -> None:
        page = self.screen.page
        if not await page.get_by_role("complementary", name="Robot").count():
            await page.get_by_role("button", name=re.compile("^Active robot")).click()
        await self.choose(texts.ROBOT_CONTROL, mode)

    async def choose(self, group: str, option: str) -> None:
        await (
            self.screen.page.get_by_role("radiogroup", name=group).get_by_role("radio", name=option, exact=True).click()
        )

    def button(self, name: str) -> Locator:
        return self.screen.page.get_by_role("button", name=name, exact=True)


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def online(module_cell: Cell, browser: Browser) -> AsyncIterator[Workplace]:
    client = await module_cell.client("colleague")
    scene, project = await module_cell.open(client)
    robot = next(each.id for each in scene.objects if each.name == "robot")
    async with screen_of(browser, module_cell.url) as screen:
        await screen.join("Eva")
        await screen.item(robot)
        await client.call("StartSceneKeepGoing")
        await scene_state(client, SceneStateEnum.STARTED, 60)
        await screen.page.get_by_role("button", name=texts.STOP_MOTION).wait_for()
        await screen.until("id => window.__engine?.item(id)?.endEffectors?.length > 0", robot)
        # The first motion takes control, and the controller adopts the tool of the settings.
        here: Pose = await client.call("GetEndEffectorPose", rpc.GetEndEffectorPoseArgs(robot, "tcp"))
        await client.call(
            "MoveToPose", rpc.MoveToPoseArgs(robot, "tcp", 0.5, here.position, here.orientation, safe=False)
        )
        await _wait_for_motion_end(client)
        yield Workplace(module_cell, client, scene, project, robot, screen)


@pytest_asyncio.fixture(loop_scope="session")
async def workplace(online: Workplace) -> Workplace:
    """All panels are closed, and the robot is at its start position."""
    await online.screen.close_panels()
    await online.wait_for_standstill()
    await place_robot(online.cell, online.screen, online.robot)
    return online


async def _move(client: Client, robot: str, to: Pose, speed: float) -> None:
    await client.call("MoveToPose", rpc.MoveToPoseArgs(robot, "tcp", speed, to.position, to.orientation, safe=False))


async def _wait_for_motion_end(client: Client) -> str:
    """Wait until the last motion ends, and return its result."""
    while True:
        event = await client.next_event("RobotMoveToPose")
        if (phase := event.data.move_event_type.value) != "start":
            return str(phase)


async def _drop_events(client: Client) -> None:
    """Drop all events received so far."""
    with contextlib.suppress(DeviceTimeout):
        while True:
            await client.next_event(timeout=0.05)


async def test_step_moves_the_tool_and_shows_the_outcome(workplace: Workplace) -> None:
    before = await workplace.wait_for_standstill()
    await workplace.robot_panel("Tool")
    await workplace.choose(texts.PRESS_MODE, "Step")
    await workplace.button("Move along −Z").click()
    await workplace.screen.sees("Reached.")
    after = await workplace.wait_for_standstill()
    assert after.z - before.z == pytest.approx(-0.01, abs=5e-4)
    # The tool points down, so its +Z is the same direction.
    await workplace.choose("Frame", "Tool")
    await workplace.button("Move along +Z").click()
    await until(_lower(workplace, after.z - 0.009), "the tool went down")
    await workplace.choose("Frame", "World")


def _lower(workplace: Workplace, z: float) -> Any:
    async def check() -> bool:
        return bool((await workplace.tool()).z < z)

    return check


AsyncCall = Callable[[], Awaitable[object]]


async def _hold(button: Locator, press: AsyncCall, release: AsyncCall, moved: AsyncCall) -> None:
    """Hold a button until the robot has moved and the button is still held. If the hold has ended, press again.

    The first press takes control, which may take longer than the deadman timeout. A busy machine may renew too late.
    """

    async def held() -> bool:
        return await button.get_attribute("data-held") == "true"

    async def check() -> bool:
        if not await held():
            await release()
            await press()
        return bool(await moved()) and await held()

    await until(check, "the arm moves while the button is held", 20)


async def test_hold_to_move_stops_on_release(workplace: Workplace) -> None:
    before = await workplace.wait_for_standstill()
    await workplace.robot_panel("Tool")
    await workplace.choose("Mode", texts.HOLD_TO_MOVE)
    hold = workplace.button("Hold to move along +Z")
    mouse = workplace.screen.page.mouse
    await hold.hover()
    await _hold(hold, mouse.down, mouse.up, _higher(workplace, before.z + 0.01))
    await workplace.screen.page.mouse.up()
    await expect(hold).to_have_attribute("data-held", "false")
    end = await workplace.wait_for_standstill()
    assert end.z - before.z < 0.15
    # The lock is released: another user can lock the robot.
    assert await until(lambda: _is_unlocked(workplace), "the lock of the robot is released")


async def _is_unlocked(workplace: Workplace) -> bool:
    with contextlib.suppress(LockedByOther):
        await workplace.client.call("WriteLock", rpc.WriteLockArgs(workplace.robot))
        await workplace.client.call("WriteUnlock", rpc.WriteUnlockArgs(workplace.robot))
        return True
    return False


def _higher(workplace: Workplace, z: float) -> Any:
    async def check() -> bool:
        return bool((await workplace.tool()).z > z)

    return check


@pytest.mark.parametrize("end_by", ["blur", "hidden", "key up"])
async def test_hold_ends_on_blur_hidden_page_and_key_up(workplace: Workplace, end_by: str) -> None:
    page = workplace.screen.page
    before = await workplace.wait_for_standstill()
    await workplace.robot_panel("Tool")
    await workplace.choose("Mode", texts.HOLD_TO_MOVE)
    hold = workplace.button("Hold to move along −Z")
    await hold.focus()
    press, release = partial(page.keyboard.down, " "), partial(page.keyboard.up, " ")
    await _hold(hold, press, release, _lower(workplace, before.z - 0.005))
    if end_by == "blur":
        await page.evaluate("window.dispatchEvent(new Event('blur'))")
    elif end_by == "hidden":
        await page.evaluate("document.dispatchEvent(new Event('visibilitychange'))")
    else:
        await page.keyboard.up(" ")
    await expect(hold).to_have_attribute("data-held", "false")
    if end_by != "key up":
        await page.keyboard.up(" ")
    end = await workplace.wait_for_standstill()
    assert before.z - end.z < 0.15


async def test_joint_is_moved_within_its_limits(workplace: Workplace) -> None:
    await workplace.wait_for_standstill()
    await workplace.robot_panel("Joints")
    await workplace.choose("Mode", "Step")
    page = workplace.screen.page
    field = page.get_by_label(re.compile("^wrist 3 joint to"))
    await field.fill("+9000")
    await field.press("Enter")
    await workplace.screen.sees("From -360.0 to 360.0 °.")
    await field.press("Escape")
    name = "wrist_3_joint"
    before = {
        each.name: each.value
        for each in await workplace.client.call("GetRobotJoints", rpc.GetRobotJointsArgs(workplace.robot))
    }
    await workplace.button("Move wrist 3 joint up").click()

    async def turned() -> bool:
        joints = await workplace.client.call("GetRobotJoints", rpc.GetRobotJointsArgs(workplace.robot))
        value = next(each.value for each in joints if each.name == name)
        return bool(abs(value - before[name] - math.radians(5)) < 1e-3)

    await until(turned, "the wrist turned by five degrees")


async def test_goal_is_previewed_by_a_ghost_before_the_robot_moves(workplace: Workplace) -> None:
    page = workplace.screen.page
    before = await workplace.wait_for_standstill()
    await workplace.robot_panel("Go to")
    await page.get_by_label("Z mm").fill("+=30")
    await page.keyboard.press("Enter")
    await workplace.screen.sees(texts.REACHABLE)
    ghost = await workplace.screen.until("id => window.__engine.item(id).ghost", workplace.robot)
    real = (await workplace.screen.item(workplace.robot))["joints"]
    assert max(abs(ghost[name] - real[name]) for name in real) > 0.01, "the ghost is at the pose of the robot"
    assert math.dist(tuple(await workplace.tool()), tuple(before)) < STANDSTILL_DISTANCE
    await workplace.button("Move there").click()
    await until(_higher(workplace, before.z + 0.029), "the robot has reached the goal")
    # Out of reach: no ghost, no motion, and a reason.
    await page.get_by_label("X mm").fill("3000")
    await page.keyboard.press("Enter")
    answer = page.locator("p.error[role=status]")
    await expect(answer).to_be_visible()
    assert len((await answer.inner_text()).split()) > 3
    await page.get_by_label("X mm").fill("400")
    await page.keyboard.press("Enter")
    await workplace.robot_panel("Tool")
    await workplace.screen.until("id => window.__engine.item(id).ghost === null", workplace.robot)


async def test_goal_is_dragged_and_the_ghost_follows(workplace: Workplace) -> None:
    """Only the latest goal is checked, at most ten times a second; the path is shown."""
    page, screen = workplace.screen.page, workplace.screen
    before = await workplace.wait_for_standstill()
    await workplace.robot_panel("Go to")
    await workplace.button("Reset to tool").click()
    await page.evaluate("id => __engine.focus(id)", workplace.robot)
    await page.evaluate(
        """() => {
            const send = WebSocket.prototype.send;
            window.requests = [];
            WebSocket.prototype.send = function (text) {
                const { request, args } = JSON.parse(text);
                if (request === 'InverseKinematics' && args.avoid_collisions) window.requests.push(performance.now());
                return send.call(this, text);
            };
        }"""
    )
    handle = await _handle(workplace, "axis z")
    await page.mouse.move(*handle)
    await page.mouse.down()
    for step in range(1, 31):
        await page.mouse.move(handle[0], handle[1] - step)
        await asyncio.sleep(0.02)
    await page.mouse.up()
    await screen.sees(texts.REACHABLE)
    move = workplace.button("Move there")
    await expect(move).to_be_enabled()
    request_times = await page.evaluate("window.requests")
    assert len(request_times) >= 3, "the goal is not checked while it is dragged"
    assert min(b - a for a, b in itertools.pairwise(request_times)) > 90
    goal = float((await page.get_by_label("Z mm").input_value()).replace(",", "")) / 1000
    assert goal > before.z + 0.01
    ghost = await screen.until("id => window.__engine.item(id).ghost", workplace.robot)
    real = (await screen.item(workplace.robot))["joints"]
    assert max(abs(ghost[name] - real[name]) for name in real) > 0.01
    assert math.dist(tuple(await workplace.tool()), tuple(before)) < STANDSTILL_DISTANCE, "the robot has moved"
    path = await page.evaluate("__engine.straightPath")
    assert path["state"] == "free"
    assert path["to"]["z"] - path["from"]["z"] == pytest.approx(goal - before.z, abs=2e-3)
    await screen.picture("robot goal dragged")
    await move.click()
    await until(_higher(workplace, goal - 1e-3), "the robot has reached the goal")
    await workplace.wait_for_standstill()
    assert await page.evaluate("__engine.straightPath") is None, "the path is still shown"
    # Dragged out of reach: the reason is shown, the ghost stays, and one tap resets the goal.
    await workplace.choose("Drag the target", "Move")
    handle = await _handle(workplace, "axis z")
    await page.mouse.move(*handle)
    await page.mouse.down()
    await page.mouse.move(handle[0], handle[1] - 600, steps=5)
    await page.mouse.up()
    await expect(page.locator("p.error[role=status]")).to_be_visible()
    assert (await page.evaluate("__engine.straightPath"))["state"] == "blocked"
    await screen.picture("robot goal out of reach")
    await workplace.button("Reset to tool").click()
    await screen.until(
        "id => window.__engine.item(id).ghost === null && window.__engine.straightPath === null", workplace.robot
    )
    await expect(page.locator("p.error[role=status]")).to_have_count(0)
    await workplace.robot_panel("Tool")
    assert await page.evaluate("__engine.gizmo.shown") is False


async def _handle(workplace: Workplace, name: str) -> tuple[float, float]:
    """Return where a handle of the gizmo is on the page, once it is at standstill."""
    box = await workplace.screen.page.locator(".view canvas").bounding_box()
    assert box is not None
    last: dict[str, float] = {}

    async def standstill() -> dict[str, float] | None:
        nonlocal last
        at: dict[str, float] | None = await workplace.screen.page.evaluate(
            "async (name) => { await new Promise(requestAnimationFrame); return __engine.gizmo.places()[name]; }", name
        )
        still = at is not None and at == last
        last = at or {}
        return at if still else None

    at = await until(standstill, f"the handle {name} has stopped moving")
    return box["x"] + at["x"], box["y"] + at["y"]


@pytest.mark.parametrize("by", ["tap", "keys"])
async def test_stop_reaches_the_robot_in_mid_move(workplace: Workplace, by: str) -> None:
    page, client = workplace.screen.page, workplace.client
    start = await workplace.wait_for_standstill()
    up = start.z < 0.4
    await _drop_events(client)
    target = await workplace.client.call("GetEndEffectorPose", rpc.GetEndEffectorPoseArgs(workplace.robot, "tcp"))
    target.position.z += 0.2 if up else -0.2
    await client.call(
        "MoveToPose", rpc.MoveToPoseArgs(workplace.robot, "tcp", 0.05, target.position, target.orientation, safe=False)
    )
    await until((_higher if up else _lower)(workplace, start.z + (0.005 if up else -0.005)), "the robot moves")
    await page.evaluate(
        """() => {
            const send = WebSocket.prototype.send;
            window.stops = 0;
            WebSocket.prototype.send = function (text) {
                if (text.includes('StopAll')) window.stops += 1;
                return send.call(this, text);
            };
        }"""
    )
    # Stop is sent on press, while the button or key is still held.
    if by == "tap":
        await page.get_by_role("button", name=texts.STOP_MOTION).hover()
        await page.mouse.down()
        await workplace.screen.until("() => window.stops > 0")
        await page.mouse.up()
    else:
        await page.keyboard.press("Escape")
        await page.keyboard.down("Escape")
        while not await page.evaluate("window.stops"):  # a slow page receives the presses too far apart
            await page.keyboard.up("Escape")
            await page.keyboard.down("Escape")
        await page.keyboard.up("Escape")
    assert await _wait_for_motion_end(client) == "failed"
    end = await workplace.wait_for_standstill()
    assert abs(end.z - start.z) < 0.15, "the robot has completed the motion"


async def test_hand_guiding_is_active_while_held(workplace: Workplace) -> None:
    page = workplace.screen.page
    await workplace.wait_for_standstill()
    await workplace.robot_panel("By hand")
    await workplace.screen.sees("Hand teaching is off")
    await workplace.button("Hold to teach: move the arm by hand").hover()
    await page.mouse.down()
    await workplace.screen.sees("Hand teaching is on")
    await page.mouse.up()
    await workplace.screen.sees("Hand teaching is off")


async def test_headset_moves_the_robot_only_while_a_tracked_controller_holds(
    workplace: Workplace, browser: Browser
) -> None:
    async with screen_of(browser, workplace.cell.url) as screen:
        page = screen.page
        await emulate(page, headset=True)
        await screen.join("Ida")
        await screen.item(workplace.robot)
        await page.get_by_role("button", name="AR", exact=True).click()
        await page.get_by_role("button", name="Camera only").wait_for()
        await screen.press("Start AR")
        await screen.until("() => __ar?.headset?.reported")
        hand = Controller(screen)

        async def wait_for_hold(wanted: bool) -> None:
            while (await workplace.client.next_event("RobotHold", timeout=30)).data.held is not wanted:
                pass

        await workplace.client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"RobotHold"}))
        await hand.button("z1")
        before = await workplace.wait_for_standstill()
        await hand.press(True)
        await wait_for_hold(True)
        await until(_higher(workplace, before.z + 0.005), "the arm moves", 20)
        await hand.press(False)
        await wait_for_hold(False)
        await hand.press(True)
        await wait_for_hold(True)
        await page.evaluate("() => { __xr.state.lostController = true; }")
        await wait_for_hold(False)
        await page.evaluate("() => { __xr.state.lostController = false; }")
        # Tracked hands have no Stop button, so motion is disabled. The panel has Stop and shows the reason.
        await page.evaluate("() => { __xr.device.primaryInputMode = 'hand'; }")
        await screen.until("() => __ar.headset.panel.content.buttons.find(({ id }) => id === 'z1').disabled")
        assert "Motion needs a controller" in await page.evaluate("__ar.headset.panel.content.lines.join()")
        assert await page.evaluate("__ar.headset.panel.middleOf('stop')")

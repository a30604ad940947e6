"""Points: added at the robot, on a surface, by coordinates; their parent, taught orientations and reachability."""

import contextlib
import math
import re
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, expect

from arcor2_hw.client import Client
from arcor2_hw.client.errors import LockedByOther, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Orientation, Position
from arcor2_hw.data.project import ActionParameter, ActionPoint, Flow, FlowTypes, Project
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, scene_state, until
from tests.editor import texts
from tests.editor.reset import place_robot
from tests.editor.screen import Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")


@dataclass
class Workplace:
    """An open project whose scene is online. The user at the screen is Eva."""

    cell: Cell
    client: Client
    scene: Scene
    project: Project
    robot: str
    screen: Screen

    async def saved(self) -> Project:
        """Save the project and return it."""
        with contextlib.suppress(RequestFailed):  # nothing to save, or locked by the screen
            await self.client.call("SaveProject")
        project: Project = await self.client.call("GetProject", rpc.IdArgs(self.project.id))
        return project

    async def point(self, name: str, wanted: Callable[[ActionPoint], bool] = lambda _: True) -> ActionPoint:
        """Return the stored point once `wanted` is true for it."""

        async def find() -> ActionPoint | None:
            found = next((each for each in (await self.saved()).action_points if each.name == name), None)
            return found if found is not None and wanted(found) else None

        point: ActionPoint = await until(find, f"the point {name} is as wanted", 15)
        return point

    async def new_point(self, before: Project, wanted: Callable[[ActionPoint], bool] = lambda _: True) -> ActionPoint:
        """Return the point that was added after `before`, once `wanted` is true for it."""
        known = {each.id for each in before.action_points}

        async def find() -> ActionPoint | None:
            found = [each for each in (await self.saved()).action_points if each.id not in known]
            return found[0] if len(found) == 1 and wanted(found[0]) else None

        point: ActionPoint = await until(find, "one point is added and as wanted", 15)
        return point

    async def add_point(self, name: str, position: Position, orientation: Orientation | None = None) -> ActionPoint:
        """Add a point through the protocol, with an orientation named "down"."""
        await self.client.call("AddActionPoint", rpc.AddActionPointArgs(name, position))
        point = await self.point(name)
        if orientation is not None:
            await self.client.call("WriteLock", rpc.WriteLockArgs(point.id))
            args = rpc.AddActionPointOrientationArgs(point.id, orientation, "down")
            await self.client.call("AddActionPointOrientation", args)
            await self.client.call("WriteUnlock", rpc.WriteUnlockArgs(point.id))
            point = await self.point(name, lambda each: len(each.orientations) == 1)
        await self.screen.item(point.id)
        return point

    def button(self, name: str) -> Locator:
        return self.screen.page.get_by_role("button", name=name, exact=True)

    async def tool(self, name: str) -> None:
        rail = self.screen.page.get_by_role("navigation").get_by_role("button").filter(has_text=name)
        if await rail.get_attribute("aria-pressed") != "true":
            await rail.click()

    async def select(self, name: str) -> None:
        """Select an object in the list."""
        await self.tool(texts.OBJECTS)
        page = self.screen.page
        await page.get_by_role("row").filter(has=page.get_by_text(name, exact=True)).first.click()


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
        await screen.until("id => window.__engine?.item(id)?.endEffectors?.length > 0", robot)
        yield Workplace(module_cell, client, scene, project, robot, screen)


@pytest_asyncio.fixture(loop_scope="session")
async def workplace(online: Workplace) -> Workplace:
    """All panels are closed, and the robot is at its start position."""
    await online.screen.close_panels()
    await place_robot(online.cell, online.screen, online.robot)
    return online


async def test_one_tap_adds_a_point_at_the_robot(workplace: Workplace) -> None:
    before = await workplace.saved()
    tool = (await workplace.screen.item(workplace.robot))["endEffectors"][0]
    await workplace.button("Save the robot pose as a point").click()  # the only tap
    point = await workplace.new_point(before, lambda each: len(each.orientations) == len(each.robot_joints) == 1)
    assert math.dist(tuple(point.position), tuple(tool["position"].values())) < 1e-3
    # It is selected and can be renamed in the panel.
    name = workplace.screen.page.get_by_label("Point name")
    await name.fill("home point")
    await name.press("Enter")
    await workplace.point("home_point")
    # The Undo button names what it undoes.
    await workplace.screen.page.get_by_role("button", name=re.compile("^Undo ")).click()
    await workplace.point(point.name)
    # A name in use is refused at the field.
    await name.fill("feeder")
    await name.press("Enter")
    await expect(workplace.screen.page.get_by_role("complementary").get_by_role("alert")).to_be_visible()
    await name.press("Escape")


async def test_tap_on_a_surface_adds_a_point_to_the_selected_object(workplace: Workplace) -> None:
    page, screen = workplace.screen.page, workplace.screen
    table = next(each for each in workplace.scene.objects if each.name == "table")
    tester = next(each for each in workplace.scene.objects if each.name == "tester")
    before = await workplace.saved()
    await workplace.select("tester")
    await workplace.tool(texts.POINTS)
    await workplace.button("Where I tap").click()
    await page.evaluate("() => __engine.view.set([0.6, -0.5, 1.2], [0.6, -0.4, 0])")
    await screen.settle()
    spot = await page.evaluate(
        """id => {
            const { width, height } = document.querySelector('.view canvas').getBoundingClientRect();
            for (let x = width * 0.3; x < width * 0.8; x += 15)
                for (let y = height * 0.3; y < height * 0.8; y += 15)
                    if (__engine.pick(x, y, 16)[0]?.id === id && __engine.pick(x, y, 16).length === 1) return { x, y };
        }""",
        table.id,
    )
    box = await page.locator(".view canvas").bounding_box()
    assert box is not None
    assert spot is not None
    await page.mouse.click(box["x"] + spot["x"], box["y"] + spot["y"])
    point = await workplace.new_point(before, lambda each: len(each.orientations) == 1)
    assert point.parent == tester.id
    drawn = (await screen.item(point.id))["pose"]["position"]
    surface = table.pose.position.z + 0.01  # type: ignore[union-attr]
    assert drawn["z"] == pytest.approx(surface, abs=1e-4)
    assert math.hypot(drawn["x"] - 0.6, drawn["y"] + 0.4) < 0.5


async def test_point_with_typed_coordinates_gets_a_parent_without_moving(workplace: Workplace) -> None:
    page = workplace.screen.page
    before = await workplace.saved()
    await workplace.tool(texts.POINTS)
    await page.get_by_text("By numbers").click()
    for axis, value in (("X", "400"), ("Y", "-100"), ("Z", "+250")):
        await page.get_by_label(f"{axis} mm").fill(value)
        await page.keyboard.press("Enter")
    await workplace.button("Add point").click()
    point = await workplace.new_point(before)
    assert tuple(point.position) == pytest.approx((0.4, -0.1, 0.25))
    tester = next(each for each in workplace.scene.objects if each.name == "tester")
    await page.get_by_role("combobox", name="Parent").select_option("tester")
    with_parent = await workplace.point(point.name, lambda each: each.parent == tester.id)
    assert tuple(with_parent.position) == pytest.approx((-0.1, -0.25, 0.2))  # relative to its parent now
    drawn = (await workplace.screen.item(point.id))["pose"]["position"]
    assert tuple(drawn.values()) == pytest.approx((0.4, -0.1, 0.25))


async def test_orientations_are_added_rotated_and_checked_for_reachability(workplace: Workplace) -> None:
    page = workplace.screen.page
    point = await workplace.add_point("turned", Position(0.4, -0.1, 0.25))
    await workplace.select("turned")
    await page.get_by_role("button", name="Add orientation").click()
    await page.get_by_role("menuitem", name="Tool straight down").click()
    added = await workplace.point("turned", lambda each: len(each.orientations) == 1)
    orientation = added.orientations[0]
    await page.get_by_role("button", name=re.compile("^down")).first.click()
    answer = page.locator(".reaches li", has_text="robot · tcp")
    await expect(answer).to_contain_text("reachable")
    assert await page.evaluate("id => __engine.item(id).kind", orientation.id) == "orientation"
    yaw = page.get_by_label("Yaw °")
    await yaw.fill("90")
    await yaw.press("Enter")
    await workplace.point("turned", lambda each: abs(_yaw(each.orientations[0].orientation) - math.pi / 2) < 1e-6)
    # The action that moves to the orientation shows the reachability in the view, too.
    args = rpc.AddActionArgs(
        point.id,
        "go_there",
        f"{workplace.robot}/move",
        [ActionParameter("pose", "pose", f'"{orientation.id}"')],
        [Flow(FlowTypes.DEFAULT, [])],
    )
    await workplace.client.call("AddAction", args)
    action = (await workplace.point("turned", lambda each: len(each.actions) == 1)).actions[0].id
    await workplace.screen.until("id => window.__engine.item(id)?.sign === 'reachable'", action)
    # Out of reach, with the reason.
    await workplace.client.call("WriteLock", rpc.WriteLockArgs(point.id, lock_tree=True))
    far = (await workplace.point("turned")).position
    far.x += 5
    await workplace.client.call("UpdateActionPointPosition", rpc.UpdateActionPointPositionArgs(point.id, far))
    await workplace.client.call("WriteUnlock", rpc.WriteUnlockArgs(point.id))
    await expect(answer).to_contain_text("out of reach")
    await workplace.screen.until("id => window.__engine.item(id).sign === 'out_of_reach'", action)
    await workplace.tool(texts.PROGRAM)
    await page.get_by_role("radio", name="Actions", exact=True).click()
    step = page.get_by_role("complementary").locator(".steps li", has_text="go_there")
    await expect(step.locator(".reach")).to_contain_text("out of reach")
    await step.get_by_text("go_there", exact=True).click()
    reach = page.locator(".reach-of-action")
    await expect(reach).to_contain_text("robot: out of reach")
    assert len((await reach.locator(".small").inner_text()).split()) > 3, "the reason is missing"
    assert (await workplace.screen.item(action))["badge"] == "out of reach"
    await workplace.screen.picture("points action out of reach")


async def test_point_is_moved_to_the_robot_by_a_tap_and_by_hand_guiding(workplace: Workplace) -> None:
    """With hand guiding, the point moves only when the user releases the button."""
    page, screen = workplace.screen.page, workplace.screen
    point = (await workplace.add_point("guided", Position(5.4, -0.1, 0.25))).id

    async def distance() -> float:
        drawn = (await screen.item(point))["pose"]["position"]
        tool = (await screen.item(workplace.robot))["endEffectors"][0]["position"]
        return float(math.dist(drawn.values(), tool.values()))

    async def at_robot() -> bool:
        return bool(await distance() < 1e-3)

    await workplace.select("guided")
    assert await distance() > 1
    await workplace.button(texts.MOVE_POINT_TO_ROBOT).click()
    await until(at_robot, "the point is at the tool")
    joints = await workplace.client.call("GetRobotJoints", rpc.GetRobotJointsArgs(workplace.robot))
    goal = [each.value for each in joints]
    goal[1] += 0.1
    button = page.get_by_role("button", name=re.compile("^Hold to teach"))

    async def in_freedrive() -> bool:
        return bool((await workplace.cell.command_fake("robot", "truth"))["freedrive"])

    async def guided() -> bool:
        """Guide the robot; press again if the hold has ended, as it may on a busy machine."""
        if await button.get_attribute("data-held") != "true":
            await page.mouse.up()
            await button.hover()
            await page.mouse.down()
        truth = await workplace.cell.command_fake("robot", "truth")
        if not truth["freedrive"]:
            return False
        if max(abs(a - b) for a, b in zip(truth["q"], goal, strict=True)) < 1e-3:
            return await button.get_attribute("data-held") == "true"
        if not any(truth["qd"]):
            with contextlib.suppress(AssertionError):  # hand guiding has ended meanwhile
                await workplace.cell.command_fake("robot", "guide", q=goal, speed=0.5)
        return False

    await until(guided, "the arm is guided to the goal", 20)
    assert await distance() > 0.02, "the point moved before the release"
    await page.mouse.up()
    await until(at_robot, "the point is at the tool after the release", 15)
    assert not await in_freedrive()


async def test_note_on_a_point_is_shared(workplace: Workplace) -> None:
    point = await workplace.add_point("noted", Position(0.3, 0.1, 0.2))
    await workplace.select("noted")
    note = workplace.screen.page.get_by_role("textbox", name="Note", exact=True)
    await note.fill("mind the cable")
    await note.blur()

    async def stored() -> bool:
        state = await workplace.client.call("GetViewState", rpc.GetViewStateArgs("shared", workplace.project.id))  # type: ignore[arg-type]
        return bool(state.values.get(f"note/{point.id}") == "mind the cable")

    await until(stored, "the note is stored for all users")
    changed = rpc.SetViewStateArgs("shared", {f"note/{point.id}": "the cable is fixed"}, workplace.project.id)  # type: ignore[arg-type]
    await workplace.client.call("SetViewState", changed)
    await expect(note).to_have_value("the cable is fixed")


async def test_robot_is_previewed_and_moved_to_a_taught_orientation(workplace: Workplace) -> None:
    page, screen = workplace.screen.page, workplace.screen
    tool = (await screen.item(workplace.robot))["endEffectors"][0]
    now = Orientation(**tool["orientation"])
    turned = Orientation.from_rotation_vector(0.0, 0.0, 0.4) * now
    point = await workplace.add_point("taught", Position(**tool["position"]), turned)
    down = point.orientations[0].id
    # An action shows the pose of its parameter.
    await workplace.select("pick")
    for shown in ("Boolean(window.__engine.item(id).ghost)", "!window.__engine.item(id).ghost"):
        await workplace.button("Show pose in the 3D view").click()
        await screen.until(f"id => {shown}", workplace.robot)
    await workplace.select("taught")
    await page.get_by_role("button", name=re.compile("^down")).first.click()
    before = (await screen.item(workplace.robot))["joints"]
    await page.get_by_text("Speed: 25 %").click()
    await page.get_by_role("slider", name="Speed").fill("1")
    await workplace.button("Preview robot").click()
    await screen.sees(texts.REACHABLE)
    ghost = await screen.until("id => window.__engine.item(id).ghost", workplace.robot)
    real = (await screen.item(workplace.robot))["joints"]
    assert max(abs(real[name] - before[name]) for name in real) < 1e-3, "the preview moved the robot"
    assert max(abs(ghost[name] - real[name]) for name in real) > 0.05
    await screen.picture("points ghost at an orientation")
    await workplace.button("Move there").click()
    tool_errors = """([robot, orientation]) => {
        const tool = window.__engine.item(robot).endEffectors[0], wanted = window.__engine.item(orientation).pose;
        const [p, q] = [tool.orientation, wanted.orientation];
        const turned = 2 * Math.acos(Math.min(1, Math.abs(p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w)));
        const [a, b] = [tool.position, wanted.position];
        return { turned, distance: Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z) };
    }"""

    async def reached() -> bool:
        found = await page.evaluate(tool_errors, [workplace.robot, down])
        return bool(found["turned"] < 2e-3 and found["distance"] < 2e-3)

    await until(reached, "the tool is at the taught pose", 20)

    async def stopped() -> bool:
        return not any((await workplace.cell.command_fake("robot", "truth"))["qd"])

    await until(stopped, "the arm has stopped")
    # The tool is rotated to another orientation at the same position.
    await workplace.client.call("WriteLock", rpc.WriteLockArgs(down))
    yawed = Orientation.from_rotation_vector(0.0, 0.0, 0.8) * now
    await workplace.client.call("UpdateActionPointOrientation", rpc.UpdateActionPointOrientationArgs(down, yawed))
    await workplace.client.call("WriteUnlock", rpc.WriteUnlockArgs(down))
    await screen.until(f"(ids) => ({tool_errors})(ids).turned > 0.1", [workplace.robot, down])
    await page.get_by_role("button", name=re.compile("^Active robot")).click()
    await page.get_by_role("radiogroup", name=texts.ROBOT_CONTROL).get_by_role("radio", name="Tool", exact=True).click()
    await workplace.button("Align with down").click()
    await until(reached, "the tool has the taught orientation", 20)
    await workplace.button(texts.CLOSE_PANEL).click()


def _yaw(q: Any) -> float:
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))


async def test_joints_of_a_moved_point_are_invalid_until_recomputed(workplace: Workplace) -> None:
    page = workplace.screen.page
    await workplace.client.call("AddApUsingRobot", rpc.AddApUsingRobotArgs(workplace.robot, "tcp", "moved"))
    point = await workplace.point("moved", lambda each: len(each.robot_joints) == 1)
    await workplace.client.call("WriteLock", rpc.WriteLockArgs(point.id, lock_tree=True))
    point.position.z -= 0.05
    await workplace.client.call(
        "UpdateActionPointPosition", rpc.UpdateActionPointPositionArgs(point.id, point.position)
    )
    await workplace.client.call("WriteUnlock", rpc.WriteUnlockArgs(point.id))
    await workplace.select("moved")
    await expect(page.get_by_label("Point name")).to_have_value("moved")
    await page.get_by_role("button", name=re.compile("^default · robot")).click()
    await workplace.screen.sees("The point has moved. These joints no longer reach it.")
    before = point.robot_joints[0].joints
    await workplace.button("Recompute").click()
    # The saved point is older than the move until the editor has released its lock.
    solved = await workplace.point(
        "moved", lambda each: each.position == point.position and each.robot_joints[0].is_valid
    )
    moved = max(abs(a.value - b.value) for a, b in zip(before, solved.robot_joints[0].joints, strict=True))
    assert 0.005 < moved < 1.0, "the new joints are equal to the old ones or far from them"


async def test_points_are_copied_in_a_row_and_locked_points_refuse_changes(workplace: Workplace) -> None:
    page = workplace.screen.page
    source = await workplace.point("feeder")
    await workplace.select("feeder")
    await page.get_by_text("Copies in a row").click()
    await page.get_by_label("Copies", exact=False).last.fill("2")
    await page.keyboard.press("Enter")
    await workplace.button("Make 2 copies").click()
    first = await workplace.point("feeder_copy")
    assert first.position.x - source.position.x == pytest.approx(0.05)

    async def both() -> bool:
        return sum(each.name.startswith("feeder_copy") for each in (await workplace.saved()).action_points) == 2

    await until(both, "the second copy is stored")
    await workplace.select("feeder")
    await page.get_by_text("Copies in a row").click()
    await workplace.button("Mirror Y").click()

    async def mirrored() -> bool:
        copies = [each for each in (await workplace.saved()).action_points if each.name.startswith("feeder_copy")]
        sides = [(each.position.x, each.position.y) for each in copies]
        return (source.position.x, -source.position.y) in sides

    await until(mirrored, "the mirrored copy is stored")
    # A point locked by another user cannot be changed; the button names the user.

    async def locked() -> bool:
        with contextlib.suppress(LockedByOther):  # until the screen has released its lock
            await workplace.client.call("WriteLock", rpc.WriteLockArgs(source.id))
            return True
        return False

    await until(locked, "the colleague holds the lock of the point")
    refused = page.get_by_role("button", name=re.compile("^Move to the robot.*In use by colleague"))
    await expect(refused).to_have_attribute("aria-disabled", "true")
    await workplace.client.call("WriteUnlock", rpc.WriteUnlockArgs(source.id))
    await expect(workplace.button(texts.MOVE_POINT_TO_ROBOT)).to_be_visible()

"""Object poses from the robot's tool and from a camera, with simulated devices."""

import asyncio
import functools
import math
import re
from collections.abc import AsyncIterator

import httpx
import numpy as np
import pytest
import pytest_asyncio
from msgspec import UNSET
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.client.errors import LockedByOther
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Mesh, ObjectModel
from arcor2_hw.data.scene import Scene, SceneObject
from tests.e2e.harness import Cell, scene_state, until
from tests.e2e.workplace_with_camera import CAMERA, ROBOT, pose_error
from tests.editor import texts
from tests.editor.scene_with_camera import camera_of, configure_markers, new_scene
from tests.editor.screen import VIEWPORTS, Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")


async def _try_to_save(client: Client) -> bool:
    try:
        await client.call("SaveScene")
    except LockedByOther:  # the screen still holds its locks
        return False
    return True


async def _saved(client: Client, scene: str, name: str) -> SceneObject:
    await until(lambda: _try_to_save(client), "the scene can be saved")
    found: Scene = await client.call("GetScene", rpc.IdArgs(scene))
    return next(each for each in found.objects if each.name == name)


async def _tool_position(screen: Screen, robot: str) -> Position:
    return Position(**(await screen.item(robot))["endEffectors"][0]["position"])


@pytest_asyncio.fixture(loop_scope="session")
async def colleague(cell: Cell) -> AsyncIterator[Client]:
    yield await cell.client("colleague")


async def test_object_is_placed_at_the_tool(cell: Cell, colleague: Client, browser: Browser) -> None:
    client = colleague
    scene, _ = await cell.open(client)
    await client.call("CloseProject")
    await client.call("OpenScene", rpc.IdArgs(scene.id))
    robot = next(each.id for each in scene.objects if each.name == "robot")
    async with screen_of(browser, cell.url) as screen:
        page = screen.page
        screen.expected_errors = ("409 (Conflict)",)  # the browser's message for a refused REST request
        await screen.join("Eva")
        await screen.item(robot)
        await client.call("StartSceneKeepGoing")
        await scene_state(client, SceneStateEnum.STARTED, 60)
        await screen.until("id => window.__engine?.item(id)?.endEffectors?.length > 0", robot)
        await page.get_by_role("navigation").get_by_role("button").filter(has_text=texts.OBJECTS).click()
        await page.get_by_role("complementary").get_by_text("tester", exact=True).first.click()
        # The tester's values are read and drawn while they are shown.
        await page.get_by_text("Trends of values").click()
        trend = page.get_by_role("img", name=re.compile("Boards tested.*, last 5 minutes"))
        await expect(page.get_by_role("listitem").filter(has_text="Supply voltage")).to_contain_text("unknown")
        await expect(page.get_by_role("listitem").filter(has_text="Boards tested")).to_contain_text("0")
        assert await trend.locator("canvas").count() == 1
        await trend.scroll_into_view_if_needed()
        for name in ("tablet", "ipad", "phone"):
            await page.set_viewport_size(VIEWPORTS[name])  # type: ignore[arg-type]
            await screen.settle()
            await screen.picture(f"trends {name}")
            assert await screen.faults() == [], name
        await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
        await page.get_by_text("Trends of values").click()
        await page.get_by_role("radio", name="Middle").click()
        await page.get_by_role("button", name="Set pose from tool", exact=True).click()
        touched = await _tool_position(screen, robot)
        tester = next(each for each in scene.objects if each.name == "tester")

        async def at_tool() -> bool:
            at = (await screen.item(tester.id))["pose"]["position"]
            return math.dist(tuple(at.values()), tuple(touched)) < 1e-3

        await until(at_tool, "the tester is at the tool", 15)
        saved = await _saved(client, scene.id, "tester")
        assert math.dist(tuple(saved.pose.position), tuple(touched)) < 1e-3  # type: ignore[union-attr]

        # Three points at the same place define no frame. The server refuses them with the reason, and nothing moves.
        await page.get_by_text("With three points").click()
        for name in ("Origin", "On the x axis", "In the xy plane"):
            await page.get_by_role("button", name=re.compile(name)).click()
        await page.get_by_role("button", name=texts.UPDATE_POSE, exact=True).click()
        await expect(page.get_by_role("complementary").get_by_role("alert")).to_be_visible()
        assert await at_tool()
        await client.call("StopScene")
        await scene_state(client, SceneStateEnum.STOPPED, 30)


# ------------------------------------------------------------------------------------------------ from pictures
TOUCHES = (
    (0.4, -1.3, 1.5, -1.2, -1.2, 0.3),
    (0.6, -1.3, 1.5, -1.2, -1.2, 0.3),
    (0.4, -1.1, 1.5, -1.2, -1.2, 0.3),
    (0.7, -1.2, 1.3, -1.2, -1.2, 0.3),
)
"""Joints at which the tool touches the points of the part, rad."""
PART = Pose(Position(0.3, 0.2, 0.1), Orientation.from_rotation_vector(0.1, -0.2, 0.7))
"""Real pose of the part."""
POINT_ERROR = 0.004
"""Error of the last touched point, m."""
FACES = (((0, 0, 0), (0, 0.1, 0), (0.1, 0, 0)), ((0, 0, 0), (0.1, 0, 0), (0, 0, 0.1)))
STL = "".join(
    f"facet normal 0 0 0\nouter loop\n{''.join(f'vertex {x} {y} {z}' + chr(10) for x, y, z in face)}endloop\nendfacet\n"
    for face in FACES
)


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def camera(shared_cell: Cell) -> AsyncIterator[None]:
    """A simulated camera in the shared workplace."""
    async with camera_of(shared_cell):
        yield


@pytest_asyncio.fixture(loop_scope="session")
async def seen(cell: Cell, camera: None) -> AsyncIterator[tuple[Client, dict[str, str]]]:
    """A camera that sees a robot and markers, in a scene whose poses of camera and robot are wrong."""
    client = await cell.client("helper")
    yield client, await new_scene(cell, client)


async def _shown_pose(screen: Screen, id: str) -> Pose:  # noqa: A002
    shown = (await screen.item(id))["pose"]
    return Pose(Position(**shown["position"]), Orientation(**shown["orientation"]))


async def _check_phone_in_dark_colours(screen: Screen, name: str) -> None:
    page = screen.page
    await page.emulate_media(color_scheme="dark")
    await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
    await screen.settle()
    assert await screen.faults() == []
    await screen.picture(name)
    await page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
    await page.emulate_media(color_scheme="light")


async def _select(screen: Screen, name: str) -> None:
    page = screen.page
    tool = page.get_by_role("navigation").get_by_role("button").filter(has_text=texts.OBJECTS)
    if await tool.get_attribute("aria-pressed") != "true":
        await tool.click()
    await page.get_by_role("complementary").get_by_text(name, exact=True).first.click()
    await page.get_by_role("complementary").get_by_role("heading", name=name, exact=True).wait_for()


async def test_camera_and_robot_are_calibrated_from_pictures(
    cell: Cell, seen: tuple[Client, dict[str, str]], browser: Browser
) -> None:
    client, ids = seen
    async with screen_of(browser, cell.url) as screen:
        page = screen.page
        await screen.join("Eva")
        await screen.item(ids["arm"])
        panel, bar = page.get_by_role("complementary"), page.get_by_role("region", name=texts.MESSAGE_BAR)
        await page.get_by_role("button", name=texts.GO_ONLINE).click()
        await bar.locator(".task").filter(has_text="Starting the scene by pictures · Eva").wait_for()
        await scene_state(client, SceneStateEnum.STARTED, 60)
        # The server's notification about the robot is shown.
        await (
            bar.locator(".notice.info").filter(has_text="arm: The calibration in the controller is now used").wait_for()
        )

        await _select(screen, "eye")
        await screen.press("Take a picture")
        picture = page.get_by_role("img", name="Camera picture")
        await picture.wait_for()
        assert await picture.evaluate("image => image.decode().then(() => image.naturalWidth)") == 1280
        # The live view shows one picture after the other. If no new one arrives, the last one stays with its age.
        await page.get_by_text("Live picture").click()
        await screen.sees(re.compile("pictures per second"))
        await screen.picture("live camera")
        await page.route("**/picture", lambda route: route.abort())
        screen.expected_errors += ("ERR_FAILED",)
        await screen.sees(re.compile(r"\d+ s old"))
        await screen.picture("old camera picture")
        await page.unroute("**/picture")
        await screen.sees(re.compile("pictures per second"))
        await page.get_by_text("Live picture").click()
        await screen.press(texts.FIND_BY_MARKERS)
        # The message bar and the panel show the server's reason.
        failed = bar.locator(".task[data-state=failed]")
        await failed.filter(has_text="No markers are configured").wait_for()
        reason = panel.get_by_text(re.compile(rf"^Failed {texts.AGO}: No markers are configured"))
        await reason.wait_for()
        assert await bar.get_by_text("No markers are configured").count() == 1
        await configure_markers(cell)
        # A panel that is opened again does not show finished attempts.
        await screen.close_panels()
        await _select(screen, "eye")
        await panel.get_by_role("button", name=texts.FIND_BY_MARKERS).wait_for()
        await expect(reason).to_have_count(0)
        before = await _shown_pose(screen, ids["eye"])
        # The failed attempt does not hide the running one.
        await asyncio.gather(panel.get_by_text("In progress: ").wait_for(), screen.press(texts.FIND_BY_MARKERS))
        await panel.get_by_role("list", name="Calibration history").get_by_text("known to").wait_for()
        millimetres, degrees = pose_error(await _shown_pose(screen, ids["eye"]), CAMERA)
        assert millimetres < 3.0
        assert degrees < 0.2
        change = panel.get_by_role("group", name="Before and after")
        moved = re.search(r"Moved by ([\d.]+) mm and [\d.]+°", await change.inner_text())
        assert moved is not None
        assert abs(float(moved[1]) - pose_error(before, CAMERA)[0]) < 3.0
        await screen.press("Check lens with markers")
        await panel.get_by_role("status").get_by_text("focal length").wait_for()
        # The corners that the server finds are drawn over the picture.
        await screen.press("Find markers")
        found = await panel.get_by_text(re.compile(r"^\d markers found")).inner_text()
        inside = (
            "all => all.every(({ points }) => [...points].every(({ x, y }) => x > 0 && x < 1280 && y > 0 && y < 720))"
        )
        outlines = panel.locator(".camera-markers polygon")
        await expect(outlines).to_have_count(int(found[0]))
        assert await outlines.evaluate_all(inside)
        assert await screen.faults() == []
        await screen.picture("calibrated camera")
        # Undo the calibration, and repeat it.
        await change.get_by_role("button", name="Restore the old pose").click()
        await expect(change).to_have_count(0)
        assert pose_error(await _shown_pose(screen, ids["eye"]), before)[0] < 0.01
        await screen.press(texts.FIND_BY_MARKERS)
        await change.get_by_role("button", name="Keep the new pose").click()
        await expect(change).to_have_count(0)

        await _select(screen, "arm")
        before = await _shown_pose(screen, ids["arm"])
        assert pose_error(before, ROBOT)[0] > 20.0
        await screen.press("Calibrate with eye")
        await bar.locator(".task").filter(has_text="Calibration of arm · Eva").wait_for()
        await change.wait_for()
        millimetres, degrees = pose_error(await _shown_pose(screen, ids["arm"]), ROBOT)
        assert millimetres < 2.5
        assert degrees < 0.2
        # The old place is a ghost until the user accepts the new one. Undo is disabled while online.
        assert (await screen.item(ids["arm"]))["ghost"]
        await screen.picture("calibrated robot")
        await _check_phone_in_dark_colours(screen, "calibrated robot phone")
        back = change.get_by_role("button", name="Restore the old pose")
        await expect(back).to_have_attribute("aria-disabled", "true")
        assert await screen.faults() == []
        await change.get_by_role("button", name="Keep the new pose").click()
        await screen.until("id => !window.__engine.item(id).ghost", ids["arm"])
        await client.stop_scene()
        await scene_state(client, SceneStateEnum.STOPPED, 30)


async def test_aiming_wizard_shows_how_well_the_points_fit(
    cell: Cell, seen: tuple[Client, dict[str, str]], browser: Browser
) -> None:
    client, ids = seen
    await client.start_scene()
    await scene_state(client, SceneStateEnum.STARTED, 60)
    touched = [await _touch(cell, client, ids["arm"], q) for q in TOUCHES]
    await client.stop_scene()
    await scene_state(client, SceneStateEnum.STOPPED, 30)
    part_from_world = np.linalg.inv(PART.matrix())
    known = [Pose.from_matrix(part_from_world @ Pose(each).matrix()) for each in touched]
    known[-1] = Pose(known[-1].position + Position(0, 0, POINT_ERROR))
    async with httpx.AsyncClient(timeout=60, base_url=cell.url.replace("ws", "http", 1)) as rest:
        stored = await rest.post(
            "/assets", files={"assetData": ("part.stl", f"solid part\n{STL}endsolid part\n".encode())}
        )
        assert stored.status_code == 200, stored.text
    mesh = ObjectModel.of(Mesh("part", stored.json()["id"], known))
    await client.call(
        "AddVirtualCollisionObjectToScene", rpc.AddVirtualCollisionObjectToSceneArgs("part", Pose(), mesh)
    )
    part = (await _saved(client, ids["scene"], "part")).id
    async with screen_of(browser, cell.url) as screen:
        page = screen.page
        panel = page.get_by_role("complementary")
        await screen.join("Eva")
        await screen.item(part)
        await client.start_scene()
        await scene_state(client, SceneStateEnum.STARTED, 60)
        await screen.until("id => window.__engine?.item(id)?.endEffectors?.length > 0", ids["arm"])
        await _select(screen, "part")
        # A preview on the tool; no request is sent.
        tool = await _tool_position(screen, ids["arm"])
        place = panel.get_by_role("region", name="Set pose with robot")
        await place.get_by_role("radio", name="Top").click()
        await place.get_by_text(texts.SHOW_ON_TOOL).click()
        await place.get_by_role("alert").filter(has_text="Use the middle").wait_for()
        await place.get_by_role("radio", name="Middle").click()
        await until(lambda: _is_near(screen, part, tool, 1e-3), "the part is shown at the tool", 15)
        await screen.picture("on the tool")
        await place.get_by_text(texts.SHOW_ON_TOOL).click()
        await until(lambda: _is_near(screen, part, Position(), 1e-3), "the part is shown at its pose", 15)

        await screen.press("Start")
        for number, (q, at) in enumerate(zip(TOUCHES, touched, strict=True), 1):
            await cell.command_fake("robot", "place", q=q)
            await until(functools.partial(_tool_is_near, screen, ids["arm"], at), "the tool is shown at the point", 15)
            await screen.press(f"Record point {number}")
            await panel.get_by_role("button", name=f"Record point {number} again").wait_for()
        # Four points, one with an error of 4 mm: the fit is shown before anything is placed.
        fit = panel.get_by_text(re.compile(r"RMS error [0-2]\.\d mm"))
        await fit.wait_for()
        await screen.picture("aimed")
        await screen.press(texts.UPDATE_POSE)
        await screen.sees("Pose updated.")
        saved = await _saved(client, ids["scene"], "part")
        assert saved.pose is not UNSET
        errors = [(saved.pose * point).position.distance_to(at) for point, at in zip(known, touched, strict=True)]
        assert max(errors) < POINT_ERROR
        await until(
            functools.partial(_is_near, screen, part, saved.pose.position, 1e-6),
            "the part is shown at its new pose",
            15,
        )
        await client.stop_scene()
        await scene_state(client, SceneStateEnum.STOPPED, 30)


async def _touch(cell: Cell, client: Client, arm: str, q: tuple[float, ...]) -> Position:
    """Put the simulated robot at these joints and return the position of its tool."""
    await cell.command_fake("robot", "place", q=q)

    async def arrived() -> bool:
        joints = await client.get_robot_joints(arm)
        return all(abs(joint.value - value) < 1e-3 for joint, value in zip(joints, q, strict=True))

    await until(arrived, "the arm is at these joints", 10)
    effector = next(iter(await client.get_end_effectors(arm)))
    tip = await client.get_end_effector_pose(robot_id=arm, end_effector_id=effector)
    return tip.position


async def _is_near(screen: Screen, id: str, wanted: Position, within: float) -> bool:  # noqa: A002
    return (await _shown_pose(screen, id)).position.distance_to(wanted) < within


async def _tool_is_near(screen: Screen, robot: str, wanted: Position) -> bool:
    return (await _tool_position(screen, robot)).distance_to(wanted) < 1e-3

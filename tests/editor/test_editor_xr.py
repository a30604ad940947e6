"""AR with WebXR on an emulated tablet and an emulated headset, whose poses are known."""

import contextlib
import json
import re
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest
import pytest_asyncio
from msgspec import to_builtins
from playwright.async_api import Browser, Locator, Page, expect

from arcor2_hw.client import Client
from arcor2_hw.client.errors import RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.events import ChangeType, SceneStateEnum
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.project import ActionParameter, Flow
from tests.e2e.harness import scene_state
from tests.editor import texts
from tests.editor.camera_video import MIDDLE, look_at, marker_table
from tests.editor.screen import VIEWPORTS, Screen, screen_of
from tests.editor.test_editor_ar import ASIDE, MAX_ASIDE, MAX_NEAR, check_stop
from tests.editor.xr import LENS, SHOTS, Controller, emulate, in_xr, overlay_errors, place_device, wait_for_overlay
from tests.server.core.serving import ServerProcess, running, talking

pytestmark = pytest.mark.asyncio(loop_scope="session")

BOX = Position(0.19, 0.14, 0.02)


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def server(tmp_path_factory: pytest.TempPathFactory, built_editor: Path) -> AsyncIterator[ServerProcess]:
    """A server with two markers and a scene with a box between them and an object with program flow."""
    directory = tmp_path_factory.mktemp("xr")
    (directory / "markers.yaml").write_text(json.dumps(marker_table()))  # YAML contains JSON
    box = ObjectModel(Model3dType.BOX, box=Box("box", 0.1, 0.06, 0.04))
    async with running(directory / "data", "--markers", str(directory / "markers.yaml")) as process:
        async with talking(process.url, "preparer") as talker:
            await talker.granted("NewScene", {"name": "Cell"})
            await talker.granted(
                "AddVirtualCollisionObjectToScene", to_builtins({"name": "box", "pose": Pose(BOX), "model": box})
            )
            await talker.granted("AddObjectToScene", {"name": "flow", "type": "FlowActions"})
            await talker.granted("SaveScene")
            await talker.granted("CloseScene", {})
        yield process


async def open_scene(client: Client) -> str:
    """Close the documents that an earlier test has left, open the scene, and return its id."""
    for request in ("StopPackage", "StopScene"):
        with contextlib.suppress(RequestFailed):
            await client.call(request)
    with contextlib.suppress(RequestFailed):
        await client.call("CloseProject", rpc.CloseProjectArgs(force=True))
    (scene,) = await client.list_scenes()
    with contextlib.suppress(RequestFailed):  # it is open
        await client.call("OpenScene", rpc.IdArgs(scene.id))
    return scene.id


async def open_project(client: Client, scene: str, name: str) -> None:
    """Open a new project of the scene."""
    await client.call("CloseScene", rpc.CloseSceneArgs(force=True))
    await client.call("NewProject", rpc.NewProjectArgs(scene, name))
    await client.next_event("OpenProject")


async def join(screen: Screen) -> str:
    """Join, and return the id of the box."""
    await screen.join("Eva")
    await screen.until("() => window.__engine?.ids().length > 0")
    await screen.page.get_by_role("button", name="AR", exact=True).click()
    await screen.page.get_by_role("button", name="Camera only").wait_for()
    found: str = await screen.page.evaluate("__engine.ids().find((id) => __engine.item(id).name === 'box')")
    return found


async def test_tablet_tracks_its_pose_and_markers_correct_it(
    server: ServerProcess, browser: Browser, pytestconfig: pytest.Config
) -> None:
    async with (
        screen_of(browser, server.url, "ipad", touch=True) as screen,
        Client(server.url, "Adam", reconnect=False) as adam,
    ):
        page = screen.page
        await emulate(page)
        scene = await open_scene(adam)
        await adam.call("StartScene")
        await scene_state(adam, SceneStateEnum.STARTED)
        box = await join(screen)
        await screen.picture("xr start")
        # If the session does not start or hides the page, the reason and the next step are shown.
        for change, reason in (("refuses", "The browser did not start AR."), ("covers", "does not show the controls")):
            await page.evaluate("(change) => { __xr.state[change] = true; }", change)
            await screen.press("Start AR")
            await screen.sees(reason)
            await page.evaluate("(change) => { __xr.state[change] = false; }", change)
        await place_device(screen, SHOTS[0])
        await screen.press("Start AR")
        quality = page.get_by_role("group", name="Quality of AR")
        await expect(quality).to_have_text(re.compile(r"Good ±\d+ mm, 2 markers, now"))
        await wait_for_overlay(screen, SHOTS[0], [MIDDLE], MAX_NEAR)
        await wait_for_overlay(screen, SHOTS[0], ASIDE, MAX_ASIDE)
        assert await screen.page.evaluate("async () => (await __xr.see()).drawn") > 1000
        await check_stop(screen)
        assert await screen.faults() == []
        await screen.picture("xr tablet")
        # Without markers in the picture, the overlay follows the device, and the quality shows it.
        await page.evaluate(
            "() => { const c = document.createElement('canvas'); c.width = 1180; c.height = 820; __xr.state.shot = c; }"
        )
        await expect(quality).to_have_text(re.compile("Tracked"))
        await place_device(screen, SHOTS[1], picture=False)
        await wait_for_overlay(screen, SHOTS[1], ASIDE, MAX_ASIDE)
        # The tracking has drifted by 30 mm. Markers correct the overlay, and the correction is reported.
        await place_device(screen, SHOTS[2], off=(0.03, 0, 0))
        await screen.sees(re.compile(r"The overlay was corrected by (29|30|31) mm."))
        await wait_for_overlay(screen, SHOTS[2], ASIDE, MAX_ASIDE)
        # Taps on the page are not WebXR selections. They select the item that is drawn there.
        assert not await page.evaluate(
            "document.body.dispatchEvent(new Event('beforexrselect', { cancelable: true, bubbles: true }))"
        )
        await screen.tap(box)
        await page.get_by_role("complementary").get_by_role("heading", name="box").wait_for()
        # The browser does not show the native list of a select over the session. A dialog replaces it.
        step = page.get_by_role("complementary").get_by_label("Step")
        await step.click()
        await screen.picture("xr list")
        await page.get_by_role("dialog").get_by_role("button", name="1 mm", exact=True).click()
        assert await step.evaluate("(each) => each.selectedOptions[0].text") == "1 mm"
        await page.evaluate("() => __xr.see()")
        await screen.picture("xr selected")
        # A frozen picture stays, and the editor works over it.
        await screen.press("Freeze")
        await screen.sees("Frozen")
        frozen = await overlay_errors(screen, SHOTS[2], [MIDDLE])
        await place_device(screen, SHOTS[0], picture=False)
        await page.evaluate("new Promise((done) => __xr.state.session.requestAnimationFrame(done))")
        assert await overlay_errors(screen, SHOTS[2], [MIDDLE]) == pytest.approx(frozen, abs=1e-6)
        drawn = await page.evaluate("__xr.see()")
        assert drawn["drawn"] == drawn["all"]
        await screen.picture("xr frozen")
        await screen.press("Continue")
        # Lost tracking dims the overlay and is reported.
        await page.evaluate("() => { __xr.state.emulated = true; }")
        await expect(quality).to_have_text(re.compile("Position lost"))
        await page.evaluate("() => { __xr.state.emulated = false; }")
        await expect(quality).not_to_have_text(re.compile("Position lost"))
        await screen.close_panels()
        await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
        await check_stop(screen)
        assert await screen.faults() == []
        await screen.picture("xr phone")
        await page.set_viewport_size(VIEWPORTS["ipad"])  # type: ignore[arg-type]
        await screen.settle()
        # The 3D view keeps the selection and the viewpoint.
        await screen.tap(box)
        await page.get_by_role("complementary").get_by_role("heading", name="box").wait_for()
        # Read the viewpoint at the click, because a marker may correct the view before it.
        await page.evaluate(
            "() => addEventListener('click', () => { window.__eye = __engine.view.camera.position.toArray(); },"
            " { capture: true, once: true })"
        )
        await screen.press("3D view")
        await page.get_by_role("button", name="Show all").wait_for()
        await page.get_by_role("complementary").get_by_role("heading", name="box").wait_for()
        assert await page.evaluate("__engine.view.viewpoint.position") == pytest.approx(
            await page.evaluate("window.__eye"), abs=1e-3
        )
        assert await page.evaluate("__xr.state.session.ended ?? !document.body.classList.contains('xr')")
        assert await page.evaluate("__engine.scene.background !== null")
        # Without markers, the workplace is placed on the surface ahead and stays there.
        await page.route("**/api/calibration/markers", lambda route: route.fulfill(body='{"markers": []}'))
        await page.get_by_role("button", name="AR", exact=True).click()
        await screen.press("Start AR")
        await screen.sees("Look at a surface, and press Place.")
        await screen.press("Place")
        await expect(quality).to_have_text(re.compile("Placed by hand"))
        before = (await screen.item(box))["screen"]
        await page.get_by_role("button", name="Right", exact=True).click()
        await screen.until("([id, x]) => __engine.item(id).screen.x > x + 2", [box, before["x"]])
        await screen.press("Leave AR")
        await adam.call("StopScene")
        await scene_state(adam, SceneStateEnum.STOPPED)
        # A program by crosshair and one thumb: on a tablet with the right hand; with --matrix, the left one on a phone.
        await page.unroute("**/api/calibration/markers")
        await open_project(adam, scene, "Thumbs")
        await page.get_by_role("heading", name="Thumbs", exact=True).wait_for()
        await place_device(screen, SHOTS[0])
        await page.get_by_role("button", name="AR", exact=True).click()
        await screen.press("Start AR")
        await wait_for_overlay(screen, SHOTS[0], [MIDDLE], MAX_NEAR)
        await check_programming(screen, adam)
        if pytestconfig.getoption("--matrix"):
            await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
            await screen.press(texts.SETTINGS)
            await page.get_by_role("menuitem", name="Left-handed controls").click()
            await check_programming(screen, adam)
            await page.set_viewport_size(VIEWPORTS["ipad"])  # type: ignore[arg-type]
        await screen.press("Leave AR")


_AIMED = """() => {
    const { width, height } = document.querySelector(".view").getBoundingClientRect();
    return __engine.pick(width / 2, height / 2, 0)[0]?.point ?? __engine.floor(width / 2, height / 2);
}"""
"""Return the position below the crosshair."""


async def check_programming(screen: Screen, adam: Client) -> None:
    """Add, select, move, rotate, undo, connect and run by taps on controls of the page over the session."""
    page = screen.page
    panel, rail = page.get_by_role("complementary"), page.get_by_role("navigation")

    async def button(name: str | re.Pattern[str], within: Locator | Page = page) -> None:
        await within.get_by_role("button", name=name, exact=isinstance(name, str)).first.tap()

    await page.evaluate("() => __xr.see()")
    await screen.close_panels()
    await button(texts.POINTS, rail)
    await panel.get_by_role("heading", name=texts.POINTS, exact=True).wait_for()
    await screen.settle()
    aimed = await page.evaluate(_AIMED)
    await button(texts.AT_CROSSHAIR, panel)
    point = (await adam.next_event("ActionPointChanged")).data
    # Markers may correct the view by some millimetres between the two readings.
    assert tuple(point.position) == pytest.approx([aimed[axis] for axis in "xyz"], abs=0.01)
    orientation = (await adam.next_event("OrientationChanged")).data
    await panel.get_by_role("heading", name=point.name, exact=True).wait_for()
    await screen.close_panels()
    await place_device(screen, look_at(np.array((0.15, -0.55, 0.6)), LENS, tuple(point.position)))
    await button(f"Select {point.name}", page.get_by_role("group", name=texts.AT_CROSSHAIR))
    await panel.get_by_role("heading", name=point.name, exact=True).wait_for()
    await button(re.compile("^Increase X by "), panel)
    moved = (await adam.next_event("ActionPointChanged")).data.position
    assert moved.x > point.position.x + 5e-4
    await button(orientation.name, panel)
    await button(re.compile("^Increase Yaw by "), panel)
    turned = (await adam.next_event("OrientationChanged")).data.orientation
    assert abs(np.dot(tuple(turned), tuple(orientation.orientation))) < 0.9999
    await screen.picture("xr turned")
    await button(re.compile("^Undo "))
    back = (await adam.next_event("OrientationChanged")).data.orientation
    assert tuple(back) == pytest.approx(tuple(orientation.orientation), abs=1e-9)
    # Actions are connected automatically. The user also replaces a connection.
    await button(texts.PROGRAM, rail)
    wait = panel.locator(".offer").filter(has=page.get_by_text("wait", exact=True)).last
    for _ in range(2):
        await wait.tap()
        action = (await adam.next_event("ActionChanged")).data
        await panel.get_by_role("status").filter(has_text=f"Added {action.name}.").wait_for()
    await button("Set parameters", panel)
    await panel.get_by_role("heading", name=action.name, exact=True).wait_for()
    await button("Remove the connection to End", panel)
    while (changed := await adam.next_event("LogicItemChanged")).change_type is not ChangeType.REMOVE:
        pass
    assert (changed.data.start, changed.data.end) == (action.id, "END")
    await button("Connect", panel)
    await button("End", panel.get_by_role("list", name="Possible next steps"))
    added = (await adam.next_event("LogicItemChanged")).data
    assert (added.start, added.end) == (action.id, "END")
    await screen.picture("xr connected")
    await button(texts.RUN, rail)
    await button("Save and run", panel)
    await package_state(adam, PackageStateEnum.RUNNING)
    await check_stop(screen)
    assert await screen.faults() == []
    await button(re.compile(f"^{texts.STOP_MOTION}"))
    await package_state(adam, PackageStateEnum.STOPPED)
    await adam.next_event("OpenProject")


async def package_state(client: Client, wanted: PackageStateEnum) -> None:
    """Wait until the program is in a state."""
    while (await client.next_event("PackageState")).data.state is not wanted:
        pass


HOLD = """() => {
    const { headset, options } = __ar, { panel, host } = headset, { show } = panel;
    window.__held = { pressed: false, released: 0, stopped: 0 };
    const press = () => {
        __held.pressed = true;
        return () => { __held.pressed = false; };
    };
    panel.show = (content) => show.call(panel, { ...content, buttons: [
        { id: "hold", label: "Hold", cells: 12, press }, ...content.buttons] });
    panel.show(panel.content);
    const release = () => {
        if (__held.pressed) __held.released++;
    };
    Object.assign(options, { release });
    Object.assign(host, { release, stopMotion: () => __held.stopped++ });
}"""
"""Add a button that is held, and record the releases and stops."""


async def check_hold_ends(screen: Screen, hand: Controller) -> None:
    """Check that a held motion ends on release and when controller, tracking or session are lost. Stop has a button."""
    page = screen.page
    await page.evaluate(HOLD)
    await hand.button("hold")
    await hand.press(True)
    assert (await page.evaluate("__held")) == {"pressed": True, "released": 0, "stopped": 0}
    await hand.press(False)
    assert not await page.evaluate("__held.pressed")
    right = "__xr.device.controllers.right"
    for lose, restore in (
        ("__xr.state.lostController = true", "__xr.state.lostController = false"),
        (f"{right}.connected = false", f"{right}.connected = true"),
        ("__xr.state.emulated = true", "__xr.state.emulated = false"),
        ("__xr.device.updateVisibilityState('visible-blurred')", "__xr.device.updateVisibilityState('visible')"),
        ("__xr.device.updateVisibilityState('hidden')", "__xr.device.updateVisibilityState('visible')"),
    ):
        await hand.press(True)
        await screen.until("() => __held.pressed")
        await page.evaluate(f"() => {{ __held.released = 0; {lose}; }}")
        await screen.until("() => __held.released > 0")
        await page.evaluate(f"() => {{ {restore}; }}")
        await hand.frames()
        await hand.press(False)
    await page.evaluate(f"{right}.updateButtonValue('b-button', 1)")
    await screen.until("() => __held.stopped === 1")
    await page.evaluate(f"{right}.updateButtonValue('b-button', 0)")


async def test_headset_registers_by_touch_selects_and_moves(server: ServerProcess, browser: Browser) -> None:
    async with (
        screen_of(browser, server.url, "ipad") as screen,
        Client(server.url, "Adam", reconnect=False) as adam,
    ):
        page = screen.page
        await emulate(page, headset=True)
        scene = await open_scene(adam)
        await join(screen)
        await place_device(screen, SHOTS[0], picture=False)
        await screen.press("Start AR")
        hand = Controller(screen)
        await screen.until("() => window.__ar?.headset")

        async def touch(off: dict[int, float]) -> None:
            await hand.button("touch")
            await hand.click()
            known = await screen.until("() => __ar.headset.touching?.known")
            assert len(known) == 3
            for number, each in enumerate(known):
                await hand.touch(in_xr(each["at"], up=off.get(number, 0.0)))
                await hand.click()

        await touch({0: 0.2})
        title = "() => __ar.headset.panel.content.title"
        lines = "() => __ar.headset.panel.content.lines.join(' ')"
        assert re.search("Not where it should be|contradict", await page.evaluate(lines))
        await touch({})
        await screen.until("() => __ar.headset.panel.content.title.includes('By touch')")
        assert re.search(r"±\d+ mm, 3 points, ", await page.evaluate(lines)), await page.evaluate(title)
        await screen.page.evaluate("__xr.see()")
        await screen.picture("xr headset")
        # A press selects the object under the ray. A second press moves it.
        top = in_xr((BOX.x, BOX.y, 0.04))
        start = np.add(top, (0.1, 0.4, 0.3))
        await hand.aim(top, start)
        await hand.click()
        await screen.until("() => __ar.headset.panel.content.lines.some((each) => each.includes('box'))")
        await hand.press(True)
        shift = in_xr((0.1, 0.05, 0.0)) - in_xr((0.0, 0.0, 0.0))
        await hand.aim(top + shift, start + shift)
        await hand.press(False)
        moved = (await adam.next_event("SceneObjectChanged")).data.pose.position
        assert tuple(moved) == pytest.approx((BOX.x + 0.1, BOX.y + 0.05, BOX.z), abs=2e-3)
        await check_hold_ends(screen, hand)
        # A pinch of a tracked hand acts as a press of a controller. A hand has no Stop button.
        assert await page.evaluate("__ar.headset.reported")
        await page.evaluate("() => { __xr.device.primaryInputMode = 'hand'; }")
        await screen.until("() => __ar.headset.reported === false")
        near = np.add(top, (0.02, 0.07, 0.05))  # below the panel
        await hand.aim(top + shift, near + shift)
        await hand.click()
        await screen.until("() => __ar.headset.panel.content.lines.some((each) => each.includes('box'))")
        await hand.press(True)
        await hand.aim(top, near)
        await hand.press(False)
        again = (await adam.next_event("SceneObjectChanged")).data.pose.position
        assert tuple(again) == pytest.approx(tuple(BOX), abs=4e-3)
        await hand.button("undo")
        await hand.click()
        back = (await adam.next_event("SceneObjectChanged")).data.pose.position
        assert tuple(back) == pytest.approx(tuple(moved), abs=1e-6)
        # A pinch places the workplace on the surface ahead. A second pinch places it from another position.
        placed = []
        for shot in SHOTS[:2]:
            await place_device(screen, shot, picture=False)
            await hand.frames()
            await hand.button("place")
            await hand.click()
            await hand.frames()
            await screen.until("() => __ar.headset.panel.content.title.includes('Placed by hand')")
            placed.append(await page.evaluate("__ar.workplace.pose.elements.slice(12, 15)"))
        assert placed[0][1] == pytest.approx(0.7)  # height of the floor
        assert np.linalg.norm(np.subtract(*placed)) > 0.01
        await hand.button("leave")
        await hand.click()
        await page.get_by_role("button", name="Show all").wait_for()
        await check_program(screen, adam, scene, hand)


async def check_program(screen: Screen, adam: Client, scene: str, hand: Controller) -> None:
    """Check that a program runs from the headset only with a Stop button, and stops when the button is lost."""
    page = screen.page
    await open_project(adam, scene, "From a headset")
    await adam.call("AddActionPoint", rpc.AddActionPointArgs("here", BOX))
    point = (await adam.next_event("ActionPointChanged")).data
    flow = next(each.id for each in (await adam.get_scene(scene)).objects if each.name == "flow")
    given = [ActionParameter("seconds", "double", "300.0")]
    await adam.call("AddAction", rpc.AddActionArgs(point.id, "long", f"{flow}/wait", given, [Flow()]))
    action = (await adam.next_event("ActionChanged")).data
    for start, end in (("START", action.id), (action.id, "END")):
        await adam.call("AddLogicItem", rpc.AddLogicItemArgs(start, end))
    await page.get_by_role("heading", name="From a headset", exact=True).wait_for()
    await page.get_by_role("button", name="AR", exact=True).click()
    await screen.press("Start AR")
    disabled = "(id) => window.__ar?.headset?.panel.content.buttons.find((each) => each.id === id)?.disabled"
    await screen.until(f"() => ({disabled})('run') === true && ({disabled})('run paused') === true")
    assert "needs a controller" in await page.evaluate("__ar.headset.panel.content.lines.join(' ')")
    await hand.button("run")
    await hand.click()

    async def use_controller() -> None:
        await page.evaluate("() => { __xr.device.primaryInputMode = 'controller'; }")
        await screen.until(f"() => ({disabled})('run') === false")

    async def press(name: str, state: PackageStateEnum) -> None:
        await hand.button(name)
        await hand.click()
        await package_state(adam, state)

    await use_controller()
    await press("run", PackageStateEnum.RUNNING)
    await press("pause", PackageStateEnum.PAUSING)  # until the action ends
    await page.evaluate("__xr.see()")
    await screen.picture("xr headset program")
    # With hands alone, no button stops motion any more.
    await page.evaluate("() => { __xr.device.primaryInputMode = 'hand'; }")
    await package_state(adam, PackageStateEnum.STOPPED)
    await adam.next_event("OpenProject")
    await use_controller()
    await press("run paused", PackageStateEnum.PAUSED)
    await press("resume", PackageStateEnum.RUNNING)
    # A menu of the headset covers the session.
    await page.evaluate("__xr.device.updateVisibilityState('visible-blurred')")
    await package_state(adam, PackageStateEnum.STOPPED)
    await adam.next_event("OpenProject")
    await page.evaluate("__xr.device.updateVisibilityState('visible')")
    await use_controller()
    await press("run paused", PackageStateEnum.PAUSED)
    await press("step", PackageStateEnum.RUNNING)
    await press("stop program", PackageStateEnum.STOPPED)
    await adam.next_event("OpenProject")
    await hand.button("leave")
    await hand.click()
    await page.get_by_role("button", name="Show all").wait_for()

"""AR with WebXR on an emulated tablet and an emulated headset, whose poses are known."""

import json
import re
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import pytest
import pytest_asyncio
from msgspec import to_builtins
from playwright.async_api import Browser, expect

from arcor2_hw.client import Client
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from tests.e2e.harness import scene_state
from tests.editor.camera_video import MIDDLE, marker_table
from tests.editor.screen import VIEWPORTS, Screen, screen_of
from tests.editor.test_editor_ar import ASIDE, MAX_ASIDE, MAX_NEAR, check_stop
from tests.editor.xr import SHOTS, Controller, emulate, in_xr, overlay_errors, place, until_fitting
from tests.server.core.serving import ServerProcess, running, talking

pytestmark = pytest.mark.asyncio(loop_scope="session")

BOX = Position(0.19, 0.14, 0.02)


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def server(tmp_path_factory: pytest.TempPathFactory, built_editor: Path) -> AsyncIterator[ServerProcess]:
    """A server with two markers and an open scene with a box between them."""
    directory = tmp_path_factory.mktemp("xr")
    (directory / "markers.yaml").write_text(json.dumps(marker_table()))  # YAML contains JSON
    box = ObjectModel(Model3dType.BOX, box=Box("box", 0.1, 0.06, 0.04))
    async with running(directory / "data", "--markers", str(directory / "markers.yaml")) as process:
        async with talking(process.url, "preparer") as talker:
            await talker.granted("NewScene", {"name": "Cell"})
            await talker.granted(
                "AddVirtualCollisionObjectToScene", to_builtins({"name": "box", "pose": Pose(BOX), "model": box})
            )
        yield process


async def joined(screen: Screen) -> str:
    """Join, and return the id of the box."""
    await screen.join("Eva")
    await screen.until("() => window.__engine?.ids().length > 0")
    await screen.page.get_by_role("button", name="AR", exact=True).click()
    await screen.page.get_by_role("button", name="Camera only").wait_for()
    found: str = await screen.page.evaluate("__engine.ids().find((id) => __engine.item(id).name === 'box')")
    return found


async def test_tablet_follows_itself_and_markers_correct_it(server: ServerProcess, browser: Browser) -> None:
    async with (
        screen_of(browser, server.url, "ipad", touch=True, drawn=True) as screen,
        Client(server.url, "Adam", reconnect=False) as adam,
    ):
        page = screen.page
        await emulate(page)
        await adam.call("StartScene")
        await scene_state(adam, SceneStateEnum.STARTED)
        box = await joined(screen)
        await screen.picture("xr start")
        await place(screen, SHOTS[0])
        await screen.press("Start AR")
        quality = page.get_by_role("group", name="Quality of AR")
        await expect(quality).to_have_text(re.compile(r"Good ±\d+ mm, 2 markers, now"))
        await until_fitting(screen, SHOTS[0], [MIDDLE], MAX_NEAR)
        await until_fitting(screen, SHOTS[0], ASIDE, MAX_ASIDE)
        assert await screen.page.evaluate("__xr.see().drawn") > 1000
        await check_stop(screen)
        assert await screen.faults() == []
        await screen.picture("xr tablet")
        # Without markers in the picture, the overlay follows the device, and its quality says so.
        await page.evaluate(
            "() => { const c = document.createElement('canvas'); c.width = 1180; c.height = 820; __xr.state.shot = c; }"
        )
        await expect(quality).to_have_text(re.compile("Tracked"))
        await place(screen, SHOTS[1], picture=False)
        await until_fitting(screen, SHOTS[1], ASIDE, MAX_ASIDE)
        # The tracking has drifted by 30 mm: markers win, and the correction is stated.
        await place(screen, SHOTS[2], off=(0.03, 0, 0))
        await screen.sees(re.compile(r"The overlay was corrected by (29|30|31) mm."))
        await until_fitting(screen, SHOTS[2], ASIDE, MAX_ASIDE)
        # Taps on the page are no selections of WebXR; they select what is drawn there.
        assert not await page.evaluate(
            "document.body.dispatchEvent(new Event('beforexrselect', { cancelable: true, bubbles: true }))"
        )
        await screen.tap(box)
        await page.get_by_role("complementary").get_by_role("heading", name="box").wait_for()
        # The browser's own list of a select is not shown over the session: a dialog replaces it.
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
        await place(screen, SHOTS[0], picture=False)
        await page.evaluate("new Promise((done) => __xr.state.session.requestAnimationFrame(done))")
        assert await overlay_errors(screen, SHOTS[2], [MIDDLE]) == pytest.approx(frozen, abs=1e-6)
        drawn = await page.evaluate("__xr.see()")
        assert drawn["drawn"] == drawn["all"]
        await screen.picture("xr frozen")
        await screen.press("Continue")
        # Lost tracking dims the overlay and says so.
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
        await screen.press("Seat view")
        await page.get_by_role("button", name="Show all").wait_for()
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
"""Add a button that is held, and record what ends it."""


async def check_hold_ends(screen: Screen, hand: Controller) -> None:
    """Check that a held motion ends on release and when controller, tracking or session are lost; Stop has a button."""
    page = screen.page
    await page.evaluate(HOLD)
    await hand.button("hold")
    await hand.press(True)
    assert (await page.evaluate("__held")) == {"pressed": True, "released": 0, "stopped": 0}
    await hand.press(False)
    assert not await page.evaluate("__held.pressed")
    right = "__xr.device.controllers.right"
    for taken, given in (
        ("__xr.state.lostController = true", "__xr.state.lostController = false"),
        (f"{right}.connected = false", f"{right}.connected = true"),
        ("__xr.state.emulated = true", "__xr.state.emulated = false"),
        ("__xr.device.updateVisibilityState('visible-blurred')", "__xr.device.updateVisibilityState('visible')"),
        ("__xr.device.updateVisibilityState('hidden')", "__xr.device.updateVisibilityState('visible')"),
    ):
        await hand.press(True)
        await screen.until("() => __held.pressed")
        await page.evaluate(f"() => {{ __held.released = 0; {taken}; }}")
        await screen.until("() => __held.released > 0")
        await page.evaluate(f"() => {{ {given}; }}")
        await hand.frames()
        await hand.press(False)
    await page.evaluate(f"{right}.updateButtonValue('b-button', 1)")
    await screen.until("() => __held.stopped === 1")
    await page.evaluate(f"{right}.updateButtonValue('b-button', 0)")


async def test_headset_registers_by_touch_selects_and_moves(server: ServerProcess, browser: Browser) -> None:
    async with (
        screen_of(browser, server.url, "ipad", drawn=True) as screen,
        Client(server.url, "Adam", reconnect=False) as adam,
    ):
        page = screen.page
        await emulate(page, headset=True)
        await joined(screen)
        await place(screen, SHOTS[0], picture=False)
        await screen.press("Start AR")
        hand = Controller(screen)
        known = await screen.until("() => window.__ar?.headset?.known")
        assert len(known) == 3

        async def touch(off: dict[int, float]) -> None:
            await hand.button("touch")
            await hand.click()
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
        # The ray selects; pressed again, it moves.
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
        # A hand pinches as a controller presses; it has no button for Stop.
        assert await page.evaluate("__ar.headset.reported")
        await page.evaluate("() => { __xr.device.primaryInputMode = 'hand'; }")
        await screen.until("() => __ar.headset.reported === false")
        await hand.button("undo")
        await hand.click()
        back = (await adam.next_event("SceneObjectChanged")).data.pose.position
        assert tuple(back) == pytest.approx(tuple(BOX), abs=1e-6)
        await hand.button("leave")
        await hand.click()
        await page.get_by_role("button", name="Show all").wait_for()

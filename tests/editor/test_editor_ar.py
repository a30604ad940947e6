"""Augmented reality over the picture of a fake camera whose poses are known."""

import asyncio
import json
import re
from collections.abc import AsyncIterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import pytest_asyncio
from msgspec import UNSET, to_builtins
from playwright.async_api import expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.editor import Presence
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from tests.editor import texts
from tests.editor.ar_probe import overlay_errors
from tests.editor.camera_video import CAMERA_ARGUMENTS, MARKERS, MIDDLE, Shot, marker_table, write_video
from tests.editor.screen import SMALLEST, VIEWPORTS, Screen, running_browser, screen_of
from tests.server.core.serving import ServerProcess, running, talking

Point = tuple[float, float, float]
ASIDE: list[Point] = [(0.69, 0.025, 0.0), (-0.31, 0.025, 0.0), (0.19, 0.525, 0.0), (0.19, 0.025, 0.3)]
"""Points on the table half a metre from the middle of the markers, and one above the middle, m."""
MAX_NEAR = 0.001
"""Largest error of the overlay near the markers, m."""
MAX_ASIDE = 0.002
"""Largest error of the overlay at the points `ASIDE`, m."""
RECORD_TRACKS = """{
    const ask = navigator.mediaDevices?.getUserMedia.bind(navigator.mediaDevices);
    window.__tracks = [];
    if (ask) navigator.mediaDevices.getUserMedia = async (wanted) => {
        const stream = await ask(wanted);
        window.__tracks.push(...stream.getTracks());
        return stream;
    };
}"""
"""Record the media tracks of the camera in `window.__tracks`."""
DARKEN = """() => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 1280, height: 720 });
    const context = canvas.getContext("2d");
    let step = 0;
    setInterval(() => {  // only changes are sent
        context.fillStyle = step++ % 2 ? "#000000" : "#050505";
        context.fillRect(0, 0, canvas.width, canvas.height);
    }, 30);
    window.__camera = __ar.video.srcObject;
    __ar.video.srcObject = canvas.captureStream(30);
    __ar.video.play();
}"""
"""Replace the pictures of the camera by dark ones."""


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def server(tmp_path_factory: pytest.TempPathFactory, built_editor: Path) -> AsyncIterator[ServerProcess]:
    """A server with two markers and a scene that is online: a box between the markers."""
    directory = tmp_path_factory.mktemp("ar")
    (directory / "markers.yaml").write_text(json.dumps(marker_table()))  # YAML contains JSON
    box = ObjectModel(Model3dType.BOX, box=Box("box", 0.1, 0.06, 0.04))
    async with running(directory / "data", "--markers", str(directory / "markers.yaml")) as process:
        async with talking(process.url, "preparer") as talker:
            await talker.granted("NewScene", {"name": "Cell"})
            at = Pose(Position(0.19, 0.14, 0.02))
            await talker.granted(
                "AddVirtualCollisionObjectToScene", to_builtins({"name": "box", "pose": at, "model": box})
            )
            await talker.granted("StartScene", {})
        yield process


async def start_ar(screen: Screen) -> None:
    await screen.page.get_by_role("button", name="AR", exact=True).click()
    await screen.press("Start AR")


async def presence(client: Client, user: str) -> Presence:
    """Return the next presence of a user."""
    while True:
        data = (await client.next_event("UserPresence")).data
        if data.user == user and data.presence is not UNSET:
            assert isinstance(data.presence, Presence)
            return data.presence


async def check_stop(screen: Screen) -> None:
    """Check that Stop motion is large enough and that nothing covers it."""
    await screen.settle()
    button = screen.page.get_by_role("button", name=texts.STOP_MOTION)
    box = await button.bounding_box()
    assert box is not None
    assert min(box["width"], box["height"]) >= SMALLEST
    covered = await button.evaluate(
        """(button) => {
            const { left, right, top, bottom } = button.getBoundingClientRect();
            const points = [0.1, 0.5, 0.9].flatMap((across) => [0.1, 0.5, 0.9].map((down) => (
                [left + across * (right - left), top + down * (bottom - top)])));
            return points.filter(([x, y]) => !button.contains(document.elementFromPoint(x, y)));
        }"""
    )
    assert covered == []


async def check_placing_by_hand(screen: Screen) -> None:
    """Place the workplace by hand with a drag and with buttons, on a tablet and on a phone."""
    page = screen.page
    quality = page.get_by_role("group", name="Quality of AR")
    await expect(quality).to_have_text(re.compile("Not placed"))
    await screen.press("Place")
    await expect(quality).to_have_text(re.compile("Placed by hand"))
    placing = page.get_by_role("group", name="Place the workplace")
    box = await page.evaluate("window.__engine.ids().find((id) => __engine.item(id).name === 'box')")
    canvas = await page.locator(".view canvas").bounding_box()
    assert canvas is not None
    # The box is 2 cm above the floor, so it moves a little more than the finger.
    before = (await screen.item(box))["screen"]
    x, y = canvas["x"] + 600, canvas["y"] + 400
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x + 80, y, steps=4)
    await page.mouse.up()
    after = (await screen.item(box))["screen"]
    assert after["x"] - before["x"] == pytest.approx(80, rel=0.2)
    for name in ("Up", "Turn left", "Camera down"):
        await placing.get_by_role("button", name=name, exact=True).click()
    await screen.settle()
    assert await screen.faults() == []
    assert await screen.barriers() == []
    await screen.picture("ar by hand")
    await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
    await check_stop(screen)
    assert await screen.faults() == []
    await screen.picture("ar by hand phone")
    await page.set_viewport_size(VIEWPORTS["ipad"])  # type: ignore[arg-type]
    # The device stores the place, until it is reset.
    placed = await page.evaluate("__ar.shown.view.shift")
    await screen.press("Leave AR")
    await start_ar(screen)
    await screen.press("Place")
    await expect(quality).to_have_text(re.compile("Placed by hand"))
    assert await page.evaluate("__ar.shown.view.shift") == pytest.approx(placed, abs=0.02)
    await placing.get_by_role("button", name="Reset").click()
    await expect(quality).to_have_text(re.compile("Not placed"))


async def wait_for_overlay(
    screen: Screen, shots: list[Shot], points: list[tuple[float, float, float]], most: float
) -> None:
    """Wait until the overlay error is at most `most`, m, in five consecutive measurements."""
    fitting, worst = 0, 0.0
    for _ in range(600):
        if errors := await overlay_errors(screen, shots, points):
            worst = max(errors)
            fitting = fitting + 1 if worst <= most else 0
            if fitting == 5:
                return
        await asyncio.sleep(0.05)
    raise AssertionError(f"the overlay is {1000 * worst:.2f} mm off")


async def check_carrying(screen: Screen, box: str, server: ServerProcess) -> None:
    """Check that the item moves with the tablet while the button is held, and that the server receives one edit."""
    page = screen.page
    await page.get_by_role("navigation").get_by_role("button", name=texts.OBJECTS, exact=True).click()
    await page.get_by_role("row", name="box").first.click()
    start = (await screen.item(box))["pose"]["position"]
    button = page.get_by_role("button", name="Hold to move box with the tablet")
    await button.scroll_into_view_if_needed()
    at = await button.bounding_box()
    assert at is not None
    async with Client(server.url, "Ada", reconnect=False) as ada:
        await page.mouse.move(at["x"] + at["width"] / 2, at["y"] + at["height"] / 2)
        await page.mouse.down()
        far = "([id, at]) => Math.hypot(...['x', 'y'].map((k) => __engine.item(id).pose.position[k] - at[k])) > 0.005"
        await screen.until(far, [box, start])
        await screen.picture("ar carried")
        await page.mouse.up()
        edited = (await ada.next_event("SceneObjectChanged")).data
        assert edited.id == box
        shown = (await screen.item(box))["pose"]["position"]
        assert [edited.pose.position.x, edited.pose.position.y] == pytest.approx([shown["x"], shown["y"]], abs=1e-6)
    await page.get_by_role("button", name=re.compile("^Undo")).click()
    moved_back = "([id, at]) => Math.abs(__engine.item(id).pose.position.x - at.x) < 1e-6"
    await screen.until(moved_back, [box, start])
    await screen.close_panels()


@pytest.mark.asyncio(loop_scope="session")
async def test_ar_follows_the_camera_freezes_and_ends(server: ServerProcess, tmp_path: Path) -> None:
    shots = write_video(tmp_path / "camera.mjpeg")
    async with (
        running_browser(*CAMERA_ARGUMENTS, f"--use-file-for-fake-video-capture={tmp_path / 'camera.mjpeg'}") as browser,
        screen_of(browser, server.url, "ipad", touch=True, drawn=True) as screen,
    ):
        page = screen.page
        await page.add_init_script(RECORD_TRACKS)
        await screen.join("Eva")
        await screen.until("() => window.__engine?.ids().length > 0")
        before = await page.evaluate("window.__engine.view.viewpoint")
        # Without markers, the reason and the next step are shown, and the workplace is placed by hand.
        await page.route("**/api/calibration/markers", lambda route: route.fulfill(body='{"markers": []}'))
        await page.get_by_role("button", name="AR", exact=True).click()
        await screen.sees("No markers are configured.")
        await screen.press("Start AR")
        await check_placing_by_hand(screen)
        await page.unroute("**/api/calibration/markers")
        await screen.press("Leave AR")
        await page.get_by_role("button", name="AR", exact=True).click()
        await screen.sees("Pictures stay on this device.")
        assert await screen.barriers() == []
        await screen.picture("ar start")
        await screen.press("Start AR")
        await wait_for_overlay(screen, shots, [MIDDLE], MAX_NEAR)
        await check_stop(screen)
        # The focal length is found while the camera moves.
        quality = page.get_by_role("group", name="Quality of AR")
        await expect(quality).to_have_text(re.compile(r"Good ±\d+ mm, 2 markers, now"))
        await wait_for_overlay(screen, shots, ASIDE, MAX_ASIDE)
        # A correction of the registration is shown as such, and can be reset.
        placing = page.get_by_role("group", name="Place the workplace")
        await screen.press("Place")
        await placing.get_by_role("button", name="Right", exact=True).click()
        await expect(quality).to_have_text(re.compile(r"Moved by hand 10 mm, 0°, 2 markers, now"))
        await screen.picture("ar nudged")
        await placing.get_by_role("button", name="Reset").click()
        await screen.press("Place")
        await wait_for_overlay(screen, shots, ASIDE, MAX_ASIDE)
        outlines = page.get_by_role("button", name="Markers")
        await outlines.click()
        await expect(page.locator(".ar-markers polygon.seen")).to_have_count(2)
        await screen.picture("ar ipad")
        await outlines.click()
        # Without visible markers, the reason is shown. Afterwards the camera is registered again.
        await page.evaluate(DARKEN)
        await screen.sees("It is too dark for the camera.")
        await screen.picture("ar lost")
        await page.evaluate("() => { __ar.video.srcObject = __camera; __ar.video.play(); }")
        await wait_for_overlay(screen, shots, ASIDE, MAX_ASIDE)
        await page.evaluate("() => { window.__worker = __ar.worker; }")
        await screen.press("Recalibrate")
        await screen.until("() => __ar.worker !== __worker && __ar.shown.found.checked")
        await wait_for_overlay(screen, shots, ASIDE, MAX_ASIDE)
        # A frozen picture is not drawn again, and the editor works over it.
        await screen.press("Freeze")
        await screen.sees("Frozen")
        await screen.settle()
        assert await screen.faults() == []
        assert await screen.barriers() == []
        # The shown picture contains the configured markers.
        screenshot = cv2.imdecode(np.frombuffer(await page.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE)
        assert screenshot is not None
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        _, numbers, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(screenshot)
        # A panel may cover one of the markers.
        found = set(np.ravel(numbers).tolist())
        assert found
        assert found <= set(MARKERS)
        frames = await screen.frames()
        box = await page.evaluate("window.__engine.ids().find((id) => __engine.item(id).name === 'box')")
        at = (await screen.item(box))["screen"]
        assert await screen.frames() == frames
        canvas = await page.locator(".view canvas").bounding_box()
        assert canvas is not None
        await page.mouse.click(canvas["x"] + at["x"], canvas["y"] + at["y"])
        await page.get_by_role("complementary").get_by_role("heading", name="box").wait_for()
        await screen.picture("ar selected")
        await check_stop(screen)
        await page.set_viewport_size(VIEWPORTS["phone"])  # type: ignore[arg-type]
        await check_stop(screen)
        await screen.close_panels()
        await screen.press("Continue")
        await wait_for_overlay(screen, shots, [MIDDLE], MAX_NEAR)
        assert await screen.faults() == []
        await check_stop(screen)
        await screen.picture("ar phone")
        await page.set_viewport_size(VIEWPORTS["ipad"])  # type: ignore[arg-type]
        await check_carrying(screen, box, server)
        # Leaving stops the camera and restores the view, and other users no longer see the camera.
        async with Client(server.url, "Adam", reconnect=False) as adam:
            await adam.call("SubscribeEvents", rpc.SubscribeEventsArgs({"UserPresence"}))
            while (seen := await presence(adam, "Eva")).camera is UNSET:
                pass
            assert seen.view == "ar"
            await screen.press("Leave AR")
            while (await presence(adam, "Eva")).camera is not UNSET:
                pass
            await screen.until("() => window.__tracks.every((track) => track.readyState === 'ended')")
            after = await page.evaluate("window.__engine.view.viewpoint")
            assert after["position"] + after["target"] == pytest.approx(before["position"] + before["target"])
            await page.evaluate("window.__engine.view.set([1, -1, 0.8], [0.2, 0.1, 0.15])")
            camera = Pose(Position(0.2, -0.35, 0.4), Orientation(-0.87, 0, 0, 0.5))
            await adam.call("UpdatePresence", Presence(document=seen.document, view="ar", camera=camera))
            await expect(page.get_by_text("Adam in AR")).to_be_visible()
            await screen.settle()
            await screen.picture("ar other user")
            frames = await screen.frames()
            await screen.settle()
            assert await screen.frames() == frames
        await expect(page.get_by_text("Adam in AR")).to_have_count(0)
        # The focal length is stored for this camera, so the next registration is good at once.
        await start_ar(screen)
        await wait_for_overlay(screen, shots, ASIDE, MAX_ASIDE)
        assert "unchecked" not in await quality.inner_text()
        await page.evaluate("() => { const now = Date.now(); Date.now = () => now + 31 * 60_000; }")
        await screen.sees("You have used AR for half an hour.")
        await screen.press("3D view")
        await page.get_by_role("button", name="Show all").wait_for()
        assert await page.evaluate("window.__engine.view.viewpoint") != before
        assert await page.get_by_role("button", name=texts.SETTINGS).is_visible()


def test_marker_codes_equal_those_of_opencv() -> None:
    source = (Path(__file__).parents[2] / "editor" / "src" / "ar" / "codes.ts").read_text()
    written = "".join(re.findall(r'^  "([0-9a-f]{100})"', source, re.MULTILINE))
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    for number in range(250):
        cells = cv2.aruco.generateImageMarker(dictionary, number, 6)[1:5, 1:5] > 128
        assert int(written[4 * number : 4 * number + 4], 16) == int(
            "".join(str(int(cell)) for cell in cells.ravel()), 2
        )

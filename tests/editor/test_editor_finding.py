"""Finding objects: with the crosshair, in the list, outside the view and behind other objects."""

import re
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.editor import ViewScope
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.project import ActionPoint, Project
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.screen import FONTS, VIEWPORTS, Screen, screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")


@dataclass
class Opened:
    """The open project, and a second client."""

    cell: Cell
    client: Client
    scene: Scene
    project: Project

    def object(self, name: str) -> str:
        return next(each.id for each in self.scene.objects if each.name == name)

    def point(self, name: str) -> ActionPoint:
        return next(each for each in self.project.action_points if each.name == name)


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def opened(module_cell: Cell) -> AsyncIterator[Opened]:
    """An open project. Each test joins as another user."""
    client = await module_cell.client("colleague")
    yield Opened(module_cell, client, *await module_cell.open(client))


async def _join(screen: Screen, name: str, opened: Opened) -> None:
    await screen.join(name)
    await screen.item(opened.object("robot"))
    await screen.page.locator(".view-controls").wait_for()


async def _tool(screen: Screen, name: str) -> None:
    await screen.page.get_by_role("navigation").get_by_role("button").filter(has_text=name).click()


async def _wait_for_panel_of(screen: Screen, name: str) -> None:
    """Wait until the panel shows the object of this name."""
    await screen.page.get_by_role("complementary").get_by_role("heading", name=name, exact=True).wait_for()


async def test_crosshair_selects_near_and_hidden_objects(opened: Opened, browser: Browser) -> None:
    client = opened.client
    await client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"UserPresence"}))
    point = opened.point("feeder")
    async with screen_of(browser, opened.cell.url) as screen:
        page = screen.page
        await _join(screen, "Iris", opened)
        await page.keyboard.press("x")
        bar = page.get_by_role("group", name=texts.AT_CROSSHAIR)
        # From below, through the table: the target may be hidden.
        at = (await screen.item(point.id))["pose"]["position"]
        below = [[at["x"] - 0.5, at["y"] - 0.5, at["z"] - 0.5], [at["x"], at["y"], at["z"]]]
        await page.evaluate("([from, to]) => __engine.view.set(from, to)", below)
        await bar.get_by_role("button", name="Select feeder", exact=True).wait_for()
        # Other users are notified of the target before anything is selected.
        presence = await _presence(client, lambda presence: presence.aimed == point.id)
        assert list(presence.selected) == []
        assert await page.evaluate(_ID_AT_CENTRE) != point.id, "nothing is in front"

        # Two keys select the next best target; taps do the same.
        await page.keyboard.press("n")
        await bar.get_by_role("button", name=re.compile(r"^Next 2.[3-8] at the crosshair$")).wait_for()
        select = bar.get_by_role("button", name=re.compile("^Select "))
        second = (await select.get_attribute("aria-label") or "").removeprefix("Select ")
        assert second != "feeder"
        await page.keyboard.press("Enter")
        await _wait_for_panel_of(screen, second)
        selected = (await _presence(client, lambda presence: len(presence.selected) == 1)).selected[0]
        assert (await screen.item(selected))["name"] == second
        # A selected action spreads its stack, which adds candidates.
        feeder = bar.get_by_role("button", name="Select feeder", exact=True)
        for _ in range(8):
            await page.keyboard.press("Shift+N")
            await screen.settle()
            if await feeder.count():
                break
        await feeder.click()
        await _wait_for_panel_of(screen, "feeder")
        await screen.picture("cross")
        await page.keyboard.press("x")
        await bar.wait_for(state="detached")

        # The list of targets, best first, without hidden objects.
        await _tool(screen, texts.OBJECTS)
        await page.get_by_role("radio", name=texts.AT_CROSSHAIR).click()
        listed = page.get_by_role("listbox", name=texts.AT_CROSSHAIR).get_by_role("option")
        await expect(listed.first).to_contain_text("feederAction point")
        near = listed.filter(has_text="feeder_box")
        await near.wait_for()
        await near.click()
        await page.get_by_role("complementary").get_by_text(texts.HIDE).click()
        await _tool(screen, texts.OBJECTS)
        await page.get_by_role("radio", name=texts.AT_CROSSHAIR).click()
        await expect(listed.first).to_contain_text("feederAction point")
        assert await near.count() == 0
        await listed.nth(1).click()
        await page.get_by_role("radio", name=texts.AT_CROSSHAIR).wait_for(state="detached")
        assert not await screen.faults()


async def _presence(client: Client, fits: Callable[[Any], bool]) -> Any:
    """Return the next presence of a user for which `fits` is true."""
    while not ((presence := (await client.next_event("UserPresence")).data.presence) and fits(presence)):
        pass
    return presence


_ID_AT_CENTRE = """() => {
    const { clientWidth, clientHeight } = document.querySelector(".view");
    return __engine.pick(clientWidth / 2, clientHeight / 2, 0)[0].id;
}"""


async def test_object_list_is_filtered_collapsed_and_stepped_through(opened: Opened, browser: Browser) -> None:
    client = opened.client
    actions = [action.name for point in opened.project.action_points for action in point.actions]

    async def stored(key: str) -> Any:
        state = await client.call("GetViewState", rpc.GetViewStateArgs(ViewScope.USER, opened.project.id, "Ida"))
        return state.values.get(key)

    async with screen_of(browser, opened.cell.url) as screen:
        page = screen.page
        await _join(screen, "Ida", opened)
        await _tool(screen, texts.OBJECTS)
        tree = page.get_by_role("treegrid", name=texts.OBJECTS)
        # Objects without a pose are listed below a separate heading.
        await page.get_by_role("heading", name="Without a pose").wait_for()
        unplaced = page.get_by_role("treegrid", name="Without a pose").get_by_role("row")
        without = sorted(each.name for each in opened.scene.objects if not isinstance(each.pose, Pose))
        assert without
        assert [row.split()[0] for row in await _row_labels(unplaced)] == without

        # A filter shows only actions and their points; the server stores it.
        chips = page.get_by_role("toolbar", name="Only these kinds")
        robots = chips.get_by_role("button", name="Robots 1")
        await robots.wait_for()
        await chips.get_by_role("button", name=f"Actions {len(actions)}").click()
        await unplaced.first.wait_for(state="detached")
        shown = await _row_labels(tree.get_by_role("row"))
        assert sorted(name for name in shown if name.endswith(" Action")) == sorted(
            f"{name} Action" for name in actions
        )
        assert "feeder Action point" in shown
        assert "robot Universal Robots UR5e" not in shown
        await until(lambda: _equals(stored, "filters", ["actions"]), "the server stores the filter")
        await page.get_by_label("Search").fill("pick")
        await expect(tree.get_by_role("row")).to_have_count(2)  # and its point
        await page.get_by_label("Search").fill("")
        await chips.get_by_role("button", name=f"Actions {len(actions)}").click()

        # A row that is collapsed with a key stays collapsed after a reload.
        tester = tree.get_by_role("row", name="tester Functional tester")
        await tester.focus()
        await page.keyboard.press("ArrowLeft")
        await tree.get_by_role("row", name="fixture Action point").wait_for(state="detached")
        assert await tester.get_attribute("aria-expanded") == "false"
        await until(
            lambda: _equals(stored, "collapsed", [opened.object("tester")]), "the server stores the collapsed rows"
        )
        await page.reload()
        await screen.item(opened.object("robot"))
        await _tool(screen, texts.OBJECTS)
        await tester.wait_for()
        assert await tester.get_attribute("aria-expanded") == "false"
        assert await tree.get_by_role("row", name="fixture Action point").count() == 0
        await tester.get_by_role("button").click()
        await tree.get_by_role("row", name="fixture Action point").wait_for()
        assert not await screen.faults()
        assert not await screen.barriers()

        # Step to the next and the previous object; with a filter, to the next of that kind.
        await tree.get_by_role("row", name="robot Universal Robots UR5e").click()
        await _wait_for_panel_of(screen, "robot")
        await screen.press("Next: table")
        await _wait_for_panel_of(screen, "table")
        await screen.press("Previous: robot")
        await _wait_for_panel_of(screen, "robot")
        await _tool(screen, texts.OBJECTS)
        await chips.get_by_role("button", name="Points").click()
        await tree.get_by_role("row", name="fixture Action point").click()
        await screen.press("Next: feeder")
        await _wait_for_panel_of(screen, "feeder")


async def _row_labels(rows: Locator) -> list[str]:
    return [await row.get_attribute("aria-label") or "" for row in await rows.all()]


async def _equals(ask: Any, key: str, expected: Any) -> bool:
    return bool(await ask(key) == expected)


async def test_selection_out_of_view_is_found_and_objects_are_faded(opened: Opened, browser: Browser) -> None:
    point, table = opened.point("fixture"), opened.object("table")
    async with screen_of(browser, opened.cell.url, touch=True, drawn=True) as screen:
        page = screen.page
        await _join(screen, "Olga", opened)
        # Points have the same size on the screen from any distance, scaled by the user.
        at = list((await screen.item(point.id))["pose"]["position"].values())
        far, near = [[0, -9, 5], [0, 0, 0]], [[at[0] + 0.3, at[1] - 0.3, at[2] + 0.3], at]
        assert await _drawn_scale(screen, point.id, far) > 3 * await _drawn_scale(screen, point.id, near)
        # Labels of near points and actions appear, at most eight. A stack of actions has one label with their number.
        action_names = {action.name for each in opened.project.action_points for action in each.actions}
        assert f"{point.name} ×{len(point.actions)}" in await _visible_labels(screen)
        await screen.page.evaluate("id => __engine.hover(id)", point.actions[0].id)
        await screen.until("() => __engine.scheduled === 0")
        assert point.actions[0].name in await _visible_labels(screen)
        await screen.page.evaluate("__engine.hover('')")
        await _drawn_scale(screen, point.id, far)
        assert not action_names & set(await _visible_labels(screen))
        before = await _drawn_scale(screen, point.id, near)
        await _tool(screen, texts.POINTS)
        await page.get_by_role("slider", name="Point size").press("End")
        await screen.until(_SCALE_OVER, [point.id, 3.9 * before])

        # Other kinds fade and objects become transparent, in the drawn picture, too.
        await _tool(screen, texts.OBJECTS)
        assert await page.evaluate("__engine.parentLines.count") == 0
        await page.get_by_text("Lines from points to their parents").click()
        with_parent = sum(1 for each in opened.project.action_points if each.parent)
        await screen.until("count => __engine.parentLines.count === count", with_parent)
        await page.evaluate("__engine.view.lookFrom('top')")
        opaque = await _colour_of(screen, table)
        await page.get_by_role("slider", name="Transparency of objects").press("End")
        await screen.until("id => __engine.item(id).faint === 0.95", table)
        assert await page.evaluate("id => __engine.item(id).faint", opened.object("robot")) == 0
        through = await _colour_of(screen, table)
        assert max(abs(a - b) for a, b in zip(opaque, through, strict=True)) > 20, (opaque, through)
        await page.get_by_role("toolbar", name="Only these kinds").get_by_role("button", name="Points").click()
        await page.get_by_text("Fade other kinds").click()
        await screen.until("id => __engine.item(id).faint === 0.85", opened.object("robot"))
        action = opened.project.action_points[0].actions[0].id
        assert not (await screen.item(action))["visible"] or (await screen.item(action))["faint"] == 1
        assert (await screen.item(point.id))["faint"] == 0
        await screen.picture("points alone")
        await page.get_by_text("Fade other kinds").click()
        steps = [item.id for item in opened.project.logic]
        await screen.until("id => __engine.ids().includes(id)", steps[0])
        await page.get_by_text("Program steps").click()
        await screen.until("ids => !__engine.ids().some((id) => ids.includes(id))", steps)
        assert (await screen.item(point.orientations[0].id))["faint"] == 0
        await page.get_by_text("Orientation arrows").click()
        await screen.until("id => __engine.item(id).faint === 1", point.orientations[0].id)
        state = await opened.client.call(
            "GetViewState", rpc.GetViewStateArgs(ViewScope.USER, opened.project.id, "Olga")
        )
        assert (state.values["hide_steps"], state.values["hide_orientations"]) == (True, True)

        # If the selection is outside the view, an arrow appears at the edge. A tap on it turns the view.
        await page.get_by_role("row", name=f"{point.name} Action point").click()
        arrow = page.get_by_role("button", name=f"Turn the view to {point.name}")
        assert await arrow.count() == 0
        for size in ("phone", "tablet"):
            await page.set_viewport_size(VIEWPORTS[size])  # type: ignore[arg-type]
            for away in ([[1, 1, 1], [3, 3, 1]], [[-1, -1, 0.5], [-3, -3, 0]]):
                await page.evaluate("([from, to]) => __engine.view.set(from, to)", away)
                await arrow.wait_for()
                await screen.settle()
                assert not await screen.faults_with(FONTS), (size, away)
        await arrow.click()
        await arrow.wait_for(state="detached")
        assert (await screen.item(point.id))["visible"]


_SCALE = """id => {
    for (const mesh of __engine.scene.children) {
        for (let index = 0; index < (mesh.userData.batch ? mesh.count : 0); index++) {
            if (mesh.userData.batch(index) !== id) continue;
            const [x, y, z] = mesh.instanceMatrix.array.slice(index * 16, index * 16 + 3);
            return Math.hypot(x, y, z);
        }
    }
}"""
_SCALE_OVER = f"([id, least]) => ({_SCALE})(id) > least"


async def _visible_labels(screen: Screen) -> list[str]:
    """Return the visible labels in the view, at most eight."""
    names = await screen.page.locator(".view-label:visible > span").all_inner_texts()
    assert 0 < len(names) <= 8
    return names


async def test_crowded_objects_have_one_label_and_the_selection_has_views_from_above_and_a_side(
    opened: Opened, browser: Browser
) -> None:
    point, tester = opened.point("fixture"), opened.object("tester")
    async with screen_of(browser, opened.cell.url, "phone", touch=True) as screen:
        page = screen.page
        await _join(screen, "Nora", opened)
        await _drawn_scale(screen, point.id, [[0, -9, 5], [0, 0, 0]])
        crowd = page.get_by_role("button", name=re.compile(r"^\d objects: .*tester.*Zoom in$"))
        await expect(crowd).to_have_count(1)
        await expect(page.locator(".view-label:visible").filter(has_text="tester")).to_have_count(0)
        assert await screen.faults() == []
        before = (await screen.item(tester))["screen"]
        await crowd.click()
        await expect(crowd).to_have_count(0)
        assert (await screen.item(tester))["screen"] != before
        # The top and side views are drawn only while they are open.
        await page.set_viewport_size(VIEWPORTS["ipad"])  # type: ignore[arg-type]
        await screen.settle()
        watchers = await page.evaluate("__engine.watchers.size")
        await screen.tap(tester)
        await screen.press("Views")
        await page.get_by_role("menuitem", name="Top and side views").click()
        views = page.get_by_role("group", name=re.compile("^Top and side views of "))
        await views.get_by_text(re.compile(r"^Top")).wait_for()
        await screen.settle()
        assert await screen.faults() == []
        await screen.picture("insets ipad")
        await views.get_by_role("button", name="View: Top").click()
        height = await page.evaluate("() => __engine.view.camera.getWorldDirection(__engine.view.target.clone()).z")
        assert height < -0.99
        await views.get_by_role("button", name="Close top and side views").click()
        await expect(views).to_have_count(0)
        assert await page.evaluate("__engine.watchers.size") == watchers


async def _drawn_scale(screen: Screen, item: str, view: Any) -> float:
    """Return the scale at which a point is drawn from a viewpoint."""
    frames = await screen.frames()
    await screen.page.evaluate("([from, to]) => __engine.view.set(from, to)", view)
    # Sizes on the screen are adjusted when the camera has stopped.
    await screen.until("frames => __engine.frames > frames && __engine.scheduled === 0", frames)
    return float(await screen.page.evaluate(_SCALE, item))


async def _colour_of(screen: Screen, item: str) -> list[int]:
    """Return the colour of a flat object at a free corner, seen from above."""
    return list(
        await screen.page.evaluate(
            """async (id) => {
                const picture = await createImageBitmap(await __engine.picture("image/png"));
                const { clientWidth, clientHeight } = document.querySelector(".view");
                const pen = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
                pen.drawImage(picture, 0, 0);
                for (let y = 8; y < clientHeight; y += 8) {
                    for (let x = 8; x < clientWidth; x += 8) {
                        const [first] = __engine.pick(x, y, 0);
                        if (first?.id !== id || __engine.pick(x, y, 12).length > 1) continue;
                        const scale = picture.width / clientWidth;
                        return [...pen.getImageData(x * scale, y * scale, 1, 1).data.slice(0, 3)];
                    }
                }
            }""",
            item,
        )
    )

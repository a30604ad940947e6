"""A tour of the screens of the editor in any language."""

from collections.abc import AsyncIterator

from playwright.async_api import Locator

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from tests.editor import texts
from tests.editor.screen import Screen
from tests.editor.words import Words


class Tour:
    """Visits the screens of a workplace. Each method is a generator of the names of the screens when they are shown."""

    def __init__(self, screen: Screen, words: Words, scene: Scene, project: Project) -> None:
        self.screen = screen
        self.words = words
        self.project = project
        self.scene = scene

    def _button(self, english: str, **values: str) -> Locator:
        name = self.words(english, **values)
        return self.screen.page.get_by_role("button", name=name, exact=True)

    def _choice(self, english: str) -> Locator:
        return self.screen.page.get_by_role("radio", name=self.words(english), exact=True)

    async def home(self, user: str) -> AsyncIterator[str]:
        """Join, and visit the lists and dialogs of the home screen."""
        page, words = self.screen.page, self.words
        await page.goto(f"{self.screen.url}/?q=low")
        await page.get_by_label(words(texts.YOUR_NAME)).wait_for()
        yield "join"
        await page.get_by_label(words(texts.YOUR_NAME)).fill(user)
        await self._button(texts.JOIN).click()
        await page.get_by_role("heading", name=words(texts.HOME_HEADING)).wait_for()
        await page.get_by_role("button", name=self.project.name).first.wait_for()
        yield "projects"
        await self._button("More about {name}", name=self.project.name).click()
        await page.get_by_role("menu").wait_for()
        yield "menu of a project"
        await page.keyboard.press("Escape")
        await self._button(texts.NEW_PROJECT).click()
        await page.get_by_role("dialog").wait_for()
        yield "new project"
        await page.keyboard.press("Escape")
        await self._list(texts.PACKAGES)
        yield "packages"
        await self._button(texts.SETTINGS).click()
        await page.get_by_role("menu").wait_for()
        yield "settings"
        await page.keyboard.press("Escape")
        for key, name in (("?", "about"), ("/", "search")):
            await page.keyboard.press(key)
            await page.get_by_role("dialog").wait_for()
            yield name
            await page.keyboard.press("Escape")
            await page.get_by_role("dialog").wait_for(state="hidden")
        await self._list(texts.SCENES)
        yield "scenes"

    async def scene_editor(self) -> AsyncIterator[str]:
        """Open the scene from its list, and visit its tools, a device form and a selected device."""
        page = self.screen.page
        await self._button("Open {name}", name=self.scene.name).click()
        await self.screen.item(self.scene.objects[0].id)
        yield "scene"
        await self._tool(texts.ADD)
        await page.locator(".kind").first.wait_for()
        yield "add"
        await page.locator(".kind").first.click()
        await page.locator(".value-field").first.wait_for(state="attached")
        await self._open_details()
        yield "form of a new device"
        await self._select("robot")
        yield "selected device"
        await self._button(texts.CLOSE_PANEL).click()
        await self._close()

    async def project_editor(self) -> AsyncIterator[str]:
        """Open the project, and visit its tools, its views and selected items."""
        page, words = self.screen.page, self.words
        await self._list(texts.PROJECTS)
        await self._button("Open {name}", name=self.project.name).click()
        await self.screen.item(self.project.action_points[0].id)
        yield "workplace"
        for tool in texts.TOOLS:
            await self._tool(tool)
            yield tool
            if tool == texts.PROGRAM:
                for tab in ("Actions", "Check", texts.VARIABLES):
                    await page.get_by_role("complementary").get_by_role("radio").filter(has_text=words(tab)).click()
                    yield f"{tool}, {tab}"
        await self._button(texts.CLOSE_PANEL).click()
        point = self.project.action_points[0]
        for item in (point.name, point.orientations[0].name, point.actions[0].name, "take_out"):
            await self._select(item)
            yield f"selected {item}"
        await self._button(texts.CLOSE_PANEL).click()
        for mode in ("Flow", "Code", "3D"):
            await self._choice(mode).click()
            await page.locator(".centre .waiting").wait_for(state="detached")
            yield f"view {mode}"

    async def online(self) -> AsyncIterator[str]:
        """Go online, and visit the panel of the robot."""
        page, words = self.screen.page, self.words
        await self._button(texts.GO_ONLINE).click()
        await page.get_by_role("button", name=words(texts.STOP_MOTION)).wait_for(timeout=60_000)
        await self._tool(texts.ROBOT)
        for tab in ("Tool", "Joints", "By hand", "Go to"):
            tabs = page.get_by_role("radiogroup", name=words(texts.HOW_TO_MOVE))
            await tabs.get_by_role("radio", name=words(tab), exact=True).click()
            yield f"robot, {tab}"
        await self._tool(texts.DEVICES)
        yield "devices online"
        await page.locator(".topbar .live").click()
        await self._button(texts.GO_ONLINE).wait_for()
        await self._close()

    async def all(self, user: str) -> AsyncIterator[str]:
        """Visit all screens as this user."""
        for part in (self.home(user), self.scene_editor(), self.project_editor(), self.online(), self.operator()):
            async for shown in part:
                yield shown

    async def operator(self) -> AsyncIterator[str]:
        """Visit the operator's screen."""
        await self.screen.page.goto(f"{self.screen.url}/?q=low#/operator")
        await self.screen.page.locator(".operator").wait_for()
        yield "operator"

    async def _list(self, english: str) -> None:
        await self.screen.page.get_by_role("radio", name=self.words(english)).click()

    async def _close(self) -> None:
        bar = self.screen.page.get_by_role("banner")
        await bar.get_by_role("button", name=self.words(texts.CLOSE_DOCUMENT), exact=True).click()
        await self.screen.page.get_by_role("heading", name=self.words(texts.HOME_HEADING)).wait_for()

    async def _tool(self, english: str) -> None:
        page, name = self.screen.page, self.words(english, "tool")
        button = page.get_by_role("navigation").get_by_role("button", name=name, exact=True)
        if await button.get_attribute("aria-pressed") != "true":
            await button.click()
        await page.get_by_role("complementary").get_by_role("heading", name=name, exact=True).wait_for()
        await page.locator(".panel-body .waiting").wait_for(state="detached")

    async def _select(self, item: str) -> None:
        """Select an item by its row in the list of objects, and open all its sections."""
        page = self.screen.page
        await self._tool(texts.OBJECTS)
        await page.get_by_role("row").filter(has=page.get_by_text(item, exact=True)).first.click()
        await page.get_by_role("complementary").get_by_role("heading", name=item, exact=True).wait_for()
        await page.locator(".panel-body .waiting").wait_for(state="detached")
        await self._open_details()

    async def _open_details(self) -> None:
        await self.screen.page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")

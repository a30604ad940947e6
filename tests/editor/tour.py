"""A tour of the screens and dialogs of the editor in any language."""

import re
from collections.abc import AsyncIterator
from typing import Any, Final

from playwright.async_api import Locator, expect

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from tests.editor import texts
from tests.editor.screen import USERS, Screen
from tests.editor.words import Words

GUIDED_STEPS = 10
JOINING: Final[Any] = {
    "addresses": ["https://workplace.local:6789", "https://192.0.2.20:6789"],
    "fingerprint": ":".join(["A0"] * 32),
    "authority": ":".join(["B1"] * 32),
}
"""Answer of a server that others can join."""
GREY_CAMERA = """() => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 640, height: 480 });
    const context = canvas.getContext("2d");
    let step = 0;
    setInterval(() => {  // only changes are sent
        context.fillStyle = step++ % 2 ? "#808080" : "#828282";
        context.fillRect(0, 0, canvas.width, canvas.height);
    }, 100);
    navigator.mediaDevices.getUserMedia = async () => canvas.captureStream(10);
}"""
"""Replace the camera of the device."""


class Tour:
    """Visits the screens of a workplace. Each method is a generator of the names of the screens when they are shown.

    The caller opens and closes documents, goes online and runs programs, so that several pages visit the same state.
    """

    def __init__(
        self, screen: Screen, user: str, words: Words, scene: Scene, project: Project, robot_host: str
    ) -> None:
        self.screen = screen
        self.user = user
        self.words = words
        self.project = project
        self.scene = scene
        self.robot_host = robot_host

    def _button(self, english: str, **values: str) -> Locator:
        name = self.words(english, **values)
        return self.screen.page.get_by_role("button", name=name, exact=True)

    def _choice(self, english: str) -> Locator:
        return self.screen.page.get_by_role("radio", name=self.words(english), exact=True)

    @property
    def _panel(self) -> Locator:
        return self.screen.page.get_by_role("complementary")

    async def join(self) -> AsyncIterator[str]:
        """Visit the screen for joining, and join."""
        page, words = self.screen.page, self.words
        USERS.add(self.user)
        await page.goto(f"{self.screen.url}/?q=low")
        await page.get_by_label(words(texts.YOUR_NAME)).wait_for()
        yield "join"
        await page.get_by_label(words(texts.YOUR_NAME)).fill("colleague")
        await self._button(texts.JOIN).click()
        await page.get_by_role("alert").first.wait_for()
        yield "join refused"
        await page.get_by_label(words(texts.YOUR_NAME)).fill(self.user)
        await self._button(texts.JOIN).click()
        await page.get_by_role("heading", name=words(texts.HOME_HEADING)).wait_for()

    async def home(self) -> AsyncIterator[str]:
        """Visit the lists and dialogs of the home screen."""
        page, words = self.screen.page, self.words
        await page.get_by_role("button", name=self.project.name).first.wait_for()
        yield "projects"
        more = self._button("More about {name}", name=self.project.name)
        await more.click()
        await page.get_by_role("menu").wait_for()
        yield "menu of a project"
        await page.get_by_role("menuitem", name=words("Duplicate…")).click()
        async for shown in self._dialog("duplicate"):
            yield shown
        await more.click()
        await page.get_by_role("menuitem", name=words("Delete…")).click()
        async for shown in self._dialog("delete"):
            yield shown
        await self._button(texts.NEW_PROJECT).click()
        async for shown in self._dialog("new project"):
            yield shown
        await self._list(texts.PACKAGES)
        await self._button("Run {name}", name=self.project.name).wait_for()
        yield "packages"
        await self._button(texts.SETTINGS).click()
        await page.get_by_role("menu").wait_for()
        yield "settings"
        await page.get_by_role("menuitem", name=words("Messages"), exact=True).click()
        async for shown in self._dialog("messages"):
            yield shown
        await self._button(texts.SETTINGS).click()
        await page.get_by_role("menuitem", name=words("Audit trail"), exact=True).click()
        await page.get_by_role("dialog").get_by_role("listitem").first.wait_for()
        async for shown in self._dialog("audit trail"):
            yield shown
        await self._button(texts.SETTINGS).click()
        await page.get_by_role("menuitem", name=words("Persons"), exact=True).click()
        await page.get_by_role("dialog").get_by_role("button", name=words("Add person"), exact=True).click()
        yield "add person"
        await page.keyboard.press("Escape")
        await page.get_by_role("dialog").get_by_role("button", name=words("Add person"), exact=True).wait_for()
        async for shown in self._dialog("persons"):
            yield shown
        # Answer like a server that others can join.
        await page.route("**/api/joining", lambda route: route.fulfill(json=JOINING))
        for key, name in (("?", "about, with the addresses to join"), ("/", "search")):
            await page.keyboard.press(key)
            async for shown in self._dialog(name):
                yield shown
        await self._list(texts.SCENES)
        yield "scenes"
        await self._button(texts.NEW_SCENE).click()
        async for shown in self._dialog("new scene"):
            yield shown
        await self._button("More about {name}", name=self.scene.name).click()
        await page.get_by_role("menuitem", name=words("Delete…")).click()
        async for shown in self._dialog("delete a scene in use"):
            yield shown

    async def guided(self) -> AsyncIterator[str]:
        """Open the project with the guided tour, and skip all its steps."""
        page, words = self.screen.page, self.words
        await self._button("Start here").click()
        shown = page.get_by_role("region", name=words("Guided tour"))
        for number in range(1, GUIDED_STEPS + 1):
            await shown.get_by_text(f"{number}/{GUIDED_STEPS}", exact=True).wait_for()
            yield f"guided tour, step {number}"
            await shown.get_by_role("button", name=re.compile(f"^({words('Skip step')}|{words('Next')})$")).click()
        await shown.wait_for(state="detached")

    async def scene_editor(self) -> AsyncIterator[str]:
        """Visit the tools of the open scene, the wizard of a device and a selected device."""
        page, words = self.screen.page, self.words
        await self.screen.item(self.scene.objects[0].id)
        yield "scene"
        await self._tool(texts.ADD)
        await page.locator(".kind").first.wait_for()
        yield "add"
        await page.locator(".kind").filter(has_text=words.server("Universal Robots UR5e")).click()
        await page.locator(".value-field").first.wait_for(state="attached")
        await self._open_details()
        yield "form of a new device"
        await self._button(texts.ADD).last.click()
        await page.get_by_role("alert").first.wait_for()
        yield "required settings"
        await self._panel.locator(".value-field input").first.fill("127.0.0.1")
        await self._button("Test connection").click()
        await self._panel.get_by_role("status").get_by_role("alert").wait_for()
        yield "failed test of a connection"
        await self._button("Search network…").click()
        await self._panel.get_by_label(words("Addresses to search")).fill(f"{self.robot_host}, 127.0.0.8/30")
        yield "search of the network"
        await self._button("Search").click()
        found = self._panel.get_by_role("list", name=words("Found devices")).get_by_role("button")
        await found.wait_for()
        yield "found device"
        # The found device is the value of the setting.
        await found.click()
        await expect(self._panel.locator(".value-field input").first).to_have_value(self.robot_host)
        await self._button("← All types").click()
        await self._button("Mesh…").click()
        yield "mesh"
        await self._select("robot")
        yield "selected device"
        await self._panel.get_by_role("button", name=words(texts.REMOVE), exact=True).first.click()
        yield "remove a device"
        await page.keyboard.press("Escape")
        await self._button(texts.CLOSE_PANEL).click()

    async def _dialog(self, name: str) -> AsyncIterator[str]:
        """Visit the dialog that opens, and close it."""
        dialog = self.screen.page.locator("[role=dialog], [role=alertdialog]")
        await dialog.wait_for()
        yield name
        await self.screen.page.keyboard.press("Escape")
        await dialog.wait_for(state="hidden")

    async def project_editor(self) -> AsyncIterator[str]:
        """Visit the tools, the views and selected items of the open project."""
        page, words = self.screen.page, self.words
        await self.screen.item(self.project.action_points[0].id)
        yield "workplace"
        for tool in texts.TOOLS:
            await self._tool(tool)
            yield tool
            if tool == texts.PROGRAM:
                for tab in ("Actions", "Check", texts.VARIABLES):
                    await self._panel.get_by_role("radio").filter(has_text=words(tab)).click()
                    yield f"{tool}, {tab}"
            if tool == texts.RUN:
                await self._button("Build…").click()
                async for shown in self._dialog("build"):
                    yield shown
        await self._button(texts.CLOSE_PANEL).click()
        point = self.project.action_points[0]
        for item in (point.name, point.orientations[0].name, point.actions[0].name, "take_out", "test"):
            await self._select(item)
            yield f"selected {item}"
        await self._button("Branch").click()
        await page.locator(".banner").wait_for()
        yield "connecting"
        await page.keyboard.press("Escape")
        await page.locator(".banner").wait_for(state="detached")
        await self._button(texts.CLOSE_PANEL).click()
        for mode in ("Flow", "Code", "3D"):
            await self._choice(mode).click()
            await page.locator(".centre .waiting").wait_for(state="detached")
            yield f"view {mode}"
        await self._button("Views").click()
        await page.get_by_role("menuitem", name=words("Save view…")).click()
        async for shown in self._dialog("save view"):
            yield shown

    async def functions(self, call: str, parallel: str) -> AsyncIterator[str]:
        """Visit functions and parallel work of the open project. `call` and `parallel` are names of actions."""
        page, words = self.screen.page, self.words
        await self._choice("3D").click()
        await self._tool(texts.PROGRAM)
        await self._panel.get_by_role("radio").filter(has_text=words(texts.ADD, "tab")).click()
        await self._panel.get_by_role("region", name=words("Functions")).wait_for()
        yield "list of functions"
        await self._panel.get_by_role("button", name=words("Run in parallel"), exact=True).click()
        async for shown in self._dialog("new parallel work"):
            yield shown
        await self._panel.get_by_role("radio").filter(has_text=words("Actions")).click()
        await self._button(texts.SELECT_SEVERAL).click()
        await page.locator(".picking").wait_for()
        yield "selection for a function"
        await self._button(texts.CANCEL).click()
        await self._select(parallel)
        yield "parallel work"
        await self._select(call)
        yield "call of a function"
        await self._panel.get_by_role("button", name=words("Open function")).click()
        await page.locator(".scope-bar").wait_for()
        await self._choice("Flow").click()
        await page.locator(".flow-node.start").click()
        await self._panel.get_by_role("region", name=words("Parameters of the function")).wait_for()
        yield "parameters of a function"
        await page.locator(".scope-bar").get_by_role("button", name=words("Back"), exact=True).click()
        await self._choice("Split").click()
        await page.locator(".flow-node.parallel").wait_for()
        yield "parallel work in the graph"
        await self._choice("3D").click()

    async def dry_run(self) -> AsyncIterator[str]:
        """Visit the result of a dry run of the open project, which another user has started, and its assumptions."""
        words = self.words
        await self._tool(texts.RUN)
        await self._panel.get_by_text(words("Assumptions"), exact=True).wait_for()
        await self._open_details()
        yield "dry run"

    async def augmented(self) -> AsyncIterator[str]:
        """Visit AR with a camera whose picture is grey."""
        page, words = self.screen.page, self.words
        await page.evaluate(GREY_CAMERA)
        await self._button("AR").click()
        await self._button("Start AR").wait_for()
        yield "before AR"
        await self._button("Start AR").click()
        await page.get_by_role("group", name=words("Quality of AR")).wait_for()
        yield "AR"
        await self._button("Leave AR").click()
        await page.locator(".ar-controls").wait_for(state="detached")

    async def online(self) -> AsyncIterator[str]:
        """Visit the panels of the robot and the devices of the open project, which is online."""
        page, words = self.screen.page, self.words
        await page.get_by_role("button", name=words(texts.STOP_MOTION)).wait_for()
        await self._tool(texts.ROBOT)
        for tab in ("Tool", "Joints", "By hand", "Go to"):
            tabs = page.get_by_role("radiogroup", name=words(texts.ROBOT_CONTROL))
            await tabs.get_by_role("radio", name=words(tab), exact=True).click()
            yield f"robot, {tab}"
        await self._tool(texts.DEVICES)
        yield "devices online"
        await self._button(texts.CLOSE_PANEL).click()

    async def camera(self) -> AsyncIterator[str]:
        """Visit the section of an online camera, with a picture and a refused calibration."""
        page, words = self.screen.page, self.words
        await page.get_by_role("button", name=words(texts.STOP_MOTION)).wait_for()
        await self._select("eye")
        await self._button("Take a picture").click()
        await page.get_by_role("img", name=words("Camera picture")).wait_for()
        yield "camera"
        await self._button("Check lens with markers").click()
        await self._panel.get_by_role("status").filter(has_text=re.compile(r"\S")).first.wait_for()
        yield "refused check of the lens"

    async def calibrated(self) -> AsyncIterator[str]:
        """Visit the sections of a camera and a robot with stored calibrations, and the check of the lens."""
        words = self.words
        await self._select("eye")
        history = self._panel.get_by_role("list", name=words("Calibration history"))
        await history.wait_for()
        await self._button("Check lens with markers").click()
        await (
            self._button("Check lens with markers")
            .and_(self._panel.locator("[data-disabled]"))
            .wait_for(state="detached")
        )
        yield "calibrated camera"
        await self._select("arm")
        await history.wait_for()
        yield "calibrated robot"
        await self._button(texts.CLOSE_PANEL).click()

    async def executing(self) -> AsyncIterator[str]:
        """Visit the screens of the program while an action runs, and leave the operator's screen open."""
        page, words = self.screen.page, self.words
        await page.evaluate("location.hash = ''")
        bar = page.get_by_role("group", name=words(texts.PROGRAM_STATE))
        await bar.get_by_role("button", name=words("Pause"), exact=True).wait_for()
        yield "running program"
        await self._operator()
        yield "operator, running program"

    async def running(self) -> AsyncIterator[str]:
        """Visit the screens of the program, which is paused before its first action."""
        page, words = self.screen.page, self.words
        bar = page.get_by_role("group", name=words(texts.PROGRAM_STATE))
        await bar.get_by_role("button", name=words(texts.STEP), exact=True).wait_for()
        await self._tool(texts.RUN)
        yield "paused program"
        await self._operator()
        yield "operator, paused program"

    async def failed(self) -> AsyncIterator[str]:
        """Visit the screens after a run that failed, from the operator's screen."""
        page, words = self.screen.page, self.words
        # Do not search by name: in some languages, notices on this screen have the same name.
        dismiss = page.locator(".operator-dismiss")
        await dismiss.wait_for()
        yield "operator, failed run"
        await dismiss.click()
        await dismiss.wait_for(state="detached")
        yield "operator"
        await page.evaluate("location.hash = ''")
        await page.get_by_role("heading", name=words(texts.HOME_HEADING)).wait_for()
        yield "failed run"

    async def _operator(self) -> None:
        await self.screen.page.evaluate("location.hash = '#/operator'")
        await self.screen.page.locator(".operator").wait_for()

    async def _list(self, english: str) -> None:
        await self.screen.page.get_by_role("radio", name=self.words(english)).click()

    async def _tool(self, english: str) -> None:
        page, name = self.screen.page, self.words(english, "tool")
        button = page.get_by_role("navigation").get_by_role("button", name=name, exact=True)
        if await button.get_attribute("aria-pressed") != "true":
            await button.click()
        await self._panel.get_by_role("heading", name=name, exact=True).wait_for()
        await page.locator(".panel-body .waiting").wait_for(state="detached")

    async def _select(self, item: str) -> None:
        """Select an item by its row in the list of objects, and open all its sections."""
        page = self.screen.page
        await self._tool(texts.OBJECTS)
        await page.get_by_role("row").filter(has=page.get_by_text(item, exact=True)).first.click()
        await self._panel.get_by_role("heading", name=item, exact=True).wait_for()
        await page.locator(".panel-body .waiting").wait_for(state="detached")
        await self._open_details()

    async def _open_details(self) -> None:
        await self.screen.page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")

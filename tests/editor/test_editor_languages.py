"""Languages: chosen in the settings, stored with the user, switched without reload; all screens in all languages.

A page visits every screen in a pseudo-locale, whose texts come from the English ones and are longer than most
translations, on a phone. On each screen all texts are translated, none is cut off, and all controls can be reached.

With `--matrix`, this page visits every screen on a tablet, too, and two more pages visit every screen: in Czech on a
phone, in dark colours; and in German on a tablet. On their screens, axe finds no serious or critical violation.
"""

import asyncio
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager

import msgspec
import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.events import ProcessStateEnum, SceneStateEnum
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene
from arcor2_server.demo.workplace import load
from tests.e2e.harness import WORKPLACE, Cell, scene_state
from tests.editor import texts
from tests.editor.pseudo import LOCALE, PseudoWords, names_in, untranslated, use_pseudo_locale
from tests.editor.scene_with_camera import NAMES, camera_of, configure_markers, new_scene
from tests.editor.screen import VIEWPORTS, Screen, screen_of
from tests.editor.tour import JOINING, Tour
from tests.editor.words import Words

pytestmark = pytest.mark.asyncio(loop_scope="session")

DEFINED_BY_DEVICES = {
    *(f"{name} joint" for name in ("shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3")),
    *("tcp", "gripper"),
    *("bgr", "jpeg"),
    "ur5e.zip",
}
"""Names in models of robots, and values of settings."""
GERMAN, CZECH = Words("de"), Words("cs")
LANGUAGES = {"pseudo": ("phone", "ipad"), "cs": ("phone",), "de": ("ipad",)}
"""Viewports of each language with `--matrix`. Without it, only the first viewport of the first language is used."""
DARK = "cs"
LABEL_RULE = "label-content-name-mismatch"
"""A rule that the pseudo-locale breaks: it lengthens a short text only as part of a longer label."""
ADDRESSES = {*JOINING["addresses"], JOINING["addresses"][0].replace("https", "http")}
FUNCTIONS = {"open_lid", "fetch", "grip", "count", "prepare"}
PEOPLE = {"colleague", "helper", "CO", "HE", *(f"Visitor {each}" for each in LANGUAGES), "VP", "VC", "VD"}


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def documents(module_cell: Cell) -> AsyncIterator[tuple[Scene, Project]]:
    """The scene and project of three devices, saved, built and closed."""
    client = await module_cell.client("colleague")
    workplace = load(WORKPLACE)
    steps = [
        msgspec.structs.replace(each, parameters={"timeout": 60.0}) if each.name == "scan" else each
        for each in workplace.steps
    ]
    scene, project = await module_cell.open(client, workplace=msgspec.structs.replace(workplace, steps=steps))
    await module_cell.build(client, project)
    yield scene, project


async def choose(page: Page, words: Words, language: str) -> None:
    await page.get_by_role("button", name=words(texts.SETTINGS), exact=True).click()
    await page.get_by_role("menuitem", name=language).click()


async def test_language_follows_the_browser_and_is_then_stored_with_the_user(
    module_cell: Cell, documents: tuple[Scene, Project], browser: Browser
) -> None:
    _, project = documents
    html = "() => document.documentElement.lang"
    async with screen_of(browser, module_cell.url, locale="de-AT") as screen:
        page = screen.page
        await page.goto(f"{screen.url}/?q=low")
        await page.get_by_label(GERMAN(texts.YOUR_NAME)).fill("Jana")
        assert await page.evaluate(html) == "de"
        await page.get_by_role("button", name=GERMAN(texts.JOIN), exact=True).click()
        await page.get_by_role("button", name=GERMAN("Open {name}", name=project.name)).click()
        await screen.item(project.action_points[0].id)
        # Numbers have a decimal comma; typed ones may have either.
        point = project.action_points[0]
        tools = page.get_by_role("navigation")
        await tools.get_by_role("button", name=GERMAN(texts.OBJECTS), exact=True).click()
        await page.get_by_role("row", name=f"{point.name} {GERMAN('Action point')}", exact=True).click()
        number = page.get_by_role("button", name=re.compile(r"^X [\d.,]+ mm"))
        for typed in ("400.25", "400,5"):
            await number.click()
            await page.keyboard.type(typed)
            await page.keyboard.press("Enter")
            await expect(number).to_have_text(f"{typed.replace('.', ',')} mm")
        # The language changes without a reload, and the view stays as it is.
        await page.evaluate("() => { window.sameEngine = window.__engine; }")
        await choose(page, GERMAN, "English")
        await tools.get_by_role("button", name=texts.POINTS, exact=True).wait_for()
        await expect(number).to_have_text("400.5 mm")
        await choose(page, Words("en"), "Čeština")
        await tools.get_by_role("button", name=CZECH(texts.POINTS), exact=True).wait_for()
        assert await page.evaluate(html) == "cs"
        assert await page.evaluate("() => window.sameEngine === window.__engine")
        # A message in the dock may have a button with this name, too.
        await page.get_by_role("button", name=CZECH(texts.CLOSE_DOCUMENT), exact=True).first.click()
        await page.get_by_role("button", name=CZECH(texts.DISCARD_CHANGES)).click()
        await page.get_by_role("heading", name=CZECH(texts.HOME_HEADING)).wait_for()
    # The language also applies on another device of the user, whose browser is in English.
    async with screen_of(browser, module_cell.url) as screen:
        await screen.join("Jana")
        await screen.page.get_by_role("heading", name=CZECH(texts.HOME_HEADING)).wait_for()
        await screen.page.reload()
        await screen.page.get_by_role("heading", name=CZECH(texts.HOME_HEADING)).wait_for()


class Visitor:
    """One page in one language. Collects texts that are not translated or cut off, and violations of accessibility."""

    def __init__(
        self, screen: Screen, language: str, sizes: Sequence[str], documents: tuple[Scene, Project], robot_host: str
    ) -> None:
        self.screen = screen
        self.language = language
        self.pseudo = language == "pseudo"
        words = PseudoWords() if self.pseudo else Words(language)
        self.tour = Tour(screen, f"Visitor {language}", words, *documents, robot_host)
        self.names = names_in(*documents) | NAMES | PEOPLE | FUNCTIONS | ADDRESSES | DEFINED_BY_DEVICES
        self._sizes = list(sizes)

    async def faults(self, screens: AsyncIterator[str], *, axe: bool) -> list[str]:
        """Return the faults of these screens in all sizes. The next screen is opened in the size of the last check."""
        found = []
        async for shown in screens:
            faults = list(await untranslated(self.screen.page, self.names)) if self.pseudo else []
            for size in self._sizes:
                if len(self._sizes) > 1:
                    await self.screen.page.set_viewport_size(VIEWPORTS[size])  # type: ignore[arg-type]
                await self.screen.settle()
                # Labels in the view are names of items, the same in every language.
                layout = [fault for fault in await self.screen.faults() if not fault.startswith("labels ")]
                faults += [f"{size}: {fault}" for fault in [*await self.screen.clipped(), *layout]]
                await self.screen.picture(f"{self.language} {shown} {size}")
            if axe:
                barriers = await self.screen.barriers()
                faults += [each for each in barriers if not (self.pseudo and each.startswith(LABEL_RULE))]
            self._sizes.reverse()
            found += [f"{self.language}, {shown}: {fault}" for fault in faults]
        return found


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def visitors(
    module_cell: Cell, documents: tuple[Scene, Project], browser: Browser, pytestconfig: pytest.Config
) -> AsyncIterator[list[Visitor]]:
    async with AsyncExitStack() as stack:
        found = []
        shown = LANGUAGES if pytestconfig.getoption("--matrix") else {"pseudo": LANGUAGES["pseudo"][:1]}
        for language, sizes in shown.items():
            locale = LOCALE if language == "pseudo" else language
            opened = screen_of(browser, module_cell.url, sizes[0], touch=True, locale=locale, dark=language == DARK)
            screen = await stack.enter_async_context(opened)
            # The tour sends requests that the server refuses.
            screen.expected_errors = ("409 (Conflict)", "400 (Bad Request)", "404 (Not Found)")
            if language == "pseudo":
                await use_pseudo_locale(screen.page)
            found.append(Visitor(screen, language, sizes, documents, module_cell.robot_host))
        await visit(found, lambda each: each.tour.join())
        yield found


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def client(module_cell: Cell, visitors: list[Visitor]) -> Client:
    """A user who opens documents, goes online and runs programs for all visitors."""
    return await module_cell.client("helper")


async def visit(
    visitors: Sequence[Visitor], screens: Callable[[Visitor], AsyncIterator[str]], *, axe: bool = False
) -> None:
    """Visit these screens in all languages. Axe checks the translations, by default not the pseudo-locale."""
    found = await asyncio.gather(*(each.faults(screens(each), axe=axe or not each.pseudo) for each in visitors))
    faults = [fault for faults in found for fault in faults]
    assert not faults, "\n".join(faults)


@asynccontextmanager
async def online(client: Client) -> AsyncIterator[None]:
    """Go online, and offline again at the end."""
    await client.start_scene()
    try:
        await scene_state(client, SceneStateEnum.STARTED, 60)
        yield
    finally:
        await client.stop_scene()
        await scene_state(client, SceneStateEnum.STOPPED, 30)


async def calibrate(client: Client, object_id: str, begin: Awaitable[None]) -> None:
    """Calibrate the pose of an object, and wait for the end."""
    await client.write_lock(object_id)
    await begin
    while (event := await client.next_event("ProcessState", timeout=60)).data.state is ProcessStateEnum.STARTED:
        pass
    assert event.data.state is ProcessStateEnum.FINISHED, event.data.message
    await client.write_unlock(object_id)


async def test_home_is_translated(visitors: list[Visitor]) -> None:
    await visit(visitors, lambda each: each.tour.home())


async def test_guided_tour_is_translated(visitors: list[Visitor], client: Client) -> None:
    try:
        await visit(visitors[:1], lambda each: each.tour.guided(), axe=True)
    finally:
        await client.close_project(force=True)


async def test_scene_editor_is_translated(
    visitors: list[Visitor], client: Client, documents: tuple[Scene, Project]
) -> None:
    await client.open_scene(documents[0].id)
    try:
        await visit(visitors, lambda each: each.tour.scene_editor())
    finally:
        await client.close_scene(force=True)


async def test_project_editor_is_translated(
    visitors: list[Visitor], client: Client, documents: tuple[Scene, Project]
) -> None:
    await client.open_project(documents[1].id)
    try:
        await visit(visitors, lambda each: each.tour.project_editor())
        await client.call("StartDryRun", rpc.StartDryRunArgs())
        await visit(visitors, lambda each: each.tour.dry_run())
        async with online(client):
            await visit(visitors, lambda each: each.tour.online())
    finally:
        await client.close_project(force=True)


async def test_function_editor_is_translated(
    visitors: list[Visitor], client: Client, documents: tuple[Scene, Project]
) -> None:
    project = documents[1]
    actions = {action.name: action.id for action in project.all_actions()}
    await client.open_project(project.id)
    try:
        functions = {
            name: await client.call("MakeFunction", rpc.MakeFunctionArgs(name, [actions[used]]))
            for name, used in (("open_lid", "open"), ("fetch", "pick"), ("grip", "close"))
        }
        count = rpc.AddFunctionParameterArgs(
            functions["grip"].function_id, "count", "integer", Parameter("count", "integer", "1")
        )
        await client.call("AddFunctionParameter", count)
        parallel_calls = [functions[name].action_id for name in ("open_lid", "fetch")]
        await client.call("MakeParallel", rpc.MakeParallelArgs("prepare", parallel_calls))
        await visit(visitors, lambda each: each.tour.functions("grip", "prepare"))
    finally:
        await client.close_project(force=True)


async def test_screens_of_a_running_program_are_translated(
    visitors: list[Visitor], client: Client, module_cell: Cell
) -> None:
    (package,) = await client.list_packages()
    await client.call("RunPackage", rpc.RunPackageArgs(package.id, start_paused=True))
    while (await client.next_event("PackageState")).data.state is not PackageStateEnum.PAUSED:
        pass
    await visit(visitors, lambda each: each.tour.running())
    await module_cell.command_fake("reader", "present", code="PCB-1")
    await module_cell.command_fake("reader", "late", seconds=60)
    await client.call("ResumePackage")
    await visit(visitors, lambda each: each.tour.executing())
    await module_cell.command_fake("reader", "power_cycle")
    await visit(visitors, lambda each: each.tour.failed())


async def test_calibration_screens_are_translated(visitors: list[Visitor], client: Client, module_cell: Cell) -> None:
    async with camera_of(module_cell, width=640, height=360):
        ids = await new_scene(module_cell, client)
        try:
            async with online(client):
                await visit(visitors, lambda each: each.tour.camera())
                await configure_markers(module_cell)
                await calibrate(client, ids["eye"], client.calibrate_camera(ids["eye"]))
                await calibrate(client, ids["arm"], client.calibrate_robot(ids["arm"], camera_id=ids["eye"]))
                await visit(visitors, lambda each: each.tour.calibrated())
            await visit(visitors, lambda each: each.tour.augmented())
        finally:
            await client.close_scene(force=True)

"""An open project on a screen, and a second client that uses the protocol, for tests of programming."""

import contextlib
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from playwright.async_api import Browser, Locator

from arcor2_hw.client import Client
from arcor2_hw.client.errors import LockedByOther, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.events import Event
from arcor2_hw.data.project import Action, ActionParameter, Flow, FlowTypes, Project
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, until
from tests.editor import texts
from tests.editor.screen import VIEWPORTS, Screen, screen_of


@dataclass
class Work:
    """A project on a screen, and a second client, "colleague". `taps` counts the taps of `tool` and `tap_button`."""

    cell: Cell
    client: Client
    scene: Scene
    original: Project
    project: Project
    screen: Screen
    taps: int = 0
    copies: int = 0

    def object(self, name: str) -> str:
        return next(each.id for each in self.scene.objects if each.name == name)

    def point(self, name: str) -> str:
        return next(each.id for each in self.project.action_points if each.name == name)

    def action(self, name: str) -> Action:
        return next(action for point in self.project.action_points for action in point.actions if action.name == name)

    @property
    def panel(self) -> Locator:
        return self.screen.page.get_by_role("complementary")

    async def start(self) -> None:
        """Open a fresh copy of the project, and reset the screen: offline, 3D view, panels closed."""
        await self.screen.page.set_viewport_size(VIEWPORTS["tablet"])  # type: ignore[arg-type]
        self.copies += 1
        name = f"{self.original.name} {self.copies}"
        await self.client.copy_project(source_id=self.original.id, target_name=name)
        copy = next(each for each in await self.client.list_projects() if each.name == name)

        async def opened() -> bool:
            """Stop and close what a test has left, and open the copy."""
            for request in (
                self.client.stop_package,
                self.client.stop_scene,
                partial(self.client.close_project, force=True),
                partial(self.client.open_project, copy.id),
            ):
                with contextlib.suppress(RequestFailed):
                    await request()
            return await self._open_id() == copy.id

        await until(opened, f"{name} is open", 30)
        # Events of earlier tests are dropped with this.
        await self.next_event("OpenProject", lambda event: event.data.project.id == copy.id)
        self.project = await self.client.get_project(copy.id)
        await self.screen.page.get_by_role("heading", name=name, exact=True).wait_for()
        await self.screen.item(self.project.action_points[0].id)
        await self.screen.close_panels()
        await self.mode("3D")
        self.taps = 0

    async def _open_id(self) -> str:
        """Return the id of the open project, as the server sends it to a new client."""
        async with Client(self.cell.url, "observer", reconnect=False) as observer:
            event = await observer.next_event("OpenProject", "OpenScene", "ShowMainScreen")
            return str(event.data.project.id) if event.event == "OpenProject" else ""

    async def tool(self, name: str) -> None:
        """Open a tool of the rail unless it is open; counts as one tap."""
        self.taps += 1
        button = self.screen.page.get_by_role("navigation").get_by_role("button", name=name, exact=True)
        if await button.get_attribute("aria-pressed") != "true":
            await button.click()

    async def tap_button(self, name: str, within: Locator | None = None) -> None:
        self.taps += 1
        await (within or self.screen.page).get_by_role("button", name=name, exact=True).first.click()

    async def mode(self, name: str) -> None:
        await self.screen.page.get_by_role("radio", name=re.compile(rf"^{name}( \d+)?$")).click()

    async def select(self, name: str) -> None:
        """Select an action in the list of actions."""
        await self.tool(texts.PROGRAM)
        await self.mode("Actions")
        await self.panel.locator(".step-name").get_by_text(name, exact=True).click()
        await self.panel.get_by_role("heading", name=name, exact=True).wait_for()

    async def next_event(self, name: str, wanted: Any = lambda event: True) -> Event:
        """Return the next event of this name that the second client receives and for which `wanted` is true."""
        while True:
            event = await self.client.next_event(name)
            if wanted(event):
                return event

    async def add(self, name: str, kind: str, point: str, *results: str, **values: ActionParameter) -> str:
        """Add an action through the protocol. `kind` is `<object>/<action>`, `results` are names of its results."""
        owner, _, method = kind.partition("/")
        flows, parameters = [Flow(FlowTypes.DEFAULT, list(results))], list(values.values())
        args = rpc.AddActionArgs(self.point(point), name, f"{self.object(owner)}/{method}", parameters, flows)
        await self.client.call("AddAction", args)
        added = await self.next_event("ActionChanged", lambda event: event.data.name == name)
        added_id: str = added.data.id
        return added_id

    async def saved(self) -> Project:
        """Save the project and return it."""
        await until(self._saved, "all locks are released and the project is saved")
        stored: Project = await self.client.call("GetProject", rpc.IdArgs(self.project.id))
        return stored

    async def _saved(self) -> bool:
        try:
            await self.client.call("SaveProject")
        except LockedByOther:  # the screen still holds its lock
            return False
        except RequestFailed as refused:
            return "no changes to save" in str(refused)
        return True

    async def parameters(self, action_id: str) -> dict[str, ActionParameter]:
        """Return the stored parameters of an action."""
        stored = await self.saved()
        actions = (action for point in stored.action_points for action in point.actions)
        return {each.name: each for each in next(one for one in actions if one.id == action_id).parameters}


@asynccontextmanager
async def project_on_screen(cell: Cell, browser: Browser, *extra: tuple[str, str]) -> AsyncIterator[Work]:
    """The project open on a screen. `extra` are names and types of objects to add to the scene."""
    client = await cell.client("colleague")
    scene, project = await cell.open(client)
    await client.call("CloseProject")
    if extra:
        await client.call("OpenScene", rpc.IdArgs(scene.id))
        for name, kind in extra:
            await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs(name, kind))
        await client.call("SaveScene")
        scene = await client.call("GetScene", rpc.IdArgs(scene.id))
        await client.call("CloseScene")
    await client.call("OpenProject", rpc.IdArgs(project.id))
    async with screen_of(browser, cell.url, touch=True) as screen:
        await screen.join("Eva")
        await screen.item("START")
        yield Work(cell, client, scene, project, project, screen)

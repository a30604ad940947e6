"""Hands for tests of the program: the project open, one person at the screen, a colleague at the protocol."""

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from playwright.async_api import Browser, Locator

from arcor2_hw.client import Client
from arcor2_hw.client.errors import LockedByOther, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.events import Event
from arcor2_hw.data.project import Action, ActionParameter, Flow, FlowTypes, Project
from arcor2_hw.data.scene import Scene
from tests.e2e.harness import Cell, until
from tests.editor.screen import SEEN_WITHIN, Screen, screen_of


@dataclass
class Work:
    """`taps` counts what `tap_button` and `tap_in_graph` did."""

    cell: Cell
    client: Client
    scene: Scene
    project: Project
    screen: Screen
    taps: int = 0

    def object(self, name: str) -> str:
        return next(each.id for each in self.scene.objects if each.name == name)

    def point(self, name: str) -> str:
        return next(each.id for each in self.project.action_points if each.name == name)

    def action(self, name: str) -> Action:
        return next(action for point in self.project.action_points for action in point.actions if action.name == name)

    @property
    def panel(self) -> Locator:
        return self.screen.page.get_by_role("complementary")

    async def tool(self, name: str) -> None:
        """Open a tool of the rail, unless it is open; one tap."""
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
        """Choose an action, from the list of actions."""
        await self.tool("Program")
        await self.mode("Actions")
        await self.panel.locator(".step-name").get_by_text(name, exact=True).click()
        await self.panel.get_by_role("heading", name=name, exact=True).wait_for()

    async def told(self, name: str, wanted: Any = lambda event: True) -> Event:
        """The next event of that name for which `wanted` holds, as the colleague is told it."""
        while True:
            event = await self.client.next_event(name, timeout=SEEN_WITHIN)
            if wanted(event):
                return event

    async def add(self, name: str, kind: str, point: str, *results: str, **values: ActionParameter) -> str:
        """Add an action by the protocol; `kind` is `<object>/<action>`, `results` what its results are called."""
        owner, _, method = kind.partition("/")
        flows, parameters = [Flow(FlowTypes.DEFAULT, list(results))], list(values.values())
        args = rpc.AddActionArgs(self.point(point), name, f"{self.object(owner)}/{method}", parameters, flows)
        await self.client.call("AddAction", args)
        added = await self.told("ActionChanged", lambda event: event.data.name == name)
        added_id: str = added.data.id
        return added_id

    async def saved(self) -> Project:
        """The project as the server has it."""
        await until(self._saved, "nobody holds anything, so that the project can be saved")
        stored: Project = await self.client.call("GetProject", rpc.IdArgs(self.project.id))
        return stored

    async def _saved(self) -> bool:
        try:
            await self.client.call("SaveProject")
        except LockedByOther:  # the screen has not given its lock back yet
            return False
        except RequestFailed as refused:
            return "no changes to save" in str(refused)
        return True

    async def parameters(self, action_id: str) -> dict[str, ActionParameter]:
        """What the server knows that an action is told."""
        stored = await self.saved()
        actions = (action for point in stored.action_points for action in point.actions)
        return {each.name: each for each in next(one for one in actions if one.id == action_id).parameters}


@asynccontextmanager
async def at_work(cell: Cell, browser: Browser, *extra: tuple[str, str]) -> AsyncIterator[Work]:
    """The project open on a screen; `extra` are names and types of objects that the scene gets besides."""
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
        yield Work(cell, client, scene, project, screen)

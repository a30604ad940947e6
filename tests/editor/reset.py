"""Bring the workplace that all editor tests of a worker share back to its initial state."""

import contextlib
from functools import partial
from typing import Final

import httpx
from playwright.async_api import Browser

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.cell_state import CellAuthority, CellMode
from arcor2_hw.data.editor import ViewScope
from tests.e2e.harness import Cell, until
from tests.editor.screen import USERS, Screen, close_abandoned

START: Final = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
"""Joints of the robot at the start of a test, rad."""


async def reset(cell: Cell, browser: Browser) -> None:
    """Close and delete all documents and packages, clear the users' settings, and clear all faults.

    The record of runs cannot be deleted: after a run, and after a test that stopped the server, the server is started
    again on an empty data directory. A test that exceeded its time limit leaves screens open. They are closed.
    """
    await close_abandoned(browser)
    await cell.close_clients()
    if cell.children["server"].ended or await _has_runs(cell):
        await cell.renew_server()
    else:
        await _empty(cell)
    USERS.clear()
    await cell.command_fake("tester", "renew")
    await cell.command_fake("reader", "renew")  # this clears its code, too
    await cell.command_fake("robot", "heal")
    if (await cell.command_fake("robot", "truth"))["safety"] != "NORMAL":
        await cell.renew_robot()
    await cell.command_fake("robot", "place", q=START)


async def place_robot(cell: Cell, screen: Screen, robot: str) -> None:
    """Put the simulated robot at its start position, and wait until the screen shows it there."""
    await cell.command_fake("robot", "place", q=START)
    joints = (await cell.command_fake("robot", "truth"))["q"]
    shown = """([robot, wanted]) => Object.values(window.__engine?.item(robot)?.joints ?? {})
        .filter((value, index) => Math.abs(value - wanted[index]) < 1e-3).length === wanted.length"""
    await screen.until(shown, [robot, joints])


async def _has_runs(cell: Cell) -> bool:
    async with Client(cell.url, "reset", reconnect=False) as client:
        return bool((await client.list_runs(limit=1)).runs)


async def _empty(cell: Cell) -> None:
    async with Client(cell.url, "reset", reconnect=False) as client:
        await until(partial(_try_to_empty, client), "all documents are closed, and deleted with all packages", 30)
        uploaded = {each.type for each in await client.get_object_types() if not each.built_in}
        if uploaded:
            await client.delete_object_types(uploaded)
        await _clear_views(client, ViewScope.SHARED)
        await _reset_mode_and_authority(client)
    for user in sorted(USERS):
        await until(partial(_clear_user, cell, user), f"{user} has left, and the user's settings are cleared", 30)
    async with httpx.AsyncClient(timeout=60, base_url=cell.url.replace("ws", "http", 1)) as rest:
        (await rest.put("/api/calibration/markers", json={})).raise_for_status()


async def _try_to_empty(client: Client) -> bool:
    """Stop, close and delete everything that can be deleted now, and return whether nothing is left."""
    for end in (client.stop_package, client.stop_scene, partial(client.close_project, force=True)):
        with contextlib.suppress(RequestFailed):
            await end()
    closed = False  # a new scene that was never saved is open, but not listed
    try:
        await client.close_scene(force=True)
    except RequestFailed as refusal:
        closed = str(refusal).startswith("No scene is open")
    for holder in await client.list_locks():
        if holder.left:
            with contextlib.suppress(RequestFailed):
                await client.take_over_locks(user=holder.user)
    packages, projects, scenes = await client.list_packages(), await client.list_projects(), await client.list_scenes()
    with contextlib.suppress(RequestFailed):  # still open, or in use by an open document
        for package in packages:
            await client.delete_package(package.id)
        for project in projects:
            await client.delete_project(project.id)
        for scene in scenes:
            await client.delete_scene(scene.id)
    return closed and not (packages or projects or scenes)


async def _reset_mode_and_authority(client: Client) -> None:
    """Set mode and authority of the cell to their defaults."""
    status = await client.call("GetCell")
    if status.mode is not CellMode.PRODUCE:
        await client.call("SetCellMode", rpc.SetCellModeArgs(CellMode.PRODUCE))
    if status.authority is not CellAuthority.HUB:
        await client.call("SetCellAuthority", rpc.SetCellAuthorityArgs(CellAuthority.HUB))


async def _clear_user(cell: Cell, user: str) -> bool:
    """Clear the settings of a user and return True; False while the user is connected."""
    try:
        async with Client(cell.url, user, reconnect=False) as client:
            await _clear_views(client, ViewScope.USER)
    except RequestFailed as refusal:
        if "is already in use" not in str(refusal):
            raise
        return False
    return True


async def _clear_views(client: Client, scope: ViewScope) -> None:
    """Clear the values that belong to no document."""
    state = await client.call("GetViewState", rpc.GetViewStateArgs(scope))
    if state.values:
        await client.call("SetViewState", rpc.SetViewStateArgs(scope, dict.fromkeys(state.values)))

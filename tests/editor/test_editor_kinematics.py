"""The robot's panel says whether poses are computed with what the controller told of its very arm."""

import re
from pathlib import Path

import msgspec
import pytest
from playwright.async_api import Browser

from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from tests.e2e.harness import Cell, scene_state
from tests.editor.screen import screen_of

pytestmark = [pytest.mark.asyncio(loop_scope="module"), pytest.mark.timeout(180)]


async def test_which_kinematics_are_in_force_is_said_beside_the_robot(
    browser: Browser, built_editor: Path, tmp_path: Path
) -> None:
    cell = Cell(tmp_path)
    try:
        await cell.start_robot()
        await cell.start_server()
        client = await cell.client("maker")
        await client.call("NewScene", rpc.NewSceneArgs("cell"))
        host = Parameter("host", "string", msgspec.json.encode(cell.robot_host).decode())
        await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("arm", "UR5e", Pose(), [host]))
        async with screen_of(browser, cell.url) as screen:
            await screen.join("Eva")
            await screen.page.get_by_role("button", name=re.compile("^Active robot")).click()
            await screen.sees("Computed as arms of this type are, off by some millimetres")
            await client.call("StartScene")
            await scene_state(client, SceneStateEnum.STARTED)
            await screen.sees("Computed with this arm's own calibration, read")
            await screen.sees("arm: kinematics are from now on those of the calibration in its controller.")
            await screen.settle()
            await screen.picture("kinematics")
            await client.call("StopScene")
            await scene_state(client, SceneStateEnum.STOPPED)
            await screen.sees("Computed with this arm's own calibration, read")
    finally:
        await cell.stop()

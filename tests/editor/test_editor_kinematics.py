"""The robot panel shows which kinematics are in force: nominal, or the calibration of this robot (by serial number)."""

import re

import msgspec
import pytest
from playwright.async_api import Browser

from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.parameter import Parameter
from tests.e2e.harness import Cell, scene_state
from tests.editor.screen import screen_of

pytestmark = pytest.mark.asyncio(loop_scope="session")


async def test_the_robot_panel_names_the_kinematics_in_force(browser: Browser, cell: Cell) -> None:
    client = await cell.client("maker")
    await client.call("NewScene", rpc.NewSceneArgs("cell"))
    host = Parameter("host", "string", msgspec.json.encode(cell.robot_host).decode())
    await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("arm", "UR5e", Pose(), [host]))
    async with screen_of(browser, cell.url) as screen:
        await screen.join("Eva")
        await screen.page.get_by_role("button", name=re.compile("^Active robot")).click()
        await screen.sees("Uses the nominal kinematics. Go online")
        await client.call("StartScene")
        await scene_state(client, SceneStateEnum.STARTED)
        await screen.sees("Uses this robot's calibration, read")
        await screen.sees("arm: The calibration in the controller is now used.")
        await screen.settle()
        await screen.picture("kinematics")
        await client.call("StopScene")
        await scene_state(client, SceneStateEnum.STOPPED)
        await screen.sees("Uses this robot's calibration, read")

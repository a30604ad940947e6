"""Count the taps and the time of the task in docs/benchmarks.md, for `make bench-editor`.

The task is done in the 3D view, and in AR with the picture of a fake camera. Each gesture is one tap of one finger.
The script taps as soon as the editor has answered, so its times compare the views; a person needs longer.
"""

import json
import time
from functools import partial
from pathlib import Path
from typing import Final

from playwright.async_api import Browser, Locator, expect

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.project import Project
from benchmarks.metrics import Metric, Report
from tests.e2e.harness import Cell, running_cell, scene_state, until
from tests.editor import texts
from tests.editor.camera_video import CAMERA_ARGUMENTS, marker_table, write_video
from tests.editor.reset import START
from tests.editor.screen import running_browser, screen_of
from tests.editor.test_editor_first_hour import CountedUser, is_at, tool_height

DIRECTIONS: Final = "+−++++"
"""Directions along Z of the axis steps to the points: above the feeder, board, above the tester, tester, both trays."""
STEP: Final = 0.01
"""Length of an axis step, m."""
STEPS: Final = 21
PROGRAM: Final = [
    ("START", "move", None),
    ("move", "move_2", None),
    ("move_2", "set_digital_output", None),
    ("set_digital_output", "move_3", None),
    ("move_3", "move_4", None),
    ("move_4", "test", None),
    ("test", "move_5", "true"),
    ("move_5", "set_digital_output_2", None),
    ("set_digital_output_2", "END", None),
    ("test", "move_6", "false"),
    ("move_6", "set_digital_output_3", None),
    ("set_digital_output_3", "wait", None),
    ("wait", "END", None),
]
"""Connections of the finished program: start, end, condition."""


_HIDDEN: Final = """(control) => {
    const { left, right, top, bottom } = control.getBoundingClientRect();
    return !control.contains(document.elementFromPoint((left + right) / 2, (top + bottom) / 2));
}"""


class Worker(CountedUser):
    """A user who scrolls a panel before tapping a control outside its visible part; scrolls are counted separately."""

    scrolls = 0

    async def tap(self, control: Locator) -> None:
        """Tap a control."""
        self.scrolls += await control.evaluate(_HIDDEN)
        await super().tap(control)


async def task(report: Report, directory: Path) -> None:
    """Do the task once in each view, with a separate server, fakes and browser."""
    video = directory / "task.mjpeg"
    write_video(video)
    camera = (*CAMERA_ARGUMENTS, f"--use-file-for-fake-video-capture={video}")
    async with running_cell(directory / "task") as cell, running_browser(*camera) as browser:
        client = await cell.client("colleague")
        scene, _ = await cell.open(client)
        await client.call("CloseProject")
        await cell.command_fake("tester", "push_door", opening=True)
        await cell.command_fake("tester", "put_board", code="B1")  # the tester does not test an empty fixture
        await cell.command_fake("tester", "push_door", opening=False)
        robot = next(each.id for each in scene.objects if each.name == "robot")
        for view, more in (("seat", ""), ("ar", ", 2 more taps start AR")):
            await client.call("NewProject", rpc.NewProjectArgs(scene.id, f"Task in {view}"))
            opened = await client.next_event("OpenProject")
            await client.call("StartScene")
            await scene_state(client, SceneStateEnum.STARTED, 60)
            await _place_robot(client, cell, robot)
            user, seconds = await _do(browser, cell, client, opened.data.project.id, view)
            report.add(Metric(f"task_{view}_taps", user.taps, STEPS, f"{STEPS} steps{more}"))
            report.add(Metric(f"task_{view}_scrolls", user.scrolls, STEPS, "before taps on what a panel hides"))
            report.add(Metric(f"task_{view}_s", seconds, 1, "one run, by a script"))
            await client.next_event("OpenProject", timeout=60)  # after the program; the scene goes online again
            await scene_state(client, SceneStateEnum.STARTED, 60)
            await client.call("StopScene")
            await scene_state(client, SceneStateEnum.STOPPED, 60)
            await client.call("CloseProject", rpc.CloseProjectArgs(force=True))


async def _place_robot(client: Client, cell: Cell, robot: str) -> None:
    """Place the robot, and move it there, so that its controller adopts the tool now and not during the task."""
    await cell.command_fake("robot", "place", q=START)
    here = await client.call("GetEndEffectorPose", rpc.GetEndEffectorPoseArgs(robot, "tcp"))
    goal = rpc.MoveToPoseArgs(robot, "tcp", 0.5, here.position, here.orientation, safe=False)
    await client.call("MoveToPose", goal)
    while (await client.next_event("RobotMoveToPose")).data.move_event_type.value == "start":
        pass


async def _do(browser: Browser, cell: Cell, client: Client, project: str, view: str) -> tuple[Worker, float]:
    """Do the task and stop its program; return the user and the time from the first tap to the end of the step, s."""
    async with screen_of(browser, cell.url, "ipad", touch=True, drawn=True) as screen:
        user, page = Worker(screen), screen.page
        table = json.dumps(marker_table())
        await page.route("**/api/calibration/markers", lambda route: route.fulfill(body=table))
        await screen.join(f"Worker in {view}")
        await page.get_by_role("button", name=texts.STOP_MOTION).wait_for()
        await screen.until("() => window.__engine?.ids().some((id) => __engine.item(id)?.endEffectors?.length)")
        began = time.perf_counter()
        if view == "ar":
            await user.button("AR")
            await user.button("Start AR")
            await screen.until("() => window.__ar?.phase === 'registered'")
        await user.tool(texts.ROBOT)
        for number, direction in enumerate(DIRECTIONS, 1):
            height = await tool_height(cell)
            await user.button(f"Move along {direction}Z")
            await until(
                partial(is_at, cell, height + (STEP if direction == "+" else -STEP)), "the arm is a step farther"
            )
            await user.button("Save the robot pose as a point")
            name = f"point_{number}" if number > 1 else "point"
            await page.get_by_text(f"Saved {name}.", exact=True).wait_for()
        await screen.picture(f"task {view} points")
        await user.tool(texts.PROGRAM)
        for action, device, added in (
            ("move", "robot", "move"),
            ("move", "robot", "move_2"),
            ("set digital output", "robot", "set_digital_output"),
            ("move", "robot", "move_3"),
            ("move", "robot", "move_4"),
            ("test", "tester", "test"),
            ("move", "robot", "move_5"),
            ("set digital output", "robot", "set_digital_output_2"),
        ):
            await user.offer(action, device, added)
        user.taps += 2
        await user.panel.get_by_label("Follows").select_option(label="test: if no")
        await user.offer("move", "robot", "move_6")
        await user.offer("set digital output", "robot", "set_digital_output_3")
        await user.offer("wait", "flow", "wait")
        await screen.picture(f"task {view} program")
        await user.button(texts.SAVE)
        await user.tool(texts.RUN)
        await user.button("Run", user.panel)
        bar = page.get_by_role("group", name=texts.PROGRAM_STATE)
        await user.tap(bar.get_by_role("button", name="Pause", exact=True))
        await expect(bar.get_by_role("button", name=texts.STEP)).to_be_enabled(timeout=60_000)
        trace = user.panel.get_by_role("region", name="Trace").get_by_role("listitem")
        before = await trace.count()
        await user.tap(bar.get_by_role("button", name=texts.STEP))
        await expect(trace).not_to_have_count(before)
        await expect(bar).to_contain_text("Paused")
        took = time.perf_counter() - began
        _check(await client.get_project(project))
        await screen.settle()
        assert not (faults := await screen.faults()), faults
        await screen.picture(f"task {view}")
        await bar.get_by_role("button", name=texts.STOP, exact=True).click()
        await expect(bar).to_be_hidden()
        return user, took


def _check(project: Project) -> None:
    """Check that the task was done: the saved project has the program of the task, with moves to the six points."""
    actions = [(point.name, action) for point in project.action_points for action in point.actions]
    names = {action.id: action.name for _, action in actions}
    steps = [
        (
            names.get(each.start.partition("/")[0], each.start),
            names.get(each.end, each.end),
            getattr(each.condition, "value", None),
        )
        for each in project.logic
    ]
    assert sorted(map(str, steps)) == sorted(map(str, PROGRAM)), steps
    moves = {action.name: point for point, action in actions if action.name.startswith("move")}
    assert moves == {name.replace("point", "move"): name for name in moves.values()}, moves

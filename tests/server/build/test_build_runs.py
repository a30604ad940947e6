"""Built packages run in a real cell host: long ones, and those with a handwritten script."""

import itertools
import re
import textwrap
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.geometry import Orientation, Position
from arcor2_hw.data.project import END, START, ActionPoint, NamedOrientation, Project
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build import package
from arcor2_server.build.service import files_of
from arcor2_server.documents.document import Document
from arcor2_server.documents.functions import make_function
from tests.server.build import hub, workplace
from tests.server.build.conftest import Mypy, make_code
from tests.server.build.projects import TypesOfTests
from tests.server.cell.conftest import Recorder, Server, serving

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "reference" / "scripts.md").read_text()
HANDWRITTEN = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)[0]
COUNT = 1000


def handwritten_project() -> Project:
    """Return the workplace's project without logic and actions, as for a handwritten script."""
    points = [replace(point, actions=[]) for point in workplace.project().action_points]
    return replace(workplace.project(), has_logic=False, logic=[], action_points=points)


async def build(directory: Path, project: Project, source: str | None = None) -> dict[str, bytes]:
    """Return the files of the package that a server builds from a stored project."""
    with pytest.MonkeyPatch.context() as patch:
        async with hub.opened(directory / "hub", make_code(directory), patch) as services:
            await services.storage.put_scene(workplace.scene())
            await services.storage.put_project(project)
            if source is not None:
                await services.storage.put_project_source(project.id, source)
            return files_of(await services.build.collect(project.id))


async def upload(server: Server, files: dict[str, bytes]) -> None:
    directory = server.services.settings.packages_dir
    package.write(files, directory / "pkg_1")


def long_project() -> Project:
    """Return a chain of distinct actions, each at its own action point. The last action ends the program."""
    points, names = [], []
    for n in range(COUNT):
        key = f"ori_{n}"
        name = f"drop {n}" if n % 2 else f"place {n}"
        names.append(name)
        given = (
            (("position", "position", f'"acp_{n}"'), ("height", "double", f"0.{n + 1}"))
            if n % 2
            else (("pose", "pose", f'"{key}"'),)
        )
        one = workplace.action(name, f"obj_robot/{name.split()[0]}", *given)
        orientations = [NamedOrientation("default", Orientation(), key)]
        points.append(ActionPoint(f"p{n}", Position(n / 1000), id=f"acp_{n}", orientations=orientations, actions=[one]))
    points[-1].actions.append(workplace.action("finish", "obj_flow/finish"))
    order = [START, *names, "finish", END]
    logic = [workplace.step(start, end) for start, end in itertools.pairwise(order)]
    return replace(workplace.project(), action_points=points, logic=logic)


async def until_ended(server: Server) -> None:
    await server.client.event("ShowMainScreen")


@serving()
async def test_a_thousand_distinct_actions_run(server: Server) -> None:
    project = long_project()
    await upload(server, await build(server.services.settings.data_dir, project))
    client = server.client
    seen: list[dict[str, Any]] = []
    put = client.put

    def record(message: bytes) -> None:
        put(message)
        seen.append(client.got[-1])

    client.put = record  # type: ignore[method-assign]
    await server.ask("RunPackage", {"id": "pkg_1"})
    await until_ended(server)
    failures = [event for event in seen if event["event"] == "ProjectException"]
    assert not failures, (len(seen), seen[-3:])
    before = [event["data"] for event in seen if event["event"] == "ActionStateBefore"]
    assert [data["action_id"] for data in before] == [a.id for point in project.action_points for a in point.actions]
    # Each action had the parameters of its action point.
    assert [data.get("action_point_ids") for data in before[:-1:2]] == [[f"acp_{n}"] for n in range(0, COUNT, 2)]
    assert before[1]["parameters"][1] == "0.2"


def project_with_function() -> tuple[Project, dict[str, str]]:
    """Return the workplace's project with a function that handles a board, and the ids of its actions by name."""
    document = Document.of(workplace.scene(), workplace.project())
    ids = {action.name: action.id for action in workplace.project().all_actions()}
    names = ("above feeder", "pick", "known?", "into good box", "throw away", "back")
    changes, _, _ = make_function(
        document, TypesOfTests(workplace.FACTS), "handle_board", [ids[name] for name in names]
    )
    document.apply(changes)
    project = document.project
    assert project is not None
    return project, {action.name: action.id for action in project.all_actions()}


@serving()
async def test_a_function_is_stepped_into_and_traced(server: Server) -> None:
    project, ids = project_with_function()
    await upload(server, await build(server.services.settings.data_dir, project))
    client, older = server.client, Recorder(None)
    server.services.hub.add(older)  # type: ignore[arg-type]
    server.services.hub.subscribe(client, {"ProgramPosition"}, True)  # type: ignore[arg-type]
    await server.ask("RunPackage", {"id": "pkg_1", "start_paused": True, "breakpoints": [ids["handle_board"]]})
    await client.state("paused", "PackageState")
    await server.ask("ResumePackage")
    await client.event("ActionStateBefore", lambda data: data["action_id"] == ids["handle_board"])
    await client.state("paused", "PackageState")
    await server.ask("StepAction", {"mode": "into"})
    frames = [
        {"action_id": ids["handle_board"]},
        {
            "action_id": ids["above feeder"],
            "function_id": project.functions[0].id,
            "call_action_id": ids["handle_board"],
        },
    ]
    position = {"id": "main", "frames": frames}
    await client.event("ProgramPosition", lambda data: data["branches"] == [position])
    await client.state("paused", "PackageState")
    assert msgspec.to_builtins(await server.ask("GetProgramPosition"))["branches"] == [position]
    [_, running] = server.services.execution.greeting()[1:]
    assert running.data["action_id"] == ids["handle_board"], "a new legacy client gets only the call"
    await server.ask("StepAction", {"mode": "out"})
    while True:  # the loop has one board for each repetition
        state = await client.event("PackageState", lambda data: data["state"] in ("paused", "stopped"))
        if state["state"] == "stopped":
            break
        await server.ask("ResumePackage")
    assert server.services.execution.program.error is None
    assert (await server.ask("GetProgramPosition")).branches == []

    inside = {action.id for action in project.functions[0].actions}
    announced = [e["data"]["action_id"] for e in older.got if e["event"] == "ActionStateBefore"]
    assert ids["handle_board"] in announced
    assert not inside.intersection(announced), "legacy clients do not get the actions of functions"
    trace = await server.services.runs.run_trace(1)
    call = next(span for span in trace.spans if span.action_id == ids["handle_board"])
    assert (call.device, call.call) == ("", UNSET)
    assert [span.name for span in trace.spans if span.call == call.number][:2] == ["above feeder", "pick"]
    assert "" not in {device.id for device in trace.devices}
    entries = (await server.ask("GetExecutionTrace", {"limit": 100})).entries
    assert {entry.call for entry in entries if entry.action_id in inside} >= {call.number}


@serving()
async def test_a_handwritten_script_runs_and_can_be_debugged(server: Server) -> None:
    files = await build(server.services.settings.data_dir, handwritten_project(), HANDWRITTEN)
    assert files["script.py"].decode() == HANDWRITTEN
    await upload(server, files)
    client = server.client
    await server.ask("RunPackage", {"id": "pkg_1", "start_paused": True, "breakpoints": ["acp_good"]})
    first = await client.event("ActionStateBefore")
    assert first == {"parameters": ["2.5", "2"]}  # a project without actions has no action ids
    await client.state("paused", "PackageState")
    await server.ask("StepAction")
    second = await client.event("ActionStateBefore")
    assert second["action_point_ids"] == ["acp_feeder"]
    await client.state("paused", "PackageState")
    await server.ask("ResumePackage")
    # The pose that the script has raised still belongs to its action point, which has a breakpoint.
    placed = await client.event("ActionStateBefore", lambda data: data.get("action_point_ids") == ["acp_good"])
    await client.state("paused", "PackageState")
    assert '"z":0.18' in placed["parameters"][0]
    await server.ask("ResumePackage")
    dropped = await client.event("ActionStateBefore", lambda data: data["parameters"][1:] == ["0.2"])
    assert '"x"' in dropped["parameters"][0]
    await until_ended(server)
    assert server.services.execution.program.error is None


@serving()
async def test_a_handwritten_script_can_fail_and_can_be_stopped(server: Server) -> None:
    body = HANDWRITTEN.replace(
        "    good = 0\n", "    robot.pick(aps.feeder.poses.default, grip=Grip.SOFT)\n    good = 0\n"
    )
    await upload(server, await build(server.services.settings.data_dir, handwritten_project(), body))
    await server.ask("RunPackage", {"id": "pkg_1"})
    found = await server.client.event("ProjectException")
    assert found["type"] == "AssertionError"
    assert "robot" in found["message"]
    await until_ended(server)

    (server.services.settings.packages_dir / "pkg_1" / "script.py").write_text(
        HANDWRITTEN.replace("    good = 0\n", "    while True:\n        robot.drop(aps.good.position, 0.1)\n").split(
            "    for _ in range"
        )[0]
        + HANDWRITTEN[HANDWRITTEN.index("\n\nif __name__") :]
    )
    await server.ask("RunPackage", {"id": "pkg_1"})
    await server.client.event("ActionStateBefore")
    await server.ask("StopPackage")
    await until_ended(server)
    assert server.services.execution.program.error is None


async def test_a_handwritten_script_is_checked_before_a_build(tmp_path: Path) -> None:
    with pytest.raises(InvalidProject, match=r"script\.py, line 3"):
        await build(tmp_path, handwritten_project(), "a = 1\n\nb = (\n")


async def test_a_type_checker_finds_the_errors_of_a_handwritten_script(tmp_path: Path, mypy: Mypy) -> None:
    directory = tmp_path / "package"
    package.write(await build(tmp_path, handwritten_project(), HANDWRITTEN), directory)
    wrong = {
        "aps.feeder.poses.defautl": '"FeederPoses" has no attribute "defautl"',
        "aps.feder": '"ActionPoints" has no attribute "feder"',
        "robot.place(aps.good.position)": 'incompatible type "Position"; expected "Pose"',
        "robot.pick(aps.feeder.poses.default, grip='firm')": 'incompatible type "str"; expected "Grip"',
        "robot.fly()": '"Arm" has no attribute "fly"',
        "res.pose(1)": 'incompatible type "int"; expected "str"',
    }
    head = """
        from action_points import ActionPoints
        from arcor2_hw.runtime.resources import Resources
        from object_types.arm import Arm


        def use(res: Resources, aps: ActionPoints, robot: Arm) -> None:
    """
    lines = "".join(f"    {line}\n" for line in wrong)
    (directory / "wrong.py").write_text(textwrap.dedent(head).strip() + "\n" + lines)
    found = [line for line in mypy(directory) if ": error: " in line]
    assert len(found) == len(wrong), found
    for line, text in zip(found, wrong.values(), strict=True):
        assert line.startswith("wrong.py:")
        assert text in line

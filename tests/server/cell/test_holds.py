"""A program that is held at a failed action, as clients see it."""

import json
from pathlib import Path
from typing import Any

import pytest
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset, now
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.held import HeldData, HoldChoice
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import (
    END,
    PARALLEL,
    START,
    Action,
    ActionPoint,
    Flow,
    LogicItem,
    Project,
    ProjectFunction,
)
from arcor2_hw.data.rpc import DecideHeldArgs
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.build import points
from arcor2_server.build.frame import TypeFacts
from arcor2_server.build.script import from_logic
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.holds import ProgramHold
from tests.e2e.harness import until
from tests.runtime.conftest import Package, scene_object

from .conftest import Recorder, Server, serving
from .test_execution_history import newest_run, subscribe

BOX = """
class Box(Generic):
    _ABSTRACT = False
    full = True
    @action
    def put(self, *, an: str | None = None) -> None:
        if Box.full:
            raise Refused("{name} is full", name=self.name)
    @action
    def weigh(self, *, an: str | None = None) -> float:
        raise DeviceTimeout("no answer")
    def acknowledge(self, code: str) -> None:
        if code != "full":
            raise NotFound("there is no alarm {code}", code=code)
        Box.full = False
"""
ACTIONS = [
    Action("put", "obj_box/put", "act_put"),
    Action("weigh", "obj_box/weigh", "act_weigh", flows=[Flow(outputs=["mass"])]),
]
PROJECT = Project(
    "project", "scn_1", id="pro_1", action_points=[ActionPoint("p", Position(), id="acp_1", actions=ACTIONS)]
)


def write(server: Server, body: str) -> Path:
    directory = server.services.settings.packages_dir / "pkg_1"
    lines = 'box = res.objects["obj_box"]\n' + body
    return Package(directory).write({"Box": BOX}, [scene_object("box", "Box")], PROJECT, lines)


async def until_held(server: Server, client: Recorder | None = None) -> dict[str, Any]:
    client = client or server.client
    data = await client.event("Held")
    await client.state("paused", "PackageState")
    return data


@serving()
async def test_operator_recovers_a_held_program(server: Server) -> None:
    subscribe(server, "Held", "HoldDecided", "ExecutionTrace", "RunStatistics")
    old = Recorder("old")
    server.services.hub.add(old)  # type: ignore[arg-type]
    write(server, 'box.put(an="put")')
    await server.ask("RunPackage", {"id": "pkg_1", "on_error": "hold"})
    data = await until_held(server)
    assert data | {"since": ""} == {
        "run": 1,
        "number": 1,
        "action_id": "act_put",
        "action_name": "put",
        "device": "obj_box",
        "kind": "refused",
        "text": "box is full",
        "key": "{name} is full",
        "values": {"name": "box"},
        "choices": ["retry", "skip", "end"],
        "again": "ask",
        "since": "",
    }
    assert (await server.ask("GetHeld")).held.number == 1

    # A client that does not know holds only sees that the program is paused.
    await old.state("paused", "PackageState")
    assert "Held" not in json.dumps(old.got)
    for name in ("ResumePackage", "StepAction"):
        with pytest.raises(RequestRefused, match="held at put, and needs a decision: try again, done by hand, end"):
            await server.ask(name, client=old)

    # The cause is acknowledged, then the action is repeated.
    with pytest.raises(RequestRefused, match="put may have been executed partly"):
        await server.ask("DecideHeld", {"number": 1, "choice": "retry"})
    with pytest.raises(Arcor2Error, match="there is no alarm empty"):
        await server.ask("AcknowledgeStop", {"object_id": "obj_box", "code": "empty"})
    await server.ask("AcknowledgeStop", {"object_id": "obj_box", "code": "full"}, client=old)
    await server.ask("DecideHeld", {"number": 1, "choice": "retry", "confirmed": True}, client=old)
    with pytest.raises(RequestRefused, match="old has already decided: try again"):
        await server.ask("DecideHeld", {"number": 1, "choice": "end"})
    assert await server.client.event("HoldDecided") == {"run": 1, "number": 1, "choice": "retry", "by": "old"}
    await server.client.state("stopped", "PackageState")
    assert (await server.ask("GetHeld")).held is UNSET

    run = await newest_run(server)
    assert run.end is RunEnd.FINISHED
    assert run.statistics.held > 0  # type: ignore[union-attr, operator]
    again, first = (await server.ask("GetExecutionTrace", {})).entries
    assert (first.error, first.hold.choice, first.hold.by) == ("box is full", "retry", "old")
    assert (again.attempt, again.number) == (2, 2)
    spans = (await server.services.runs.run_trace(1)).spans
    assert spans[0].hold == first.hold
    assert first.hold.duration >= 0


@serving()
async def test_entered_result_is_in_the_trace_next_to_the_error(server: Server) -> None:
    write(server, 'assert box.weigh(an="weigh") == 0.5')
    await server.ask("RunPackage", {"id": "pkg_1", "on_error": "hold"})
    await server.client.state("paused", "PackageState")
    with pytest.raises(RequestRefused, match="Choices: try again, enter the result, end the program"):
        await server.ask("DecideHeld", {"number": 1, "choice": "skip"})
    with pytest.raises(Arcor2Error, match="wrong type"):
        await server.ask("DecideHeld", {"number": 1, "choice": "result", "results": ['"heavy"']})
    await server.ask("DecideHeld", {"number": 1, "choice": "result", "results": ["0.5"]})
    after = await server.client.event("ActionStateAfter")
    assert after == {"action_id": "act_weigh", "results": ["0.5"]}
    await server.client.state("stopped", "PackageState")
    [entry] = (await server.ask("GetExecutionTrace", {})).entries
    assert (entry.results, entry.error, entry.hold.choice) == (["0.5"], "no answer", "result")
    assert (await newest_run(server)).end is RunEnd.FINISHED


@serving()
async def test_a_held_program_can_be_stopped_and_only_the_option_holds_programs(server: Server) -> None:
    subscribe(server, "Held")
    write(server, 'box.put(an="put")')
    await server.ask("RunPackage", {"id": "pkg_1", "on_error": "hold"})
    await until_held(server)
    with pytest.raises(RequestRefused, match="cannot be paused"):
        await server.ask("PausePackage")
    await server.ask("StopPackage")
    await server.client.state("stopped", "PackageState")
    with pytest.raises(RequestRefused, match="not held"):
        await server.ask("DecideHeld", {"number": 1, "choice": "end"})
    run = await newest_run(server)
    assert (run.end, run.stopped_by) == (RunEnd.STOPPED, "alice")
    [entry] = (await server.ask("GetExecutionTrace", {})).entries
    assert isinstance(entry.hold.duration, float)
    assert not isinstance(entry.hold.by, str)
    server.client.got.clear()
    await server.ask("RunPackage", {"id": "pkg_1"})
    await server.client.event("ProjectException")
    assert not any(event["event"] == "Held" for event in server.client.got)


STATION = """
_pressed = threading.Event()

class Station(Generic):
    _ABSTRACT = False
    full = True
    @action
    def fill(self, *, an: str | None = None) -> None:
        _pressed.wait(60)
        if Station.full:
            raise Refused("{name} is full", name=self.name)
    @action
    def press(self, *, an: str | None = None) -> None:
        _pressed.set()
    @action
    def report(self, *, an: str | None = None) -> None: ...
    def acknowledge(self, code: str) -> None:
        Station.full = False
"""


def parallel_package(server: Server) -> None:
    """Write a package whose program fills a box and presses in parallel, and then reports."""

    def function(name: str, device: str) -> ProjectFunction:
        logic = [LogicItem(START, f"act_{name}", id=f"lit_{name}"), LogicItem(f"act_{name}", END, id=f"lit_{name}_end")]
        return ProjectFunction(
            f"do_{name}", [Action(name, f"obj_{device}/{name}", f"act_{name}")], logic, id=f"pfu_{name}"
        )

    actions = [
        Action("both", PARALLEL, "act_both", branches=["act_filling", "act_pressing"]),
        Action("filling", "pfu_fill/call", "act_filling"),
        Action("pressing", "pfu_press/call", "act_pressing"),
        Action("report", "obj_press/report", "act_report"),
    ]
    project = Project(
        "project",
        "scn_1",
        id="pro_1",
        action_points=[ActionPoint("p", Position(), id="acp_1", actions=actions)],
        functions=[function("fill", "box"), function("press", "press")],
        logic=[
            LogicItem(START, "act_both", id="lit_1"),
            LogicItem("act_both", "act_report", id="lit_2"),
            LogicItem("act_report", END, id="lit_3"),
        ],
    )
    objects = [scene_object("box", "Station"), scene_object("press", "Station")]
    facts = TypeFacts(
        "object_types.station", "Station", {name: ObjectAction(name) for name in ("fill", "press", "report")}
    )
    script = from_logic(Scene("scene", objects=objects, id="scn_1"), project, {"Station": facts})
    directory = server.services.settings.packages_dir / "pkg_1"
    Package(directory).write({"Station": STATION}, objects, project, "", script=script)
    (directory / "action_points.py").write_text(points.source(project))


@serving()
async def test_a_failed_branch_is_retried_while_the_other_one_waits(server: Server) -> None:
    subscribe(server, "Held", "ProgramPosition")
    parallel_package(server)
    await server.ask("RunPackage", {"id": "pkg_1", "on_error": "hold"})
    data = await until_held(server)
    assert (data["action_id"], data["device"], data["choices"]) == ("act_fill", "obj_box", ["retry", "skip", "end"])

    async def ended() -> set[str]:
        entries = (await server.ask("GetExecutionTrace", {})).entries
        return {entry.name for entry in entries if not isinstance(entry.duration, Unset)}

    async def pressed() -> bool:
        return "press" in await ended()

    await until(pressed, "the action of the other branch has ended")
    assert await ended() <= {"pressing", "fill", "press"}, "parallel work and the failed branch wait"

    await server.ask("AcknowledgeStop", {"object_id": "obj_box", "code": "full"})
    await server.ask("DecideHeld", {"number": data["number"], "choice": "retry", "confirmed": True})
    await server.client.event("ActionStateAfter", lambda event: event["action_id"] == "act_report")
    await server.ask("StopPackage")
    await server.client.state("stopped", "PackageState")
    spans = {span.number: span for span in (await server.services.runs.run_trace(1)).spans}
    failed = spans[data["number"]]
    assert (failed.lane, failed.hold.choice, failed.hold.by) == ("act_filling", "retry", "alice")  # type: ignore[union-attr]
    again = next(span for span in spans.values() if span.attempt == 2)
    report = next(span for span in spans.values() if span.action_id == "act_report")
    assert (again.action_id, again.lane, again.error) == ("act_fill", "act_filling", UNSET)
    assert again.start + again.duration <= report.start


class _Stub:
    """Stub of the event hub, the list of runs and the cell host."""

    def broadcast(self, event: object) -> None: ...
    def set_hold(self, number: int, hold: object) -> None: ...
    async def decide(self, *decision: object) -> None: ...


async def test_an_action_may_fail_after_the_program_was_held_before_it() -> None:
    stub: Any = _Stub()
    hold = ProgramHold(stub, stub)
    data = HeldData(
        0, 7, "act_put", "put", "obj_box", "connection_lost", "lost", [HoldChoice.RETRY], now(), before=True
    )
    retry = DecideHeldArgs(7, HoldChoice.RETRY)
    for held in (data, replace(data, kind="device_fault", before=UNSET)):
        hold.begin(1, held)
        await hold.decide(stub, retry, "ann")
        with pytest.raises(RequestRefused, match="ann has already decided"):
            await hold.decide(stub, retry, "ben")
        hold.end()

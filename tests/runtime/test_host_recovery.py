"""The cell host with a package that is held at a failed action until a person decides."""

import json
import textwrap
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.device import Connection
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.held import HeldData, HoldChoice, HoldExit, ResultType
from arcor2_hw.data.project import END, Action, ActionPoint, Flow, LogicItem, Project, ProjectFunction
from arcor2_hw.exceptions import ConnectionLost
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.branches import Branch
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.pacing import Gate
from arcor2_hw.runtime.recovery import ActionCall, Decision, Recovery

from .conftest import HostProcess, Package, scene_object

TOOL = """
from arcor2_hw.actions.decorator import StrEnum
from arcor2_hw.data.device import Connection

class Grade(StrEnum):
    GOOD = "good"
    POOR = "poor"

@dataclass
class ToolSettings(Settings):
    directory: str

class Tool(Generic):
    _ABSTRACT = False

    def __init__(self, obj_id, name, settings: ToolSettings):
        super().__init__(obj_id, name, settings)
        self.directory = Path(settings.directory)
        self.owner = None

    @property
    def connection(self):
        return Connection.LOST if (self.directory / "unplugged").exists() else Connection.ONLINE

    def control_owner(self): return self.owner
    def take_control(self):
        if (self.directory / "stopped").exists():
            raise SafetyStop("protective stop")
        self.owner = "us"
        self.note("control")

    def note(self, text):
        with open(self.directory / "notes", "a") as file:
            file.write(text + "\\n")

    def work_or_fail(self, text):
        fault = self.directory / "fault"
        if not fault.exists():
            return self.note(text)
        kind = fault.read_text()
        self.note(f"{text}: {kind}")
        if kind == "safety":
            self.owner = None
        raise {
            "refused": Refused("the box is full"),
            "late": DeviceTimeout("no answer"),
            "lost": ConnectionLost("cable cut"),
            "safety": SafetyStop("protective stop"),
            "odd": ValueError("odd"),
        }[kind]

    @action
    def work(self, *, an: str | None = None) -> None:
        self.work_or_fail("work")

    @action(again="safe")
    def measure(self, *, an: str | None = None) -> tuple[float, Grade]:
        self.work_or_fail("measure")
        return 1.5, Grade.GOOD

    @action(again="never")
    def dispense(self, *, an: str | None = None) -> int:
        self.work_or_fail("dispense")
        return 1

    @action
    def other(self, *, an: str | None = None) -> None:
        self.note("other")

    @action
    def gated(self, *, an: str | None = None) -> None:
        self.note("gated")
        while not (self.directory / "go on").exists():
            time.sleep(0.01)
"""
OBJ = "obj_tool"


def tool_action(name: str, method: str = "work", *outputs: str) -> Action:
    return Action(name, f"{OBJ}/{method}", f"act_{name}", flows=[Flow(outputs=list(outputs))])


PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    action_points=[
        ActionPoint(
            "p",
            Position(),
            id="acp_1",
            actions=[
                tool_action("work"),
                tool_action("measure", "measure", "width", "grade"),
                tool_action("dispense", "dispense"),
                tool_action("other", "other"),
                tool_action("gated", "gated"),
                tool_action("exits"),
                Action("call", "pfu_1/call", "act_call"),
            ],
        )
    ],
    logic=[
        LogicItem("act_exits", "act_other", id="lit_late", error_kinds=["device_timeout"]),
        LogicItem("act_call", END, id="lit_call", error_kinds=["refused"]),
    ],
    functions=[ProjectFunction("inside", [tool_action("inner")], id="pfu_1")],
)


class Run:
    def __init__(self, host: HostProcess, package: Package, directory: Path) -> None:
        self.host, self.package, self.directory = host, package, directory

    def start(self, body: str, fault: str = "", project: Project = PROJECT, *, hold: bool = True) -> None:
        if fault:
            (self.directory / "fault").write_text(fault)
        lines = f'tool = res.objects["{OBJ}"]\n' + textwrap.dedent(body)
        tool = scene_object("tool", "Tool", directory=str(self.directory))
        path = self.package.write({"Tool": TOOL}, [tool], project, lines)
        self.host.send(m.RunPackage("pkg_1", str(path), streaming_period=0, hold_on_error=hold))

    def clear_fault(self) -> None:
        (self.directory / "fault").unlink()

    def notes(self) -> list[str]:
        return (self.directory / "notes").read_text().splitlines()

    def held(self) -> HeldData:
        """Wait until the program is held and no action runs."""
        found = self.host.expect(m.ProgramHeld).held
        self.host.expect_state("paused")
        return found

    def decide(self, held: HeldData, choice: HoldChoice, *results: Any, exit_id: str = "", number: int = 0) -> Any:
        encoded = [json.dumps(result) for result in results]
        self.host._calls += 1
        self.host.send(m.DecideHeld(self.host._calls, number or held.number, choice, encoded, exit_id))
        return self.host.answer(self.host._calls)

    def ended(self) -> m.ProgramChanged:
        ended = self.host.expect_state("stopped")
        assert self.host.gone() == 0
        return ended

    def data_of(self, name: str) -> list[dict[str, Any]]:
        events = [e for e in self.host.seen if isinstance(e, m.ProgramEvent) and e.event == name]
        return [msgspec.json.decode(e.encoded)["data"] for e in events]


@pytest.fixture
def run(host: HostProcess, package: Package, tmp_path: Path) -> Run:
    return Run(host, package, tmp_path)


def test_device_that_refuses_control_at_the_start_holds_the_program(run: Run) -> None:
    (run.directory / "stopped").touch()
    run.start('tool.work(an="work")')
    held = run.held()
    assert (held.kind, held.action_name, held.before) == ("safety_stop", "work", True)
    assert held.choices == [HoldChoice.RETRY, HoldChoice.END]
    assert run.decide(held, HoldChoice.RETRY) is None
    held = run.held()  # it still refuses
    assert (held.kind, held.before) == ("safety_stop", UNSET)
    (run.directory / "stopped").unlink()  # as a person acknowledges it
    assert run.decide(held, HoldChoice.RETRY) is None
    assert run.host.expect_state("stopped").finished
    assert run.notes() == ["control", "work"]


def test_device_that_refuses_control_ends_a_program_that_is_not_held(run: Run) -> None:
    (run.directory / "stopped").touch()
    run.start('tool.work(an="work")', hold=False)
    assert "protective stop" in str(run.host.expect_state("stopped").error)


def test_retry_repeats_the_action_until_it_succeeds(run: Run) -> None:
    run.start('tool.work(an="work")\ntool.other(an="other")', "refused")
    held = run.held()
    assert (held.number, held.action_id, held.action_name, held.device) == (1, "act_work", "work", OBJ)
    assert (held.kind, held.text, held.again) == ("refused", "tool (Tool): the box is full", "ask")
    assert held.choices == ["retry", "skip", "end"]
    assert run.decide(held, HoldChoice.RETRY) is None
    second = run.held()  # the action fails again
    assert second.number == 2
    assert run.notes() == ["control", "work: refused", "work: refused"]
    assert run.decide(held, HoldChoice.RETRY).code == "conflict", "an outdated number"
    run.clear_fault()
    assert run.decide(second, HoldChoice.RETRY) is None
    assert run.ended().finished
    assert run.notes()[3:] == ["work", "other"]
    started = [e for e in run.host.seen if isinstance(e, m.ProgramEvent) and e.event == "ActionStateBefore"]
    assert [(e.name, e.attempt) for e in started] == [("work", 1), ("work", 2), ("work", 3), ("other", 1)]
    assert run.data_of("ProjectException") == []


def test_a_person_supplies_the_results_of_the_right_types(run: Run) -> None:
    run.start(
        """
        width, grade = tool.measure(an="measure")
        assert (width, type(grade).__name__, grade) == (2.5, "Grade", "poor"), (width, grade)
        """,
        "odd",
    )
    held = run.held()
    assert (held.kind, held.again, held.choices) == ("error", "safe", ["retry", "result", "end"])
    assert held.returns == [ResultType("double"), ResultType("string_enum", ['"good"', '"poor"'])]
    for results in ((2.5, "awful"), ("2.5", "good"), (2.5,)):
        assert run.decide(held, HoldChoice.RESULT, *results).code == "invalid_data"
    assert run.decide(held, HoldChoice.SKIP).code == "invalid_data", "the results are used"
    assert run.decide(held, HoldChoice.RESULT, 2.5, "poor") is None
    assert run.ended().error is None
    assert run.notes() == ["control", "measure: odd"]
    assert run.data_of("ActionStateAfter") == [{"action_id": "act_measure", "results": ["2.5", '"poor"']}]


def test_skipped_action_counts_as_done(run: Run) -> None:
    run.start('tool.dispense(an="dispense")\ntool.other(an="other")', "refused")
    held = run.held()
    assert held.choices == ["skip", "end"], "it must not be repeated, and its result is not used"
    assert run.decide(held, HoldChoice.RETRY).code == "invalid_data"
    assert run.decide(held, HoldChoice.SKIP) is None
    assert run.ended().finished
    assert run.notes() == ["control", "dispense: refused", "other"]
    assert [after["action_id"] for after in run.data_of("ActionStateAfter")] == ["act_dispense", "act_other"]


def test_end_ends_the_program_as_without_a_hold(run: Run) -> None:
    run.start('tool.work(an="work")', "safety")
    held = run.held()
    assert run.data_of("ProjectException") == []
    assert run.decide(held, HoldChoice.END) is None
    assert run.ended().error.type == "SafetyStop"  # type: ignore[union-attr]
    [raised] = run.data_of("ProjectException")
    assert (raised["type"], raised["action_id"]) == ("SafetyStop", "act_work")


EXITS = """
    try:
        tool.work(an="exits")
    except DeviceTimeout as error:
        problem = res.caught(error)
        tool.note(f"exit {problem.device} {problem.kind} {problem.text}")
        tool.other(an="other")
    """


def test_a_matching_error_exit_is_taken_without_a_hold(run: Run) -> None:
    run.start(EXITS, "late")
    assert run.ended().finished
    assert run.notes() == ["control", "work: late", "exit tool device_timeout no answer", "other"]


@pytest.mark.parametrize("fault", ["refused", "safety"])
def test_an_error_exit_is_taken_by_decision(run: Run, fault: str) -> None:
    run.start(EXITS, fault)
    held = run.held()
    assert held.choices == ["retry", "skip", "error_exit", "end"]
    assert held.exits == [HoldExit("lit_late", ["device_timeout"], "other")]
    assert run.decide(held, HoldChoice.ERROR_EXIT, exit_id="lit_other").code == "invalid_data"
    assert run.decide(held, HoldChoice.ERROR_EXIT, exit_id="lit_late") is None
    assert run.ended().finished
    assert run.notes()[2].startswith(f"exit tool {held.kind} ")
    assert "other" in run.notes()


def test_error_exits_of_function_calls_are_taken(run: Run) -> None:
    body = """
        @res.function
        def inside(*, an: str) -> None:
            tool.work(an="inner")

        try:
            inside(an="call")
        except Refused as error:
            tool.note(res.caught(error).kind)
        """
    run.start(body, "late")
    held = run.held()
    assert (held.action_id, held.exits) == ("act_inner", [HoldExit("lit_call", ["refused"])])
    (run.directory / "fault").write_text("refused")
    assert run.decide(held, HoldChoice.RETRY) is None
    assert run.ended().finished, "the exit of the call names the second error"
    assert run.notes() == ["control", "work: late", "work: refused", "refused"]


def test_the_program_is_held_after_the_last_automatic_retry(run: Run) -> None:
    run.start('res.retry(tool, 2).measure(an="measure")', "refused")
    held = run.held()
    assert held.number == 3
    assert run.decide(held, HoldChoice.RETRY) is None
    held = run.held()
    assert run.decide(held, HoldChoice.END) is None
    run.ended()
    assert run.notes() == ["control", *["measure: refused"] * 4]


def test_safety_stop_holds_before_the_automatic_retries_and_control_is_taken_again(run: Run) -> None:
    run.start('res.retry(tool, 2).measure(an="measure")', "safety")
    held = run.held()
    assert (held.number, held.kind) == (1, "safety_stop")
    run.clear_fault()
    assert run.decide(held, HoldChoice.RETRY) is None
    assert run.ended().finished
    assert run.notes() == ["control", "measure: safety", "control", "measure"]


def test_stop_ends_a_held_program(run: Run) -> None:
    run.start('tool.work(an="work")\ntool.other(an="other")', "refused")
    run.held()
    run.host.send(m.StopProgram())
    assert run.ended().error is None
    assert run.notes() == ["control", "work: refused"]


def test_lost_device_holds_the_program_before_the_next_action(run: Run) -> None:
    run.start('tool.gated(an="gated")\ntool.other(an="other")')
    run.host.expect_event("ActionStateBefore")
    (run.directory / "unplugged").touch()
    run.host.expect(m.DeviceChanged, lambda change: change.connection.value == "lost")
    (run.directory / "go on").touch()
    held = run.held()
    assert (held.action_id, held.device, held.before) == ("act_other", OBJ, True)
    assert (held.kind, held.choices) == ("connection_lost", ["retry", "end"])
    refused = run.decide(held, HoldChoice.RETRY)
    assert (refused.code, refused.message.text) == ("not_connected", "tool is not connected: unknown reason")
    assert run.notes() == ["control", "gated"]
    (run.directory / "unplugged").unlink()
    assert run.decide(held, HoldChoice.RETRY) is None
    assert run.ended().finished
    assert run.notes() == ["control", "gated", "other"]


def test_pause_remains_in_force_after_the_decision(run: Run) -> None:
    run.start('tool.work(an="work")\ntool.other(an="other")', "refused")
    held = run.held()
    run.host.send(m.Pause())
    run.clear_fault()
    assert run.decide(held, HoldChoice.RETRY) is None  # a decision starts the action, then the program pauses
    run.host.expect_state("paused")
    assert run.notes() == ["control", "work: refused", "work"]
    run.host.send(m.Resume())
    assert run.ended().finished


def test_without_logic_or_without_the_option_the_program_ends(run: Run) -> None:
    run.start('tool.work(an="work")', "refused", replace(PROJECT, has_logic=False))
    assert run.ended().error.type == "Refused"  # type: ignore[union-attr]
    assert not any(isinstance(message, m.ProgramHeld) for message in run.host.seen)


def test_another_branch_waits_at_its_next_action() -> None:
    reports: list[str] = []
    gate = Gate(reports.append)
    started, passed = threading.Event(), threading.Event()
    gate.before(Branch())
    holder = threading.Thread(target=gate.hold_program, args=(Branch(), started.set))
    holder.start()
    assert started.wait(20)

    def another() -> None:
        gate.before(Branch())
        passed.set()

    threading.Thread(target=another).start()
    gate.resume()  # does not end a hold
    assert not passed.wait(0.1)
    assert reports == ["paused"]
    gate.release()
    assert passed.wait(20)
    holder.join(20)
    assert reports == ["paused", "running"]


def test_the_program_is_paused_when_the_action_of_another_branch_fails_too() -> None:
    started, paused = threading.Event(), threading.Event()
    gate = Gate(lambda state: paused.set() if state == "paused" else None)
    for _ in range(2):
        gate.before(Branch())
    holders = [threading.Thread(target=gate.hold_program, args=(Branch(), started.set), daemon=True) for _ in range(2)]
    holders[0].start()
    assert started.wait(20)
    assert not paused.is_set(), "the other action still runs"
    holders[1].start()
    assert paused.wait(5)
    started.clear()
    gate.release()
    assert started.wait(20), "the second failure is shown after the first decision"
    gate.release()
    for holder in holders:
        holder.join(20)


def test_another_hold_starts_before_the_decision_takes_effect() -> None:
    seen: list[str] = []

    class OneAtATime(Gate):
        def hold_program(self, branch: Branch, begin: Callable[[], None]) -> None:
            begin()
            recovery.decide(m.DecideHeld(1, len(seen), HoldChoice.RETRY if len(seen) == 1 else HoldChoice.END, []))
            if len(seen) == 1:  # the thread of the decided branch has not continued yet
                assert recovery.before_action(Branch(), ActionCall(2, "work", ["act_work"])) is None
                recovery.hold_before_next(device, ConnectionLost("cable cut again"))
                assert hold(2).choice is HoldChoice.END

    def hold(number: int) -> Decision:
        found = recovery.before_action(Branch(), ActionCall(number, "work", ["act_work"]))
        assert found is not None
        return found

    recovery = Recovery(OneAtATime(lambda _: None), Cell(), lambda: None, lambda held, *_: seen.append(held.text))
    tool = SimpleNamespace(connection=Connection.ONLINE)
    recipe = SimpleNamespace(cls=SimpleNamespace, address="")
    device: Any = SimpleNamespace(id=OBJ, name="tool", instance=tool, require=lambda: tool, recipe=recipe)
    recovery.hold_before_next(device, ConnectionLost("cable cut"))
    assert hold(1).choice is HoldChoice.RETRY

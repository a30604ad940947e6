"""The cell host with parallel work: two devices that work at the same time; stopping, pausing and ending them."""

import textwrap
from pathlib import Path

import msgspec
import pytest

from arcor2_hw.data.geometry import Position
from arcor2_hw.data.position import Frame, ProgramStep
from arcor2_hw.data.project import Action, ActionPoint, Project, ProjectFunction
from arcor2_hw.runtime import messages as m

from .conftest import HostProcess, Package, scene_object

WORKER = """
_meeting = threading.Barrier(2)

@dataclass
class WorkerSettings(Settings):
    file: str

class Worker(Generic):
    _ABSTRACT = False

    def __init__(self, obj_id, name, settings: WorkerSettings):
        super().__init__(obj_id, name, settings)
        self.stopped = threading.Event()

    def note(self, text):
        with open(self.settings.file, "a") as f:
            f.write(f"{self.name} {text}\\n")

    def stop(self):
        self.note("stop")
        self.stopped.set()

    @action
    def meet(self, *, an: str | None = None) -> str:
        _meeting.wait(60)
        return self.name

    @action
    def meet_and_wait_for_gate(self, *, an: str | None = None) -> None:
        _meeting.wait(60)
        while not os.path.exists(self.settings.file + ".gate"):
            self.stopped.wait(0.005)

    @action
    def work(self, *, an: str | None = None) -> None:
        self.note("works")
        self.stopped.wait(600)

    @action
    def fail(self, *, an: str | None = None) -> None:
        _meeting.wait(60)
        raise Refused("the box is full")

    @action
    def meet_and_work(self, *, an: str | None = None) -> None:
        _meeting.wait(60)
        self.stopped.wait(600)

    @action
    def quick(self, *, an: str | None = None) -> None:
        self.note(an)
"""
ACTIONS = {name: Action(name, f"obj_{name[0]}/quick", f"act_{name}") for name in ("a1", "a2", "b1", "b2", "c1", "c2")}
PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    action_points=[
        ActionPoint(
            "point",
            Position(),
            id="acp_1",
            actions=[
                Action("both", "functions/parallel", "act_both", branches=["act_a", "act_b"]),
                Action("call a", "pfu_a/call", "act_a"),
                Action("call b", "pfu_b/call", "act_b"),
                ACTIONS["c1"],
                ACTIONS["c2"],
            ],
        )
    ],
    functions=[
        ProjectFunction("do_a", [ACTIONS["a1"], ACTIONS["a2"]], id="pfu_a"),
        ProjectFunction("do_b", [ACTIONS["b1"], ACTIONS["b2"]], id="pfu_b"),
    ],
)
BODY = """
a, b = res.objects["obj_a"], res.objects["obj_b"]

@res.function
def do_a(*, an: str):
    result = a.{a1}(an="a1")
    a.quick(an="a2")
    return result

@res.function
def do_b(*, an: str):
    result = b.{b1}(an="b1")
    b.quick(an="b2")
    return result

"""
BOTH = 'values = res.parallel(lambda: do_a(an="call a"), lambda: do_b(an="call b"), an="both")\n'


class Run:
    def __init__(self, host: HostProcess, package: Package, tmp_path: Path) -> None:
        self.host, self.package, self.notes_path = host, package, tmp_path / "notes"

    def start(self, a1: str, b1: str, body: str = BOTH, *, start_paused: bool = False, breakpoints: tuple = ()) -> None:
        objects = [scene_object(name, "Worker", file=str(self.notes_path)) for name in ("a", "b")]
        lines = BODY.format(a1=a1, b1=b1) + textwrap.dedent(body)
        directory = self.package.write({"Worker": WORKER}, objects, PROJECT, lines)
        self.host.send(m.RunPackage("pkg_1", str(directory), start_paused, list(breakpoints)))

    def notes(self) -> list[str]:
        return self.notes_path.read_text().splitlines() if self.notes_path.exists() else []

    def announced(self) -> list[m.ProgramEvent]:
        return [e for e in self.host.seen if isinstance(e, m.ProgramEvent) and e.event == "ActionStateBefore"]

    def open_gate(self) -> None:
        """End `meet_and_wait_for_gate`."""
        self.notes_path.with_name(f"{self.notes_path.name}.gate").touch()

    def order(self) -> list[str]:
        """Return starts and ends of actions in their order: `+name`, `-name`, and `!name` for failed ones."""
        names = {e.number: e.name for e in self.announced()}
        found = []
        for event in self.host.seen:
            match event:
                case m.ProgramEvent(event="ActionStateBefore"):
                    found.append(f"+{event.name}")
                case m.ProgramEvent(event="ActionStateAfter"):
                    found.append(f"-{names[event.number]}")
                case m.ActionFailed():
                    found.append(f"!{names[event.number]}")
        return found

    def expect_announced(self, name: str) -> m.ProgramEvent:
        seen = next((e for e in self.announced() if e.name == name), None)
        return seen or self.host.expect(m.ProgramEvent, lambda e: e.event == "ActionStateBefore" and e.name == name)

    def paused_at(self) -> dict[str, str]:
        """Wait until the program pauses; return the last announced action of each branch that has not ended."""
        self.host.expect_state("paused")
        ended = {text[1:] for text in self.order() if text[0] in "-!"}
        return {e.branch: e.name for e in self.announced() if e.name not in ended}


@pytest.fixture
def run(host: HostProcess, package: Package, tmp_path: Path) -> Run:
    return Run(host, package, tmp_path)


def test_two_devices_work_at_the_same_time(run: Run) -> None:
    # `meet` returns only when both devices execute it.
    run.start("meet", "meet", BOTH + 'assert values == ("a", "b"), values\na.quick(an="c1")')
    assert run.host.expect_state("stopped").error is None
    order = run.order()
    assert max(order.index("+a1"), order.index("+b1")) < min(order.index("-a1"), order.index("-b1"))
    assert order[0] == "+both"
    assert order[-3:] == ["-both", "+c1", "-c1"], "the program continues when both have ended"
    position = {e.name: (e.branch, e.frames) for e in run.announced()}
    assert position["both"] == ("main", [Frame("act_both")])
    assert position["call a"] == ("act_a", [Frame("act_a")])
    assert position["b2"] == ("act_b", [Frame("act_b"), Frame("act_b2", "pfu_b", "act_b")])
    assert position["c1"] == ("main", [Frame("act_c1")])
    numbers = {e.name: e.number for e in run.announced()}
    assert {e.name: e.call for e in run.announced()} == {
        "both": 0,
        "call a": numbers["both"],
        "call b": numbers["both"],
        "a1": numbers["call a"],
        "a2": numbers["call a"],
        "b1": numbers["call b"],
        "b2": numbers["call b"],
        "c1": 0,
    }
    assert msgspec.json.decode(msgspec.json.encode(position["b2"][1]), type=list[Frame]) == position["b2"][1]


def test_a_failing_branch_stops_the_others_and_the_first_error_is_raised(run: Run) -> None:
    run.start("fail", "meet_and_work")
    ended = run.host.expect_state("stopped")
    assert ended.error is not None
    assert ended.error.type == "Refused"
    assert run.notes()[0] == "b stop", "the running action is stopped"
    assert "+a2" not in run.order()
    assert "+b2" not in run.order()
    assert run.order()[-3:].count("!both") == 1
    [raised] = [
        msgspec.json.decode(e.encoded)["data"]
        for e in run.host.seen
        if isinstance(e, m.ProgramEvent) and e.event == "ProjectException"
    ]
    assert raised["action_id"] == "act_a1"
    assert "the box is full" in raised["message"]


def test_an_error_exit_of_parallel_work_is_taken_when_all_branches_have_ended(run: Run) -> None:
    run.start(
        "meet_and_work",
        "fail",
        """
        from arcor2_hw.exceptions import Refused
        try:
            res.parallel(lambda: do_a(an="call a"), lambda: do_b(an="call b"), an="both")
        except Refused as error:
            assert res.caught(error) == ("b", "refused", "the box is full"), res.caught(error)
            a.quick(an="c1")
        """,
    )
    assert run.host.expect_state("stopped").error is None
    order = run.order()
    assert order[-2:] == ["+c1", "-c1"]
    assert max(order.index("!call a"), order.index("!call b")) < order.index("!both") < order.index("+c1")


def test_stop_ends_all_branches(run: Run) -> None:
    run.start("work", "work")
    run.expect_announced("a1")
    run.expect_announced("b1")
    run.host.send(m.StopProgram())
    ended = run.host.expect_state("stopped")
    assert (ended.finished, ended.error) == (False, None)
    assert {"+a2", "+b2"}.isdisjoint(run.order())
    assert run.host.gone() == 0


def test_stop_ends_a_branch_that_computes(run: Run) -> None:
    run.start("quick", "quick", "def loop():\n    while True: pass\nres.parallel(loop, loop, an='both')")
    run.expect_announced("both")
    run.host.send(m.StopProgram())
    assert run.host.expect_state("stopped").error is None
    assert run.host.gone() == 0


def test_a_breakpoint_holds_all_branches_and_a_step_continues_one(run: Run) -> None:
    run.start("meet", "meet_and_wait_for_gate", breakpoints=("act_a2",))
    run.expect_announced("a2")
    run.open_gate()
    run.host.expect_state("paused")
    assert "-b1" in run.order()
    assert "-b2" not in run.order(), "the branch act_b pauses too"
    run.host.send(m.Step(ProgramStep.OVER, "act_b"))
    run.host.expect_state("paused")
    assert "-b2" in run.order(), "the branch act_b has made its step, and has ended"
    assert "-a2" not in run.order(), "the other branch remains paused"
    run.host.send(m.Resume())
    assert run.host.expect_state("stopped").error is None
    assert sorted(run.notes()) == ["a a2", "b b2"]


def test_steps_go_into_parallel_work_and_over_it(run: Run) -> None:
    body = BOTH + 'a.quick(an="c1")\n'
    run.start("quick", "quick", body, start_paused=True)
    assert run.paused_at() == {"main": "both"}
    run.host.send(m.Step(ProgramStep.INTO))
    run.host.expect_state("paused")
    run.expect_announced("call a")
    run.expect_announced("call b")
    for expected in ("a1", "a2"):
        run.host.send(m.Step(ProgramStep.INTO, "act_a"))
        assert run.paused_at()["act_a"] == expected
    assert "+b1" not in run.order()
    run.host.send(m.Step(ProgramStep.OUT, "act_a"))  # the branch ends
    run.host.expect_state("paused")
    assert run.order()[-1] == "-call a"
    run.host.send(m.Step())  # without a branch, the one that waits longest
    assert run.paused_at() == {"main": "c1"}, "the step over the call of the last branch ends in the program"
    run.host.send(m.Step())
    assert run.host.expect_state("stopped").error is None


def test_a_step_over_parallel_work_executes_all_of_it(run: Run) -> None:
    run.start("meet", "meet", BOTH + 'a.quick(an="c1")\n', start_paused=True)
    assert run.paused_at() == {"main": "both"}
    run.host.send(m.Step())
    assert run.paused_at() == {"main": "c1"}
    run.host.send(m.Resume())
    assert run.host.expect_state("stopped").error is None


def test_parallel_work_inside_parallel_work_is_refused(run: Run) -> None:
    inner = 'res.parallel(lambda: a.quick(an="a1"), lambda: b.quick(an="b1"), an="c1")'
    run.start("quick", "quick", f'res.parallel(lambda: {inner}, lambda: b.quick(an="b2"), an="both")')
    error = run.host.expect_state("stopped").error
    assert error is not None
    assert error.type == "InvalidData"

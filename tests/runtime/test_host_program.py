"""The cell host with a package: events, pause and breakpoints, and the ends of a program."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.position import Frame, ProgramStep
from arcor2_hw.data.project import (
    Action,
    ActionPoint,
    NamedOrientation,
    Project,
    ProjectFunction,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.runtime import messages as m
from tests.waiting import WITHIN, wait_for

from .conftest import HostProcess, Package, scene_object

ARM = """
from arcor2_hw.data.device import Connection

@dataclass
class ArmSettings(Settings):
    file: str

class Arm(Robot):
    _ABSTRACT = False

    def __init__(self, obj_id, name, pose, settings: ArmSettings):
        super().__init__(obj_id, name, pose, settings)
        self.stopped = threading.Event()
        self.owner = None

    def note(self, text):
        with open(self.settings.file, "a") as f:
            f.write(text + "\\n")

    def disconnect(self): self.note("disconnected")
    def take_control(self):
        self.owner = "us"
        self.note("control")
    def control_owner(self): return self.owner
    def get_end_effectors_ids(self): return {"tool"}
    def get_end_effector_pose(self, end_effector): return Pose(Position(0.1, 0.2, 0.3))
    def robot_joints(self, include_gripper=False): return [Joint("j0", 0.5)]
    def grippers(self): return set()
    def suctions(self): return set()

    def stop(self):
        self.note("stop")
        self.stopped.set()

    @action
    def go(self, where: Pose, speed: float = 0.5, *, an: str | None = None) -> None:
        self.note(f"go {where.position.x:g}")

    @action
    def slow(self, seconds: float, *, an: str | None = None) -> str:
        self.note("slow")
        with self._move_lock:
            self.stopped.wait(seconds)
        return "arrived"

    def wait_for_test(self) -> None:
        while not Path(self.settings.file).with_name("go on").exists():
            time.sleep(0.01)

    @action
    def gated(self, *, an: str | None = None) -> None:
        self.wait_for_test()

    @action
    def joints(self, target: ProjectRobotJoints, *, an: str | None = None) -> bool:
        return target.is_valid

    @action(composite=True)
    def twice(self, where: Pose, *, an: str | None = None) -> tuple[int, str]:
        self.go(where)
        self.go(where)
        return 2, "done"

    @action
    def fail(self, kind: str, *, an: str | None = None) -> None:
        raise {"lost": ConnectionLost("cable cut"), "odd": ValueError("odd"), "full": Refused("the box is full")}[kind]

    @action(again="safe")
    def flaky(self, kind: str, failures: int, *, an: str | None = None) -> int:
        self.tries = getattr(self, "tries", 0) + 1
        self.note(f"try {self.tries}")
        if self.tries <= failures:
            self.fail(kind)
        return self.tries

    @action
    def finish(self, *, an: str | None = None) -> None:
        raise ProgramFinished()

    @action(deadline=0.2)
    def stuck(self, *, an: str | None = None) -> None:
        time.sleep(1.0)

    @action
    def unstoppable(self, *, an: str | None = None) -> None:
        self.note("unstoppable")
        ctypes.CDLL(None).sleep(1000)
"""
NAMES = ("a1", "a2", "a3", "a4")
OBJ = "obj_arm"


def _action(name: str) -> Action:
    return Action(name, f"{OBJ}/go", f"act_{name}")


PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    action_points=[
        ActionPoint(
            "top",
            Position(1, 0, 0),
            OBJ,
            id="acp_top",
            orientations=[NamedOrientation("o", Orientation(), "ori_top")],
            robot_joints=[ProjectRobotJoints("j", OBJ, [Joint("j0", 0.5)], True, id="joi_1")],
            actions=[_action(name) for name in NAMES],
        ),
        ActionPoint(
            "child",
            Position(1, 0, 0),
            "acp_top",
            id="acp_child",
            orientations=[NamedOrientation("o", Orientation(), "ori_child")],
        ),
    ],
    parameters=[ProjectParameter("speed", "double", "0.25", id="pco_speed")],
)


class Run:
    def __init__(self, host: HostProcess, package: Package, tmp_path: Path) -> None:
        self.host, self.package, self.notes_path = host, package, tmp_path / "notes"
        self.directory = Path()

    def write(self, body: str, project: Project = PROJECT) -> Path:
        lines = f'arm = res.objects["{OBJ}"]\n' + textwrap.dedent(body)
        arm = scene_object("arm", "Arm", pose=True, file=str(self.notes_path))
        arm = SceneObject("arm", "Arm", Pose(Position(10, 0, 0)), arm.parameters, OBJ)
        return self.package.write({"Arm": ARM}, [arm], project, lines)

    def start(
        self, body: str, *, project: Project = PROJECT, start_paused: bool = False, breakpoints: tuple = ()
    ) -> None:
        self.directory = self.write(body, project)
        self.host.send(m.RunPackage("pkg_1", str(self.directory), start_paused, list(breakpoints), 0.05))

    def notes(self) -> list[str]:
        return self.notes_path.read_text().splitlines() if self.notes_path.exists() else []

    def wait_note(self, text: str) -> None:
        wait_for(lambda: text in self.notes())

    def go_on(self) -> None:
        """Let `gated` and `wait_for_test` return."""
        self.notes_path.with_name("go on").touch()

    def handled(self) -> None:
        """Wait until the host has handled the messages that were sent."""
        assert self.host.call("obj_none", "quick").code == "not_found"

    def data_of(self, name: str) -> list[dict[str, object]]:
        return [
            json.loads(e.encoded)["data"] for e in self.host.seen if isinstance(e, m.ProgramEvent) and e.event == name
        ]


@pytest.fixture
def run(host: HostProcess, package: Package, tmp_path: Path) -> Run:
    return Run(host, package, tmp_path)


def test_an_error_exit_is_taken(run: Run) -> None:
    run.start(
        """
        from arcor2_hw.exceptions import Arcor2Error, Refused
        try:
            arm.fail("full", an="a1")
        except Refused as error:
            problem = res.caught(error)
        assert problem == ("arm", "refused", "the box is full"), problem
        arm.go(res.pose("ori_top"), an="a2")
        try:
            arm.fail("lost", an="a3")
        except Arcor2Error as error:
            res.caught(error)
        arm.go(res.pose("ori_top"), an="a4")
        """
    )
    ended = run.host.expect_state("stopped")
    assert ended.finished is False
    assert run.host.gone() == 0
    assert [event["action_id"] for event in run.data_of("ActionStateBefore")] == ["act_a1", "act_a2", "act_a3"]
    [raised] = run.data_of("ProjectException")
    assert (raised["type"], raised["action_id"]) == ("ConnectionLost", "act_a3")


def test_a_safe_action_is_retried(run: Run) -> None:
    run.start(
        """
        from arcor2_hw.exceptions import InvalidData, Refused
        assert res.retry(arm, 2, pause=0.01).flaky("full", 2, an="a1") == 3
        arm.tries = 0
        try:
            res.retry(arm, 1).flaky("full", 5, an="a2")
        except Refused as error:
            res.caught(error)
        assert arm.tries == 2
        try:
            res.retry(arm, 1).fail("full", an="a3")
        except InvalidData as error:
            assert str(error) == "arm: fail cannot be retried, because repeating it may do harm.", error
        arm.tries = 0
        res.retry(arm, 5).flaky("lost", 5, an="a4")
        """
    )
    run.host.expect_state("stopped")
    assert run.host.gone() == 0
    announced = [e for e in run.host.seen if isinstance(e, m.ProgramEvent) and e.event == "ActionStateBefore"]
    attempts = [("a1", 1), ("a1", 2), ("a1", 3), ("a2", 1), ("a2", 2), ("a4", 1)]
    assert [(event.name, event.attempt) for event in announced] == attempts
    [raised] = run.data_of("ProjectException")
    assert (raised["type"], raised["action_id"]) == ("ConnectionLost", "act_a4"), (
        "a lost device ends the program at once"
    )


def test_pause_and_stop_work_between_two_attempts(run: Run) -> None:
    run.start('res.retry(arm, 5, pause=1000).flaky("full", 5, an="a1")')
    run.host.expect(m.ActionFailed)
    run.host.send(m.Pause())
    run.host.expect_state("paused")
    run.host.send(m.StopProgram())
    run.host.expect_state("stopped")
    assert run.host.gone() == 0
    assert run.notes().count("try 2") == 0


def test_a_complete_run_sends_its_events_in_order(run: Run) -> None:
    run.start(
        """
        from object_types.arm import Arm
        assert isinstance(arm, Arm)
        assert arm.name == "arm" and arm.pose.position.x == 10
        assert res.parameter("pco_speed") == 0.25
        pose = res.pose("ori_child")
        assert pose.position.x == 12, pose
        arm.go(pose, 0.75, an="a1")
        arm.joints(res.joints("joi_1"), an="a2")
        result = arm.twice(res.pose("ori_top"), an="a3")
        assert result == (2, "done")
        pose.position.x = 99
        assert res.pose("ori_child").position.x == 12
        arm.go(where=pose, speed=0.1, an="a4")
        """
    )
    ended = run.host.expect_state("stopped")
    assert (ended.error, ended.finished) == (None, True)
    assert run.host.gone() == 0
    pairs = ["ActionStateBefore", "ActionStateAfter"] * 4
    assert run.host.events() == ["running", "PackageInfo", *pairs, "stopped"]
    before, after = run.data_of("ActionStateBefore"), run.data_of("ActionStateAfter")
    assert [b["action_id"] for b in before] == [f"act_{name}" for name in NAMES]
    assert before[0]["action_point_ids"] == ["acp_child"]
    assert before[0]["parameters"][1] == "0.75"
    assert json.loads(before[0]["parameters"][0])["position"] == {"x": 12.0, "y": 0.0, "z": 0.0}
    assert before[1]["action_point_ids"] == ["acp_top"]
    assert before[3]["parameters"][1] == "0.1"
    assert "thread_id" not in before[0]
    assert after == [
        {"action_id": "act_a1"},
        {"action_id": "act_a2", "results": ["true"]},
        {"action_id": "act_a3", "results": ["2", '"done"']},
        {"action_id": "act_a4"},
    ]
    [info] = run.data_of("PackageInfo")
    assert (info["package_id"], info["package_name"]) == ("pkg_1", "demo")
    assert info["scene"]["objects"][0]["id"] == OBJ
    assert run.notes() == ["control", "go 12", "go 11", "go 11", "go 99", "disconnected"]


# ------------------------------------------------------------------------------------------------ functions
INNER = [Action(name, f"{OBJ}/go", f"act_{name}") for name in ("i1", "i2")]
WITH_FUNCTION = replace(
    PROJECT,
    functions=[ProjectFunction("there_and_back", INNER, id="pfu_1")],
    action_points=[
        replace(
            PROJECT.action_points[0],
            actions=[_action("a1"), Action("c1", "pfu_1/call", "act_c1"), Action("c2", "pfu_1/call", "act_c2")],
        ),
        PROJECT.action_points[1],
    ],
)
CALLS = """
    from arcor2_hw.data.geometry import Pose

    @res.function
    def there_and_back(where: Pose, *, an: str) -> bool:
        arm.go(where, an="i1")
        arm.go(res.pose("ori_child"), an="i2")
        return True

    arm.go(res.pose("ori_top"), an="a1")
    assert there_and_back(res.pose("ori_top"), an="c1") is True
    there_and_back(res.pose("ori_top"), an="c2")
    """


def paused_at(run: Run) -> list[str]:
    """Wait until the program pauses; return the actions of its frames."""
    run.host.expect_state("paused")
    announced = [e for e in run.host.seen if isinstance(e, m.ProgramEvent) and e.event == "ActionStateBefore"]
    return [frame.action_id for frame in announced[-1].frames]


def test_steps_go_over_into_and_out_of_functions(run: Run) -> None:
    run.start(CALLS, project=WITH_FUNCTION, start_paused=True)
    assert paused_at(run) == ["act_a1"]
    for mode, expected in (
        (ProgramStep.OVER, ["act_c1"]),
        (ProgramStep.INTO, ["act_c1", "act_i1"]),
        (ProgramStep.OVER, ["act_c1", "act_i2"]),
        (ProgramStep.OVER, ["act_c2"]),
        (ProgramStep.INTO, ["act_c2", "act_i1"]),
    ):
        run.host.send(m.Step(mode))
        assert paused_at(run) == expected
    last = [e for e in run.host.seen if isinstance(e, m.ProgramEvent) and e.event == "ActionStateBefore"][-1]
    assert last.frames[1] == Frame("act_i1", "pfu_1", "act_c2")
    run.host.send(m.Step(ProgramStep.OUT))
    assert run.host.expect_state("stopped").error is None
    announced = [e for e in run.host.seen if isinstance(e, m.ProgramEvent) and e.number]
    calls = [(e.number, e.call, e.device) for e in announced if e.event == "ActionStateBefore"]
    assert calls == [(1, 0, OBJ), (2, 0, ""), (3, 2, OBJ), (4, 2, OBJ), (5, 0, ""), (6, 5, OBJ), (7, 5, OBJ)]
    assert [e.call for e in announced if e.event == "ActionStateAfter"] == [0, 2, 2, 0, 5, 5, 0]
    assert run.data_of("ActionStateAfter")[3] == {"action_id": "act_c1", "results": ["true"]}


def test_breakpoints_in_a_function_pause_in_every_call(run: Run) -> None:
    # The action point of the pose pauses at the action that uses it, not at the call that passes it on.
    run.start(CALLS, project=WITH_FUNCTION, breakpoints=("act_i2", "acp_top"))
    for expected in (
        ["act_a1"],
        ["act_c1", "act_i1"],
        ["act_c1", "act_i2"],
        ["act_c2", "act_i1"],
        ["act_c2", "act_i2"],
    ):
        assert paused_at(run) == expected
        run.host.send(m.Resume())
    assert run.host.expect_state("stopped").error is None


def test_an_error_leaves_a_function_by_the_exit_of_its_call(run: Run) -> None:
    run.start(
        """
        from arcor2_hw.exceptions import Refused

        @res.function
        def there_and_back(*, an: str) -> None:
            arm.fail("full", an="i1")

        try:
            there_and_back(an="c1")
        except Refused as error:
            problem = res.caught(error)
        assert problem == ("arm", "refused", "the box is full"), problem
        there_and_back(an="c2")
        """,
        project=WITH_FUNCTION,
    )
    run.host.expect_state("stopped")
    failed = [e for e in run.host.seen if isinstance(e, m.ActionFailed)]
    assert [(e.number, str(e.error)) for e in failed] == [(number, "the box is full") for number in (2, 1, 4, 3)]
    [raised] = run.data_of("ProjectException")
    assert raised["action_id"] == "act_i1", "the action that failed, not the call"


def test_robots_are_streamed_while_an_action_runs(run: Run) -> None:
    run.start('arm.slow(30.0, an="a1")')
    run.host.expect_event("ActionStateBefore")
    for _ in range(3):
        joints = run.host.expect(m.StreamEvent, lambda s: s.event == "RobotJoints")
        eef = run.host.expect(m.StreamEvent, lambda s: s.event == "RobotEef")
    assert msgspec.json.decode(joints.encoded)["data"] == {"robot_id": OBJ, "joints": [{"name": "j0", "value": 0.5}]}
    assert msgspec.json.decode(eef.encoded)["data"]["end_effectors"][0]["end_effector_id"] == "tool"
    run.host.send(m.StopProgram())
    run.host.expect_state("stopped")


def test_pause_waits_for_the_running_action_and_blocks_the_next(run: Run) -> None:
    run.start('arm.gated(an="a1")\narm.slow(0.0, an="a2")')
    run.host.expect_event("ActionStateBefore")
    run.host.send(m.Pause())
    run.handled()
    run.go_on()
    run.host.expect_state("paused")
    assert run.host.events() == ["running", "PackageInfo", "ActionStateBefore", "ActionStateAfter", "paused"]
    time.sleep(0.2)
    assert "slow" not in run.notes()
    run.host.send(m.Resume())
    run.host.expect_state("stopped")
    assert run.host.events()[5:] == ["running", "ActionStateBefore", "ActionStateAfter", "stopped"]


def test_pause_between_actions_is_reported_at_once(run: Run) -> None:
    run.start('arm.wait_for_test()\narm.slow(0.0, an="a1")')
    run.host.expect_event("PackageInfo")
    run.host.send(m.Pause())
    run.host.expect_state("paused")
    assert run.host.events() == ["running", "PackageInfo", "paused"]
    run.go_on()
    run.host.expect_event("ActionStateBefore")
    time.sleep(0.1)
    assert "slow" not in run.notes()
    run.host.send(m.Resume())
    assert run.host.expect_state("stopped").finished


def test_a_program_starts_paused_and_is_stepped(run: Run) -> None:
    run.start('for name in ("a1", "a2", "a3"): arm.slow(0.0, an=name)', start_paused=True)
    run.host.expect_state("paused")
    assert run.host.events() == ["running", "PackageInfo", "ActionStateBefore", "paused"]
    for done in (1, 2):
        run.host.send(m.Step())
        run.host.expect_state("paused")
        assert run.notes().count("slow") == done
    tail = ["running", "ActionStateAfter", "ActionStateBefore", "paused"]
    assert run.host.events()[4:] == tail * 2
    run.host.send(m.Resume())
    assert run.host.expect_state("stopped").finished


def test_a_breakpoint_pauses_at_its_action_point(run: Run) -> None:
    run.start(
        'arm.go(res.pose("ori_top"), an="a1")\narm.go(res.pose("ori_child"), an="a2")\narm.slow(0.0, an="a3")',
        breakpoints=("acp_child",),
    )
    run.host.expect_state("paused")
    assert run.data_of("ActionStateBefore")[-1]["action_id"] == "act_a2"
    assert [n for n in run.notes() if n.startswith("go")] == ["go 11"]
    run.host.send(m.Resume())
    assert run.host.expect_state("stopped").finished


def test_shared_breakpoints_may_be_unknown_and_change(run: Run) -> None:
    run.directory = run.write(
        'for _ in range(2):\n    arm.slow(0.0, an="a1")\n    arm.slow(0.0, an="a2")\n    arm.slow(0.0, an="a3")',
        PROJECT,
    )
    run.host.send(
        m.RunPackage("pkg_1", str(run.directory), False, ["act_a2"], 0.05, shared_breakpoints=["act_a3", "act_gone"])
    )
    for expected in ("act_a2", "act_a3"):
        run.host.expect_state("paused")
        assert run.data_of("ActionStateBefore")[-1]["action_id"] == expected
        if expected == "act_a3":
            run.host.send(m.SetBreakpoints(["act_a1"]))
        run.host.send(m.Resume())
    for expected in ("act_a1", "act_a2"):  # the second round: breakpoints of the start remain
        run.host.expect_state("paused")
        assert run.data_of("ActionStateBefore")[-1]["action_id"] == expected
        run.host.send(m.Resume())
    assert run.host.expect_state("stopped").finished


def test_each_action_is_reported_with_time_and_result(run: Run) -> None:
    run.start(
        """
        arm.slow(0.2, an="a1")
        try:
            arm.fail("odd", an="a2")
        except ValueError:
            pass
        arm.fail("lost", an="a3")
        """
    )
    before = time.time()
    assert run.host.expect_state("stopped").error is not None
    reported = [e for e in run.host.seen if isinstance(e, m.ProgramEvent) and e.number]
    failed = [e for e in run.host.seen if isinstance(e, m.ActionFailed)]
    assert [(e.event.removeprefix("ActionState"), e.number, e.name) for e in reported] == [
        ("Before", 1, "a1"),
        ("After", 1, ""),
        ("Before", 2, "a2"),
        ("Before", 3, "a3"),
    ]
    assert abs(reported[0].time - before) < 60
    assert 0.2 <= reported[1].time < 60
    assert [(e.number, str(e.error).rpartition(" ")[2]) for e in failed] == [(2, "odd"), (3, "cut")]
    [exception] = run.data_of("ProjectException")
    assert exception["action_id"] == "act_a3"


def test_a_program_waits_for_a_slow_server_without_losing_events(run: Run) -> None:
    run.start('for _ in range(6000):\n    arm.slow(0.0, an="a1")')
    time.sleep(1.5)  # without reading: the program creates no more events than fit here and into the socket
    done = len([note for note in run.notes() if note == "slow"])
    assert done < 6000
    ended = run.host.expect_state("stopped", 120.0)
    assert ended.finished
    numbers = [e.number for e in run.host.seen if isinstance(e, m.ProgramEvent) and e.event == "ActionStateAfter"]
    assert numbers == list(range(1, 6001))


def test_an_unknown_breakpoint_fails_the_start(run: Run) -> None:
    run.start('arm.slow(0.0, an="a1")', breakpoints=("acp_none",))
    ended = run.host.expect_state("stopped")
    assert ended.error is not None
    assert "acp_none" in ended.error.message.text
    assert run.host.events() == ["ProjectException", "stopped"]


def test_a_flow_action_finishes_the_program(run: Run) -> None:
    run.start("try:\n    arm.finish(an='a1')\nexcept Exception:\n    pass\narm.slow(0.0, an='a2')")
    ended = run.host.expect_state("stopped")
    assert (ended.finished, ended.error) == (True, None)
    assert run.host.events()[2:] == ["ActionStateBefore", "ActionStateAfter", "stopped"]


@pytest.mark.parametrize(
    ("body", "kind", "handled"),
    [
        ('arm.fail("lost", an="a1")', "ConnectionLost", True),
        ('arm.fail("odd", an="a1")', "ValueError", False),
        ('arm.stuck(an="a1")', "DeviceTimeout", True),
        ("arm.slow(0.0)", "InvalidData", True),
        ('arm.slow(0.0, an="unknown")', "InvalidData", True),
        ("1 / 0", "ZeroDivisionError", False),
    ],
)
def test_an_exception_is_reported_and_all_devices_stop(run: Run, body: str, kind: str, handled: bool) -> None:
    run.start(body)
    ended = run.host.expect_state("stopped")
    [exception] = run.data_of("ProjectException")
    assert (exception["type"], exception["handled"]) == (kind, handled)
    assert exception["message"]
    assert not ended.finished
    assert ended.error is not None
    assert ended.error.type == kind
    assert run.notes()[-2:] == ["stop", "disconnected"]
    assert bool(list(run.directory.glob("traceback-*.txt"))) is not handled
    assert run.host.gone() == 0


def test_a_handled_exception_does_not_end_the_program(run: Run) -> None:
    run.start('try:\n    arm.fail("lost", an="a1")\nexcept ConnectionLost:\n    arm.slow(0.0, an="a2")')
    assert run.host.expect_state("stopped").finished
    assert "ProjectException" not in run.host.events()


@pytest.mark.parametrize(
    "body",
    [
        'arm.slow(1000.0, an="a1")',
        "arm.note('slow'); time.sleep(1000)",
        "arm.note('slow')\nwhile True: pass",
        "arm.note('slow')\nthreading.Event().wait()",
        "arm.note('slow')\nwhile True:\n    try:\n        time.sleep(0.1)\n    except Exception:\n        pass",
        "arm.note('slow')\nfor _ in 1, 2, 3:\n    try: time.sleep(1000)\n    except BaseException: pass",
        "def f(): arm.slow(1000.0, an='a1')\nt = threading.Thread(target=f)\nt.start()\nt.join()",
    ],
    ids=["action", "sleep", "loop", "lock", "catches errors", "catches all", "thread"],
)
def test_stop_ends_the_script_in_any_state(run: Run, body: str) -> None:
    run.start(body)
    run.wait_note("slow")
    run.host.send(m.StopProgram())
    ended = run.host.expect_state("stopped")
    assert not ended.finished
    assert ended.error is None
    assert run.notes()[-2:] == ["stop", "disconnected"]
    assert run.notes().count("stop") == 1
    assert "ProjectException" not in run.host.events()
    assert run.host.gone() == 0


def test_stop_ends_a_paused_program(run: Run) -> None:
    run.start('arm.slow(0.0, an="a1")', start_paused=True)
    run.host.expect_state("paused")
    run.host.send(m.StopProgram())
    run.host.expect_state("stopped")
    assert "slow" not in run.notes()


def test_a_hanging_driver_does_not_keep_the_host_running(run: Run) -> None:
    run.start('arm.unstoppable(an="a1")')
    run.wait_note("unstoppable")
    run.host.send(m.StopProgram())
    run.host.expect_state("stopped")
    assert run.host.gone() == 0
    assert run.notes()[-1] == "disconnected"


def test_the_host_stops_the_program_when_the_server_is_killed(run: Run) -> None:
    run.start('arm.slow(1000.0, an="a1")')
    run.wait_note("slow")
    run.host.socket.close()
    run.host.gone()
    assert [n for n in run.notes() if n in ("stop", "disconnected")][-1] == "disconnected"
    assert "stop" in run.notes()


def test_a_syntax_error_of_the_script_is_reported(run: Run) -> None:
    run.directory = run.write("pass")
    (run.directory / "script.py").write_text("def broken(:\n")
    run.host.send(m.RunPackage("pkg_1", str(run.directory)))
    assert run.host.expect_state("stopped").error.type == "SyntaxError"
    assert run.host.events() == ["ProjectException", "stopped"]


# ------------------------------------------------------------------------------------------ control by the client
def _run_script(directory: Path, *arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, str(directory / "script.py"), *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "ARCOR2_STREAMING_PERIOD": "0"},
    )


def test_a_script_run_by_hand_prints_events_and_reads_commands(run: Run) -> None:
    directory = run.write('arm.slow(0.0, an="a1")\narm.slow(0.0, an="a2")')
    with _run_script(directory, "-p") as process:
        assert process.stdin is not None
        assert process.stdout is not None
        printed = []
        for line in process.stdout:
            event = json.loads(line)
            printed.append(event["data"]["state"] if event["event"] == "PackageState" else event["event"])
            if printed[-1] == "paused":
                process.stdin.write("s\n" if printed.count("paused") == 1 else "r\n")
                process.stdin.flush()
        assert process.wait(WITHIN) == 0
    before, after = "ActionStateBefore", "ActionStateAfter"
    first = ["running", "PackageInfo", before, "paused", "running", after]
    assert printed == [*first, before, "paused", "running", after]
    assert run.notes() == ["control", "slow", "slow", "disconnected"]


def test_ctrl_c_stops_a_script_run_run_script(run: Run) -> None:
    directory = run.write('arm.slow(1000.0, an="a1")')
    with _run_script(directory) as process:
        run.wait_note("slow")
        process.send_signal(signal.SIGINT)
        assert process.wait(WITHIN) == 0
    assert run.notes() == ["control", "slow", "stop", "disconnected"]

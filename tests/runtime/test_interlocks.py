"""Interlocks in the cell host: conditions before and during actions and jogging, and zones of two robots."""

import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import msgspec
import pytest
from hypothesis import settings, strategies
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from msgspec.structs import replace

from arcor2_hw.actions import observation
from arcor2_hw.data.device import Quality, Reading
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.held import HoldChoice
from arcor2_hw.data.interlocks import Interlock, InterlockCondition, InterlockTarget, Need, Unmet
from arcor2_hw.data.object_type import Box, Model3dType, ObjectModel
from arcor2_hw.data.operation import HoldKind
from arcor2_hw.data.operator import Operator
from arcor2_hw.data.project import START, Action, ActionPoint, LogicItem, Project, ProjectFunction
from arcor2_hw.data.scene import Scene
from arcor2_hw.messages import Message
from arcor2_hw.objects import Generic
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.needs import MAX_VALUE_AGE, CachedValue, read, verdict
from arcor2_hw.runtime.zones import ZoneTokens

from .conftest import PATIENCE, HostProcess, Package, scene_object, type_code

ROBOTS: Final = ("a", "b", "c")
ZONES: Final = ("x", "y", "z")


# ------------------------------------------------------------------------------------------------ tokens
class Tokens(RuleBasedStateMachine):
    """Robots that take and release zones at random; the model states which robot has which zone."""

    def __init__(self) -> None:
        super().__init__()
        self.tokens = ZoneTokens()
        self.inside: dict[str, set[str]] = {robot: set() for robot in ROBOTS}
        self.wants: dict[str, set[str]] = {}
        self.deadlocked: set[str] = set()

    @rule(robot=strategies.sampled_from(ROBOTS), zones=strategies.sets(strategies.sampled_from(ZONES), min_size=1))
    def begin(self, robot: str, zones: set[str]) -> None:
        if robot not in self.wants:
            self.wants[robot] = zones | self.inside[robot]
            self.request(robot)

    @rule(robot=strategies.sampled_from(ROBOTS))
    def ask_again(self, robot: str) -> None:
        if robot in self.wants:
            self.request(robot)

    def request(self, robot: str) -> None:
        busy = self.tokens.take(robot, self.wants[robot])
        if busy is None:
            self.inside[robot] = self.wants.pop(robot)
            assert self.tokens.owned(robot) == self.inside[robot]
        else:
            assert busy.owner != robot
            assert self.tokens.owner(busy.zone) == busy.owner
            if busy.deadlock:
                self.cancel(robot)

    @rule(robot=strategies.sampled_from(ROBOTS))
    def cancel(self, robot: str) -> None:
        self.wants.pop(robot, None)
        self.tokens.release(robot, keep=self.inside[robot])
        assert self.tokens.owned(robot) == self.inside[robot]

    @precondition(lambda self: any(self.inside.values()))
    @rule(robot=strategies.sampled_from(ROBOTS), kept=strategies.sets(strategies.sampled_from(ZONES)))
    def leave(self, robot: str, kept: set[str]) -> None:
        if robot not in self.wants:
            self.inside[robot] &= kept
            self.tokens.release(robot, keep=self.inside[robot])

    @invariant()
    def no_zone_has_two_robots(self) -> None:
        for zone in ZONES:
            assert sum(zone in inside for inside in self.inside.values()) <= 1

    @invariant()
    def a_robot_can_continue(self) -> None:
        """Of the robots that wait, at least one waits for a robot that does not wait: deadlocks were detected."""
        if self.wants:
            waited_for = {self.tokens.take(robot, zones) for robot, zones in self.wants.items()}
            assert any(busy is None or busy.deadlock or busy.owner not in self.wants for busy in waited_for)
            for robot in [robot for robot, zones in self.wants.items() if self.tokens.owned(robot) >= zones]:
                self.inside[robot] = self.wants.pop(robot)


Tokens.TestCase.settings = settings(max_examples=200, stateful_step_count=30, deadline=None)
TestTokens = Tokens.TestCase


# ------------------------------------------------------------------------------------------------ needs
@pytest.mark.parametrize(
    ("operator", "value", "upper", "seen", "state"),
    [
        (Operator.EQUAL, "true", None, True, "met"),
        (Operator.EQUAL, "true", None, False, "not_met"),
        (Operator.EQUAL, "1", None, True, "not_met"),
        (Operator.EQUAL, '"idle"', None, "idle", "met"),
        (Operator.DIFFERENT, '"idle"', None, "idle", "not_met"),
        (Operator.LESS, "0.1", None, 0.05, "met"),
        (Operator.LESS, "0.1", None, "fast", "not_met"),
        (Operator.CLOSED, "1", "2", 2, "met"),
        (Operator.RIGHT_OPEN, "1", "2", 2, "not_met"),
    ],
)
def test_values_are_compared(operator: Operator, value: str, upper: str | None, seen: Any, state: str) -> None:
    need = Need("obj", "value", operator, value)
    need = need if upper is None else replace(need, upper=upper)
    assert verdict(need, CachedValue(seen, time.monotonic()), "door").state == state


def test_unknown_and_old_values_do_not_count() -> None:
    need = Need("obj", "open")
    never = verdict(need, None, "door")
    assert (never.state, str(never.text)) == ("unknown", "door: open is not confirmed, no value is known")
    old = verdict(need, CachedValue(True, time.monotonic() - MAX_VALUE_AGE - 2.0), "door")
    assert (old.state, str(old.text)) == ("unknown", "door: open is not confirmed, last known 3 s ago")
    closed = verdict(need, CachedValue(False, time.monotonic()), "door")
    assert (closed.state, str(closed.text)) == ("not_met", "door: open is not met")


# ------------------------------------------------------------------------------------------------ the host
DOOR = """
@dataclass
class DoorSettings(Settings):
    directory: str

class Door(Generic):
    _ABSTRACT = False
    def __init__(self, obj_id, name, settings: DoorSettings):
        super().__init__(obj_id, name, settings)
        self.directory = Path(settings.directory)

    @observation
    def open(self) -> bool:
        return (self.directory / "door").read_text() == "open"
"""
ARM = """
@dataclass
class ArmSettings(Settings):
    directory: str
    x: float = 0.0

class Arm(Robot):
    _ABSTRACT = False
    def __init__(self, obj_id, name, pose, settings: ArmSettings):
        super().__init__(obj_id, name, pose, settings)
        self.directory, self.x, self.stopped, self.velocity = Path(settings.directory), settings.x, False, 0.0
        self.until = 0.0
        threading.Thread(target=self.jogs, daemon=True).start()

    def log(self, text):
        with open(self.directory / "log", "a") as file:
            file.write(f"{self.name} {text}\\n")

    def get_end_effectors_ids(self):
        return {"tool"}
    def get_end_effector_pose(self, end_effector):
        return Pose(Position(self.x, 0.0, 0.0))
    def robot_joints(self, include_gripper=False):
        return [Joint("j", self.x)]
    def grippers(self):
        return set()
    def suctions(self):
        return set()

    def stop(self):
        self.stopped, self.velocity = True, 0.0

    def to(self, x):
        before, self.x = self.x, x
        if (abs(self.x - 1.0) <= 0.2) != (abs(before - 1.0) <= 0.2):
            self.log("enters" if abs(self.x - 1.0) <= 0.2 else "leaves")

    def jog(self, *, twist=None, frame="world", joint_velocities=None, valid_for, **_):
        self.velocity, self.until = twist[0], time.monotonic() + valid_for

    def set_hand_teaching_mode(self, enabled):
        self.log(f"by hand {enabled}")

    def jogs(self):
        while True:
            time.sleep(0.005)
            if time.monotonic() < self.until:
                self.to(self.x + 0.005 * self.velocity)

    @action
    def move(self, pose: Pose, speed: float = 2.0, *, an: str | None = None) -> None:
        self.stopped = False
        while abs(pose.position.x - self.x) > 1e-9:
            time.sleep(0.005)
            if self.stopped:
                raise Cancelled("stopped")
            step = 0.005 * speed
            self.to(self.x + max(-step, min(step, pose.position.x - self.x)))

    @action
    def hop(self, pose: Pose, *, an: str | None = None) -> None:
        self.to(pose.position.x)
"""
BODY = """
class Zone(CollisionObject):
    _ABSTRACT = False
"""
SIZE: Final = 0.4
INSIDE: Final = Pose(Position(1.0, 0.0, 0.0))
OUTSIDE: Final = Pose(Position(0.0, 0.0, 0.0))
OPEN: Final = Need("obj_door", "open")
ENTER: Final = Interlock("Door", InterlockTarget.ZONE, "obj_zone", [], [OPEN], True, 30.0, Unmet.WAIT, "ilk_1")
MODELS: Final = {"Zone": ObjectModel(Model3dType.BOX, Box("Zone", SIZE, 1.0, 1.0))}
TYPES: Final = {"Door": DOOR, "Arm": ARM, "Zone": BODY}


class Cell:
    """A door, a zone around x = 1 m, and arms that move along x. Their joint log shows which arm is in the zone."""

    def __init__(self, host: HostProcess, package: Package, directory: Path) -> None:
        self.host, self.package, self.directory = host, package, directory
        self.door("closed")
        zone = replace(scene_object("zone", "Zone", pose=True), pose=INSIDE)
        self.objects = [scene_object("door", "Door", directory=str(directory)), self.arm("arm"), zone]

    def arm(self, name: str, x: float = 0.0) -> Any:
        return scene_object(name, "Arm", pose=True, directory=str(self.directory), x=x)

    def door(self, state: str) -> None:
        file = self.directory / "door.new"
        file.write_text(state)
        with (self.directory / "log").open("a") as log:
            if state == "closed":
                log.write("door closed\n")
            file.replace(self.directory / "door")
            if state == "open":
                log.write("door open\n")

    def log(self) -> list[str]:
        return (self.directory / "log").read_text().splitlines()

    def open(self, *interlocks: Interlock) -> None:
        scene = Scene("scene", id="scn_1", objects=self.objects, interlocks=list(interlocks))
        types = [type_code(name, source) for name, source in TYPES.items()]
        self.host.send(m.OpenScene(scene, types, MODELS))
        self.host.expect(m.SceneOpened)

    def run(self, body: str, *interlocks: Interlock, project: Project | None = None) -> None:
        actions = [Action(name, "obj_arm/move", f"act_{name}") for name in ("enter", "leave")]
        logic = [LogicItem(START, "act_enter", id="lit_1")]
        point = ActionPoint("point", Position(), id="acp_1", actions=actions)
        project = project or Project("project", "scn_1", id="pro_1", action_points=[point], logic=logic)
        directory = self.package.write(TYPES, self.objects, project, body, interlocks=list(interlocks))
        (directory / "data" / "models" / "zone.json").write_bytes(msgspec.json.encode(MODELS["Zone"]))
        self.host.send(m.RunPackage("pkg_1", str(directory), hold_on_error=True))

    def command(self, method: str, **arguments: Any) -> int:
        """Call a method of the arm as the server does for a request that acts on it."""
        self.host._calls += 1
        encoded = {name: msgspec.json.encode(value) for name, value in arguments.items()}
        self.host.send(m.Call(self.host._calls, "obj_arm", method, encoded, control=True))
        return self.host._calls

    def move(self, pose: Pose) -> int:
        return self.command("move", pose=pose)

    def expect_state(self, where: Callable[[Any], bool]) -> Any:
        """Wait for the state of the first interlock."""
        message = self.host.expect(m.InterlocksChanged, lambda c: bool(c.states) and where(c.states[0]))
        return message.states[0]


@pytest.fixture
def cell(host: HostProcess, package: Package, tmp_path: Path) -> Cell:
    return Cell(host, package, tmp_path)


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


PROGRAM: Final = """
from arcor2_hw.data.geometry import Pose, Position
arm = res.objects["obj_arm"]
arm.move(Pose(Position(1.0, 0.0, 0.0)), an="enter")
arm.move(Pose(Position(0.0, 0.0, 0.0)), an="leave")
"""


def test_a_program_waits_for_the_door(cell: Cell) -> None:
    cell.run(PROGRAM, ENTER)
    waiting = cell.expect_state(lambda state: bool(state.waiting))
    assert (waiting.state, waiting.text) == (InterlockCondition.NOT_MET, "door: open is not met")
    assert waiting.waiting == ["obj_arm"]
    cell.door("open")
    assert cell.host.expect_state("stopped").finished
    assert cell.log() == ["door closed", "door open", "arm enters", "arm leaves"]


def test_a_program_can_be_paused_while_it_waits(cell: Cell) -> None:
    cell.run(PROGRAM, ENTER)
    cell.expect_state(lambda state: bool(state.waiting))
    cell.host.send(m.Pause())
    cell.host.expect_state("paused")
    cell.door("open")
    cell.expect_state(lambda state: state.state is InterlockCondition.MET)
    assert "arm enters" not in cell.log()
    cell.host.send(m.Resume())
    assert cell.host.expect_state("stopped").finished


def test_a_door_that_closes_midway_holds_the_program(cell: Cell) -> None:
    cell.door("open")
    cell.run(PROGRAM.replace('0)), an="enter"', '0)), 0.5, an="enter"'), ENTER)
    wait_for(lambda: "arm enters" in cell.log())
    cell.door("closed")
    held = cell.host.expect(m.ProgramHeld).held
    assert held.text == "arm: move was stopped. Interlock Door: door: open is not met"
    assert (held.kind, held.action_name, held.device) == ("interlock", "enter", "obj_arm")
    assert "arm leaves" not in cell.log()
    cell.host.send(m.DecideHeld(1, held.number, HoldChoice.RETRY))
    cell.expect_state(lambda state: bool(state.waiting))
    cell.door("open")
    assert cell.host.expect_state("stopped").finished


def test_an_action_that_does_not_wait_fails_at_once(cell: Cell) -> None:
    on_action = replace(ENTER, on=InterlockTarget.ACTION, object_id="obj_arm", otherwise=Unmet.HOLD, during=False)
    cell.open(on_action)
    error = cell.host.answer(cell.move(INSIDE))
    assert (error.code, str(error.message)) == (
        "interlock",
        "arm: move was not started. Interlock Door: door: open is not met",
    )
    assert cell.host.answer(cell.command("set_hand_teaching_mode", enabled=True)).code == "interlock"
    assert cell.host.answer(cell.command("set_hand_teaching_mode", enabled=False)) is None
    assert cell.log()[1:] == ["arm by hand False"], "hand teaching can always be switched off"
    cell.host.send(m.SetInterlocks([replace(on_action, otherwise=Unmet.WAIT, within=0.05)]))
    assert cell.host.answer(cell.move(INSIDE)).code == "interlock"
    cell.door("open")
    cell.expect_state(lambda state: state.state is InterlockCondition.MET)
    assert cell.host.answer(cell.move(INSIDE)) is None
    cell.host.send(m.SetInterlocks([replace(on_action, actions=["hop"])]))
    cell.door("closed")
    assert cell.host.answer(cell.move(OUTSIDE)) is None


def test_a_stop_ends_the_waiting(cell: Cell) -> None:
    cell.open(ENTER)
    number = cell.move(INSIDE)
    cell.expect_state(lambda state: bool(state.waiting))
    cell.host.send(m.StopMotion(100, "obj_arm"))
    assert cell.host.answer(number).code == "cancelled"
    assert "arm enters" not in cell.log()


def test_jogging_stops_before_a_zone(cell: Cell) -> None:
    cell.objects[1] = cell.arm("arm", x=0.6)
    cell.open(ENTER)
    cell.host._calls = 1000
    ended = None
    for number in range(1, 200):
        lease = m.Lease(number, "obj_arm", 1, HoldKind.JOG, time.monotonic() + 0.3, (0.25, 0, 0, 0, 0, 0))
        cell.host.send(lease)
        if isinstance(cell.host.answer(number), m.ErrorData):
            ended = cell.host.expect(m.HoldEnded) if not _ended(cell.host) else _ended(cell.host)
            break
        time.sleep(0.05)
    assert ended is not None
    assert ended.error is not None
    assert ended.error.code == "interlock"
    assert "door: open is not met" in str(ended.error.message)
    assert "arm enters" not in cell.log()
    where = cell.host.call("obj_arm", "get_end_effector_pose", end_effector="tool")
    assert 0.6 < where["position"]["x"] < 0.8


def hold(cell: Cell, number: int, velocity: float = 0.0) -> Any:
    """Jog the arm, or let it leave its zone, until the hold is refused or ends; return the reason."""
    for lease_id in range(1000 * number, 1000 * number + 200):
        twist = (velocity, 0.0, 0.0, 0.0, 0.0, 0.0) if velocity else None
        lease = m.Lease(lease_id, "obj_arm", number, HoldKind.JOG, time.monotonic() + 0.3, twist, retract=not velocity)
        cell.host.send(lease)
        answer = cell.host.answer(lease_id)
        if isinstance(answer, m.ErrorData):
            cell.host.expect(m.HoldEnded)
            return answer
        time.sleep(0.05)
    raise AssertionError("the robot moves on")


def test_a_robot_leaves_a_zone_that_it_may_not_enter(cell: Cell) -> None:
    cell.objects[1] = cell.arm("arm", x=0.85)
    # The nearest surface is at x = 1.2; the path leads through the door at x = 0.8.
    cell.open(replace(ENTER, otherwise=Unmet.HOLD, retract=[Position(0.0), Position(-0.25)]))
    state = cell.expect_state(lambda one: one.inside == ["obj_arm"])
    assert state.state is InterlockCondition.NOT_MET
    assert cell.host.answer(cell.move(OUTSIDE)).code == "interlock"
    deeper = hold(cell, 1, velocity=0.25)
    assert deeper.code == "interlock"
    assert "not deeper" in str(deeper.message)
    start = time.monotonic()
    assert str(hold(cell, 2).message) == "arm has left the zone."
    assert time.monotonic() - start > 1.5, "the robot leaves the zone slowly"
    assert cell.log()[1:] == ["arm leaves"]
    where = cell.host.call("obj_arm", "get_end_effector_pose", end_effector="tool")
    assert 0.73 < where["position"]["x"] < 0.8
    assert hold(cell, 3).code == "refused"
    entering = hold(cell, 4, velocity=0.25)
    assert "door: open is not met" in str(entering.message)
    assert cell.log()[1:] == ["arm leaves"]


def _ended(host: HostProcess) -> m.HoldEnded | None:
    return next((one for one in host.seen if isinstance(one, m.HoldEnded)), None)


def test_two_robots_never_share_a_zone(cell: Cell) -> None:
    cell.objects.append(cell.arm("other"))
    calls = [Action(f"call {name}", f"pfu_{name}/call", f"act_{name}") for name in ("arm", "other")]
    both = Action("both", "functions/parallel", "act_both", branches=["act_arm", "act_other"])
    functions = [
        ProjectFunction(name, [Action(f"hop {name}", f"obj_{name}/hop", f"act_hop_{name}")], id=f"pfu_{name}")
        for name in ("arm", "other")
    ]
    project = Project("project", "scn_1", id="pro_1", functions=functions)
    project = replace(project, action_points=[ActionPoint("point", Position(), id="acp_1", actions=[*calls, both])])
    body = """
    import random
    from arcor2_hw.data.geometry import Pose, Position

    def cycles(name):
        choice = random.Random(name)
        robot = res.objects[f"obj_{name}"]
        for _ in range(500):
            robot.hop(Pose(Position(choice.choice([0.0, 1.0, 1.1, 2.0]), 0.0, 0.0)), an=f"hop {name}")
        robot.hop(Pose(Position(0.0, 0.0, 0.0)), an=f"hop {name}")

    @res.function
    def arm(*, an: str):
        cycles("arm")

    @res.function
    def other(*, an: str):
        cycles("other")

    res.parallel(lambda: arm(an="call arm"), lambda: other(an="call other"), an="both")
    """
    cell.run(body, replace(ENTER, needs=[]), project=project)
    ended = cell.host.expect_state("stopped", 60.0)
    assert ended.finished, ended.error
    inside: set[str] = set()
    entries: dict[str, int] = {}
    for line in cell.log()[1:]:
        name, event = line.split()
        if event == "enters":
            inside.add(name)
            entries[name] = entries.get(name, 0) + 1
        else:
            inside.remove(name)
        assert len(inside) <= 1
    assert min(entries["arm"], entries["other"]) > 20


class Sensor(Generic):
    def __init__(self) -> None:
        super().__init__("obj_sensor", "sensor")
        self.quality = Quality.GOOD

    @observation
    def level(self) -> Reading[float]:
        return Reading.of(0.5, self.quality)

    def height(self) -> float:
        return 0.5


def test_an_uncertain_value_does_not_count() -> None:
    sensor = Sensor()
    device: Any = SimpleNamespace(name="sensor", recipe=SimpleNamespace(cls=Sensor), require=lambda: sensor)
    good = read(device, "level", "", CachedValue())
    assert (good.value, good.problem) == (0.5, None)
    sensor.quality = Quality.UNCERTAIN
    assert read(device, "level", "", good) == good._replace(problem=Message.of("the value is not reliable"))
    assert read(device, "height", "", CachedValue()).at == 0.0, "height is not marked as an observation"

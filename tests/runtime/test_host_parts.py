"""The cell host tracks the places of parts, and stores checkpoints before and after each action."""

import os
import signal
import textwrap
from pathlib import Path

import pytest
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.geometry import Orientation, Position
from arcor2_hw.data.held import HeldData, HoldChoice
from arcor2_hw.data.parts import ConfirmedPart, Part, PartInventory
from arcor2_hw.data.project import (
    START,
    Action,
    ActionPoint,
    Flow,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectFunction,
    ProjectParameter,
)
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.checkpoints import CheckpointFile

from .conftest import HostProcess, Package, scene_object

ARM = """
@dataclass
class ArmSettings(Settings):
    directory: str

class Arm(Generic):
    _ABSTRACT = False
    def __init__(self, obj_id, name, settings: ArmSettings):
        super().__init__(obj_id, name, settings)
        self.directory = Path(settings.directory)

    def part_present(self):
        sensor = self.directory / "sensor"
        return sensor.read_text() == "on" if sensor.exists() else None

    def move(self, text):
        with open(self.directory / "notes", "a") as file:
            file.write(text + "\\n")
        while (self.directory / "hang").exists():
            time.sleep(0.01)
        if (self.directory / "fault").exists():
            raise DeviceFault("the part sticks")

    @action(takes_from="pose")
    def pick(self, pose: Pose, *, an: str | None = None) -> None:
        self.move("pick")

    @action(puts_to="pose")
    def place(self, pose: Pose, *, an: str | None = None) -> None:
        self.move("place")

    @action(identifies=True)
    def scan(self, code: str, *, an: str | None = None) -> str:
        return code

    @action(verdict=True)
    def test(self, good: bool, *, an: str | None = None) -> bool:
        return good
"""


def point(name: str, parent: str, *actions: str) -> ActionPoint:
    methods = {"pick": "pick", "insert": "place", "take": "pick", "into_box": "place", "scan": "scan", "test": "test"}
    flows = {name: [Flow(outputs=["code"] if name == "scan" else [])] for name in methods}
    created = [Action(each, f"obj_arm/{methods[each]}", f"act_{each}", flows=flows[each]) for each in actions]
    orientation = NamedOrientation("default", Orientation(), f"ori_{name}")
    return ActionPoint(name, Position(), parent, id=f"acp_{name}", orientations=[orientation], actions=created)


PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    action_points=[
        point("stop", "obj_feeder", "scan", "pick"),
        point("inside", "obj_nest", "insert", "test", "take"),
        point("box", "obj_good", "into_box"),
    ],
    logic=[LogicItem(START, "act_scan", id="lit_1")],
)
BODY = """
arm = res.objects["obj_arm"]
stop, inside, box = (res.pose(f"ori_{name}") for name in ("stop", "inside", "box"))
"""
ONE = BODY + 'arm.scan("A-1", an="scan")\narm.pick(stop, an="pick")\narm.place(inside, an="insert")\n'


def write_package(package: Path, directory: Path, body: str, project: Project = PROJECT) -> Path:
    """Write a package whose arm writes notes to the directory, and reads its faults from there."""
    objects = [
        scene_object("arm", "Arm", directory=str(directory)),
        scene_object("feeder", "PartFeeder", pose=True),
        scene_object("nest", "PartHolder", pose=True),
        scene_object("good", "PartBox", pose=True, counts_as="good"),
    ]
    return Package(package).write({"Arm": ARM}, objects, project, body)


class Cell:
    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.records = directory / "records"
        self.runs = 0
        self.hosts: list[HostProcess] = []

    def start(self, body: str, project: Project = PROJECT, **options: object) -> HostProcess:
        host = HostProcess()
        self.hosts.append(host)
        self.runs += 1
        path = write_package(self.directory / f"pkg_{self.runs}", self.directory, body, project)
        more = {"records": str(self.records), "run": self.runs, "hold_on_error": True} | options
        host.send(m.RunPackage("pkg_1", str(path), streaming_period=0, **more))  # type: ignore[arg-type]
        return host

    def inventory(self) -> PartInventory:
        found = CheckpointFile(self.records, "scn_1").read()
        assert found is not None
        return found

    def notes(self) -> list[str]:
        path = self.directory / "notes"
        return path.read_text().split() if path.exists() else []


@pytest.fixture
def cell(tmp_path: Path):  # type: ignore[no-untyped-def]
    created = Cell(tmp_path)
    yield created
    for host in created.hosts:
        host.end()


def wait_until_held(host: HostProcess) -> HeldData:
    found = host.expect(m.ProgramHeld).held
    host.expect_state("paused")
    return found


def decide(host: HostProcess, number: int, choice: HoldChoice) -> None:
    host._calls += 1
    host.send(m.DecideHeld(host._calls, number, choice, []))
    assert host.answer(host._calls) is None


def confirm(host: HostProcess, *parts: ConfirmedPart) -> object:
    host._calls += 1
    host.send(m.ConfirmParts(host._calls, list(parts)))
    return host.answer(host._calls)


def test_a_nest_is_not_filled_twice_by_another_run(cell: Cell) -> None:
    host = cell.start(ONE)
    assert host.expect_state("stopped").finished
    inventory = cell.inventory()
    assert inventory.parts == [Part(1, "obj_nest", "A-1")]
    assert inventory.run is not UNSET
    assert inventory.run.ended
    assert inventory.run.cycle == 1
    assert inventory.run.results["act_scan"] == ['"A-1"']

    host = cell.start(ONE.replace("A-1", "A-2"))
    found = wait_until_held(host)
    assert (found.kind, found.action_name) == ("place_occupied", "insert")
    assert "nest is occupied: part A-1 is there" in found.text
    assert cell.notes() == ["pick", "place", "pick"]  # the arm has not moved since
    assert confirm(host, ConfirmedPart(1, "obj_good")) is None
    decide(host, found.number, HoldChoice.RETRY)
    assert host.expect_state("stopped").finished
    assert (cell.inventory().counts.fed, cell.inventory().counts.good) == (2, 1)
    assert [part.serial for part in cell.inventory().parts] == ["A-2"]


def test_a_failed_movement_is_repeated_or_done_by_hand(cell: Cell) -> None:
    (cell.directory / "fault").touch()
    host = cell.start(ONE + 'arm.test(True, an="test")\narm.pick(inside, an="take")\narm.place(box, an="into_box")')
    found = wait_until_held(host)
    assert cell.inventory().parts == [Part(1, "obj_feeder", "A-1", moving_to="obj_arm", confirmed=False)]
    changed = [each.inventory for each in host.seen if isinstance(each, m.PartsChanged)]
    assert changed[-1].parts == cell.inventory().parts
    (cell.directory / "sensor").write_text("on")
    decide(host, found.number, HoldChoice.SKIP)  # the part is in the gripper
    found = wait_until_held(host)
    assert found.action_name == "insert"
    (cell.directory / "sensor").write_text("off")
    decide(host, found.number, HoldChoice.RETRY)
    found = wait_until_held(host)
    assert (found.kind, found.text) == (
        "place_empty",
        "arm (Arm): The sensor detects no part at arm. Check the place, then confirm where the parts are.",
    )
    (cell.directory / "fault").unlink()
    decide(host, found.number, HoldChoice.SKIP)
    found = wait_until_held(host)
    assert found.action_name == "into_box"  # the sensor is off although the part was taken
    (cell.directory / "sensor").unlink()
    decide(host, found.number, HoldChoice.RETRY)
    assert host.expect_state("stopped").finished
    assert cell.inventory().counts.good == 1


def test_after_kill_the_checkpoint_names_the_running_action(cell: Cell) -> None:
    (cell.directory / "hang").touch()
    host = cell.start(ONE)
    host.expect(m.ProgramEvent, lambda event: event.name == "pick")
    while not cell.notes():
        pass
    os.kill(host.process.pid, signal.SIGKILL)
    host.gone()
    inventory = cell.inventory()
    assert inventory.run is not UNSET
    assert not inventory.run.ended
    assert [(action.action_name, action.branch) for action in inventory.run.actions] == [("pick", "main")]
    assert inventory.run.last == "act_scan"
    assert len(inventory.run.package_hash) == 64
    assert inventory.parts == [Part(1, "obj_feeder", "A-1", moving_to="obj_arm")]


def test_checkpoints_of_actions_can_be_switched_off(cell: Cell) -> None:
    host = cell.start(BODY + 'arm.scan("A-1", an="scan")\narm.pick(box, an="pick")', checkpoints=False)
    found = wait_until_held(host)  # parts are not taken from a box
    assert cell.inventory().parts == []
    decide(host, found.number, HoldChoice.END)
    host.expect_state("stopped")
    assert cell.inventory().parts == [Part(1, "obj_feeder", "A-1")]


def test_a_part_that_is_elsewhere_does_not_count_as_moved(cell: Cell) -> None:
    (cell.directory / "fault").touch()
    host = cell.start(ONE)
    found = wait_until_held(host)
    assert HoldChoice.SKIP in found.choices
    for where, reason in (("obj_nest", "A-1 is at nest, not at arm"), ("", "skip is not possible here")):
        assert confirm(host, ConfirmedPart(1, where)) is None
        host._calls += 1
        host.send(m.DecideHeld(host._calls, found.number, HoldChoice.SKIP, []))
        assert reason in host.answer(host._calls).message.text
    (changed,) = [each.held for each in host.seen if isinstance(each, m.HeldChanged)]
    assert changed.choices == [HoldChoice.RETRY, HoldChoice.END]
    decide(host, found.number, HoldChoice.END)
    host.expect_state("stopped")


STEPS = f"""{ONE}arm.test(True, an="test")
arm.pick(inside, an="take")
arm.place(box, an="into_box")
"""
CALLED = replace(
    PROJECT,
    action_points=[
        *PROJECT.action_points,
        ActionPoint("p", Position(), actions=[Action("all", "pfu_1/call", "act_all")]),
    ],
    functions=[ProjectFunction("work", [], id="pfu_1")],
    logic=[LogicItem(START, "act_all", id="lit_1")],
)


@pytest.mark.parametrize("called", [False, True], ids=["actions", "a function"])
def test_an_interrupted_program_continues_at_its_interrupted_action(cell: Cell, called: bool) -> None:
    body, project = STEPS, PROJECT
    if called:
        inside = f"@res.function\ndef work(*, an: str) -> None:\n{textwrap.indent(STEPS, '    ')}"
        body, project = f'{inside}\nwork(an="all")', CALLED
    (cell.directory / "hang").touch()
    host = cell.start(body, project)
    host.expect(m.ProgramEvent, lambda event: event.name == "pick")
    while not cell.notes():
        pass
    os.kill(host.process.pid, signal.SIGKILL)
    host.gone()
    (cell.directory / "hang").unlink()
    run = cell.inventory().run
    assert run is not UNSET
    assert (run.published().continues, run.published().continues_at) == (True, ["pick"])

    host = cell.start(body, project, continues=True)
    found = wait_until_held(host)
    assert (found.kind, found.action_name, found.choices) == (
        "program_interrupted", "pick", [HoldChoice.RETRY, HoldChoice.SKIP, HoldChoice.END]
    )  # fmt: skip
    assert cell.notes() == ["pick"]  # the arm has not moved since
    decide(host, found.number, HoldChoice.RETRY)
    assert host.expect_state("stopped").finished
    assert cell.notes() == ["pick", "pick", "place", "pick", "place"]
    assert cell.inventory().counts.good == 1
    assert cell.inventory().run.cycle == 1  # type: ignore[union-attr]
    assert [done.name for done in cell.inventory().run.done] == ["scan", "pick", "insert", "test", "take", "into_box"]  # type: ignore[union-attr]


def test_an_interrupted_program_continues_at_a_chosen_action(cell: Cell) -> None:
    (cell.directory / "hang").touch()
    host = cell.start(STEPS, PROJECT)
    while not cell.notes():
        pass
    os.kill(host.process.pid, signal.SIGKILL)
    host.gone()
    (cell.directory / "hang").unlink()
    host = cell.start(STEPS, PROJECT, continues=True, continue_at=0)
    found = wait_until_held(host)
    assert (found.kind, found.action_name) == ("program_interrupted", "scan")
    assert cell.notes() == ["pick"]  # the arm has not moved since
    decide(host, found.number, HoldChoice.RETRY)
    assert host.expect_state("stopped").finished
    assert cell.notes() == ["pick", "pick", "place", "pick", "place"]
    assert cell.inventory().counts.good == 1


COUNTING = f"""{BODY}
last: str = ""
while True:
    arm.pick(stop, an="pick")
    arm.place(inside, an="insert")
    arm.test(True, an="test")
    arm.pick(inside, an="take")
    arm.place(box, an="into_box")
    last = arm.scan(last + "x", an="scan")
"""
WITH_VARIABLE = replace(
    PROJECT,
    action_points=[
        replace(each, actions=[replace(one, flows=[Flow(outputs=["last"])]) if one.name == "scan" else one
                               for one in each.actions])
        for each in PROJECT.action_points
    ],
    logic=[LogicItem(START, "act_pick", id="lit_1")],
    parameters=[ProjectParameter("last", "string", '""', id="pco_last", variable=True)],
)  # fmt: skip


def test_an_interrupted_program_continues_with_its_variables(cell: Cell) -> None:
    host = cell.start(COUNTING, WITH_VARIABLE)
    host.expect(m.ProgramEvent, lambda event: event.name == "scan")
    (cell.directory / "hang").touch()
    while len(cell.notes()) < 5:  # the second cycle has started
        pass
    os.kill(host.process.pid, signal.SIGKILL)
    host.gone()
    (cell.directory / "hang").unlink()
    assert cell.inventory().run.variables == {"last": '"x"'}  # type: ignore[union-attr]

    host = cell.start(COUNTING, WITH_VARIABLE, continues=True)
    decide(host, wait_until_held(host).number, HoldChoice.RETRY)
    scanned = host.expect(
        m.ProgramEvent, lambda event: event.event == "ActionStateAfter" and b"act_scan" in event.encoded
    )
    assert b'"xx\\"' in scanned.encoded

"""The belt with its light barriers, and the place where labels are applied to boards and pressed on."""

import copy
import itertools
import math
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings, strategies as st

import arcor2_fakes.cell
from arcor2_fakes.cell import seen_objects
from arcor2_fakes.cell.boards import Board
from arcor2_fakes.cell.layout import Layout
from arcor2_fakes.cell.supply import BoardBelt
from arcor2_fakes.cell.world import World
from arcor2_fakes.cell.world_data import Inputs, Printed, Robot, Thing

PLAIN = msgspec.json.decode(Path(arcor2_fakes.cell.__file__).with_name("example.json").read_bytes())
TOLERANCE = {"position": 0.01, "height": 0.02, "tilt": 0.15}
UP_Y = [0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)]  # x of the belt along y of the world
STOP, NEST = (0.4, -0.3, 0.08), (0.45, -0.08, 0.08)
BEGIN, END = (0.45, -0.1, 0.09), (0.45, -0.06, 0.09)
COUNTS = 1000.0  # per metre
WHOLE = {
    **{name: part for name, part in PLAIN.items() if name != "feeder"},
    "reader": {"pose": {"position": STOP}, "tolerance": TOLERANCE},
    "belt": {
        "pose": {"position": STOP, "orientation": UP_Y},
        **{"tolerance": TOLERANCE, "length": 0.6, "pitch": 0.2, "board_length": 0.08, "counts_per_metre": COUNTS},
        "barriers": [{"input": 0, "at": 0.0}, {"input": 3, "at": -0.2}],
    },
    "labelling": {
        "place": {"pose": {"position": NEST}, "tolerance": TOLERANCE},
        "arm": {"base": {"position": [0.65, -0.08, 0.09]}, "links": [0.15, 0.1]},
        "press": {"begin": BEGIN, "end": END, "tolerance": 0.008},
    },
    "tower": {"green": 2},
}
LAYOUT = msgspec.convert(WHOLE, Layout)
BOARDS = [Board("A"), Board("B", "short"), Board("C")]
TIP = 0.1


class Devices:
    """Records what it receives; the tester accepts everything."""

    def __init__(self) -> None:
        self.barriers: list[tuple[int, bool]] = []
        self.shown: str | None = None

    async def put_into_tester(self, board: Board) -> str | None:
        return None

    async def take_from_tester(self) -> str | None:
        return None

    async def present(self, code: str | None) -> None:
        self.shown = code

    async def set_sensor(self, held: bool) -> None:
        pass

    async def set_barrier(self, number: int, interrupted: bool) -> None:
        self.barriers.append((number, interrupted))


def joints(x: float, y: float) -> tuple[float, float]:
    """Return the arm's joint values for a point of the world, always with the same elbow side."""
    x, y = x - 0.65, y + 0.08
    cosine = (x * x + y * y - 0.15**2 - 0.1**2) / (2 * 0.15 * 0.1)
    elbow = math.acos(max(-1.0, min(1.0, cosine)))
    return math.atan2(y, x) - math.atan2(0.1 * math.sin(elbow), 0.15 + 0.1 * math.cos(elbow)), elbow


class Cell:
    """A world with a robot that moves instantly, a belt moved by the test, and a printer."""

    def __init__(self, boards: list[Board] = BOARDS) -> None:
        self.devices = Devices()
        self.world = World(LAYOUT, boards, self.devices)
        self.inputs = Inputs(belt=0.0, arm=(0.0, 0.0))
        self.now, self.bits = 0.0, 0
        self.pose: Any = (0.0, 0.6, 0.5, 0.0, math.pi, 0.0)

    async def wait(self, seconds: float = 0.1) -> None:
        for _ in range(round(seconds / 0.02)):
            self.now += 0.02
            await self.world.step(self.now, Robot(self.pose, (0.0,) * 6, self.bits), copy.copy(self.inputs))  # type: ignore[arg-type]

    async def run(self, metres: float) -> None:
        assert self.inputs.belt is not None
        begin = self.inputs.belt
        for part in range(1, 21):
            self.inputs.belt = begin + metres * COUNTS * part / 20
            await self.wait(0.02)

    async def at(self, x: float, y: float, z: float) -> None:
        self.pose = (-x, -y, z + TIP, 0.0, math.pi, 0.0)
        await self.wait()

    async def grip(self, on: bool) -> None:
        self.bits = int(on)
        await self.wait(0.3)

    async def carry(self, source: Any, target: Any) -> None:
        await self.at(*source)
        await self.grip(True)
        await self.at(*target)
        await self.grip(False)

    async def print(self, code: str) -> None:
        number = len(self.inputs.printed) + 1
        fields = [{"text": "PASSED"}, {"barcode": True, "text": code}]
        self.inputs.printed = [*self.inputs.printed, Printed(number, fields)]
        await self.wait()

    async def roll(self, *points: tuple[float, ...]) -> None:
        """Move the roller from point to point in straight lines."""
        x, y, _ = self.world.truth()["roller"]
        for target in points:
            for part in range(1, 11):
                here = x + (target[0] - x) * part / 10, y + (target[1] - y) * part / 10
                self.inputs.arm = joints(*here)
                await self.wait(0.02)
            x, y = target[0], target[1]

    def board(self, code: str) -> dict[str, Any]:
        return next(board for board in self.world.truth()["boards"] if board["code"] == code)


async def in_nest(cell: Cell) -> None:
    await cell.world.begin()
    await cell.run(0.7)
    await cell.carry(STOP, NEST)
    assert cell.board("A")["place"] == "label"


# ---------------------------------------------------------------------------------------------------- belt
async def test_boards_ride_interrupt_barriers_and_wait_at_the_stop() -> None:
    cell = Cell()
    await cell.world.begin()
    assert cell.devices.barriers == [(0, False), (3, False)]
    await cell.run(0.3)
    assert [board["before_stop"] for board in cell.world.truth()["belt"]] == pytest.approx([0.3, 0.5], abs=0.035)
    assert cell.devices.barriers == [(0, False), (3, False)]
    assert cell.devices.shown is None
    await cell.run(0.5)
    truth = cell.world.truth()
    assert truth["at_pick_place"] == cell.devices.shown == "A"
    # The first board is at the stop and the others follow without gaps. The second beam was interrupted twice.
    assert next(board["before_stop"] for board in truth["belt"]) == 0.0
    assert cell.devices.barriers.count((3, True)) >= 2
    assert (0, True) in cell.devices.barriers
    await cell.run(1.0)
    assert [board["before_stop"] for board in cell.world.truth()["belt"]] == pytest.approx([0.0, 0.08, 0.16])
    cell.devices.barriers.clear()
    await cell.carry(STOP, (0.2, 0.5, 0.06))
    assert (0, False) in cell.devices.barriers
    assert cell.board("A")["place"] == "good"
    assert cell.world.truth()["at_pick_place"] is None  # the belt is stopped: the next board does not arrive
    await cell.run(0.08)
    assert cell.world.truth()["at_pick_place"] == "B"


async def test_a_board_is_gripped_only_where_it_is() -> None:
    cell = Cell()
    await cell.world.begin()
    await cell.run(0.5)
    s = cell.world.truth()["belt"][0]["before_stop"]
    assert 0.05 < s < 0.2
    await cell.carry(STOP, (0.2, 0.5, 0.06))
    assert cell.board("A")["place"] == "belt"
    await cell.carry((STOP[0], STOP[1] - s, STOP[2]), (0.2, 0.5, 0.06))
    assert cell.board("A")["place"] == "good"


async def test_a_board_placed_on_another_is_lost() -> None:
    cell = Cell()
    await cell.world.begin()
    await cell.run(0.7)
    await cell.at(*STOP)
    await cell.grip(True)
    await cell.run(0.2)
    await cell.at(STOP[0], STOP[1] - 0.02, STOP[2])
    await cell.grip(False)
    assert cell.board("A")["place"] == "lost"
    assert "onto a board" in cell.board("A")["history"][-1]["why"]
    await cell.carry(STOP, (STOP[0], STOP[1] - 0.4, STOP[2]))
    assert cell.board("B")["place"] == "belt"
    await cell.run(1.0)
    assert [board["code"] for board in cell.world.truth()["belt"]] == ["C", "B"]


async def test_a_belt_that_runs_backwards_loses_its_boards() -> None:
    cell = Cell([Board("A")])
    await cell.world.begin()
    await cell.run(0.2)
    await cell.run(-0.3)
    assert cell.board("A")["place"] == "lost"
    assert "backwards" in cell.board("A")["history"][-1]["why"]


async def test_a_stuck_light_barrier_reports_a_wrong_state() -> None:
    cell = Cell()
    await cell.world.begin()
    await cell.world.stick_barrier(0, True)
    assert cell.devices.barriers[-1] == (0, True)
    await cell.run(0.8)
    assert (0, False) not in cell.devices.barriers[3:]
    await cell.world.stick_barrier(0, None)
    with pytest.raises(ValueError, match="input 7 has no light barrier; connected: 0, 3"):
        await cell.world.stick_barrier(7, True)


@settings(max_examples=60, deadline=None)
@given(pushes=st.lists(st.floats(-0.05, 0.3), max_size=40), takes=st.lists(st.booleans(), min_size=40, max_size=40))
def test_boards_on_a_belt_neither_overlap_nor_pass_the_stop(pushes: list[float], takes: list[bool]) -> None:
    things = [Thing(Board(str(number))) for number in range(8)]
    assert LAYOUT.belt is not None
    belt, counts = BoardBelt(LAYOUT.belt, things), 0.0
    belt.advance(0.0, counts)
    for push, take in zip(pushes, takes, strict=False):
        counts += push * COUNTS
        belt.advance(0.0, counts)
        places = [s for _, s in belt.places()]
        assert all(-0.6 - 1e-6 <= s <= 0.0 for s in places)
        assert all(ahead - behind >= 0.08 - 1e-9 for ahead, behind in itertools.pairwise(places))
        if take and (top := belt.top()) is not None:
            belt.take(top)


# ---------------------------------------------------------------------------------------------------- labels
async def test_a_label_stays_on_the_board_once_pressed() -> None:
    cell = Cell()
    await in_nest(cell)
    await cell.print("A")
    assert cell.board("A")["label"] == {"code": "A", "pressed": False}
    await cell.roll(BEGIN, END)
    assert cell.board("A")["label"] == {"code": "A", "pressed": True}
    await cell.carry(NEST, (0.2, 0.5, 0.06))
    assert (cell.board("A")["place"], cell.board("A")["label"]) == ("good", {"code": "A", "pressed": True})
    assert cell.world.truth()["spilled_labels"] == []


@pytest.mark.parametrize(("first", "last", "pressed"), [(BEGIN, END, True), (END, BEGIN, False)])
async def test_the_world_may_see_the_roller_only_before_and_after(
    first: tuple[float, ...], last: tuple[float, ...], pressed: bool
) -> None:
    cell = Cell()
    await in_nest(cell)
    await cell.print("A")
    way = last[0] - first[0], last[1] - first[1]
    for share in (-0.3, 1.3):
        cell.inputs.arm = joints(first[0] + share * way[0], first[1] + share * way[1])
        await cell.wait(0.02)
    assert cell.board("A")["label"] == {"code": "A", "pressed": pressed}


async def test_a_label_that_was_not_pressed_falls_off() -> None:
    cell = Cell()
    await in_nest(cell)
    await cell.print("A")
    await cell.carry(NEST, (0.2, 0.5, 0.06))
    assert cell.board("A")["label"] is None
    assert cell.world.truth()["spilled_labels"] == ["A"]


@pytest.mark.parametrize(
    "way",
    [
        [END, BEGIN],
        [BEGIN],
        [BEGIN, (0.5, -0.08), END],
        [(0.46, -0.1 - 0.03), (0.5, -0.08)],
    ],
    ids=["the wrong way round", "half", "off the label in between", "next to it"],
)
async def test_a_label_is_not_pressed_by_wrong_motions(way: list[tuple[float, ...]]) -> None:
    cell = Cell()
    await in_nest(cell)
    await cell.print("A")
    await cell.roll((0.55, -0.1), *way)
    assert not cell.board("A")["label"]["pressed"]


async def test_rolling_without_a_label_presses_nothing() -> None:
    cell = Cell()
    await in_nest(cell)
    await cell.roll(BEGIN, END)
    await cell.print("A")
    await cell.wait(0.5)
    assert not cell.board("A")["label"]["pressed"]


async def test_labels_without_a_free_board_are_wasted() -> None:
    cell = Cell()
    cell.inputs.printed = [Printed(1, [{"barcode": True, "text": "of yesterday"}])]
    await cell.world.begin()
    await cell.wait()
    await cell.print("nobody")
    await cell.run(0.7)
    await cell.carry(STOP, NEST)
    await cell.print("A")
    await cell.print("twice")
    assert cell.world.truth()["spilled_labels"] == ["nobody", "twice"]
    assert cell.board("A")["label"]["code"] == "A"


async def test_lamps_follow_the_outputs() -> None:
    cell = Cell()
    cell.inputs.outputs = [False, True, True]
    await cell.wait()
    assert cell.world.truth()["tower"] == {"green": True}


# ---------------------------------------------------------------------------------------------------- layout
@pytest.mark.parametrize(
    ("change", "names"),
    [
        (lambda whole: whole.update(feeder=PLAIN["feeder"]), "feeder or a belt"),
        (lambda whole: whole["belt"].update(pitch=0.05), "pitch"),
        (lambda whole: whole["belt"]["barriers"][0].update(at=0.1), "barriers"),
        (lambda whole: whole["labelling"]["press"].update(end=list(BEGIN)), "begin to end"),
        (lambda whole: whole["labelling"]["arm"].update(links=[0.1]), "links"),
    ],
)
def test_an_invalid_layout_is_refused(change: Any, names: str) -> None:
    whole = copy.deepcopy(WHOLE)
    change(whole)
    with pytest.raises(msgspec.ValidationError, match=names):
        msgspec.convert(whole, Layout)


def test_a_layout_lists_its_devices() -> None:
    assert LAYOUT.needs() == ["conveyor", "io", "printer", "arm"]
    assert msgspec.convert(PLAIN, Layout).needs() == []


# ---------------------------------------------------------------------------------------------------- camera
CAMERA = {
    "pose": {"position": [0.4, -0.3, 0.7], "orientation": [1.0, 0.0, 0.0, 0.0]},
    "board": [0.08, 0.06, 0.002],
    "things": [{"name": "box", "pose": {"position": [0.2, 0.5, 0.02]}, "size": [0.2, 0.2, 0.04]}],
}


async def test_the_camera_sees_boards_and_piles_in_boxes() -> None:
    cell = Cell()
    cell.world = World(msgspec.convert({**WHOLE, "camera": CAMERA}, Layout), BOARDS, cell.devices)
    await cell.world.begin()
    await cell.run(0.7)
    seen = cell.world.seen()
    assert "box" in seen
    assert seen["A"]["pose"]["position"] == pytest.approx([*STOP[:2], STOP[2] - 0.001])
    await cell.carry(STOP, (0.2, 0.5, 0.06))
    await cell.run(0.3)
    await cell.carry(STOP, (0.2, 0.5, 0.06))
    piled = [cell.world.seen()[code]["pose"]["position"][2] for code in "AB"]
    assert piled == pytest.approx([0.059, 0.061])
    await cell.world.remove("A")
    assert "A" not in cell.world.seen()


async def test_only_changes_are_sent_to_the_camera() -> None:
    cell = Cell()
    cell.world = World(msgspec.convert({**WHOLE, "camera": CAMERA}, Layout), BOARDS, cell.devices)
    await cell.world.begin()
    await cell.run(0.7)
    before = cell.world.seen()
    assert seen_objects.changes(before, cell.world.seen()) == (False, {})
    await cell.at(*STOP)
    await cell.grip(True)
    await cell.at(0.4, -0.2, 0.2)
    others, moved = seen_objects.changes(before, cell.world.seen())
    assert (others, set(moved)) == (False, {"A"})
    assert moved["A"]["position"] == pytest.approx([0.4, -0.2, 0.199])
    await cell.at(*NEST)
    await cell.grip(False)
    before = cell.world.seen()
    await cell.print("A")
    assert seen_objects.changes(before, cell.world.seen()) == (True, {})

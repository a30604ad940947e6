"""The inventory of parts, and its checkpoints on disk."""

import itertools
import random
from pathlib import Path

import pytest
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.parts import ConfirmedPart, DoneAction, PartInventory, Place, PlaceKind, RunCheckpoint
from arcor2_hw.exceptions import Conflict, NotFound, PartError, PartUnconfirmed, PlaceEmpty, PlaceOccupied, WrongPart
from arcor2_hw.runtime.checkpoints import CheckpointFile, stored_scenes
from arcor2_hw.runtime.ledger import Ledger

PLACES = [
    Place("stop", "stop", PlaceKind.FEEDER),
    Place("robot", "robot", PlaceKind.HOLDER),
    Place("nest", "nest", PlaceKind.HOLDER),
    Place("good", "good box", PlaceKind.GOOD, 0),
    Place("bad", "bad box", PlaceKind.BAD, 0),
]


@pytest.fixture
def ledger() -> Ledger:
    ledger = Ledger(PartInventory("scn_1"))
    ledger.set_places(PLACES)
    return ledger


def carry(ledger: Ledger, *places: str) -> None:
    for source, target in itertools.pairwise(places):
        ledger.complete(ledger.move(source, target))


def test_a_part_is_followed_from_the_feeder_to_the_box(ledger: Ledger) -> None:
    ledger.identify("stop", "A-1")
    carry(ledger, "stop", "robot", "nest")
    (part,) = ledger.inventory.parts
    assert (part.place, part.serial, part.moving_to, part.confirmed) == ("nest", "A-1", UNSET, True)
    carry(ledger, "nest", "robot")
    ledger.tests = True
    with pytest.raises(WrongPart, match="A-1 does not belong in good box: it has not passed its test"):
        carry(ledger, "robot", "good")
    ledger.judge("robot", True)
    with pytest.raises(WrongPart, match="A-1 does not belong in bad box: it has passed its test"):
        carry(ledger, "robot", "bad")
    carry(ledger, "robot", "good")
    inventory = ledger.inventory
    assert (inventory.counts.fed, inventory.counts.good, inventory.counts.in_cell) == (1, 1, 0)
    assert next(place.parts for place in inventory.places if place.id == "good") == ["A-1"]


def test_an_occupied_place_is_not_filled_twice(ledger: Ledger) -> None:
    ledger.identify("stop", "A-1")
    carry(ledger, "stop", "robot", "nest")
    carry(ledger, "stop", "robot")
    with pytest.raises(PlaceOccupied, match="nest is occupied: part A-1 is there"):
        ledger.move("robot", "nest")
    with pytest.raises(PlaceOccupied, match="robot is occupied: part #2 is there"):
        ledger.move("stop", "robot")
    assert ledger.inventory.counts.fed == 2  # a refused pick feeds nothing
    ledger.confirm([ConfirmedPart(1, ""), ConfirmedPart(2, "")])
    with pytest.raises(PlaceEmpty, match="no part at nest"):
        ledger.move("nest", "robot")


def test_after_a_failure_a_person_confirms_the_place(ledger: Ledger) -> None:
    ledger.identify("stop", "A-1")
    ledger.fail(ledger.move("stop", "robot"))
    with pytest.raises(PartUnconfirmed, match="A-1 is at stop or at robot"):
        ledger.move("robot", "nest")
    ledger.fail(ledger.move("stop", "robot"))  # repeated by decision
    with pytest.raises(NotFound, match="no place shelf"):
        ledger.confirm([ConfirmedPart(1, "shelf")])
    ledger.confirm([ConfirmedPart(1, "robot", "A-2")])
    ledger.complete(1)  # no effect, because a person has found the part
    carry(ledger, "robot", "nest")
    with pytest.raises(PlaceOccupied):
        ledger.confirm([ConfirmedPart(0, "nest")])
    with pytest.raises(Conflict, match="A-2"):
        ledger.confirm([ConfirmedPart(0, "robot", "A-2")])
    assert ledger.inventory.counts.fed == 1
    ledger.confirm([ConfirmedPart(0, "robot", "B-1"), ConfirmedPart(1, "")])
    assert (ledger.inventory.counts.fed, ledger.inventory.counts.rejected, ledger.inventory.counts.in_cell) == (2, 1, 1)


def test_a_code_that_is_expected_elsewhere_is_refused(ledger: Ledger) -> None:
    ledger.identify("stop", "A-1")
    ledger.identify("stop", "A-1")
    with pytest.raises(WrongPart, match="A-2 was read at stop, where part A-1 is expected"):
        ledger.identify("stop", "A-2")
    carry(ledger, "stop", "robot", "nest")
    with pytest.raises(WrongPart, match="A-1 was read at stop, but it is expected at nest"):
        ledger.identify("stop", "A-1")


def test_the_inventory_balances_after_random_operations(ledger: Ledger) -> None:
    seed = random.SystemRandom().randrange(1_000_000)
    chance = random.Random(seed)
    ids = [place.id for place in PLACES]
    for _ in range(3000):
        parts = ledger.inventory.parts
        try:
            match chance.randrange(6):
                case 0:
                    ledger.fail(ledger.move(chance.choice(ids), chance.choice(ids)))
                case 1:
                    ledger.judge(chance.choice(ids), chance.random() < 0.5)
                case 2 if parts:
                    part = chance.choice(parts)
                    exists = bool(part.serial) or chance.random() < 0.8
                    ledger.confirm([ConfirmedPart(part.number, chance.choice([*ids, ""]), exists=exists)])
                case 3:
                    ledger.identify("stop", str(chance.randrange(1000)))
                case 4:
                    ledger.interrupt()
                    ledger.confirm([ConfirmedPart(part.number, part.place) for part in parts])
                case _:
                    carry(ledger, chance.choice(ids), chance.choice(ids))
        except PartError:
            pass
        inventory, counts = ledger.inventory, ledger.inventory.counts
        assert counts.fed == counts.good + counts.bad + counts.rejected + len(inventory.parts), seed
        held = [part.place for part in inventory.parts]
        assert len(held) == len(set(held)), seed
    assert ledger.inventory.counts.good, seed


def test_a_part_that_a_sensor_has_reported_falsely_does_not_count(ledger: Ledger) -> None:
    carry(ledger, "stop", "robot")
    number = ledger.move("stop", "nest")
    ledger.fail(number)
    ledger.confirm([ConfirmedPart(1, "", exists=False)])
    assert (ledger.inventory.counts.fed, ledger.inventory.counts.in_cell, ledger.inventory.counts.rejected) == (1, 1, 0)
    ledger.confirm([ConfirmedPart(number, "nest")])
    ledger.identify("stop", "A-1")
    assert [part.number for part in ledger.inventory.parts] == [2, 3]
    with pytest.raises(Conflict, match="A-1 was read, so it exists"):
        ledger.confirm([ConfirmedPart(3, "", exists=False)])


def test_effects_that_ended_with_the_program_are_repeated() -> None:
    def done(branch: str, name: str, device: str, **more: bool) -> DoneAction:
        return DoneAction(branch, f"act_{name}", name, device, **more)

    belt = [done("next", "run", "belt", lasts=True), done("next", "wait", "io")]
    run = RunCheckpoint(1, "pkg", "", "", cycle=1, complete=True, done=[done("main", "scan", "reader"), *belt])
    assert [[each.name for each in part] for part in run.split_done()] == [["scan"], ["run", "wait"]]
    assert (run.published().continues, run.published().continues_at) == (True, ["run"])
    halted = replace(run, done=[*run.done, done("next", "halt", "belt")])
    assert halted.split_done() == (halted.done, [])
    moved = replace(run, done=[*run.done, done("next", "pick", "robot", moved=True)])
    assert (moved.why_not(), moved.published().continues) == ("pick", False)


def test_a_power_cut_leaves_the_previous_checkpoint(tmp_path: Path) -> None:
    file = CheckpointFile(tmp_path, "scn/1")
    assert file.read() is None
    for number in range(4):
        file.write(PartInventory(f"{number}"))
    newest = max(tmp_path.iterdir(), key=lambda path: path.read_bytes()[0])
    intact = newest.read_bytes()
    for damaged in (intact[:-1], intact[:10], b"", intact[:-1] + bytes([intact[-1] ^ 1])):
        newest.write_bytes(damaged)
        found = CheckpointFile(tmp_path, "scn/1").read()
        assert found is not None
        assert found.scene_id == "2"
    reopened = CheckpointFile(tmp_path, "scn/1")
    reopened.write(PartInventory("5"))
    found = CheckpointFile(tmp_path, "scn/1").read()
    assert found is not None
    assert found.scene_id == "5"
    assert stored_scenes(tmp_path) == ["scn/1"]

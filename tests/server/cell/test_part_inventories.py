"""The part inventory after an interruption, as clients see it."""

import os
import signal
from pathlib import Path
from types import SimpleNamespace

import pytest
from msgspec import UNSET

from arcor2_hw.data.base import now
from arcor2_hw.data.parts import (
    ConfirmedPart,
    DoneAction,
    Part,
    PartCounts,
    PartInventory,
    Place,
    PlaceKind,
    RunCheckpoint,
)
from arcor2_hw.data.rpc import ConfirmPartsArgs
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.runtime.checkpoints import CheckpointFile
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.part_inventories import PartInventories
from tests.e2e.harness import until
from tests.runtime.test_host_parts import ONE, write_package

from .conftest import Recorder, running_server
from .test_execution_history import subscribe

CONTINUE = {"id": "pkg_1", "on_error": "hold", "continues": True}
CONFIRMED = {"scene_id": "scn_1", "parts": [{"number": 1, "place": "obj_arm"}]}


async def test_after_an_interruption_a_person_confirms_where_parts_are(tmp_path: Path) -> None:
    (tmp_path / "hang").touch()
    async with running_server(tmp_path / "data") as server:
        subscribe(server, "PartsChanged")
        old = Recorder("old")
        server.services.hub.add(old)  # type: ignore[arg-type]
        write_package(server.services.settings.packages_dir / "pkg_1", tmp_path, ONE)
        await server.ask("RunPackage", {"id": "pkg_1", "on_error": "hold"})
        await server.client.event("PartsChanged", lambda data: data["parts"] and "moving_to" in data["parts"][0])
        (inventory,) = await server.ask("GetParts")
        assert (inventory.parts[0].serial, inventory.run) == ("A-1", UNSET)
        with pytest.raises(Arcor2Error, match="while an action runs: pick"):
            await server.ask("ConfirmParts", CONFIRMED)
        await until((tmp_path / "notes").exists, "the arm picks the part")
        host = server.services.execution._host.host
        os.kill(host.pid, signal.SIGKILL)
        await server.client.state("stopped", "PackageState")
        published = await server.client.event("PartsChanged")
        assert published["parts"] == [
            {"number": 1, "place": "obj_feeder", "serial": "A-1", "moving_to": "obj_arm", "confirmed": False}
        ]
        assert [action["action_name"] for action in published["run"]["actions"]] == ["pick"]
        assert "PartsChanged" not in str(old.got)

    async with running_server(tmp_path / "data") as server:  # as after a power cut
        subscribe(server, "PartsChanged", "Held")
        (inventory,) = await server.ask("GetParts")
        assert inventory.run.package_id == "pkg_1"
        assert [part.confirmed for part in inventory.parts] == [False]
        with pytest.raises(RequestRefused, match=r"Confirm where these parts are .*: A-1 \(feeder\)"):
            await server.ask("RunPackage", {"id": "pkg_1"})
        with pytest.raises(RequestRefused, match=r"Confirm where these parts are"):
            await server.ask("RunPackage", CONTINUE)
        await server.ask("ConfirmParts", CONFIRMED)
        published = await server.client.event("PartsChanged")
        assert published["parts"] == [{"number": 1, "place": "obj_arm", "serial": "A-1", "confirmed": True}]
        run = published["run"]
        assert (run["confirmed"], run["continues"], run["continues_at"], run["done"]) == (True, True, ["pick"], [])
        assert (tmp_path / "notes").read_text().split() == ["pick"]  # nothing has moved

        (tmp_path / "hang").unlink()
        await server.ask("RunPackage", CONTINUE)
        held = await server.client.event("Held")
        assert (held["kind"], held["action_name"]) == ("program_interrupted", "pick")
        await server.ask("DecideHeld", {"number": held["number"], "choice": "skip"})  # the part is in the gripper
        await server.client.state("stopped", "PackageState")
        assert (tmp_path / "notes").read_text().split() == ["pick", "place"]
        (inventory,) = await server.ask("GetParts")
        assert [(part.serial, part.place) for part in inventory.parts] == [("A-1", "obj_nest")]
        with pytest.raises(RequestRefused, match="was not interrupted"):
            await server.ask("RunPackage", CONTINUE)


async def test_parts_are_confirmed_one_after_the_other(tmp_path: Path) -> None:
    hub = SimpleNamespace(broadcast=lambda event: None)
    inventory = PartInventories(hub, tmp_path)  # type: ignore[arg-type]
    places = [Place(each, each, PlaceKind.HOLDER) for each in ("nest", "arm")]
    run = RunCheckpoint(1, "pkg_1", "", now(), cycle=1, complete=True)
    file = CheckpointFile(tmp_path, "scn_1")
    file.write(PartInventory("scn_1", [Part(1, "nest"), Part(2, "arm")], places, PartCounts(2, in_cell=2), run))
    file.close()
    for part, left in ((ConfirmedPart(1, "nest"), [2]), (ConfirmedPart(2, "arm"), [])):
        await inventory.confirm(None, ConfirmPartsArgs("scn_1", [part]), "ann")
        (found,) = await inventory.all()
        assert [each.number for each in found.unconfirmed] == left
        assert found.run.confirmed is (not left)  # type: ignore[union-attr]
    await inventory.confirm(None, ConfirmPartsArgs("scn_1", [], dismiss=True), "ann")
    (found,) = await inventory.all()
    assert (found.run, len(found.parts)) == (UNSET, 2)
    with pytest.raises(RequestRefused, match="was not interrupted"):
        await inventory.require_continues("scn_1", "pkg_1")


def test_a_run_that_cannot_continue_names_the_missing_result() -> None:
    done = [DoneAction("main", "act_1", "picture", "obj_camera", stored=False)]
    run = RunCheckpoint(1, "pkg_1", "", now(), cycle=1, complete=True, done=done)
    assert (run.published().continues, run.published().missing) == (False, "picture")


async def test_a_person_chooses_where_an_interrupted_program_continues(tmp_path: Path) -> None:
    inventory = PartInventories(SimpleNamespace(broadcast=lambda event: None), tmp_path)  # type: ignore[arg-type]
    places = [Place("feeder", "feeder", PlaceKind.FEEDER, 0)]
    places += [Place(each, each, PlaceKind.HOLDER) for each in ("arm", "nest")]
    done = [
        DoneAction("main", "act_scan", "scan", "reader", results=['"A-1"']),
        DoneAction("main", "act_pick", "pick", "arm", moved=True, source="feeder", target="arm"),
        DoneAction("act_b", "act_light", "light", "lamp"),  # of a branch of parallel work
        DoneAction("main", "act_insert", "insert", "arm", moved=True, source="arm", target="nest"),
        DoneAction("main", "act_look", "look", "camera", stored=False),
        DoneAction("main", "act_test", "test", "tester", results=["true"]),
    ]
    run = RunCheckpoint(1, "pkg_1", "", now(), cycle=1, complete=True, done=done)
    file = CheckpointFile(tmp_path, "scn_1")
    file.write(PartInventory("scn_1", [Part(1, "nest"), Part(2, "arm")], places, PartCounts(2, in_cell=2), run))
    file.close()
    with pytest.raises(RequestRefused, match="Confirm first"):
        await inventory.require_continues("scn_1", "pkg_1", 0)

    async def confirmed(*parts: ConfirmedPart) -> dict[str, str]:
        await inventory.confirm(None, ConfirmPartsArgs("scn_1", list(parts)), "ann")
        (found,) = await inventory.all()
        return {each.name: each.text for each in found.run.restarts}  # type: ignore[union-attr]

    assert await confirmed(ConfirmedPart(1, "nest"), ConfirmedPart(2, "arm")) == {
        "scan": "pick needs room at arm, where part #2 is.",
        "pick": "pick needs room at arm, where part #2 is.",
        "insert": "insert needs room at nest, where part #1 is.",
        "look": "",
        "test": "The result of look is not stored, or it would have to be repeated.",
    }
    with pytest.raises(RequestRefused, match="insert needs room at nest"):
        await inventory.require_continues("scn_1", "pkg_1", 3)
    with pytest.raises(RequestRefused, match="no action 2"):
        await inventory.require_continues("scn_1", "pkg_1", 2)
    found = await confirmed(ConfirmedPart(1, ""), ConfirmedPart(2, "nest"))
    assert found["insert"] == "insert needs a part at arm, and there is none."
    assert await inventory.require_continues("scn_1", "pkg_1", 0) == 1

"""The record of a run that cannot start."""

from pathlib import Path

import pytest

from arcor2_hw.data.parts import Part, PartInventory
from arcor2_hw.data.project import Project
from arcor2_hw.exceptions import Conflict, PartUnconfirmed
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.checkpoints import CheckpointFile
from arcor2_hw.runtime.record import RunRecord


def test_a_run_that_cannot_start_leaves_the_inventory_as_it_is(tmp_path: Path) -> None:
    inventory = PartInventory("scn_1", [Part(1, "obj_feeder", "A-1", confirmed=False)])
    file = CheckpointFile(tmp_path, "scn_1")
    file.write(inventory)
    file.close()
    record = RunRecord(lambda scene: CheckpointFile(tmp_path, scene), 7, "pkg_1", lambda _: None)
    with pytest.raises(PartUnconfirmed, match="A-1"):
        record.open(Project(id="prj_1", name="project", scene_id="scn_1"), Cell(), tmp_path)
    with pytest.raises(Conflict):
        record.confirm([])
    record.close()
    assert CheckpointFile(tmp_path, "scn_1").read() == inventory

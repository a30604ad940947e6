"""A cable that is cut and repaired between a server and a node, in network namespaces."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.server.nodes.cable import Cable, CannotIsolate
from tests.server.nodes.conftest import NODE


def cut_and_heal(cable: Cable, folder: Path) -> dict[str, object]:
    words = [json.dumps(each) for each in (cable.cut(), cable.heal(), cable.at_node)]
    command = [*cable.at_hub, sys.executable, "-m", "tests.server.nodes.cable_cut", str(folder), *words]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True, timeout=200)
    found: dict[str, object] = json.loads(done.stdout)
    return found


def test_motion_stops_after_a_cut_and_nothing_moves_after_the_repair(tmp_path: Path) -> None:
    try:
        with Cable() as cable:
            found = cut_and_heal(cable, tmp_path)
    except CannotIsolate as reason:
        pytest.skip(f"no network namespaces: {reason}")
    (loss,) = found["reasons"]  # type: ignore[misc]
    assert f"the connection to the node {NODE} was lost" in loss
    assert found["unknown"], "the outcome of an unanswered command is not unknown"
    assert not found["late"], "a command from before the repair was executed"

"""The board of nodes, which is built from their announcements, with a simulated clock."""

from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.cell import Cell, CellDevice, assigned_nodes, node_of, objects_by_node
from arcor2_hw.data.events import Event
from arcor2_hw.data.nodes import NodesData, NodeState
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import SeveralNodes
from arcor2_hw.messages import Message
from arcor2_server.hosts.placement import place
from arcor2_server.nodes.board import FORGOTTEN_AFTER, LOAD_PERIOD, SILENT_AFTER, NodeBoard
from arcor2_server.nodes.presence import Announcement, LastError, RunningSession, own_version

PRESS = Announcement("press", own_version(), "pc-7", "run-1", 60.0, 0.5, 10**9, [])


class Board:
    """A board without a broker, and what it has published."""

    def __init__(self, assigned: dict[str, str], configured: bool = True) -> None:
        self.now = 1000.0
        self.needed: dict[str, list[str]] = {}
        self.published: list[NodesData] = []
        hub: Any = SimpleNamespace(broadcast=self._broadcast)
        self.board = NodeBoard(hub, assigned, lambda: self.needed, lambda: configured, clock=lambda: self.now)

    def _broadcast(self, event: Event) -> None:
        self.published.append(event.data)

    def after(self, seconds: float, *announced: Announcement) -> list[NodesData]:
        """Return the published events after some time, with announcements of nodes."""
        self.now += seconds
        for each in announced:
            self.board.take(each)
        self.board.check()
        found, self.published = self.published, []
        return found


def test_a_node_is_connected_then_silent_and_finally_forgotten() -> None:
    board = Board({})
    assert board.after(0.0) == [NodesData(True)]
    [seen] = board.after(1.0, PRESS)
    [node] = seen.nodes
    assert (node.name, node.state, node.computer, node.load) == ("press", NodeState.CONNECTED, "pc-7", 0.5)
    assert board.after(1.0, PRESS) == []
    busy = replace(PRESS, load=0.9, free=5)
    assert board.after(1.0, busy) == []  # a change of the load alone is published later
    [later] = board.after(LOAD_PERIOD, busy)
    assert (later.nodes[0].load, later.nodes[0].since) == (0.9, node.since)
    [silent] = board.after(SILENT_AFTER + 0.1)
    assert (silent.nodes[0].state, bool(silent.nodes[0].seen)) == (NodeState.SILENT, True)
    [back] = board.after(1.0, PRESS)
    assert back.nodes[0].state is NodeState.CONNECTED
    [gone] = board.after(FORGOTTEN_AFTER + 1.0)
    assert gone.nodes == []


def test_another_version_sessions_and_errors_are_published() -> None:
    board = Board({})
    error = LastError(Message.of("The node {node} failed.", node="press"), 5.0)
    session = RunningSession("s1", "scene", "cell", 3.0)
    [data] = board.after(0.0, replace(PRESS, version="0.0.1", sessions=[session], error=error))
    [node] = data.nodes
    assert (node.state, node.version) == (NodeState.OTHER_VERSION, "0.0.1")
    assert [(each.kind, each.name) for each in node.sessions] == [("scene", "cell")]
    assert node.error
    assert (node.error.text, node.error.key) == ("The node press failed.", "The node {node} failed.")
    again = replace(
        PRESS, version="0.0.1", sessions=[replace(session, age=4.0)], error=replace(error, age=6.0), age=61.0
    )
    assert board.after(1.0, again) == [], "changed ages alone were published"


def test_nodes_that_the_scene_needs_are_lost_after_a_while() -> None:
    board = Board({"lamp": "oven"})
    board.needed = {"press": ["arm", "belt"]}
    [data] = board.after(0.0)
    assert [(each.name, each.state, each.objects) for each in data.nodes] == [
        ("oven", NodeState.SILENT, []),
        ("press", NodeState.SILENT, ["arm", "belt"]),
    ]
    assert data.assigned == {"lamp": "oven"}
    assert board.board.lost() == {}, "it may not have announced itself yet"
    board.after(SILENT_AFTER + 0.1)
    assert board.board.lost() == {"press": ["arm", "belt"]}
    board.after(0.1, PRESS)
    assert board.board.lost() == {}
    board.after(SILENT_AFTER + 0.1)
    assert board.board.lost() == {"press": ["arm", "belt"]}
    board.needed = {}
    assert board.board.lost() == {}


def test_objects_that_cannot_work_together_are_published() -> None:
    """The board applies the same rule as the start of a scene."""

    def apart() -> Message | None:
        try:
            place(None, objects, lambda name, base: (name, base) == ("Gripper", "HoldsParts"))
        except SeveralNodes as error:
            return error.message
        return None

    hub: Any = SimpleNamespace(broadcast=lambda _: None)
    board = NodeBoard(hub, {}, dict, lambda: True, apart=apart)
    objects = [SceneObject("left", "Gripper", id="1", node="press"), SceneObject("right", "Gripper", id="2")]
    assert "left (node press), right (the computer of the server)" in str(board.data().apart)
    del objects[1]
    assert board.data().apart is UNSET


def test_a_node_cannot_pretend_to_be_another_one() -> None:
    board = Board({})
    for subject, body in (
        ("arcor2.oven.presence", msgspec.json.encode(PRESS)),
        ("arcor2.press.presence", b"{}"),
        ("arcor2.oven.presence", msgspec.json.encode(replace(PRESS, name="oven"))),
    ):
        board.board.take_encoded(subject, body)
    assert [each.name for each in board.board.data().nodes] == ["oven"]


def test_without_a_broker_no_node_is_known_or_lost() -> None:
    board = Board({}, configured=False)
    board.needed = {"press": ["arm"]}
    assert board.board.data() == NodesData(False)
    board.after(SILENT_AFTER + 0.1)
    assert board.board.lost() == {}


def test_the_cell_file_overrides_the_node_of_a_scene() -> None:
    cell = Cell([CellDevice("arm", "Arm", node="press"), CellDevice("belt", "Belt")])
    arm, belt, box = (
        SceneObject(name, "T", node=node) for name, node in (("arm", "oven"), ("belt", "saw"), ("box", ""))
    )
    assert objects_by_node(cell, [arm, belt, box]) == {"press": ["arm"], "saw": ["belt"]}
    assert objects_by_node(None, [arm, box]) == {"oven": ["arm"]}
    assert assigned_nodes(cell) == {"arm": "press"}
    assert [node_of(cell, each) for each in (arm, belt, box)] == ["press", "saw", ""]


@pytest.mark.parametrize("name", ["*", "press.x", "press\n", "Press", "-x", "x" * 64])
def test_a_node_name_that_cannot_be_part_of_a_subject_is_invalid(name: str) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert({"name": "arm", "type": "Arm", "node": name}, SceneObject)

"""The document: random edits can be undone, and the journal restores the same document."""

import random
from collections.abc import Callable

import msgspec
import pytest
from hypothesis import given, settings, strategies as st
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, new_id
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.project import (
    Action,
    ActionParameter,
    ActionPoint,
    BareActionPoint,
    Flow,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectLogicIf,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import Scene, SceneObject, SceneObjectOverride
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.documents.changes import (
    Change,
    Item,
    Kind,
    decode_changes,
    decode_items,
    encode_rows,
)
from arcor2_server.documents.document import Document


def some_project(points: int = 3, actions: int = 2) -> tuple[Scene, Project]:
    scene = Scene("s", id="scn_1", objects=[SceneObject("table", "Table", Pose(), [], "obj_1")])
    chain = []
    for number in range(points):
        parent = ("obj_1", UNSET, f"acp_{number - 1}")[number % 3]
        chain.append(
            ActionPoint(
                f"p{number}",
                Position(float(number)),
                parent,
                id=f"acp_{number}",
                orientations=[NamedOrientation("o", Orientation(), f"ori_{number}")],
                robot_joints=[ProjectRobotJoints("j", "obj_1", [Joint("a", 0.1)], True, id=f"joi_{number}")],
                actions=[
                    Action(
                        f"a{number}_{index}",
                        "obj_1/move",
                        f"act_{number}_{index}",
                        [ActionParameter("pose", "pose", f'"ori_{number}"')],
                        [Flow(outputs=[f"r{number}_{index}"])],
                    )
                    for index in range(actions)
                ],
            )
        )
    logic = [LogicItem("START", "act_0_0", id="lit_0"), LogicItem("act_0_0", "END", id="lit_1")]
    parameters = [ProjectParameter("speed", "double", "0.5", id="pco_0")]
    overrides = [SceneObjectOverride("obj_1", [])]
    return scene, Project(
        "p", "scn_1", id="pro_1", action_points=chain, logic=logic, parameters=parameters, object_overrides=overrides
    )


def state(document: Document) -> tuple[bytes, Scene | None, Project | None]:
    return encode_rows(document.items()), document.scene, document.project


def lookups(document: Document) -> dict[str, object]:
    """Return all lookups, without the empty ones."""
    indexes = document._indexes
    names = ("names", "users", "leaving", "arriving", "points")
    return {name: {key: set(ids) for key, ids in getattr(indexes, name).items()} for name in names} | {
        "owned": {p: {k: set(i) for k, i in kinds.items() if i} for p, kinds in indexes.owned.items()}
    }


def test_a_document_round_trips() -> None:
    scene, project = some_project()
    document = Document.of(scene, project)
    assert (document.scene, document.project) == (scene, project)
    assert Document.of(scene).project is None
    assert Document().scene is None


def _random_edit(document: Document, draw: random.Random) -> list[Change]:
    """Make one or several of the changes that requests can make."""

    def some(kind: Kind) -> Item | None:
        items = document.of_kind(kind)
        return draw.choice(items) if items else None

    def add_point() -> list[Change]:
        parent = some(draw.choice((Kind.POINT, Kind.OBJECT)))
        key = new_id("acp")
        value = BareActionPoint(key[-6:], Position(draw.random()), parent.id if parent else UNSET, id=key)
        return [document.add(Kind.POINT, key, value)]

    def add_action() -> list[Change]:
        point, orientation = some(Kind.POINT), some(Kind.ORIENTATION)
        if point is None:
            return []
        key = new_id("act")
        parameters = [ActionParameter("pose", "pose", f'"{orientation.id}"')] if orientation else []
        value = Action(key[-6:], "obj_1/move", key, parameters, [Flow(outputs=[draw.choice("abc") + key[-6:]])])
        return [document.add(Kind.ACTION, key, value, point.id)]

    def add_logic() -> list[Change]:
        one, other = some(Kind.ACTION), some(Kind.ACTION)
        if one is None or other is None:
            return []
        key = new_id("lit")
        condition = ProjectLogicIf(f"{one.id}/default/0", "true") if draw.random() < 0.5 else UNSET
        return [document.add(Kind.LOGIC, key, LogicItem(one.id, other.id, condition, key))]

    def rename() -> list[Change]:
        item = some(draw.choice((Kind.POINT, Kind.ACTION, Kind.ORIENTATION, Kind.JOINTS, Kind.PARAMETER, Kind.SCENE)))
        return [document.update(item.kind, item.id, replace(item.value, name=f"n{draw.random()}"))] if item else []

    def remove() -> list[Change]:
        item = some(draw.choice((Kind.ACTION, Kind.ORIENTATION, Kind.LOGIC, Kind.PARAMETER, Kind.OVERRIDE)))
        return [document.remove(item.kind, item.id)] if item else []

    def remove_point() -> list[Change]:
        item = some(Kind.POINT)
        if item is None:
            return []
        owned = [i for kind in (Kind.ACTION, Kind.JOINTS, Kind.ORIENTATION) for i in document.owned(item.id, kind)]
        return [*(document.remove(i.kind, i.id) for i in owned), document.remove(Kind.POINT, item.id)]

    edits: tuple[Callable[[], list[Change]], ...] = (add_point, add_action, add_logic, rename, remove, remove_point)
    return draw.choice(edits)()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), length=st.integers(1, 30))
def test_random_edits_are_undone_redone_and_replayed(seed: int, length: int) -> None:
    draw = random.Random(seed)
    document = Document.of(*some_project())
    base = encode_rows(document.items())
    steps, states = [], [state(document)]
    for _ in range(length):
        changes = _random_edit(document, draw)
        document.apply(changes)
        steps.append(changes)
        states.append(state(document))
    # The lookups are the same as in a document made of its items.
    assert lookups(document) == lookups(Document(document.items()))
    # Through the journal: base and changes, written and read, result in the same document.
    replayed = Document(decode_items(base))
    for changes in steps:
        replayed.apply(decode_changes(encode_rows(changes)))
    assert state(replayed) == states[-1]
    assert lookups(replayed) == lookups(document)
    # Undo step by step, the order of the items included, then redo.
    for changes, before in zip(reversed(steps), reversed(states[:-1]), strict=True):
        document.apply([change.inverse() for change in reversed(changes)])
        assert state(document) == before
    for changes, after in zip(steps, states[1:], strict=True):
        document.apply(changes)
        assert state(document) == after
    assert lookups(document) == lookups(replayed)


def test_a_document_indexes_names_users_and_trees() -> None:
    document = Document.of(*some_project())
    assert document.named(Kind.POINT, "p1") == "acp_1"
    assert document.named("output", "r2_1") == "act_2_1"
    assert document.named(Kind.ORIENTATION, "o", "acp_1") == "ori_1"
    assert document.named(Kind.ORIENTATION, "x", "acp_1") is None
    assert [user.id for user in document.users_of("ori_1")] == ["act_1_0", "act_1_1"]
    assert document.root_of("act_0_1") == "obj_1"
    assert document.root_of("ori_2") == "acp_1"
    assert set(document.tree_of("acp_1")) == {
        "acp_2", "ori_1", "joi_1", "act_1_0", "act_1_1", "ori_2", "joi_2", "act_2_0", "act_2_1"
    }  # fmt: skip
    assert document.tree_of("pco_0") == []
    assert {document.root_of(i) for i in ("scn_1", "pro_1", "pco_0")} == {"scn_1", "pro_1", "pco_0"}
    with pytest.raises(NotFound):
        document.root_of("lit_0")
    assert [item.id for item in document.outgoing("START")] == ["lit_0"]
    assert [item.id for item in document.incoming("END")] == ["lit_1"]


def test_a_closed_document_refuses_changes() -> None:
    document = Document.of(*some_project())
    with document.retiring():
        pass
    for make in (
        lambda: document.add(Kind.PARAMETER, "x", ProjectParameter("x", "double", "1.0")),
        lambda: document.update(Kind.POINT, "acp_0", None),
        lambda: document.remove(Kind.POINT, "acp_0"),
    ):
        with pytest.raises(InvalidData, match="closed"):
            make()


def test_damaged_rows_are_reported() -> None:
    with pytest.raises(msgspec.DecodeError):
        decode_items(b'[["action_point","x"]]')
    with pytest.raises(msgspec.DecodeError):
        decode_changes(b'[["action","x","y",1,null,{"name":1}]]')

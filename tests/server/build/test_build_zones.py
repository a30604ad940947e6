"""Build reports overlapping zones, and robots that may wait for each other's zone for ever."""

import json

import pytest

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.interlocks import Interlock, InterlockTarget
from arcor2_hw.data.object_type import Box, Cylinder, Models, Sphere
from arcor2_hw.data.project import (
    END,
    START,
    Action,
    ActionParameter,
    ActionPoint,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectFunction,
)
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.build.zones import check_zones, overlap

TURNED = Orientation(0.0, 0.0, 0.3826834, 0.9238795)  # by 45°
MODELS = {"Left": Box("Left", 0.4, 0.4, 0.4), "Right": Box("Right", 0.4, 0.4, 0.4)}
PLACES = {"left": 0.0, "right": 1.0, "free": 3.0, "beside": -2.0}


@pytest.mark.parametrize(
    ("one", "other", "x", "orientation", "expected"),
    [
        (Box("a", 1, 1, 1), Box("b", 1, 1, 1), 0.9, Orientation(), True),
        (Box("a", 1, 1, 1), Box("b", 1, 1, 1), 1.0, Orientation(), False),
        (Box("a", 1, 1, 1), Box("b", 1, 1, 1), 1.1, TURNED, True),
        (Box("a", 1, 1, 1), Box("b", 1, 1, 1), 1.25, TURNED, False),
        (Box("a", 1, 1, 1), Sphere("b", 0.5), 0.9, Orientation(), True),
        (Sphere("a", 0.5), Box("b", 1, 1, 1), 1.01, Orientation(), False),
        (Sphere("a", 0.5), Sphere("b", 0.5), 0.99, Orientation(), True),
        (Cylinder("a", 0.5, 1), Sphere("b", 0.5), 1.2, Orientation(), False),
    ],
)
def test_overlapping_bodies_are_detected(
    one: Models, other: Models, x: float, orientation: Orientation, expected: bool
) -> None:
    first = Obstacle("a", one, Pose())
    second = Obstacle("b", other, Pose(Position(x, 0.0, 0.0), orientation))
    assert overlap(first, second) is expected
    assert overlap(second, first) is expected


def make_scene(right: float = 1.0) -> Scene:
    objects = [SceneObject(name, "Arm", Pose(), id=f"obj_{name}") for name in ("alpha", "beta")]
    objects += [
        SceneObject(name, name.capitalize(), Pose(Position(x, 0.0, 0.0)), id=f"obj_{name}")
        for name, x in (("left", 0.0), ("right", right))
    ]
    locks = [Interlock(name, InterlockTarget.ZONE, f"obj_{name}", id=f"ilk_{name}") for name in ("left", "right")]
    return Scene("scene", id="scn_1", objects=objects, interlocks=locks)


SCENE = make_scene()


def move(text: str) -> Action:
    """Return the action `alpha left`: a motion of this robot to this place."""
    robot, place = text.split()
    pose = ActionParameter("pose", "pose", json.dumps(f"ori_{place}"))
    return Action(text, f"obj_{robot}/move", f"act_{robot}_{place}", parameters=[pose])


def chain(ids: list[str]) -> list[LogicItem]:
    return [LogicItem(a, b, id=f"lit_{a}") for a, b in zip([START, *ids], [*ids, END], strict=True)]


def points(*actions: Action) -> list[ActionPoint]:
    found = [
        ActionPoint(
            name,
            Position(x, 0.0, 0.0),
            id=f"acp_{name}",
            orientations=[NamedOrientation("o", Orientation(), f"ori_{name}")],
        )
        for name, x in PLACES.items()
    ]
    found[0].actions.extend(actions)
    return found


def sequential(*moves: str) -> Project:
    actions = [move(each) for each in moves]
    return Project("project", "scn_1", id="pro_1", action_points=points(*actions), logic=chain([a.id for a in actions]))


def parallel(first: list[str], second: list[str]) -> Project:
    functions = []
    for name, moves in (("one", first), ("two", second)):
        actions = [move(each) for each in moves]
        functions.append(ProjectFunction(name, actions, chain([a.id for a in actions]), id=f"pfu_{name}"))
    calls = [Action(f"call {name}", f"pfu_{name}/call", f"act_{name}") for name in ("one", "two")]
    both = Action("both", "functions/parallel", "act_both", branches=["act_one", "act_two"])
    return Project(
        "project",
        "scn_1",
        id="pro_1",
        action_points=points(*calls, both),
        functions=functions,
        logic=chain(["act_both"]),
    )


def check(project: Project, scene: Scene = SCENE) -> None:
    check_zones(scene, project, MODELS.get, lambda name: name == "Arm")


def test_overlapping_zones_are_refused() -> None:
    with pytest.raises(InvalidProject, match="The zones left and right overlap"):
        check(sequential(), make_scene(right=0.3))


@pytest.mark.parametrize(
    ("project", "reason"),
    [
        (
            sequential("alpha left", "beta left"),
            "'beta left' moves beta into left, in which alpha stays after 'alpha left'",
        ),
        (sequential("alpha beside", "beta right", "alpha free"), "alpha into right, in which beta stays"),
        (sequential("alpha free", "beta free", "alpha left", "beta beside", "alpha free"), "beta into left"),
        (parallel(["alpha left", "alpha right", "alpha free"], ["beta right", "beta left", "beta beside"]), "needs"),
        (parallel(["alpha left"], ["beta left", "beta beside"]), "in which alpha stays after 'alpha left'"),
    ],
)
def test_possible_deadlocks_are_refused(project: Project, reason: str) -> None:
    with pytest.raises(InvalidProject, match=reason):
        check(project)


@pytest.mark.parametrize(
    "project",
    [
        sequential("alpha left", "alpha beside", "beta right", "beta free"),
        parallel(["alpha left", "alpha beside"], ["beta right", "beta free"]),
        parallel(["alpha left", "alpha right", "alpha free"], ["beta left", "beta right", "beta free"]),
        sequential("alpha left"),
    ],
)
def test_programs_without_deadlocks_are_accepted(project: Project) -> None:
    check(project)

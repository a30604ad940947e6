"""Checks of zones before a program runs: zones that overlap, and robots that may wait for each other forever."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.collision.lines import first_hit
from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Models, Sphere
from arcor2_hw.data.project import CALL, END, START, Action, ActionParameterType, LogicItem, Project
from arcor2_hw.data.project_index import ProjectIndex, global_pose
from arcor2_hw.data.scene import Scene, zones_of
from arcor2_hw.exceptions import InvalidProject, NotFound
from arcor2_server.documents.item_indexes import action_of, reference

_TOUCHING: Final = 1e-6
"""Overlap up to which two bodies only touch each other, m."""
_PLACES: Final = ("pose", "position", "joints")
"""Types of parameters that state the target of a motion."""
_COMPUTED: Final = (ActionParameterType.LINK, ActionParameterType.FUNCTION_PARAMETER)

Vector = tuple[float, float, float]


# ------------------------------------------------------------------------------------------------ overlap
class _Block(NamedTuple):
    """A box around a body: centre, axes, half lengths."""

    centre: Vector
    axes: tuple[Vector, Vector, Vector]
    half: Vector


def _block(model: Models, pose: Pose) -> _Block:
    match model:
        case Box():
            half = (model.size_x / 2, model.size_y / 2, model.size_z / 2)
        case Cylinder():
            half = (model.radius, model.radius, model.height / 2)
        case _:
            half = (0.0, 0.0, 0.0)
    x, y, z = (_vector(Position(*unit).rotated(pose.orientation)) for unit in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    return _Block(_vector(pose.position), (x, y, z), half)


def _vector(position: Position) -> Vector:
    return position.x, position.y, position.z


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return math.fsum(i * j for i, j in zip(a, b, strict=True))


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def overlap(first: Obstacle, second: Obstacle) -> bool:
    """Return whether two bodies overlap. A cylinder counts as the box around it."""
    spheres = [each for each in (first, second) if isinstance(each.model, Sphere)]
    if len(spheres) == 2:
        reach = math.fsum(each.model.radius for each in spheres if isinstance(each.model, Sphere))
        return first.pose.position.distance_to(second.pose.position) < reach - _TOUCHING
    if spheres:
        ball, block = (first, second) if isinstance(first.model, Sphere) else (second, first)
        assert isinstance(ball.model, Sphere)
        found = _block(block.model, block.pose)
        way = [a - b for a, b in zip(_vector(ball.pose.position), found.centre, strict=True)]
        beyond = [max(abs(_dot(way, axis)) - half, 0.0) for axis, half in zip(found.axes, found.half, strict=True)]
        return math.hypot(*beyond) < ball.model.radius - _TOUCHING
    a, b = _block(first.model, first.pose), _block(second.model, second.pose)
    way = [j - i for i, j in zip(a.centre, b.centre, strict=True)]
    crossed = (_cross(i, j) for i in a.axes for j in b.axes)
    for axis in (*a.axes, *b.axes, *crossed):  # the separating axis theorem
        if (length := math.hypot(*axis)) < 1e-9:
            continue
        reach = math.fsum(h * abs(_dot(i, axis)) for each in (a, b) for i, h in zip(each.axes, each.half, strict=True))
        if abs(_dot(way, axis)) - reach > -_TOUCHING * length:
            return False
    return True


# ------------------------------------------------------------------------------------------------ deadlocks
class _Stay(NamedTuple):
    """Where a robot may be after an action: the zones of its last target, and the name of the action."""

    zones: frozenset[str]
    at: Vector
    action: str


class _Need(NamedTuple):
    """A robot needs a zone while it has others."""

    robot: str
    held: frozenset[str]
    zone: str
    action: str


_State = dict[str, frozenset[_Stay]]
"""Possible places of each robot. A robot whose place is unknown is missing."""


class _Walk:
    """Follows all paths of a project, and finds the zones that its robots need and stay in."""

    def __init__(self, scene: Scene, project: Project, zones: Mapping[str, Obstacle], robots: frozenset[str]) -> None:
        self._index, self._zones, self._robots = ProjectIndex(scene, project), zones, robots
        self._actions = {action.id: action for action in project.all_actions()}
        self._functions = {function.id: function for function in project.functions}
        self._project = project

    def name(self, object_id: str) -> str:
        return self._index.scene_object(object_id).name

    def check(self) -> None:
        state: _State = {}
        for _ in range(2):  # the program repeats its logic
            state = self._run(self._project.logic, state, frozenset(), [])

    def _run(self, logic: Sequence[LogicItem], start: _State, elsewhere: frozenset[str], needs: list[_Need]) -> _State:
        """Return the possible places of the robots at the end of a program or function.

        Args:
            logic: its logic items.
            start: their possible places at its start.
            elsewhere: robots that other branches move at the same time.
            needs: is extended by the zones that its actions need.
        """
        following: dict[str, list[str]] = {}
        for item in logic:
            following.setdefault(action_of(item.start), []).append(action_of(item.end))
        before: dict[str, _State] = {START: start}
        waiting = [START]
        while waiting:
            here = waiting.pop()
            state = before[here]
            if (action := self._actions.get(here)) is not None:
                state = self._after(action, state, elsewhere, needs)
            for end in following.get(here, ()):
                merged = _merged([before[end], state]) if end in before else state
                if end not in before or merged != before[end]:
                    before[end] = merged
                    waiting.append(end)
        return before.get(END, {})

    def _after(self, action: Action, state: _State, elsewhere: frozenset[str], needs: list[_Need]) -> _State:
        owner, _, method = action.type.partition("/")
        if action.is_parallel:
            return self._after_parallel(action, state, needs)
        if method == CALL and owner in self._functions:
            return self._run(self._functions[owner].logic, state, elsewhere, needs)
        places = [one for one in action.parameters if one.type in (*_PLACES, *_COMPUTED)]
        if owner not in self._robots or not places:
            return state
        targets = [self._target(one.type, one.value) for one in places]
        if None in targets:
            return {robot: stays for robot, stays in state.items() if robot != owner}
        known = [each for each in targets if each is not None]
        mine = state.get(owner, frozenset())
        paths = [[stay.at, *known] for stay in mine] or [known]
        touched = {zone for path in paths for zone in self._touched(path)}
        for robot, stays in state.items():
            if robot == owner or robot in elsewhere:
                continue
            for stay in stays:
                for zone in sorted(stay.zones & touched):
                    self._refuse_kept(action.name, owner, zone, robot, stay.action)
        held = mine or frozenset({_Stay(frozenset(), known[0], "")})
        needs += [_Need(owner, one.zones, zone, action.name) for one in held for zone in touched - one.zones]
        zones = frozenset(self._touched([known[-1], known[-1]]))
        return state | {owner: frozenset({_Stay(zones, known[-1], action.name)})}

    def _after_parallel(self, action: Action, state: _State, needs: list[_Need]) -> _State:
        calls = [self._actions[key].type.partition("/")[0] for key in action.branches or () if key in self._actions]
        functions = [key for key in calls if key in self._functions]
        moved = [self._moved(key) for key in functions]
        found: list[list[_Need]] = []
        ends: list[_State] = []
        for number, key in enumerate(functions):
            own: list[_Need] = []
            others = frozenset().union(*(robots for other, robots in enumerate(moved) if other != number))
            ends.append(self._run(self._functions[key].logic, state, others, own))
            found.append(own)
        needs += [need for own in found for need in own]
        self._check_kept(moved, ends, found)
        self._check_cycles(found)
        after = dict(state)
        for robots, end in zip(moved, ends, strict=True):
            for robot in robots:
                after.pop(robot, None)
                if robot in end:
                    after[robot] = end[robot]
        return after

    def _check_kept(self, moved: Sequence[frozenset[str]], ends: Sequence[_State], found: list[list[_Need]]) -> None:
        """Refuse a branch that ends with a robot in a zone that another branch needs."""
        for one, end in enumerate(ends):
            for robot in moved[one] & end.keys():
                for stay in end[robot]:
                    for need in (need for other, own in enumerate(found) if other != one for need in own):
                        if need.zone in stay.zones:
                            self._refuse_kept(need.action, need.robot, need.zone, robot, stay.action)

    def _check_cycles(self, found: list[list[_Need]]) -> None:
        """Refuse branches whose robots may each wait for a zone of the next one."""
        for count in range(2, len(found) + 1):
            for branches in itertools.permutations(range(len(found)), count):
                for needs in itertools.product(*({*found[one]} for one in branches)):
                    pairs = zip(needs, (*needs[1:], needs[0]), strict=True)
                    if all(need.zone in after.held for need, after in pairs):
                        first, second = needs[0], needs[1]
                        raise InvalidProject(
                            "Possible deadlock: in {action!r}, {robot} needs {zone} while {other} has it, "
                            "and in {other_action!r}, {other} needs {other_zone}. Let one of them leave first.",
                            action=first.action,
                            robot=self.name(first.robot),
                            zone=self.name(first.zone),
                            other=self.name(second.robot),
                            other_action=second.action,
                            other_zone=self.name(second.zone),
                        )

    def _refuse_kept(self, action: str, robot: str, zone: str, second: str, other_action: str) -> None:
        raise InvalidProject(
            "Possible deadlock: {action!r} moves {robot} into {zone}, in which {other} stays after {other_action!r}. "
            "Let {other} leave it first.",
            action=action,
            robot=self.name(robot),
            zone=self.name(zone),
            other=self.name(second),
            other_action=other_action,
        )

    def _moved(self, function: str) -> frozenset[str]:
        found: set[str] = set()
        for action in self._functions[function].actions:
            owner, _, method = action.type.partition("/")
            if method == CALL and owner in self._functions:
                found |= self._moved(owner)
            elif owner in self._robots:
                found.add(owner)
        return frozenset(found)

    def _target(self, kind: str, value: str) -> Vector | None:
        """Return the position that a parameter names, None if it is unknown."""
        key = reference(kind, value)
        if key is None or kind not in _PLACES:
            return None
        try:
            match kind:
                case "pose":
                    point, _ = self._index.orientation(key)
                case "joints":
                    point, _ = self._index.joints(key)
                case _:
                    point = self._index.action_point(key)
            return _vector(global_pose(self._index, point).position)
        except NotFound:
            return None

    def _touched(self, path: Sequence[Vector]) -> Iterator[str]:
        points = [Position(*each) for each in path]
        for start, end in itertools.pairwise(points if len(points) > 1 else points * 2):
            for key, body in self._zones.items():
                if first_hit(start, end, [(key, body)], 0.0) is not None:
                    yield key


def _merged(states: Iterable[_State]) -> _State:
    found: _State = {}
    for state in states:
        for robot, stays in state.items():
            found[robot] = found.get(robot, frozenset()) | stays
    return found


# ------------------------------------------------------------------------------------------------ project
def check_zones(
    scene: Scene, project: Project, model_of: Callable[[str], Models | None], is_robot: Callable[[str], bool]
) -> None:
    """Raise InvalidProject if zones overlap, or if robots may wait for each other's zone forever.

    The targets of actions are the positions of their poses and joints. Those that a program computes are not known.

    Args:
        scene: the scene.
        project: the project.
        model_of: returns the collision model of an object type.
        is_robot: returns whether an object type is a robot.
    """
    wanted = zones_of(scene)
    zones: dict[str, Obstacle] = {}
    for obj in scene.objects:
        model = model_of(obj.type) if obj.id in wanted else None
        if model is not None and not isinstance(model, Mesh) and not isinstance(obj.pose, Unset):
            zones[obj.id] = Obstacle(obj.name, model, obj.pose)
    for one, other in itertools.combinations(zones.values(), 2):
        if overlap(one, other):
            raise InvalidProject(
                "The zones {one} and {other} overlap. Move or resize one of them, or use one zone.",
                one=one.name,
                other=other.name,
            )
    if zones and project.has_logic:
        _Walk(scene, project, zones, frozenset(obj.id for obj in scene.objects if is_robot(obj.type))).check()

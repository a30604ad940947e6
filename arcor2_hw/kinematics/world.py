"""The collision world: bodies, robots and what these hold; what is in collision, how far apart, what a line meets.

Poses are in the world. Names: of a body its id, of a robot's link "robot/link". A robot's links that do not move with
its joints are how it is mounted, and no question of a configuration: they are never in collision with bodies. A body
that encloses something without touching it has an inside unless it is an exact mesh, which is but a surface.
Nothing here is safe for two threads at once.
"""

import collections
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import coal
import numpy as np

from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound
from arcor2_hw.kinematics import rays
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array, Shape, check, coal_geometry
from arcor2_hw.kinematics.standing import Held, Part, StandingRobot

KEPT_CHANGES: Final = 4096
_TINY: Final = 1e-9


class Contact(Data, frozen=True):
    """Two things that are in collision, by name; depth: how deep, m, as far as it is known."""

    first: str
    second: str
    depth: float

    def __str__(self) -> str:
        return f"{self.first} and {self.second}"


class Clearance(Data, frozen=True):
    """The nearest two things and their distance, m, negative when they are in collision; the points nearest by."""

    distance: float
    first: str
    second: str
    first_point: Position
    second_point: Position


class RayHit(Data, frozen=True):
    """What a line meets first: its name, at which share of the line, and the point."""

    name: str
    share: float
    point: Position


class Change(NamedTuple):
    """That something came, went or moved: where it was and is, lower and upper corner (2, 3); whose it is."""

    revision: int
    box: Array
    name: str


@dataclass(eq=False)
class _Body:
    name: str
    shape: Shape
    pose: Array
    object: Any
    box: Array
    geometry: Any


class CollisionWorld:
    """Bodies by id and robots by id; `margin`, m, is how far apart things have to be to count as free.

    revision: grows with every change. changes: the newest of them.
    """

    def __init__(self, margin: float = 0.0) -> None:
        if not 0.0 <= margin <= 1.0:
            raise InvalidData(f"The margin must be 0 to 1 m, not {margin!r}.")
        self.margin = margin
        self.revision = 0
        self.changes: collections.deque[Change] = collections.deque(maxlen=KEPT_CHANGES)
        self.robots: dict[str, StandingRobot] = {}
        self._bodies: dict[str, _Body] = {}
        self._held: dict[str, str] = {}
        self._allowed: dict[str, set[str]] = {}
        self._manager: Any = coal.DynamicAABBTreeCollisionManager()
        self._apart: dict[str, _Body] = {}
        self._boxes: tuple[list[_Body], Array] | None = None

    # -------------------------------------------------------------------------------- bodies
    def put(self, name: str, shape: Shape, pose: Pose) -> None:
        """Put a body in, in place of one of that id. Raises Conflict for a robot's id, ZeroLength, InvalidData."""
        if name in self.robots:
            raise Conflict(f"{name} is a robot.")
        check(shape, name)
        placed = _matrix(pose, name)
        if name in self._held or name in self._bodies:
            self.delete(name)
        self._insert(name, shape, placed)

    def move(self, name: str, pose: Pose) -> None:
        """Put a body elsewhere; one that is held is let go. Raises NotFound, InvalidData."""
        placed = _matrix(pose, name)
        if name in self._held:
            shape = self.robots[self._held[name]].held[name].shape
            self.delete(name)
            self._insert(name, shape, placed)
            return
        body = self._body(name)
        before = body.box
        _place(body, placed)
        if name not in self._apart:
            self._manager.update()
        self._changed(np.array((before, body.box)), name)

    def delete(self, name: str) -> None:
        """Take a body out, also one that is held. Raises NotFound."""
        if name in self._held:
            robot = self.robots[self._held.pop(name)]
            del robot.held[name]
            robot.rebuild()
            self._changed(np.array((self._robot_box(robot), self._robot_box(robot))), name)
            return
        body = self._body(name)
        del self._bodies[name]
        if self._apart.pop(name, None) is None:
            self._manager.unregisterObject(body.object)
        self._changed(np.array((body.box, body.box)), name)

    def clear(self) -> None:
        """Take everything out, robots too."""
        for name in [*self._bodies, *self._held]:
            self.delete(name)
        for name in list(self.robots):
            self.remove_robot(name)
        self._allowed.clear()
        self._manager.clear()
        self._manager.setup()

    def ids(self) -> list[str]:
        """Give the ids of all bodies, those that are held too."""
        return sorted([*self._bodies, *self._held])

    def pose(self, name: str) -> Pose:
        """Give where a body is now; one that is held moves with its robot. Raises NotFound."""
        if name in self._held:
            robot = self.robots[self._held[name]]
            held = robot.held[name]
            return Pose.from_matrix(robot.link_frames(robot.q)[held.link] @ held.in_link)
        return Pose.from_matrix(self._body(name).pose)

    def _body(self, name: str) -> _Body:
        try:
            return self._bodies[name]
        except KeyError:
            raise NotFound(f"There is no body {name!r}.") from None

    def _insert(self, name: str, shape: Shape, pose: Array) -> None:
        geometry = coal_geometry(shape)
        body = _Body(name, shape, pose, coal.CollisionObject(geometry), np.zeros((2, 3)), geometry)
        _place(body, pose)
        self._bodies[name] = body
        if self._allowed.get(name):
            self._apart[name] = body
        else:
            self._manager.registerObject(body.object)
            self._manager.setup()
        self._changed(np.array((body.box, body.box)), name)

    # -------------------------------------------------------------------------------- robots
    def add_robot(self, name: str, model: RobotModel, base: Pose, q: Array | None = None) -> StandingRobot:
        """Let a robot stand in the world, its root at `base`, in joint values of the model's order (neutral if None).

        Raises Conflict when the id is taken, InvalidData.
        """
        if name in self.robots or name in self._bodies or name in self._held:
            raise Conflict(f"There is something called {name} already.")
        given = model.neutral() if q is None else q
        robot = StandingRobot(name, model, _matrix(base, name), _joints(model, given), self.margin)
        self.robots[name] = robot
        self._robot_changed(robot, None)
        return robot

    def remove_robot(self, name: str) -> None:
        """Take a robot out; what it held stays where it is. Raises NotFound."""
        robot = self.robot(name)
        for held in list(robot.held):
            self.detach(held)
        before = self._robot_box(robot)
        del self.robots[name]
        self._changed(np.array((before, before)), name)

    def robot(self, name: str) -> StandingRobot:
        """Give a robot. Raises NotFound."""
        try:
            return self.robots[name]
        except KeyError:
            raise NotFound(f"There is no robot {name!r}.") from None

    def move_robot(self, name: str, base: Pose) -> None:
        """Let a robot stand elsewhere, with what it holds. Raises NotFound, InvalidData."""
        robot = self.robot(name)
        before = self._robot_box(robot)
        robot.place(_matrix(base, name))
        self._robot_changed(robot, before)

    def set_joints(self, name: str, q: Array) -> None:
        """Take note of a robot's present joint values, in the model's order. Raises NotFound, InvalidData."""
        robot = self.robot(name)
        given = _joints(robot.model, q)
        if not np.array_equal(given, robot.q):
            before = self._robot_box(robot)
            robot.q = given
            self._robot_changed(robot, before)

    def attach(self, name: str, robot: str, link: str, *, touching: Iterable[str] = ()) -> None:
        """Let a link of a robot hold a body from where both are now on: it moves with it, and may touch that link.

        `touching` names more links that it may touch. Raises NotFound, Conflict when it is held already.
        """
        holder = self.robot(robot)
        if name in self._held:
            raise Conflict(f"{name} is held by {self._held[name]}.")
        body = self._body(name)
        if link not in holder.model.description.links:
            raise NotFound(f"{holder.model.name} has no link {link!r}.")
        in_link = np.linalg.inv(holder.link_frames(holder.q)[link]) @ body.pose
        self.delete(name)
        holder.held[name] = Held(name, body.shape, link, in_link, frozenset(touching))
        self._held[name] = robot
        before = self._robot_box(holder)
        holder.rebuild()
        self._robot_changed(holder, before)

    def detach(self, name: str) -> Pose:
        """Let go of a body, which stays where it is now; gives where. Raises NotFound."""
        if name not in self._held:
            raise NotFound(f"{name!r} is not held.")
        pose = self.pose(name)
        self.move(name, pose)
        return pose

    # -------------------------------------------------------------------------------- who may touch
    def allow(self, one: str, other: str, allowed: bool = True) -> None:
        """Let two things touch, or no longer: bodies, robots, or links as "robot/link"."""
        for first, second in ((one, other), (other, one)):
            partners = self._allowed.setdefault(first, set())
            partners.add(second) if allowed else partners.discard(second)
        for name in (one, other):
            body = self._bodies.get(name)
            if body is not None and (name in self._apart) != bool(self._allowed[name]):
                if self._allowed[name]:
                    self._apart[name] = body
                    self._manager.unregisterObject(body.object)
                else:
                    del self._apart[name]
                    self._manager.registerObject(body.object)
                    self._manager.setup()
                self._changed(np.array((body.box, body.box)), name)
        for name in {self._held.get(each, each.split("/")[0]) for each in (one, other)} & self.robots.keys():
            self.robots[name].revision += 1
            self._robot_changed(self.robots[name], None)

    def _may_touch(self, part: Part, robot: str, names: tuple[str, ...]) -> bool:
        if not self._allowed:
            return False
        mine = (part.name,) if part.held is not None else (robot, f"{robot}/{part.link}")
        return any(other in self._allowed.get(one, ()) for one in mine for other in names)

    # -------------------------------------------------------------------------------- collisions
    def is_free(self, robot: str, q: Array) -> bool:
        """Tell whether a robot in joint values (model's order), with what it holds, is in collision with nothing.

        Its other joints, other robots and the bodies are taken as they are now. Raises NotFound.
        """
        mine = self.robot(robot)
        if mine.hits_itself(q):
            return False
        mine.pose(q)
        if self._bodies and self._collides(self._manager, mine.manager):
            return False
        if not self._apart and len(self.robots) == 1:
            return True
        return next(self._contacts_around(mine, self._apart.values()), None) is None

    def contacts(self, robot: str, q: Array) -> list[Contact]:
        """Give everything that a robot in joint values, or what it holds, is in collision with. Raises NotFound."""
        mine = self.robot(robot)
        mine.pose(q, everything=True)
        found = [
            Contact(_name(mine, mine.parts[one]), _name(mine, mine.parts[two]), depth)
            for one, two in mine.pairs
            if (depth := self._depth(mine.parts[one].object, mine.parts[two].object)) is not None
        ]
        found += self._contacts_around(mine, self._bodies.values())
        return list({(each.first, each.second): each for each in found}.values())

    def _contacts_around(self, mine: StandingRobot, bodies: Iterable[_Body]) -> Iterator[Contact]:
        """Give contacts of a robot that is posed already with bodies, and with other robots."""
        for number in mine.moving:
            part = mine.parts[number]
            low, high = _corners(part.object)
            for body in bodies:
                if (body.box[0] > high).any() or (body.box[1] < low).any():
                    continue
                if self._may_touch(part, mine.name, (body.name,)):
                    continue
                if (depth := self._depth(part.object, body.object)) is not None:
                    yield Contact(_name(mine, part), body.name, depth)
        for other in self.robots.values():
            if other is not mine:
                yield from self._contacts_between(mine, other)

    def _contacts_between(self, mine: StandingRobot, other: StandingRobot) -> Iterator[Contact]:
        other.pose(other.q, everything=True)
        for part in mine.parts:
            low, high = _corners(part.object)
            for their in other.parts:
                their_low, their_high = _corners(their.object)
                if (their_low > high).any() or (their_high < low).any() or not (part.body or their.body):
                    continue
                names = (their.name,) if their.held is not None else (other.name, f"{other.name}/{their.link}")
                if self._may_touch(part, mine.name, names):
                    continue
                if (depth := self._depth(part.object, their.object)) is not None:
                    yield Contact(_name(mine, part), _name(other, their), depth)

    def _collides(self, one: Any, other: Any) -> bool:
        callback = coal.CollisionCallBackDefault()
        callback.init()
        callback.data.request.security_margin = self.margin
        one.collide(other, callback)
        return bool(callback.data.result.isCollision())

    def _depth(self, one: Any, other: Any) -> float | None:
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        request.security_margin = self.margin
        if not coal.collide(one, other, request, result):
            return None
        return max(0.0, -float(result.getContact(0).penetration_depth))

    # -------------------------------------------------------------------------------- distances and lines
    def clearance(self, robot: str, q: Array, within: float = np.inf) -> Clearance | None:
        """Give the nearest pair of a robot in joint values and what is around it, None when none is `within` m.

        Of the robot itself those links count that may not touch. Raises NotFound.
        """
        mine = self.robot(robot)
        mine.pose(q, everything=True)
        best: Clearance | None = None
        for bound, part, other, name in sorted(self._nearby(mine), key=lambda each: each[0]):
            if bound >= (within if best is None else best.distance):
                break
            request, result = coal.DistanceRequest(), coal.DistanceResult()
            request.enable_signed_distance = True
            distance = float(coal.distance(part.object, other, request, result))
            if distance < (within if best is None else best.distance):
                points = (
                    Position(*map(float, result.getNearestPoint1())),
                    Position(*map(float, result.getNearestPoint2())),
                )
                best = Clearance(distance, _name(mine, part), name, *points)
        return best

    def _nearby(self, mine: StandingRobot) -> Iterator[tuple[float, Part, Any, str]]:
        """Give parts of a robot with what may not touch them, and a bound below which their distance cannot be."""
        bodies, boxes = self._all_boxes()
        for number in mine.moving:
            part = mine.parts[number]
            low, high = _corners(part.object)
            gaps = np.maximum(0.0, np.maximum(boxes[:, 0] - high, low - boxes[:, 1]))
            for body, bound in zip(bodies, np.linalg.norm(gaps, axis=1), strict=True):
                if not self._may_touch(part, mine.name, (body.name,)):
                    yield float(bound), part, body.object, body.name
        for one, two in mine.pairs:
            yield (
                _gap(mine.parts[one], mine.parts[two]),
                mine.parts[one],
                mine.parts[two].object,
                _name(mine, mine.parts[two]),
            )
        for other in self.robots.values():
            if other is mine:
                continue
            other.pose(other.q, everything=True)
            for part in mine.parts:
                for their in other.parts:
                    names = (their.name,) if their.held is not None else (other.name, f"{other.name}/{their.link}")
                    if (part.body or their.body) and not self._may_touch(part, mine.name, names):
                        yield _gap(part, their), part, their.object, _name(other, their)

    def ray(self, start: Position, end: Position, ignore: Iterable[str] = (), inflation: float = 0.0) -> RayHit | None:
        """Give what a straight line meets first, None when it is free. Robots stand as they are now.

        `ignore`: ids of bodies and robots that are no obstacle; what such a robot holds still is one. `inflation`:
        sizes count as larger by so much, m. Raises InvalidData for numbers that are not finite.
        """
        a, b = np.array([*start]), np.array([*end])
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            raise InvalidData("A line needs two points that are somewhere.")
        left_out = set(ignore)
        best: tuple[float, str] | None = None
        for name, shape, pose in self._obstacles(a, b, inflation, left_out):
            rotation = pose[:3, :3]
            at = rays.entry(shape, (a - pose[:3, 3]) @ rotation, (b - a) @ rotation, inflation)
            if at is not None and (best is None or at < best[0]):
                best = at, name
        if best is None:
            return None
        return RayHit(best[1], best[0], Position(*map(float, a + best[0] * (b - a))))

    def _obstacles(self, a: Array, b: Array, inflation: float, ignore: set[str]) -> Iterator[tuple[str, Shape, Array]]:
        bodies, boxes = self._all_boxes()
        low, high = np.minimum(a, b) - inflation, np.maximum(a, b) + inflation
        near = np.nonzero(((boxes[:, 0] <= high) & (boxes[:, 1] >= low)).all(axis=1))[0]
        for number in near:
            if bodies[number].name not in ignore:
                yield bodies[number].name, bodies[number].shape, bodies[number].pose
        for robot in self.robots.values():
            frames = robot.link_frames(robot.q)
            for each in robot.model.collision if robot.name not in ignore else ():
                yield f"{robot.name}/{each.link}", each.shape, frames[each.link] @ each.origin
            for held in robot.held.values():
                if held.name not in ignore:
                    yield held.name, held.shape, frames[held.link] @ held.in_link

    # -------------------------------------------------------------------------------- inside
    def changed_since(self, revision: int) -> list[Change] | None:
        """Give what changed after a revision; None when that is no longer known."""
        if revision < self.revision - len(self.changes):
            return None
        return [change for change in self.changes if change.revision > revision]

    def _changed(self, boxes: Array, name: str) -> None:
        self.revision += 1
        self._boxes = None
        box = np.array((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))
        self.changes.append(Change(self.revision, box, name))

    def _robot_changed(self, robot: StandingRobot, before: Array | None) -> None:
        box = self._robot_box(robot)
        self._changed(np.array((box if before is None else before, box)), robot.name)

    def _robot_box(self, robot: StandingRobot) -> Array:
        """Give the corners of the box around a robot as it stands, and what it holds."""
        robot.pose(robot.q, everything=True)
        corners = np.array([_corners(part.object) for part in robot.parts]).reshape(-1, 2, 3)
        if not len(corners):
            return np.array((robot.base[:3, 3], robot.base[:3, 3]))
        return np.array((corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)))

    def _all_boxes(self) -> tuple[list[_Body], Array]:
        if self._boxes is None:
            bodies = list(self._bodies.values())
            self._boxes = bodies, np.array([body.box for body in bodies]).reshape(-1, 2, 3)
        return self._boxes


def _matrix(pose: Pose, name: str) -> Array:
    if not all(map(np.isfinite, pose.position)):
        raise InvalidData(f"The pose of {name} has numbers that are not finite.")
    return pose.matrix()


def _joints(model: RobotModel, q: Array) -> Array:
    given = np.array(q, dtype=np.float64)
    if given.shape != (len(model.joints),) or not np.isfinite(given).all():
        raise InvalidData(f"{model.name} needs {len(model.joints)} finite joint values.")
    return given


def _place(body: _Body, pose: Array) -> None:
    body.pose = pose
    body.object.setTranslation(pose[:3, 3])
    body.object.setRotation(np.ascontiguousarray(pose[:3, :3]))
    body.object.computeAABB()
    body.box = np.array(_corners(body.object))


def _corners(placed: Any) -> tuple[Array, Array]:
    box = placed.getAABB()
    return np.array(box.min_), np.array(box.max_)


def _gap(one: Part, two: Part) -> float:
    (low, high), (their_low, their_high) = _corners(one.object), _corners(two.object)
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(their_low - high, low - their_high))))


def _name(robot: StandingRobot, part: Part) -> str:
    return part.name if part.held is not None else f"{robot.name}/{part.link}"

"""The collision world: contacts, clearances and rays among bodies, robots and attached bodies.

Poses are in the world. A body is named by its id, a link of a robot by "robot/link". Links that do not move with the
joints are part of the mounting: they are never checked for contacts. A body that encloses another one without touching
it is in contact with it, unless it is an exact mesh, which is only a surface. Not safe for use by two threads at once.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import coal
import numpy as np

from arcor2_hw.collision import rays
from arcor2_hw.collision.robot import CollisionRobot, RobotPart
from arcor2_hw.collision.world_state import PlacedBody, WorldState, corners
from arcor2_hw.data.base import Data
from arcor2_hw.data.geometry import Position
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.kinematics.arm import Arm
from arcor2_hw.kinematics.inverse import CollisionCheck
from arcor2_hw.kinematics.shapes import Array, Shape
from arcor2_hw.messages import Message


class Contact(Data, frozen=True):
    """Two objects in contact, by name, and the penetration depth in m if it is known."""

    first: str
    second: str
    depth: float

    @property
    def message(self) -> Message:
        """The names of both things."""
        return Message.of("{first} and {second}", first=self.first, second=self.second)

    def __str__(self) -> str:
        return self.message.text


class Clearance(Data, frozen=True):
    """The two nearest objects and their distance in m, negative when in contact, with the nearest points."""

    distance: float
    first: str
    second: str
    first_point: Position
    second_point: Position


class RayHit(Data, frozen=True):
    """The first object that a line meets: its name, the position along the line (0 to 1), and the point."""

    name: str
    share: float
    point: Position


class CollisionWorld(WorldState):
    """Bodies and robots by id (see `WorldState`), with queries about contacts, clearances and rays."""

    # -------------------------------------------------------------------------------- collisions
    def is_free(self, robot: str, q: Array) -> bool:
        """Return whether a robot at joint values, with its attached bodies, is free of collision.

        Its other joints, other robots and the bodies are taken as they are at present.

        Args:
            robot: Id of the robot.
            q: Joint values, in the model's order.

        Raises:
            NotFound: The robot does not exist.
        """
        return not self.robot(robot).in_self_collision(q) and self.is_free_around(robot, q)

    def is_free_around(self, robot: str, q: Array, more: float = 0.0) -> bool:
        """Return whether a robot is farther than the margin plus `more` (m) from everything around it."""
        mine = self.robot(robot)
        mine.pose(q, more=more)
        margin = self.margin + more
        if self._bodies and self._collides(self._manager, mine.manager, margin):
            return False
        if self._apart and next(self._contacts_with(mine, self._apart.values(), margin), None) is not None:
            return False
        for other in self.robots.values():
            if other is mine:
                continue
            other.pose(other.q, everything=True)
            if self._collides(other.obstacle, mine.manager, margin) and (
                not self._allowed or next(self._contacts_between(mine, other, margin), None) is not None
            ):
                return False
        return True

    def contacts(self, robot: str, q: Array) -> list[Contact]:
        """Return all contacts of a robot at joint values, those of its attached bodies first.

        An attached body at the end effector collides in every configuration that reaches a pose, so it is named first.

        Raises:
            NotFound: The robot does not exist.
        """
        mine = self.robot(robot)
        mine.pose(q, everything=True)
        found = [
            Contact(_name(mine, mine.parts[one]), _name(mine, mine.parts[two]), depth)
            for one, two in mine.pairs
            if (depth := _depth(mine.parts[one].object, mine.parts[two].object, 0.0)) is not None
        ]
        found += self._contacts_with(mine, self._bodies.values(), self.margin)
        for other in self.robots.values():
            if other is not mine:
                other.pose(other.q, everything=True)
                found += self._contacts_between(mine, other, self.margin)
        found.sort(key=lambda each: each.first not in mine.held)
        return list({(each.first, each.second): each for each in found}.values())

    def first_contact(self, robot: str, q: Array) -> str:
        """Return the first contact of a robot at joint values as text, empty when there is none."""
        if self.is_free(robot, q):
            return ""
        found = self.contacts(robot, q)
        return str(found[0]) if found else "an obstacle"

    def _contacts_with(self, robot: CollisionRobot, bodies: Iterable[PlacedBody], margin: float) -> Iterator[Contact]:
        """Yield contacts of a robot, whose objects are already placed, with bodies."""
        every = list(bodies)
        boxes = np.array([body.box for body in every]).reshape(-1, 2, 3)
        for number in robot.moving:
            part = robot.parts[number]
            low, high = corners(part.object)
            for index in np.nonzero(((boxes[:, 0] <= high) & (boxes[:, 1] >= low)).all(axis=1))[0]:
                body = every[index]
                if self._may_touch(part, robot.name, (body.name,)):
                    continue
                if (depth := _depth(part.object, body.object, margin)) is not None:
                    yield Contact(_name(robot, part), body.name, depth)

    def _contacts_between(self, robot: CollisionRobot, second: CollisionRobot, margin: float) -> Iterator[Contact]:
        """Yield contacts of the moving parts of a robot with another robot; objects of both are already placed."""
        for number in robot.moving:
            part = robot.parts[number]
            low, high = corners(part.object)
            for their in second.parts:
                their_low, their_high = corners(their.object)
                if (their_low > high).any() or (their_high < low).any():
                    continue
                names = (their.name,) if their.held is not None else (second.name, f"{second.name}/{their.link}")
                if self._may_touch(part, robot.name, names):
                    continue
                if (depth := _depth(part.object, their.object, margin)) is not None:
                    yield Contact(_name(robot, part), _name(second, their), depth)

    def _collides(self, first: Any, second: Any, margin: float) -> bool:
        callback = coal.CollisionCallBackDefault()
        callback.init()
        callback.data.request.security_margin = margin
        first.collide(second, callback)
        return bool(callback.data.result.isCollision())

    # -------------------------------------------------------------------------------- distances and lines
    def clearance(self, robot: str, q: Array, within: float = np.inf) -> Clearance | None:
        """Return the nearest pair of a robot and its surroundings, or None if no pair is nearer than `within`.

        Links count as surroundings of each other where contact between them is not allowed.

        Args:
            robot: Id of the robot.
            q: Joint values, in the model's order.
            within: Maximum distance, m.

        Raises:
            NotFound: The robot does not exist.
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

    def _nearby(self, robot: CollisionRobot) -> Iterator[tuple[float, RobotPart, Any, str]]:
        """Yield pairs that may not touch, each with a lower bound of their distance."""
        bodies, boxes = self.all_boxes()
        for number in robot.moving:
            part = robot.parts[number]
            low, high = corners(part.object)
            gaps = np.maximum(0.0, np.maximum(boxes[:, 0] - high, low - boxes[:, 1]))
            for body, bound in zip(bodies, np.linalg.norm(gaps, axis=1), strict=True):
                if not self._may_touch(part, robot.name, (body.name,)):
                    yield float(bound), part, body.object, body.name
        for one, two in robot.pairs:
            yield (
                _gap(robot.parts[one], robot.parts[two]),
                robot.parts[one],
                robot.parts[two].object,
                _name(robot, robot.parts[two]),
            )
        for other in self.robots.values():
            if other is robot:
                continue
            other.pose(other.q, everything=True)
            for part in robot.parts:
                for their in other.parts:
                    names = (their.name,) if their.held is not None else (other.name, f"{other.name}/{their.link}")
                    if (part.body or their.body) and not self._may_touch(part, robot.name, names):
                        yield _gap(part, their), part, their.object, _name(other, their)

    def ray(self, start: Position, end: Position, ignore: Iterable[str] = (), inflation: float = 0.0) -> RayHit | None:
        """Return the first object that a straight line meets, or None if the line is free.

        Robots are at their present joint values.

        Args:
            start: Start of the line.
            end: End of the line.
            ignore: Ids of bodies and robots to ignore; bodies attached to such a robot still count.
            inflation: Length added to all sizes, m.

        Raises:
            InvalidData: A coordinate is not finite.
        """
        a, b = np.array([*start]), np.array([*end])
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            raise InvalidData("The start and the end of a line need finite coordinates.")
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
        bodies, boxes = self.all_boxes()
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

    def _may_touch(self, part: RobotPart, robot: str, names: tuple[str, ...]) -> bool:
        if not self._allowed:
            return False
        mine = (part.name,) if part.held is not None else (robot, f"{robot}/{part.link}")
        return any(other in self._allowed.get(one, ()) for one in mine for other in names)


def collision_check(world: CollisionWorld, robot: str, arm: Arm, others: Array | None = None) -> CollisionCheck:
    """Return a function that checks joint values of an arm for collisions.

    Args:
        world: The collision world.
        robot: Name of the robot in it.
        arm: The arm whose joint values are checked.
        others: Joint values of the whole model, for the joints that the arm does not move; default: present ones.
    """
    placed = world.robot(robot)

    def check(q: Array) -> str:
        return world.first_contact(robot, arm.whole(q, placed.q if others is None else others))

    return check


def _gap(first: RobotPart, second: RobotPart) -> float:
    (low, high), (their_low, their_high) = corners(first.object), corners(second.object)
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(their_low - high, low - their_high))))


def _name(robot: CollisionRobot, part: RobotPart) -> str:
    return part.name if part.held is not None else f"{robot.name}/{part.link}"


def _depth(first: Any, second: Any, margin: float) -> float | None:
    """Return the penetration depth of two objects: 0 when only the margin is violated, or None if they are free."""
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.security_margin = margin
    if not coal.collide(first, second, request, result):
        return None
    return max(0.0, -float(result.getContact(0).penetration_depth))

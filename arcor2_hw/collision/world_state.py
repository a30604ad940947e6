"""The content of a collision world: bodies, robots, attached bodies, allowed contacts, and recent changes."""

import collections
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import coal
import numpy as np

from arcor2_hw.collision.robot import AttachedBody, CollisionRobot
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import Conflict, InvalidData, NotFound
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array, Shape, check, coal_geometry

MAX_CHANGES: Final = 4096


class Change(NamedTuple):
    """A change of a world.

    Attributes:
        revision: Revision of the world after the change.
        box: Bounding box (2, 3) of the changed object before and after the change.
        name: Name of the body or robot.
    """

    revision: int
    box: Array
    name: str


@dataclass(eq=False)
class PlacedBody:
    """A body that is not attached.

    Attributes:
        name: Name of the body.
        shape: Shape.
        pose: Pose in the world, (4, 4).
        object: coal's collision object.
        box: Bounding box, (2, 3).
        geometry: coal's geometry.
    """

    name: str
    shape: Shape
    pose: Array
    object: Any
    box: Array
    geometry: Any


class WorldState:
    """Bodies by id and robots by id.

    Attributes:
        margin: Distance between a robot and its surroundings below which it is in collision, m.
        revision: Grows with every change.
        changes: Recent changes, at most MAX_CHANGES.
    """

    def __init__(self, margin: float = 0.0) -> None:
        if not 0.0 <= margin <= 1.0:
            raise InvalidData("The margin must be 0 to 1 m, not {margin!r}.", margin=margin)
        self.margin = margin
        self.revision = 0
        self.changes: collections.deque[Change] = collections.deque(maxlen=MAX_CHANGES)
        self.robots: dict[str, CollisionRobot] = {}
        self._bodies: dict[str, PlacedBody] = {}
        self._held: dict[str, str] = {}
        self._allowed: dict[str, set[str]] = {}
        self._manager: Any = coal.DynamicAABBTreeCollisionManager()
        self._apart: dict[str, PlacedBody] = {}
        self._boxes: tuple[list[PlacedBody], Array] | None = None

    # -------------------------------------------------------------------------------- bodies
    def put(self, name: str, shape: Shape, pose: Pose) -> None:
        """Add a body, replacing one of the same id.

        Raises:
            Conflict: The id is that of a robot.
            ZeroLength: A size of the shape is not above zero.
            InvalidData: The pose is not finite.
        """
        if name in self.robots:
            raise Conflict("Body {name} cannot be added: a robot has that id.", name=name)
        check(shape, name)
        placed = _matrix(pose, name)
        if name in self._held or name in self._bodies:
            self.delete(name)
        self._insert(name, shape, placed)

    def move(self, name: str, pose: Pose) -> None:
        """Move a body; an attached one is detached.

        Raises:
            NotFound: The body does not exist.
            InvalidData: The pose is not finite.
        """
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
        """Remove a body, attached or not.

        Raises:
            NotFound: The body does not exist.
        """
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
        """Remove all bodies and robots."""
        for name in [*self._bodies, *self._held]:
            self.delete(name)
        for name in list(self.robots):
            self.remove_robot(name)
        self._allowed.clear()
        self._manager.clear()
        self._manager.setup()

    def ids(self) -> list[str]:
        """Return the sorted ids of all bodies, including attached ones."""
        return sorted([*self._bodies, *self._held])

    def pose(self, name: str) -> Pose:
        """Return the present pose of a body; an attached body moves with its robot.

        Raises:
            NotFound: The body does not exist.
        """
        if name in self._held:
            robot = self.robots[self._held[name]]
            held = robot.held[name]
            return Pose.from_matrix(robot.link_frames(robot.q)[held.link] @ held.in_link)
        return Pose.from_matrix(self._body(name).pose)

    def _body(self, name: str) -> PlacedBody:
        try:
            return self._bodies[name]
        except KeyError:
            raise NotFound("Body {name!r} does not exist.", name=name) from None

    def _insert(self, name: str, shape: Shape, pose: Array) -> None:
        geometry = coal_geometry(shape)
        body = PlacedBody(name, shape, pose, coal.CollisionObject(geometry), np.zeros((2, 3)), geometry)
        _place(body, pose)
        self._bodies[name] = body
        if self._allowed.get(name):
            self._apart[name] = body
        else:
            self._manager.registerObject(body.object)
            self._manager.setup()
        self._changed(np.array((body.box, body.box)), name)

    # -------------------------------------------------------------------------------- robots
    def add_robot(self, name: str, model: RobotModel, base: Pose, q: Array | None = None) -> CollisionRobot:
        """Add a robot.

        Args:
            name: Id of the robot.
            model: Its model.
            base: Pose of the root link in the world.
            q: Joint values in the model's order; default: the neutral configuration.

        Raises:
            Conflict: The id is taken.
            InvalidData: The pose or a joint value is not finite.
        """
        if name in self.robots or name in self._bodies or name in self._held:
            raise Conflict("Robot {name} cannot be added: the id is taken.", name=name)
        given = model.neutral() if q is None else q
        robot = CollisionRobot(name, model, _matrix(base, name), _joints(model, given), self.margin)
        self.robots[name] = robot
        self._robot_changed(robot, None)
        return robot

    def remove_robot(self, name: str) -> None:
        """Remove a robot; bodies attached to it stay at their present poses.

        Raises:
            NotFound: The robot does not exist.
        """
        robot = self.robot(name)
        for held in list(robot.held):
            self.detach(held)
        before = self._robot_box(robot)
        del self.robots[name]
        self._changed(np.array((before, before)), name)

    def robot(self, name: str) -> CollisionRobot:
        """Return a robot.

        Raises:
            NotFound: The robot does not exist.
        """
        try:
            return self.robots[name]
        except KeyError:
            raise NotFound("Robot {name!r} does not exist.", name=name) from None

    def move_robot(self, name: str, base: Pose) -> None:
        """Move the base of a robot, with everything attached to it.

        Raises:
            NotFound: The robot does not exist.
            InvalidData: The pose is not finite.
        """
        robot = self.robot(name)
        before = self._robot_box(robot)
        robot.place(_matrix(base, name))
        self._robot_changed(robot, before)

    def set_joints(self, name: str, q: Array) -> None:
        """Set the present joint values of a robot, in the model's order.

        Raises:
            NotFound: The robot does not exist.
            InvalidData: A value is missing or not finite.
        """
        robot = self.robot(name)
        given = _joints(robot.model, q)
        if not np.array_equal(given, robot.q):
            before = self._robot_box(robot)
            robot.q = given
            self._robot_changed(robot, before)

    def attach(self, name: str, robot: str, link: str, *, touching: Iterable[str] = ()) -> None:
        """Attach a body to a link at their present poses. It moves with the link and may touch it.

        Args:
            name: Id of the body.
            robot: Id of the robot.
            link: Link of the robot.
            touching: Further links that the body may touch.

        Raises:
            NotFound: The body, robot or link does not exist.
            Conflict: The body is attached already.
        """
        holder = self.robot(robot)
        if name in self._held:
            raise Conflict(
                "{name} cannot be attached to {robot}: it is attached to {held}.",
                name=name,
                robot=robot,
                held=self._held[name],
            )
        body = self._body(name)
        if link not in holder.model.description.links:
            raise NotFound("{name} has no link {link!r}.", name=holder.model.name, link=link)
        in_link = np.linalg.inv(holder.link_frames(holder.q)[link]) @ body.pose
        self.delete(name)
        holder.held[name] = AttachedBody(name, body.shape, link, in_link, frozenset(touching))
        self._held[name] = robot
        before = self._robot_box(holder)
        holder.rebuild()
        self._robot_changed(holder, before)

    def detach(self, name: str) -> Pose:
        """Detach a body and return its pose, which stays as it is.

        Raises:
            NotFound: The body is not attached.
        """
        if name not in self._held:
            raise NotFound("{name!r} is not attached to a robot.", name=name)
        pose = self.pose(name)
        self.move(name, pose)
        return pose

    # -------------------------------------------------------------------------------- allowed contacts
    def allow(self, one: str, other: str, allowed: bool = True) -> None:
        """Allow or forbid contact between two bodies, robots, or links ("robot/link")."""
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

    # -------------------------------------------------------------------------------- inside
    def changed_since(self, revision: int) -> list[Change] | None:
        """Return the changes after a revision, or None if they are no longer recorded."""
        if revision < self.revision - len(self.changes):
            return None
        return [change for change in self.changes if change.revision > revision]

    def _changed(self, boxes: Array, name: str) -> None:
        self.revision += 1
        self._boxes = None
        box = np.array((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))
        self.changes.append(Change(self.revision, box, name))

    def _robot_changed(self, robot: CollisionRobot, before: Array | None) -> None:
        box = self._robot_box(robot)
        self._changed(np.array((box if before is None else before, box)), robot.name)

    def _robot_box(self, robot: CollisionRobot) -> Array:
        """Return the bounding box of a robot and its attached bodies at the present joint values."""
        robot.pose(robot.q, everything=True)
        boxes = np.array([corners(part.object) for part in robot.parts]).reshape(-1, 2, 3)
        if not len(boxes):
            return np.array((robot.base[:3, 3], robot.base[:3, 3]))
        return np.array((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))

    def all_boxes(self) -> tuple[list[PlacedBody], Array]:
        """Return all bodies that are not attached, and their bounding boxes (n, 2, 3)."""
        if self._boxes is None:
            bodies = list(self._bodies.values())
            self._boxes = bodies, np.array([body.box for body in bodies]).reshape(-1, 2, 3)
        return self._boxes


def _matrix(pose: Pose, name: str) -> Array:
    if not all(map(np.isfinite, pose.position)):
        raise InvalidData("The pose of {name} has numbers that are not finite.", name=name)
    return pose.matrix()


def _joints(model: RobotModel, q: Array) -> Array:
    given = np.array(q, dtype=np.float64)
    if given.shape != (len(model.joints),) or not np.isfinite(given).all():
        raise InvalidData("{name} needs {count} finite joint values.", name=model.name, count=len(model.joints))
    return given


def _place(body: PlacedBody, pose: Array) -> None:
    body.pose = pose
    body.object.setTranslation(pose[:3, 3])
    body.object.setRotation(np.ascontiguousarray(pose[:3, :3]))
    body.object.computeAABB()
    body.box = np.array(corners(body.object))


def corners(placed: Any) -> tuple[Array, Array]:
    """Return the lower and upper corner of the bounding box of one of coal's objects."""
    box = placed.getAABB()
    return np.array(box.min_), np.array(box.max_)

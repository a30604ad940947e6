"""What is in a collision world: bodies, robots and what these hold, who may touch whom, and what changed when."""

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
    """That something came, went or moved: where it was and is, lower and upper corner (2, 3); whose it is."""

    revision: int
    box: Array
    name: str


@dataclass(eq=False)
class PlacedBody:
    """A body that nobody holds: its shape, pose (4, 4), box (2, 3) and what coal has of it."""

    name: str
    shape: Shape
    pose: Array
    object: Any
    box: Array
    geometry: Any


class WorldState:
    """Bodies by id and robots by id; `margin`, m, is how far from its surroundings a robot has to be to be free.

    revision: grows with every change. changes: the newest of them.
    """

    def __init__(self, margin: float = 0.0) -> None:
        if not 0.0 <= margin <= 1.0:
            raise InvalidData(f"The margin must be 0 to 1 m, not {margin!r}.")
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

    def _body(self, name: str) -> PlacedBody:
        try:
            return self._bodies[name]
        except KeyError:
            raise NotFound(f"There is no body {name!r}.") from None

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
        """Let a robot stand in the world, its root at `base`, in joint values of the model's order (neutral if None).

        Raises Conflict when the id is taken, InvalidData.
        """
        if name in self.robots or name in self._bodies or name in self._held:
            raise Conflict(f"There is something called {name} already.")
        given = model.neutral() if q is None else q
        robot = CollisionRobot(name, model, _matrix(base, name), _joints(model, given), self.margin)
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

    def robot(self, name: str) -> CollisionRobot:
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
        holder.held[name] = AttachedBody(name, body.shape, link, in_link, frozenset(touching))
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

    def _robot_changed(self, robot: CollisionRobot, before: Array | None) -> None:
        box = self._robot_box(robot)
        self._changed(np.array((box if before is None else before, box)), robot.name)

    def _robot_box(self, robot: CollisionRobot) -> Array:
        """Give the corners of the box around a robot as it stands, and what it holds."""
        robot.pose(robot.q, everything=True)
        boxes = np.array([corners(part.object) for part in robot.parts]).reshape(-1, 2, 3)
        if not len(boxes):
            return np.array((robot.base[:3, 3], robot.base[:3, 3]))
        return np.array((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))

    def all_boxes(self) -> tuple[list[PlacedBody], Array]:
        """Give all bodies that nobody holds, and the boxes around them, (n, 2, 3)."""
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


def _place(body: PlacedBody, pose: Array) -> None:
    body.pose = pose
    body.object.setTranslation(pose[:3, 3])
    body.object.setRotation(np.ascontiguousarray(pose[:3, :3]))
    body.object.computeAABB()
    body.box = np.array(corners(body.object))


def corners(placed: Any) -> tuple[Array, Array]:
    """Give lower and upper corner of the box around one of coal's objects."""
    box = placed.getAABB()
    return np.array(box.min_), np.array(box.max_)

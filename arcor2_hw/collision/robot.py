"""A robot in a collision world: its shapes and attached bodies."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import coal
import numpy as np
import pinocchio as pin

from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array, Shape, coal_geometry
from arcor2_hw.kinematics.tree import Tree

_SAMPLES: Final = 100
_ALWAYS: Final = 0.95
"""Share of random configurations in contact from which two links count as overlapping by design."""


@dataclass(eq=False)
class AttachedBody:
    """A body attached to a link.

    Attributes:
        name: Name of the body.
        shape: Shape.
        link: The link that it moves with.
        in_link: Pose in the frame of the link, (4, 4).
        touching: Further links that it may touch.
    """

    name: str
    shape: Shape
    link: str
    in_link: Array
    touching: frozenset[str]


@dataclass(eq=False)
class RobotPart:
    """A shape of a link, or an attached body.

    Attributes:
        name: Name of the shape or body.
        link: The link that it moves with.
        held: The attached body, None for a shape of the link itself.
        body: Number of the moving body in Pinocchio's model; 0 does not move.
        origin: Pose in the frame of that body, (4, 4).
        geometry: coal's geometry.
        object: coal's collision object.
    """

    name: str
    link: str
    held: AttachedBody | None
    body: int
    origin: Array
    geometry: Any
    object: Any


class CollisionRobot:
    """One robot of a collision world. Not safe for use by two threads at once.

    Attributes:
        q: Present joint values, in the model's order.
        parts: Shapes of the links, then attached bodies.
        manager: coal's manager of the parts that move with the joints.
        obstacle: coal's manager of all parts.
        margin: Distance to the bodies of the world below which a configuration is in collision, m.
        revision: Grows whenever the result for the same joint values may change: the base was moved, a body was
            attached or detached, an allowed contact changed.
    """

    def __init__(self, name: str, model: RobotModel, base: Array, q: Array, margin: float = 0.0) -> None:
        self.name = name
        self.margin = margin
        self.model = model
        self.q = np.array(q, dtype=np.float64)
        self.held: dict[str, AttachedBody] = {}
        self.revision = 0
        self._touching: frozenset[frozenset[str]] | None = None
        self.place(base)

    def place(self, base: Array) -> None:
        """Move the root link to `base`, (4, 4) in the world."""
        self.base = np.array(base, dtype=np.float64)
        self.tree = Tree(self.model.description, self.base)
        self.rebuild()

    def rebuild(self) -> None:
        """Recreate the collision objects, after a body was attached or detached."""
        self.revision += 1
        self.parts: list[RobotPart] = []
        for each in self.model.collision:
            body, frame = self.tree.bodies[each.link]
            self._add(each.name, each.link, None, body, frame @ each.origin, each.shape)
        for held in self.held.values():
            body, frame = self.tree.bodies[held.link]
            self._add(held.name, held.link, held, body, frame @ held.in_link, held.shape)
        self._geometry = pin.GeometryModel()
        for part in self.parts:
            self._geometry.addGeometryObject(
                pin.GeometryObject(part.name, part.body, pin.SE3(part.origin), part.geometry)
            )
        self.pairs = [(one, two) for one, two in self._candidates() if not self._may_touch(one, two)]
        for one, two in self.pairs:
            self._geometry.addCollisionPair(pin.CollisionPair(one, two))
        self._data = pin.GeometryData(self._geometry)
        # Parts that do not move with the joints are not checked per configuration.
        self.moving = [number for number, part in enumerate(self.parts) if part.body]
        self.manager: Any = coal.DynamicAABBTreeCollisionManager()
        for number in self.moving:
            self.manager.registerObject(self.parts[number].object)
        self.manager.setup()
        self.obstacle: Any = coal.DynamicAABBTreeCollisionManager()
        for part in self.parts:
            self.obstacle.registerObject(part.object)
        self.obstacle.setup()
        self._posed: tuple[bytes, float, bool] | None = None

    def _add(self, name: str, link: str, held: AttachedBody | None, body: int, origin: Array, shape: Shape) -> None:
        geometry = coal_geometry(shape)
        self.parts.append(RobotPart(name, link, held, body, origin, geometry, coal.CollisionObject(geometry)))

    # -------------------------------------------------------------------------------- moving
    def pose(self, q: Array, everything: bool = False, more: float = 0.0) -> None:
        """Move the collision objects to joint values.

        Args:
            q: Joint values, in the model's order.
            everything: Also move the parts that do not depend on joints.
            more: Distance by which bounding boxes are enlarged in addition to the margin, m.
        """
        margin = self.margin + more
        posed = self._posed
        if posed is not None and posed[:2] == (q.tobytes(), margin) and (posed[2] or not everything):
            return
        pin.updateGeometryPlacements(self.tree.model, self.tree.data, self._geometry, self._data, self.tree.expand(q))
        placements = self._data.oMg
        for number in range(len(self.parts)) if everything else self.moving:
            placed, body = self.parts[number].object, placements[number]
            placed.setTranslation(body.translation)
            placed.setRotation(body.rotation)
            placed.computeAABB()
            if margin:
                placed.getAABB().expand(margin)
        self.manager.update()
        if everything:
            self.obstacle.update()
        self._posed = q.tobytes(), margin, everything

    def box(self, q: Array) -> Array:
        """Return the bounding box (2, 3) of the moving parts at joint values."""
        self.pose(q)
        corners = [(box.min_, box.max_) for box in (self.parts[number].object.getAABB() for number in self.moving)]
        every = np.array(corners).reshape(-1, 2, 3)
        return np.array((every[:, 0].min(axis=0, initial=np.inf), every[:, 1].max(axis=0, initial=-np.inf)))

    def link_frames(self, q: Array) -> dict[str, Array]:
        """Return the frame of each link in the world, (4, 4)."""
        return self.tree.frames(q)

    # -------------------------------------------------------------------------------- itself
    def in_self_collision(self, q: Array) -> bool:
        """Return whether the robot and its attached bodies collide with each other."""
        return bool(
            pin.computeCollisions(
                self.tree.model, self.tree.data, self._geometry, self._data, self.tree.expand(q), True
            )
        )

    def _candidates(self) -> Iterable[tuple[int, int]]:
        parts = self.parts
        return ((one, two) for one in range(len(parts)) for two in range(one + 1, len(parts)))

    def _may_touch(self, one: int, two: int) -> bool:
        first, second = self.parts[one], self.parts[two]
        if first.body == second.body:
            return True
        for held, other in ((first.held, second), (second.held, first)):
            if held is not None and (other.link in held.touching or self._follows(other.body, held.link)):
                return True
        if first.held is not None or second.held is not None:
            return False
        parents = self.tree.model.parents
        if first.body in (parents[second.body],) or second.body in (parents[first.body],):
            return True
        pair = frozenset({first.link, second.link})
        return pair in self.model.description.touching or pair in self._built_into_each_other()

    def _follows(self, body: int, link: str) -> bool:
        """Return whether a body is moved by joints behind a link, as fingers are by those of a hand."""
        at, _ = self.tree.bodies[link]
        while body > at:
            body = self.tree.model.parents[body]
        return body == at != 0

    def _built_into_each_other(self) -> frozenset[frozenset[str]]:
        """Return pairs of links whose shapes touch in nearly all configurations, so that they overlap by design."""
        if self._touching is None:
            known = self.model.touching
            if known is None:
                known = self.model.touching = _sampled(self.model)
            self._touching = known
        return self._touching


def _sampled(model: RobotModel) -> frozenset[frozenset[str]]:
    tree = Tree(model.description, np.eye(4))
    geometry = pin.GeometryModel()
    links: list[tuple[str, int]] = []
    for each in model.collision:
        body, frame = tree.bodies[each.link]
        links.append((each.link, body))
        placed = pin.SE3(frame @ each.origin)
        geometry.addGeometryObject(pin.GeometryObject(each.name, body, placed, coal_geometry(each.shape)))
    pairs = [(one, two) for one in range(len(links)) for two in range(one + 1, len(links))]
    pairs = [(one, two) for one, two in pairs if links[one][1] != links[two][1]]
    for one, two in pairs:
        geometry.addCollisionPair(pin.CollisionPair(one, two))
    data = pin.GeometryData(geometry)
    chance = np.random.default_rng(0)
    lower, upper = np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi)
    counts: dict[frozenset[str], int] = {}
    for _ in range(_SAMPLES):
        q = tree.expand(chance.uniform(lower, upper))
        pin.computeCollisions(tree.model, tree.data, geometry, data, q, False)
        touched = {
            frozenset({links[one][0], links[two][0]})
            for (one, two), result in zip(pairs, data.collisionResults, strict=True)
            if result.isCollision()
        }
        for pair in touched:
            counts[pair] = counts.get(pair, 0) + 1
    return frozenset(pair for pair, count in counts.items() if count >= _ALWAYS * _SAMPLES)

"""The worker's copy of a world description as a CollisionWorld; only changed items are loaded and placed again."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from arcor2_hw.collision.description import MeshShape, RobotSource, WorldBody, WorldItem, WorldRobot
from arcor2_hw.collision.world import CollisionWorld
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_hw.kinematics import model, shapes
from arcor2_hw.kinematics.errors import BadMesh
from arcor2_hw.kinematics.inverse import InverseKinematics
from arcor2_hw.kinematics.meshes import read_mesh
from arcor2_hw.kinematics.model_package import MAX_MESH
from arcor2_hw.planning.reachability import Reachability

MESHES: Final = 64
"""Maximum number of cached meshes; the least recently used is dropped."""


class WorldReplica:
    """A CollisionWorld that follows a world description.

    Attributes:
        collisions: The collision world, up to date after `apply_changes`.
    """

    def __init__(self, load: Callable[[RobotSource], model.RobotModel]) -> None:
        self.collisions = CollisionWorld()
        self._load = load
        self._things: dict[str, WorldItem] = {}
        self._placed: dict[str, WorldItem] = {}
        """Items in `collisions`."""
        self._waiting: dict[str, None] = {}
        """Ids of items changed since, in order."""
        self._unusable: dict[str, Arcor2Error] = {}
        self._meshes: OrderedDict[tuple[str, tuple[float, float, float]], shapes.TriangleMesh] = OrderedDict()
        self._reach: dict[tuple[str, str], Reachability] = {}
        self._inverse: dict[tuple[str, str], InverseKinematics] = {}

    def change(self, put: Sequence[WorldItem], remove: Sequence[str]) -> None:
        """Record changes of the description."""
        for key in remove:
            self._things.pop(key, None)
            self._waiting[key] = None
        for thing in put:
            self._things[thing.id] = thing
            self._waiting[thing.id] = None

    def apply_changes(self) -> None:
        """Apply recorded changes to the collision world.

        Raises:
            Arcor2Error: An item cannot be used. The error is raised again at every call until the item is removed.
        """
        waiting, self._waiting = list(self._waiting), {}
        again = self._let_go(waiting)
        for key in sorted([*waiting, *again], key=self._order):
            self._unusable.pop(key, None)
            thing = self._things.get(key)
            try:
                self._put(key, thing)
            except Arcor2Error as error:
                self._drop(key)
                self._unusable[key] = error
        if self._unusable:
            raise next(iter(self._unusable.values()))

    def _order(self, key: str) -> int:
        """Return the order of processing: removals, robots, bodies, attached bodies."""
        thing = self._things.get(key)
        if thing is None:
            return 0
        return 1 if isinstance(thing, WorldRobot) else 2 if thing.attachment is None else 3

    def _let_go(self, waiting: Sequence[str]) -> list[str]:
        """Return the ids of bodies to attach again, because their robot is replaced or removed."""
        gone = {
            key
            for key in waiting
            if isinstance(old := self._placed.get(key), WorldRobot) and not _same_robot(old, self._things.get(key))
        }
        return [
            key
            for key, thing in self._things.items()
            if isinstance(thing, WorldBody)
            and thing.attachment is not None
            and key not in waiting
            and (thing.attachment.robot in gone or (key in self._unusable and thing.attachment.robot in waiting))
        ]

    # -------------------------------------------------------------------------------- one thing
    def _put(self, key: str, item: WorldItem | None) -> None:
        old = self._placed.get(key)
        match item:
            case None:
                self._drop(key)
                return
            case WorldRobot():
                if not _same_robot(old, item):
                    self._drop(key)
                self._stand(item, key in self._placed)
            case WorldBody():
                if isinstance(old, WorldRobot):
                    self._drop(key)
                self._place(item, old if isinstance(old, WorldBody) else None)
        self._placed[key] = item

    def _stand(self, robot: WorldRobot, stands: bool) -> None:
        world = self.collisions
        if not stands:
            world.add_robot(robot.id, self._load(robot.model), robot.model.base)
        else:
            world.move_robot(robot.id, robot.model.base)
        standing = world.robot(robot.id)
        if robot.joints:
            world.set_joints(robot.id, standing.model.values(robot.joints, standing.q))

    def _place(self, body: WorldBody, old: WorldBody | None) -> None:
        world, pose = self.collisions, body.pose
        if body.attachment is not None:
            if body.attachment.robot not in world.robots:
                raise NotFound(
                    "{id} is attached to {robot}, which is not in the world.", id=body.id, robot=body.attachment.robot
                )
            standing = world.robot(body.attachment.robot)
            frames = standing.link_frames(standing.q)
            if body.attachment.link not in frames:
                raise NotFound(
                    "{id} is attached to {link}, which is not a link of {robot}.",
                    id=body.id,
                    link=body.attachment.link,
                    robot=body.attachment.robot,
                )
            pose = type(pose).from_matrix(frames[body.attachment.link] @ pose.matrix())
        if old is not None and old.shape == body.shape:
            world.move(body.id, pose)
        else:
            world.put(body.id, self._shape(body), pose)
        if body.attachment is not None:
            world.attach(body.id, body.attachment.robot, body.attachment.link, touching=body.attachment.touching)

    def _drop(self, key: str) -> None:
        old = self._placed.pop(key, None)
        if isinstance(old, WorldRobot):
            self.collisions.remove_robot(key)
            for kept in (self._reach, self._inverse):
                for pair in [pair for pair in kept if pair[0] == key]:
                    del kept[pair]
        elif old is not None:
            self.collisions.delete(key)

    # -------------------------------------------------------------------------------- shapes
    def _shape(self, body: WorldBody) -> shapes.Shape:
        return self.mesh(body.shape) if isinstance(body.shape, MeshShape) else body.shape

    def mesh(self, shape: MeshShape) -> shapes.TriangleMesh:
        """Return a mesh, read once.

        Raises:
            BadMesh: The mesh cannot be used; the message names it.
        """
        key = (shape.file.path, shape.scale)
        found = self._meshes.pop(key, None)
        if found is None:
            found = mesh_of(shape)
        self._meshes[key] = found
        while len(self._meshes) > MESHES:
            self._meshes.popitem(last=False)
        return found

    # -------------------------------------------------------------------------------- cached robot models
    def reachability(self, robot: str, end_effector: str) -> Reachability:
        """Return the reachability of an end effector, with its cache.

        Raises:
            NotFound: The robot or end effector does not exist.
        """
        key = (robot, end_effector)
        if key not in self._reach:
            arm = self.collisions.robot(robot).model.arm(end_effector)
            self._reach[key] = Reachability(self.collisions, robot, arm)
        return self._reach[key]

    def inverse(self, robot: str, end_effector: str) -> InverseKinematics:
        """Return the inverse kinematics of an end effector.

        Raises:
            NotFound: The robot or end effector does not exist.
        """
        key = (robot, end_effector)
        if key not in self._inverse:
            self._inverse[key] = InverseKinematics(self.collisions.robot(robot).model.arm(end_effector))
        return self._inverse[key]


def mesh_of(shape: MeshShape) -> shapes.TriangleMesh:
    """Read a mesh.

    Raises:
        BadMesh: The mesh cannot be used; the message names it.
    """
    path = Path(shape.file.path)
    try:
        with path.open("rb") as file:
            content = file.read(MAX_MESH + 1)
    except OSError as error:
        raise BadMesh(
            "The mesh {name} cannot be read: {reason}.", name=shape.file.name, reason=error.strerror
        ) from error
    return read_mesh(content, shape.file.name, shape.scale)


def _same_robot(old: WorldItem | None, new: WorldItem | None) -> bool:
    """Return whether two items are the same robot, except for its base pose and joints."""
    if not isinstance(old, WorldRobot) or not isinstance(new, WorldRobot):
        return False
    one, other = old.model, new.model
    return (one.urdf, one.settings, one.calibration) == (other.urdf, other.settings, other.calibration)

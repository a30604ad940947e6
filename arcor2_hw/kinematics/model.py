"""A robot model: joints, links, shapes and end effectors, and poses for joint values.

Joint values are arrays in the order of `joints`, rad or (prismatic) m. Matrices are homogeneous, (4, 4), in the frame
of the root link unless stated otherwise. Not safe for use by two threads at once: a model computes in place.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np

from arcor2_hw.exceptions import NotFound
from arcor2_hw.kinematics import adjustment, shapes
from arcor2_hw.kinematics.arm import Arm, Step
from arcor2_hw.kinematics.description import Description, EndEffector, Geometry, Joint, MeshFile
from arcor2_hw.kinematics.errors import ZeroLength
from arcor2_hw.kinematics.joints import JointSet
from arcor2_hw.kinematics.meshes import read_mesh
from arcor2_hw.kinematics.model_package import MAX_MESH, Package
from arcor2_hw.kinematics.shapes import Array, MeshUse, Shape
from arcor2_hw.kinematics.tree import Tree
from arcor2_hw.kinematics.urdf import describe
from arcor2_hw.messages import Message

_PARALLEL: Final = 1e-6
_TOUCHING: Final = 1e-5


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A shape of a link, and its pose in the frame of the link, (4, 4)."""

    link: str
    name: str
    shape: Shape
    origin: Array


class RobotModel(JointSet):
    """A robot as its URDF describes it. Created by `load`.

    Attributes:
        links: Names of the links, from the root outwards.
        end_effectors: Links for which poses are specified.
        visual: Shapes for display.
        collision: Shapes for collision checks.
    """

    def __init__(self, description: Description, package: Package, beside: str, mesh_use: MeshUse = "hull") -> None:
        moving = [joint for joint in description.joints if joint.kind != "fixed" and joint.mimic is None]
        super().__init__(description.name, moving)
        self.description = description
        self.root = description.root
        self._package, self._beside, self._mesh_use = package, beside, mesh_use
        self.end_effectors: dict[str, EndEffector] = {each.link: each for each in description.end_effectors}
        self.tree = Tree(description, np.eye(4))
        self.links: tuple[str, ...] = tuple(self.tree.bodies)
        self.touching: frozenset[frozenset[str]] | None = None
        """Pairs of links that overlap by design, once computed."""
        self._refuse_zero_lengths()
        self.visual, self.collision = self._shapes()

    # -------------------------------------------------------------------------------- creation
    @classmethod
    def load(
        cls,
        source: Path | bytes,
        settings: Mapping[str, object] | None = None,
        *,
        name: str = "",
        mesh_use: MeshUse = "hull",
    ) -> Self:
        """Load a package: a folder, zip archive or single URDF file, or the bytes of an archive or URDF file.

        Args:
            source: The package.
            settings: Settings of the object, which the URDF may depend on.
            name: Name in messages.
            mesh_use: Whether collision meshes are replaced by their convex hulls, which is faster.

        Raises:
            ModelError: The package cannot be used; see `errors` for the kinds.
        """
        package = Package.open(source, name)
        beside, content = package.urdf()
        description = describe(content, package.name)
        return cls(adjustment.with_settings(description, settings or {}), package, beside, mesh_use)

    def with_origins(self, origins: Mapping[str, Array]) -> Self:
        """Return a model with other origins of joints in their parent links, (4, 4) each.

        Raises:
            ModelError: The joint does not exist.
        """
        moved = adjustment.with_origins(self.description, origins)
        return type(self)(moved, self._package, self._beside, self._mesh_use)

    # -------------------------------------------------------------------------------- poses
    def link_poses(self, q: Array) -> dict[str, Array]:
        """Return the frame of each link, (4, 4)."""
        return self.tree.frames(q)

    def arm(self, end_effector: str, tool: Array | None = None) -> Arm:
        """Return the chain from the root to an end effector, or to any link.

        Args:
            end_effector: The link.
            tool: Pose of a tool's tip in the frame of the link, (4, 4).

        Raises:
            NotFound: The link does not exist.
            ModelError: No joint moves it.
        """
        if end_effector not in self.description.links:
            known = ", ".join(self.end_effectors)
            raise NotFound(
                "{name} has no end effector {end_effector!r}. Available: {known}.",
                name=self.name,
                end_effector=end_effector,
                known=known,
            )
        steps: list[Step] = []
        link = end_effector
        to = {joint.child: joint for joint in self.description.joints}
        while link != self.root:
            joint = to[link]
            steps.append(self._step(joint))
            link = joint.parent
        kind = self.end_effectors.get(end_effector, EndEffector(end_effector))
        return Arm(self, kind, steps[::-1], np.eye(4) if tool is None else tool)

    def _step(self, joint: Joint) -> Step:
        if joint.kind == "fixed":
            return Step(joint.name, joint.origin, None, False, -1, 0.0, 0.0)
        leader, factor, offset = joint.name, 1.0, 0.0
        if joint.mimic is not None:
            leader, factor, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
        prismatic = joint.kind == "prismatic"
        return Step(joint.name, joint.origin, np.array(joint.axis), prismatic, self._column[leader], factor, offset)

    # -------------------------------------------------------------------------------- inside
    def _refuse_zero_lengths(self) -> None:
        """Reject two joints about the same axis, because the link between them has no length."""
        frames = self.link_poses(self.neutral())
        to = {joint.child: joint for joint in self.description.joints}
        for joint in self.joints:
            before = joint.parent
            while before in to and to[before].kind == "fixed":
                before = to[before].parent
            other = to.get(before)
            if other is None or other.mimic is not None or "prismatic" in (joint.kind, other.kind):
                continue
            one, two = frames[joint.child], frames[other.child]
            axis, axis_before = one[:3, :3] @ joint.axis, two[:3, :3] @ other.axis
            apart = one[:3, 3] - two[:3, 3]
            if (
                np.linalg.norm(np.cross(axis, axis_before)) < _PARALLEL
                and np.linalg.norm(np.cross(apart, axis)) < _TOUCHING
            ):
                raise ZeroLength(
                    "{name}: the link {child} has no length between the joints {other_name} and"
                    " {joint_name}, which turn about the same axis.",
                    name=self.name,
                    child=other.child,
                    other_name=other.name,
                    joint_name=joint.name,
                )

    def _shapes(self) -> tuple[tuple[LinkShape, ...], tuple[LinkShape, ...]]:
        visual: list[LinkShape] = []
        collision: list[LinkShape] = []
        for link in self.description.links.values():
            visual += self._made(link.name, "visual", link.visual, "exact")
            collision += self._made(link.name, "collision", link.collision, self._mesh_use)
        return tuple(visual), tuple(collision)

    def _made(self, link: str, kind: str, every: tuple[Geometry, ...], use: MeshUse) -> list[LinkShape]:
        made = []
        for number, geometry in enumerate(every):
            where = Message.of("{robot}: link {name}, {kind}", robot=self.name, name=link, kind=kind)
            made.append(LinkShape(link, f"{link} {number}", self._shape(geometry, where, use), geometry.origin))
        return _capsules(made) if kind == "collision" else made

    def _shape(self, geometry: Geometry, element: Message, use: MeshUse) -> Shape:
        what = geometry.what
        if isinstance(what, MeshFile):
            if 0.0 in what.scale:
                raise ZeroLength(
                    "{place}: the mesh {reference} has a scale of zero.", place=element, reference=what.reference
                )
            path = self._package.locate(what.reference, self._beside)
            mesh = read_mesh(self._package.read(path, MAX_MESH), path, what.scale, upright=False)
            return (
                mesh
                if use == "exact"
                else shapes.hull_of(mesh.vertices, Message.of("{place}: the mesh {path}", place=element, path=path))
            )
        made = {"box": shapes.Box, "cylinder": shapes.Cylinder, "sphere": shapes.Sphere, "capsule": shapes.Capsule}
        shape: Shape = made[what.kind](*what.sizes)
        shapes.check(shape, element)
        return shape


def _capsules(made: list[LinkShape]) -> list[LinkShape]:
    """Replace a cylinder with a sphere of its radius at both ends by a capsule, which is faster to check."""
    left = list(made)
    for each in made:
        cylinder = each.shape
        if not isinstance(cylinder, shapes.Cylinder):
            continue
        ends = [each.origin[:3, 3] + sign * cylinder.length / 2.0 * each.origin[:3, 2] for sign in (-1.0, 1.0)]
        balls = [_ball(left, end, cylinder.radius) for end in ends]
        if balls[0] is not None and balls[1] is not None:
            capsule = shapes.Capsule(cylinder.radius, cylinder.length)
            left = [one for one in left if one not in (*balls, each)]
            left.append(LinkShape(each.link, each.name, capsule, each.origin))
    return left


def _ball(among: list[LinkShape], at: Array, radius: float) -> LinkShape | None:
    for each in among:
        ball = each.shape
        if not isinstance(ball, shapes.Sphere) or abs(ball.radius - radius) > _TOUCHING:
            continue
        if np.linalg.norm(each.origin[:3, 3] - at) < _TOUCHING:
            return each
    return None

"""Description of a robot: links with shapes, joints, end effectors and settings. `urdf` reads it from a file."""

from dataclasses import dataclass, field
from typing import Final, Literal

from arcor2_hw.kinematics.shapes import Array

JointKind = Literal["revolute", "continuous", "prismatic", "fixed"]
KINDS: Final[tuple[JointKind, ...]] = ("revolute", "continuous", "prismatic", "fixed")
ORIGIN: Final = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Reference to a mesh file, with its scale."""

    reference: str
    scale: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Primitive:
    """A box, cylinder, sphere or capsule with its sizes, m."""

    kind: Literal["box", "cylinder", "sphere", "capsule"]
    sizes: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Geometry:
    """A shape of a link, and its pose in the frame of the link, (4, 4)."""

    what: MeshFile | Primitive
    origin: Array


@dataclass(frozen=True, eq=False)
class Link:
    """A link with its visual and collision shapes."""

    name: str
    visual: tuple[Geometry, ...]
    collision: tuple[Geometry, ...]


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another one: value = multiplier * value of `joint` + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint.

    Attributes:
        origin: Pose in the parent link, (4, 4).
        axis: Unit axis in its own frame.
        lower: Lower limit, rad or m.
        upper: Upper limit, rad or m.
        velocity: Maximum velocity, rad/s or m/s.
        mimic: The joint that it follows, if any.
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    origin: Array
    axis: tuple[float, float, float]
    lower: float
    upper: float
    velocity: float
    mimic: Mimic | None = None


@dataclass(frozen=True)
class EndEffector:
    """A link for which poses are specified.

    Attributes:
        link: The link.
        free: Directions of its frame that are not controlled, of rx, ry, rz.
        position_tolerance: Maximum position error, m.
        orientation_tolerance: Maximum orientation error, rad.
    """

    link: str
    free: frozenset[str] = frozenset()
    position_tolerance: float = 1e-6
    orientation_tolerance: float = 1e-5


@dataclass(frozen=True)
class Setting:
    """A setting of the object type that a component of a joint or link follows."""

    name: str
    target: Literal["joint", "link"]
    of: str
    component: str


@dataclass(frozen=True, eq=False)
class Description:
    """The content of a URDF; joints are ordered from the root outwards."""

    name: str
    root: str
    links: dict[str, Link]
    joints: tuple[Joint, ...]
    end_effectors: tuple[EndEffector, ...]
    settings: tuple[Setting, ...] = ()
    touching: frozenset[frozenset[str]] = field(default_factory=frozenset)

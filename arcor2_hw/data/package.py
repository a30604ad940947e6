"""Execution packages: their metadata, and the data that they announce while they run."""

import enum

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.object_type import Box, Cylinder, Mesh, Sphere


class PackageMeta(Data, frozen=True):
    """The content of package.json that clients see."""

    name: str
    built: Timestamp
    executed: Timestamp | Unset = UNSET


class ProjectMeta(Data, frozen=True):
    """The project that a package was built from."""

    id: str
    name: str
    description: str
    modified: Timestamp


class PackageSummary(Data, frozen=True):
    """One package."""

    id: str
    package_meta: PackageMeta
    project_meta: ProjectMeta | Unset = UNSET


class CollisionModels(Data, frozen=True):
    """The collision models of a package's scene, by kind."""

    boxes: list[Box] = field(default_factory=list)
    spheres: list[Sphere] = field(default_factory=list)
    cylinders: list[Cylinder] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)


class PackageStateEnum(enum.StrEnum):
    """States of the execution (protocol, section 12.3)."""

    STARTED = "started"
    RUNNING = "running"
    STOPPING = "stopping"
    STOPPED = "stopped"
    PAUSING = "pausing"
    PAUSED = "paused"
    RESUMING = "resuming"
    UNDEFINED = "undefined"

"""A scene: the objects of a workplace, their poses and settings."""

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.interlocks import Interlock
from arcor2_hw.data.nodes import NodeName
from arcor2_hw.data.parameter import Parameter


class SceneObject(Data, frozen=True):
    """One object; `pose` is set exactly when its type has one.

    node (not in ARCOR2): name of the computer (`arcor2-hw node`) on which it runs; omitted if it needs none.
    """

    name: str
    type: str
    pose: Pose | Unset = UNSET
    parameters: list[Parameter] = field(default_factory=list)
    id: str = ""
    node: NodeName | Unset = UNSET


class BareScene(Data, frozen=True):
    """A scene without its objects."""

    name: str
    description: str = ""
    created: Timestamp | Unset = UNSET
    modified: Timestamp | Unset = UNSET
    int_modified: Timestamp | Unset = UNSET
    id: str = ""


class Scene(BareScene, frozen=True):
    """A scene with its objects. `interlocks` (not in ARCOR2) is omitted if there are none."""

    objects: list[SceneObject] = field(default_factory=list)
    interlocks: list[Interlock] | Unset = UNSET


def zones_of(scene: Scene | None) -> frozenset[str]:
    """Return the ids of the collision bodies that are zones of interlocks, and therefore no obstacles."""
    interlocks = UNSET if scene is None else scene.interlocks
    return frozenset() if isinstance(interlocks, Unset) else frozenset(one.zone for one in interlocks if one.zone)


class SceneObjectOverride(Data, frozen=True):
    """Settings of one scene object that a project overrides."""

    id: str
    parameters: list[Parameter]

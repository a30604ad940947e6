"""Object types as clients see them: metadata, actions, collision models."""

import enum
from collections.abc import Iterable
from typing import Self

from msgspec import field
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Data, Timestamp, TranslatableData, Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.messages import Message


class Model3dType(enum.StrEnum):
    """Kinds of collision model."""

    NONE = "None"
    BOX = "Box"
    CYLINDER = "Cylinder"
    SPHERE = "Sphere"
    MESH = "Mesh"


class Model(Data, frozen=True):
    """A collision model; its id is the object type's name."""

    id: str

    def type(self) -> Model3dType:
        """Return the kind of this model."""
        return Model3dType(self.__class__.__name__)


def _positive(model: Data, *names: str) -> None:
    for name in names:
        if not getattr(model, name) > 0:
            raise ValueError(f"{type(model).__name__}: {name} must be greater than zero")


class Box(Model, frozen=True):
    """A box around its origin, edges in m."""

    size_x: float
    size_y: float
    size_z: float

    def __post_init__(self) -> None:
        _positive(self, "size_x", "size_y", "size_z")


class Cylinder(Model, frozen=True):
    """A cylinder around its origin along z, m."""

    radius: float
    height: float

    def __post_init__(self) -> None:
        _positive(self, "radius", "height")


class Sphere(Model, frozen=True):
    """A sphere around its origin, m."""

    radius: float

    def __post_init__(self) -> None:
        _positive(self, "radius")


class Mesh(Model, frozen=True):
    """A mesh stored as an asset, with focus points for aiming with a robot."""

    asset_id: str
    focus_points: list[Pose] | Unset = UNSET


Models = Box | Cylinder | Sphere | Mesh


class ObjectModel(Data, frozen=True):
    """One model, named by its kind. Raises ValueError unless exactly the field of that kind is set."""

    type: Model3dType
    box: Box | Unset = UNSET
    cylinder: Cylinder | Unset = UNSET
    sphere: Sphere | Unset = UNSET
    mesh: Mesh | Unset = UNSET

    def __post_init__(self) -> None:
        given = {name for name in ("box", "cylinder", "sphere", "mesh") if getattr(self, name) is not UNSET}
        wanted = set() if self.type is Model3dType.NONE else {self.type.value.lower()}
        if given != wanted:
            raise ValueError(f"a model of type {self.type.value} needs exactly the field {', '.join(wanted) or 'none'}")

    def model(self) -> Models:
        """Return the model. Raises ValueError when the type is None."""
        for model in (self.box, self.cylinder, self.sphere, self.mesh):
            if not isinstance(model, Unset):
                return model
        raise ValueError("an object model of type None contains no model")

    @classmethod
    def of(cls, model: Models) -> "ObjectModel":
        """Wrap a model."""
        kind = model.type()
        return cls(kind, **{kind.value.lower(): model})  # type: ignore[arg-type]


class ParameterMeta(Data, frozen=True):
    """One parameter of an action or setting; `extra` and `default_value` are JSON in strings.

    former_names (not in ARCOR2): names in older projects. secret: the value of this setting is stored by the server and
    never sent to clients. address: whether this setting contains the address of the device; omitted when its name
    decides. for_control: whether the device can only be observed while this setting has its default value.
    found_by: the search (arcor2_hw.data.discovery.Search) that finds values of this setting.
    """

    name: str
    type: str
    dynamic_value: bool = False
    dynamic_value_parents: set[str] | Unset = UNSET
    description: str | Unset = UNSET
    default_value: str | Unset = UNSET
    extra: str | Unset = UNSET
    former_names: list[str] | Unset = UNSET
    secret: bool | Unset = UNSET
    address: bool | Unset = UNSET
    for_control: bool | Unset = UNSET
    found_by: str | Unset = UNSET


class Again(enum.StrEnum):
    """Whether an action may be repeated after a failure: always, after confirmation by a person, or never."""

    SAFE = "safe"
    ASK = "ask"
    NEVER = "never"


class ActionMetadata(Data, frozen=True):
    """Properties of an action. `composite` actions may call others; `hidden` actions are not offered to users.

    verdict (not in ARCOR2): whether the returned boolean says that a part is good. again (not in ARCOR2): whether the
    action may be repeated after it has failed; ask if it is omitted.
    """

    composite: bool = False
    hidden: bool = False
    cancellable: bool = False
    verdict: bool | Unset = UNSET
    again: Again | Unset = UNSET


class ObservationMeta(Data, frozen=True):
    """An observation that interlocks compare: name, parameter type of its value, and description.

    members: values of an enumeration, each as JSON. unit: SI; omitted without one. of_point: whether the observation
    belongs to a point, such as an input of an I/O block, whose name the interlock states.
    """

    name: str
    type: str
    description: str = ""
    unit: str | Unset = UNSET
    members: list[str] | Unset = UNSET
    of_point: bool | Unset = UNSET


class Disableable(TranslatableData, frozen=True, kw_only=True):
    """Base of items that a problem in their source disables. `key` and `values` translate the problem."""

    disabled: bool = False
    problem: str | Unset = UNSET

    def disabled_because(self, problem: Message) -> Self:
        """Return this, disabled by a problem."""
        return replace(self.untranslated(), disabled=True, problem=problem.text, **problem.translation())

    @property
    def why_disabled(self) -> Message:
        """The problem as a message, to be translated as part of another one."""
        text = "the reason is unknown" if isinstance(self.problem, Unset) else self.problem
        key = text if isinstance(self.key, Unset) else self.key
        return Message(text, key, {} if isinstance(self.values, Unset) else self.values)


class ObjectAction(Disableable, frozen=True):
    """One action of an object type; category, icon, former_names, key and values are not in ARCOR2.

    former_names: names in older projects.
    """

    name: str
    description: str | Unset = UNSET
    parameters: list[ParameterMeta] = field(default_factory=list)
    meta: ActionMetadata = ActionMetadata()
    origins: str | Unset = UNSET
    returns: list[str] = field(default_factory=list)
    category: str | Unset = UNSET
    icon: str | Unset = UNSET
    former_names: list[str] | Unset = UNSET

    def present_name(self, parameter: str) -> str:
        """Return the present name of a parameter given by a present or former name."""
        for each in self.parameters:
            if not isinstance(each.former_names, Unset) and parameter in each.former_names:
                return each.name
        return parameter


def find_action(actions: Iterable[ObjectAction], name: str) -> ObjectAction | None:
    """Return the action with a name, or with this former name; None if there is neither."""
    actions = list(actions)
    present = next((action for action in actions if action.name == name), None)
    formerly = (each for each in actions if not isinstance(each.former_names, Unset) and name in each.former_names)
    return present or next(formerly, None)


class ObjectTypeMeta(Disableable, frozen=True):
    """Metadata of an object type; all fields from display_name on, key and values are not in ARCOR2.

    display_name: name for users; omitted when the type declares none.
    built_in: a base class or an installed type, which cannot be deleted. shadows: distribution and version of the
    installed type of the same name that this uploaded type replaces. observable: whether StreamObservations returns
    values of its objects. observations: those that interlocks compare.
    """

    type: str
    description: str = ""
    built_in: bool = False
    base: str = ""
    object_model: ObjectModel | Unset = UNSET
    needs_parent_type: str | Unset = UNSET
    has_pose: bool = False
    abstract: bool = False
    settings: list[ParameterMeta] = field(default_factory=list)
    modified: Timestamp | Unset = UNSET
    display_name: str | Unset = UNSET
    category: str | Unset = UNSET
    icon: str | Unset = UNSET
    shadows: str | Unset = UNSET
    observable: bool | Unset = UNSET
    observations: list[ObservationMeta] | Unset = UNSET

    @property
    def shown_name(self) -> str:
        """The name for users: the display name, or without one the name of the class."""
        return self.type if isinstance(self.display_name, Unset) else self.display_name


class ObjectTypeSource(Data, frozen=True):
    """A stored object type: its Python module and its collision model.

    Attributes:
        modules: Sources of the modules that belong to this type only, by name. UNSET: none, or when saving, the stored
            ones remain.
    """

    id: str
    source: str
    description: str | Unset = UNSET
    model: ObjectModel | Unset = UNSET
    created: Timestamp | Unset = UNSET
    modified: Timestamp | Unset = UNSET
    modules: dict[str, str] | Unset = UNSET

    @property
    def own_modules(self) -> dict[str, str]:
        """The sources of the modules of this type; empty if it has none."""
        return {} if isinstance(self.modules, Unset) else self.modules

    @property
    def code(self) -> tuple[str, dict[str, str]]:
        """The source and the modules, to compare types."""
        return self.source, self.own_modules

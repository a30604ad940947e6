"""A project: action points with orientations, joints and actions, the logic between actions, parameters."""

import enum
from collections.abc import Iterator
from typing import Final

from msgspec import field

from arcor2_hw.data.base import UNSET, Data, MutableData, Timestamp, Unset
from arcor2_hw.data.geometry import Orientation, Position
from arcor2_hw.data.operator import Operator as Operator
from arcor2_hw.data.parameter import Parameter, Range
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import SceneObjectOverride

START = "START"
END = "END"
ERROR_FLOW: Final = "error"
"""The flow in a link to the error of an action: `<action id>/error/<index of the part>`."""
ERROR_PARTS: Final = ("device", "kind", "text")
"""The parts of an error, in the order of their indexes. All are strings."""

CALL: Final = "call"
"""The action of a function in the type of an action that calls it: `<function id>/call`."""

PARALLEL: Final = "functions/parallel"
"""The type of an action that runs several calls at once, and ends when all of them have ended."""
MIN_BRANCHES: Final = 2
"""Minimum number of calls that an action runs at once."""
MAX_BRANCHES: Final = 4
"""Maximum number of calls that an action runs at once."""


MAX_RETRIES: Final = 100
"""Maximum number of repetitions of an action."""
MAX_RETRY_PAUSE: Final = 3600.0
"""Maximum pause before a repetition, s."""


class FlowTypes(enum.StrEnum):
    """Kinds of flow that leave an action."""

    DEFAULT = "default"


class Flow(Data, frozen=True):
    """Names of the results of an action; without names the results are not stored.

    Raises ValueError when an output name is repeated.
    """

    type: FlowTypes = FlowTypes.DEFAULT
    outputs: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.outputs) != len(set(self.outputs)):
            raise ValueError("the outputs of a flow need unique names")


class ActionParameterType(enum.StrEnum):
    """Values of an action parameter's `type` in addition to the names of parameter types."""

    PROJECT_PARAMETER = "project_parameter"
    LINK = "link"
    FUNCTION_PARAMETER = "function_parameter"
    """The name of a parameter of the function that contains the action; not in ARCOR2."""


class ActionParameter(Parameter, frozen=True):
    """A literal, a project parameter, a parameter of the function, or a link to a result, depending on `type`."""


class BareAction(Data, frozen=True):
    """An action without parameters and flows; `type` is `<object id>/<action name>`, or `<function id>/call`."""

    name: str
    type: str
    id: str = ""


class Retry(Data, frozen=True):
    """Maximum number of repetitions of a failed action, and the pause before each repetition, s."""

    count: int
    pause: float = 0.0


class Action(BareAction, frozen=True):
    """An action on an action point, or of a function.

    `error_output` names the error for the actions after an error exit; without it, the error is not stored. `retry`
    repeats an action that is safe to repeat. `branches` are the ids of the calls that an action of type
    `functions/parallel` runs at once; no connection leads to or from them.
    """

    parameters: list[ActionParameter] = field(default_factory=list)
    flows: list[Flow] = field(default_factory=list)
    error_output: str | Unset = UNSET
    retry: Retry | Unset = UNSET
    branches: list[str] | Unset = UNSET

    def parse_type(self) -> tuple[str, str]:
        """Return the object id and the name of the method. Raises ValueError when `type` is not of that form."""
        object_id, slash, method = self.type.partition("/")
        if not slash or not object_id or not method or "/" in method:
            raise ValueError(f"action {self.name}: type {self.type!r} is not <object id>/<action>")
        return object_id, method

    @property
    def is_parallel(self) -> bool:
        """Whether the action runs several calls at once."""
        return self.type == PARALLEL

    def outputs(self) -> list[str]:
        """Return the names of the results in the default flow, empty when they are not stored."""
        return next((flow.outputs for flow in self.flows if flow.type is FlowTypes.DEFAULT), [])

    def names(self) -> list[str]:
        """Return the names of the results and of the error: the variables of the program."""
        return [*self.outputs(), self.error_output] if self.error_output else self.outputs()


class NamedOrientation(Data, frozen=True):
    """An orientation of an action point."""

    name: str
    orientation: Orientation
    id: str = ""


class ProjectRobotJoints(MutableData):
    """Joint values of one robot, stored at an action point; rad, m where prismatic."""

    name: str
    robot_id: str
    joints: list[Joint]
    is_valid: bool = False
    arm_id: str | Unset = UNSET
    end_effector_id: str | Unset = UNSET
    id: str = ""


class BareActionPoint(Data, frozen=True):
    """An action point without its lists; the position is relative to the parent, or global without one."""

    name: str
    position: Position
    parent: str | Unset = UNSET
    display_name: str | Unset = UNSET
    description: str | Unset = UNSET
    id: str = ""


class ActionPoint(BareActionPoint, frozen=True):
    """An action point with orientations, joints and actions."""

    orientations: list[NamedOrientation] = field(default_factory=list)
    robot_joints: list[ProjectRobotJoints] = field(default_factory=list)
    actions: list[Action] = field(default_factory=list)


class ProjectLogicIf(Data, frozen=True):
    """A condition: `what` is `<action id>/default/<output index>`, `value` JSON in a string."""

    what: str
    value: str

    def parse_what(self) -> tuple[str, str, int]:
        """Return action id, flow and output index. Raises ValueError when `what` is not of that form."""
        return parse_link(self.what)


class Match(enum.StrEnum):
    """Whether all comparisons have to be true, or any of them."""

    ALL = "all"
    ANY = "any"


class LogicComparison(Data, frozen=True):
    """A comparison of a value with a constant, or with another value.

    `what` is `<action id>/default/<output index>`, or the id of a project parameter. `value`, and `upper` of a range,
    are JSON in a string. `other` is another value in the form of `what`; `value` is empty then.
    """

    what: str
    operator: Operator
    value: str = ""
    upper: str | Unset = UNSET
    other: str | Unset = UNSET

    def compared(self) -> list[str]:
        """Return the compared values: `what`, and `other` if there is one."""
        return [self.what] if isinstance(self.other, Unset) else [self.what, self.other]


class LogicWhen(Data, frozen=True):
    """A condition of one or several comparisons."""

    comparisons: list[LogicComparison]
    match: Match = Match.ALL


def parse_link(link: str) -> tuple[str, str, int]:
    """Split `<action id>/<flow>/<output index>`. Raises ValueError when the text is not of that form."""
    parts = link.split("/")
    if len(parts) != 3 or not parts[0] or not parts[2].isdecimal():
        raise ValueError(f"{link!r} is not <action id>/<flow>/<output index>")
    return parts[0], parts[1], int(parts[2])


class LogicItem(Data, frozen=True):
    """A step from one action to the next, taken when its condition holds.

    `when` is a condition that compares several values; `condition` is then unset. With `error_kinds` it is an error
    exit: it is taken when the action fails with an error of one of these kinds.
    """

    start: str
    end: str
    condition: ProjectLogicIf | Unset = UNSET
    id: str = ""
    error_kinds: list[str] | Unset = UNSET
    when: LogicWhen | Unset = UNSET

    @property
    def has_condition(self) -> bool:
        """Whether the step depends on a condition."""
        return not isinstance(self.condition, Unset) or self.has_comparisons

    @property
    def has_comparisons(self) -> bool:
        """Whether the step depends on comparisons. Without any, it has no condition."""
        return not isinstance(self.when, Unset) and bool(self.when.comparisons)

    def used(self) -> set[str]:
        """Return the ids of the actions and project parameters whose values the condition compares."""
        links = [] if isinstance(self.condition, Unset) else [self.condition.what]
        if not isinstance(self.when, Unset):
            links += [what for one in self.when.comparisons for what in one.compared()]
        return {link.partition("/")[0] for link in links}

    @property
    def is_error_exit(self) -> bool:
        """Whether the step is taken when the action fails. Without kinds it is an ordinary step."""
        return bool(self.error_kinds)


class ProjectParameter(Parameter, frozen=True):
    """A constant of the project, or a variable with its value at the start of a run.

    Actions store results in a variable by giving the result its name.
    """

    range: Range | Unset = UNSET
    display_name: str | Unset = UNSET
    description: str | Unset = UNSET
    id: str = ""
    variable: bool | Unset = UNSET


class FunctionReturns(Data, frozen=True):
    """A result of a function: its type, and the result `<action id>/default/<output index>` of one of its actions."""

    type: str
    link: str


class ProjectFunction(Data, frozen=True):
    """A named group of actions with logic of its own, which actions of type `<function id>/call` call.

    `type` of a parameter is the name of a parameter type. Its `value` has no meaning, and is empty.
    """

    name: str
    actions: list[Action] = field(default_factory=list)
    logic: list[LogicItem] = field(default_factory=list)
    parameters: list[ActionParameter] = field(default_factory=list)
    returns: list[FunctionReturns] = field(default_factory=list)
    id: str = ""


class BareProject(Data, frozen=True):
    """A project without its content."""

    name: str
    scene_id: str
    description: str = ""
    has_logic: bool = True
    created: Timestamp | Unset = UNSET
    modified: Timestamp | Unset = UNSET
    int_modified: Timestamp | Unset = UNSET
    id: str = ""


class Project(BareProject, frozen=True):
    """A project with its content.

    `script` is the program in Python as a person has edited it. Build uses its comments and formatting.
    """

    action_points: list[ActionPoint] = field(default_factory=list)
    parameters: list[ProjectParameter] = field(default_factory=list)
    functions: list[ProjectFunction] = field(default_factory=list)
    logic: list[LogicItem] = field(default_factory=list)
    object_overrides: list[SceneObjectOverride] = field(default_factory=list)
    project_objects_ids: list[str] | Unset = UNSET
    script: str | Unset = UNSET

    def all_actions(self) -> Iterator[Action]:
        """Return the actions on all action points, then those of all functions."""
        for point in self.action_points:
            yield from point.actions
        for function in self.functions:
            yield from function.actions

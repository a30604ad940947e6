"""The ten kinds of parameter an action may take: how one is read, checked, compiled and shown (protocol, 9.4)."""

import abc
import ast
import copy
import math
from typing import Any, ClassVar, Final, Protocol

import msgspec

from arcor2_hw.actions.json_values import decode_json, decode_picture, encode, is_picture
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.project_index import ProjectLookup, global_pose
from arcor2_hw.exceptions import Arcor2Error, InvalidData


class ScriptNames(Protocol):
    """By what names a script knows the things that parameters refer to. Build implements it."""

    def pose(self, orientation_id: str) -> ast.expr:
        """Give the expression for the pose of an action point with this orientation."""

    def position(self, action_point_id: str) -> ast.expr:
        """Give the expression for the position of an action point."""

    def joints(self, joints_id: str) -> ast.expr:
        """Give the expression for joints of an action point."""

    def enum_member(self, parameter: Parameter, value: str | int) -> ast.expr:
        """Give the expression for the member with `value` of the enumeration that `parameter` takes."""


def read_json(parameter: Parameter) -> Any:
    """Give the JSON document inside `parameter.value`; InvalidData naming the parameter when it is none."""
    try:
        return msgspec.json.decode(parameter.value)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InvalidData(f"parameter {parameter.name}: the value is not JSON: {error}") from error


def read_reference(parameter: Parameter) -> str:
    """Give the id that `parameter.value` holds; InvalidData naming the parameter when it holds none."""
    found = read_json(parameter)
    if not isinstance(found, str) or not found:
        raise InvalidData(f"parameter {parameter.name}: {parameter.value[:80]} is not an id")
    return found


class ParameterType(abc.ABC):
    """One kind of parameter.

    name: what the protocol calls it. annotations: the type hints that mean it, as they end in source (`Image.Image`).
    """

    name: ClassVar[str]
    annotations: ClassVar[frozenset[str]]

    @abc.abstractmethod
    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Return when `parameter` is a sound literal of this kind; InvalidData naming it when it is not.

        meta: what the action says of the parameter (range, allowed values); None where there is no such saying, as
        for project parameters. lookup: where ids are looked up; without it nothing can be referred to.
        robot_id: the robot whose action it is, which joints must belong to; None when that is not known.
        """

    @abc.abstractmethod
    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Give what the action gets at execution: a copy of its own, geometry in the world.

        An enumeration is given by its raw value. Raises InvalidData naming the parameter.
        """

    @abc.abstractmethod
    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Give the expression that stands for the literal in a script. Raises InvalidData naming the parameter."""

    def encode(self, result: Any) -> str:
        """Give a value of this kind as JSON for events; InvalidData when it is not of this kind."""
        return encode(result)

    def decode_json(self, text: str, annotation: Any) -> Any:
        """Read a value that travelled as JSON into what `annotation` says; InvalidData when it does not fit."""
        return decode_json(text, annotation)

    def _check_type(self, parameter: Parameter, meta: ParameterMeta | None) -> None:
        if parameter.type != self.name or (meta is not None and meta.type != self.name):
            wanted = self.name if meta is None else meta.type
            raise InvalidData(f"parameter {parameter.name} must be of type {wanted}, not {parameter.type}")


class Extra(Data, frozen=True):
    """What an action says of a parameter beside its type: an inclusive range and the unit, or a closed list."""

    minimum: int | float | Unset = UNSET
    maximum: int | float | Unset = UNSET
    allowed_values: list[int | str] | Unset = UNSET
    unit: str | Unset = UNSET


def extra_of(meta: ParameterMeta | None) -> Extra:
    """Give what `meta.extra` says; InvalidData when it is not readable."""
    if meta is None or isinstance(meta.extra, Unset):
        return Extra()
    try:
        return msgspec.json.decode(meta.extra, type=Extra)
    except msgspec.MsgspecError as error:
        raise InvalidData(f"parameter {meta.name}: what is said of it is not readable: {error}") from error


class _Scalar(ParameterType):
    """A JSON literal of exactly one kind."""

    python_type: ClassVar[type]
    kind: ClassVar[str]

    def _read(self, parameter: Parameter) -> Any:
        found = read_json(parameter)
        # type() and not isinstance(): true is no integer, and 1 is no double.
        if type(found) is not self.python_type:
            raise InvalidData(f"parameter {parameter.name}: {parameter.value[:80]} is not {self.kind}")
        return found

    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Check the kind of the literal, and what the action says of it."""
        self._check_type(parameter, meta)
        self._check_extra(parameter, self._read(parameter), extra_of(meta))

    def _check_extra(self, parameter: Parameter, found: Any, extra: Extra) -> None:
        """Compare with what the action says; a plain scalar has nothing to compare."""

    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Give the literal."""
        return self._read(parameter)

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Give the literal as Python writes it."""
        found = self._read(parameter)
        if isinstance(found, int | float) and not isinstance(found, bool) and math.copysign(1, found) < 0:
            # Python has no negative literals; an AST with one would not come back from its own source.
            return ast.UnaryOp(ast.USub(), ast.Constant(-found))
        return ast.Constant(found)

    def encode(self, result: Any) -> str:
        """Give the value as JSON; InvalidData when it is of another kind."""
        # bool is a subclass of int in Python only.
        if not isinstance(result, self.python_type) or (isinstance(result, bool) and self.python_type is not bool):
            raise InvalidData(f"{result!r:.80} is not {self.kind}")
        return encode(self.python_type(result))


class _Number(_Scalar):
    def _check_extra(self, parameter: Parameter, found: Any, extra: Extra) -> None:
        low = -math.inf if isinstance(extra.minimum, Unset) else extra.minimum
        high = math.inf if isinstance(extra.maximum, Unset) else extra.maximum
        if not low <= found <= high:
            raise InvalidData(f"parameter {parameter.name}: {found} is not within {low} and {high}")


class BooleanType(_Scalar):
    """True or false."""

    name = "boolean"
    annotations = frozenset({"bool"})
    python_type = bool
    kind = "true or false"


class IntegerType(_Number):
    """A whole number."""

    name = "integer"
    annotations = frozenset({"int"})
    python_type = int
    kind = "an integer"


class DoubleType(_Number):
    """A number with a fraction or exponent."""

    name = "double"
    annotations = frozenset({"float"})
    python_type = float
    kind = "a number with a fraction or an exponent"

    def encode(self, result: Any) -> str:
        """Give the number as JSON, always with a fraction; InvalidData when it is not finite."""
        # PEP 484 lets an int stand for a float; on the wire a double needs its fraction.
        if isinstance(result, int) and not isinstance(result, bool):
            try:
                result = float(result)
            except OverflowError as error:
                raise InvalidData("an integer is too large for a double") from error
        if isinstance(result, float) and not math.isfinite(result):
            raise InvalidData(f"{result} has no form in JSON")
        return super().encode(result)


class StringType(_Scalar):
    """Text."""

    name = "string"
    annotations = frozenset({"str"})
    python_type = str
    kind = "a string"


class _Enumeration(_Scalar):
    """A value out of a closed list; a hint means it when it names a subclass of the framework's enumeration."""

    def _check_extra(self, parameter: Parameter, found: Any, extra: Extra) -> None:
        allowed = extra.allowed_values
        if not isinstance(allowed, Unset) and found not in allowed:
            raise InvalidData(f"parameter {parameter.name}: {found!r} is none of {', '.join(map(repr, allowed))}")

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Give the member by its name."""
        return names.enum_member(parameter, self._read(parameter))


class StringEnumType(_Enumeration):
    """Text out of a closed list."""

    name = "string_enum"
    annotations = frozenset({"StrEnum"})
    python_type = str
    kind = "a string"

    def encode(self, result: Any) -> str:
        """Give the value of the member as JSON."""
        return super().encode(getattr(result, "value", result))


class IntegerEnumType(_Enumeration):
    """A whole number out of a closed list."""

    name = "integer_enum"
    annotations = frozenset({"IntEnum"})
    python_type = int
    kind = "an integer"


class _Reference(ParameterType):
    """Something of the project, by its id."""

    result_type: ClassVar[type]
    what: ClassVar[str]

    @abc.abstractmethod
    def _find(self, reference: str, lookup: ProjectLookup) -> Any:
        """Give what is referred to, as it is at execution; NotFound."""

    def _resolve(self, parameter: Parameter, lookup: ProjectLookup | None) -> Any:
        reference = read_reference(parameter)
        if lookup is None:
            raise InvalidData(f"parameter {parameter.name}: {self.what} can be told in a project only")
        try:
            return self._find(reference, lookup)
        except Arcor2Error as error:
            raise InvalidData(f"parameter {parameter.name}: {error}") from error

    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Check that the id is known."""
        self._check_type(parameter, meta)
        self._resolve(parameter, lookup)

    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Give a copy of what the id stands for, in the world."""
        return copy.deepcopy(self._resolve(parameter, lookup))

    def encode(self, result: Any) -> str:
        """Give the value as JSON; InvalidData when it is of another kind."""
        if not isinstance(result, self.result_type):
            raise InvalidData(f"{result!r:.80} is no {self.result_type.__name__}")
        return encode(result)


class PoseType(_Reference):
    """A pose: the id of an orientation, whose action point gives the position."""

    name = "pose"
    annotations = frozenset({"Pose"})
    result_type = Pose
    what = "a pose"

    def _find(self, reference: str, lookup: ProjectLookup) -> Pose:
        point, named = lookup.orientation(reference)
        return global_pose(lookup, point, named.orientation)

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Give the pose by the names of action point and orientation."""
        return names.pose(read_reference(parameter))


class PositionType(_Reference):
    """A position: the id of an action point."""

    name = "position"
    annotations = frozenset({"Position"})
    result_type = Position
    what = "a position"

    def _find(self, reference: str, lookup: ProjectLookup) -> Position:
        return global_pose(lookup, lookup.action_point(reference)).position

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Give the position by the name of its action point."""
        return names.position(read_reference(parameter))


class JointsType(_Reference):
    """Joint values of the robot whose action it is, by their id."""

    name = "joints"
    annotations = frozenset({"ProjectRobotJoints"})
    result_type = ProjectRobotJoints
    what = "joint values"

    def _find(self, reference: str, lookup: ProjectLookup) -> ProjectRobotJoints:
        return lookup.joints(reference)[1]

    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Check that the id is known, and that the joints are those of the robot."""
        self._check_type(parameter, meta)
        joints = self._resolve(parameter, lookup)
        if robot_id is not None and joints.robot_id != robot_id:
            raise InvalidData(f"parameter {parameter.name}: joints {joints.name} belong to another robot")

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Give the joints by the names of action point and joints."""
        return names.joints(read_reference(parameter))


class ImageType(ParameterType):
    """A picture: comes as a result and goes on by a link, never as a literal."""

    name = "image"
    annotations = frozenset({"Image", "Image.Image"})

    def _refuse(self, parameter: Parameter) -> InvalidData:
        return InvalidData(f"parameter {parameter.name}: a picture can only be linked to a result")

    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Refuse the literal."""
        raise self._refuse(parameter)

    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Refuse the literal."""
        raise self._refuse(parameter)

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Refuse the literal."""
        raise self._refuse(parameter)

    def encode(self, result: Any) -> str:
        """Give the picture as the protocol carries it."""
        if not is_picture(result):
            raise InvalidData(f"{result!r:.80} is no picture")
        return encode(result)

    def decode_json(self, text: str, annotation: Any) -> Any:
        """Read a picture back."""
        return decode_picture(text)


PARAMETER_TYPES: Final[dict[str, ParameterType]] = {
    kind.name: kind
    for kind in (
        BooleanType(),
        IntegerType(),
        DoubleType(),
        StringType(),
        StringEnumType(),
        IntegerEnumType(),
        PoseType(),
        PositionType(),
        JointsType(),
        ImageType(),
    )
}
"""Every parameter type by its name in the protocol; there is no other list of them."""

_BY_ANNOTATION: Final = {hint: kind for kind in PARAMETER_TYPES.values() for hint in kind.annotations}


def by_annotation(name: str) -> ParameterType | None:
    """Give the parameter type that a hint means, None when it means none.

    A dotted hint counts by its end (`common.Pose`). For an enumeration give its framework base (StrEnum, IntEnum).
    """
    parts = name.split(".")
    return _BY_ANNOTATION.get(".".join(parts[-2:])) or _BY_ANNOTATION.get(parts[-1])


def parameter_type(name: str) -> ParameterType:
    """Give the parameter type of that name; InvalidData when there is none."""
    try:
        return PARAMETER_TYPES[name]
    except KeyError:
        raise InvalidData(f"there is no parameter type {name!r:.80}") from None

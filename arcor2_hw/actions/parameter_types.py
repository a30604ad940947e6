"""The ten types of action parameters: how they are read, checked, compiled and displayed (protocol, section 9.4)."""

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
    """Names of the parts of a project in a script, implemented by the build."""

    def pose(self, orientation_id: str) -> ast.expr:
        """Return the expression for the pose of an action point with this orientation."""

    def position(self, action_point_id: str) -> ast.expr:
        """Return the expression for the position of an action point."""

    def joints(self, joints_id: str) -> ast.expr:
        """Return the expression for joints of an action point."""

    def enum_member(self, parameter: Parameter, value: str | int) -> ast.expr:
        """Return the expression for the member with `value` of the enumeration of `parameter`."""


def read_json(parameter: Parameter) -> Any:
    """Return the JSON document in `parameter.value`.

    Raises:
        InvalidData: It is not JSON; the message names the parameter.
    """
    try:
        return msgspec.json.decode(parameter.value)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InvalidData(f"parameter {parameter.name}: the value is not JSON: {error}") from error


def read_reference(parameter: Parameter) -> str:
    """Return the id in `parameter.value`.

    Raises:
        InvalidData: It is not an id; the message names the parameter.
    """
    found = read_json(parameter)
    if not isinstance(found, str) or not found:
        raise InvalidData(f"parameter {parameter.name}: {parameter.value[:80]} is not an id")
    return found


class ParameterType(abc.ABC):
    """One type of parameter.

    Attributes:
        name: Name in the protocol.
        annotations: Type hints of this type, by the end of their source text (`Image.Image`).
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
        """Check that `parameter` is a valid literal of this type.

        Args:
            parameter: The parameter.
            meta: Declaration of the parameter (range, allowed values); None for project parameters.
            lookup: Lookup for ids; without it, references are invalid.
            robot_id: Robot of the action, to which joints must belong; None when unknown.

        Raises:
            InvalidData: It is invalid; the message names the parameter.
        """

    @abc.abstractmethod
    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Return the argument at execution: a new object, with geometry in the world. An enumeration is its raw value.

        Raises:
            InvalidData: It is invalid; the message names the parameter.
        """

    @abc.abstractmethod
    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Return the expression of the literal in a script.

        Raises:
            InvalidData: It is invalid; the message names the parameter.
        """

    def encode(self, result: Any) -> str:
        """Convert a value of this type to JSON for events.

        Raises:
            InvalidData: It is not of this type.
        """
        return encode(result)

    def decode_json(self, text: str, annotation: Any) -> Any:
        """Convert a value from JSON to the type `annotation`.

        Raises:
            InvalidData: It does not have that type.
        """
        return decode_json(text, annotation)

    def _check_type(self, parameter: Parameter, meta: ParameterMeta | None) -> None:
        if parameter.type != self.name or (meta is not None and meta.type != self.name):
            wanted = self.name if meta is None else meta.type
            raise InvalidData(f"parameter {parameter.name} must be of type {wanted}, not {parameter.type}")


class Extra(Data, frozen=True):
    """Declaration of a parameter in addition to its type: an inclusive range and a unit, or a list of values."""

    minimum: int | float | Unset = UNSET
    maximum: int | float | Unset = UNSET
    allowed_values: list[int | str] | Unset = UNSET
    unit: str | Unset = UNSET


def extra_of(meta: ParameterMeta | None) -> Extra:
    """Return the content of `meta.extra`.

    Raises:
        InvalidData: It is invalid.
    """
    if meta is None or isinstance(meta.extra, Unset):
        return Extra()
    try:
        return msgspec.json.decode(meta.extra, type=Extra)
    except msgspec.MsgspecError as error:
        raise InvalidData(f"parameter {meta.name}: its declaration is invalid: {error}") from error


class _Scalar(ParameterType):
    """A JSON literal of exactly one kind."""

    python_type: ClassVar[type]
    kind: ClassVar[str]

    def _read(self, parameter: Parameter) -> Any:
        found = read_json(parameter)
        # type() instead of isinstance(), because true is not an integer, and 1 is not a double.
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
        """Check the kind of the literal, and its declared range or values."""
        self._check_type(parameter, meta)
        self._check_extra(parameter, self._read(parameter), extra_of(meta))

    def _check_extra(self, parameter: Parameter, found: Any, extra: Extra) -> None:
        """Compare with the declaration. A plain scalar has none."""

    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Return the literal."""
        return self._read(parameter)

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Return the literal in Python syntax."""
        found = self._read(parameter)
        if isinstance(found, int | float) and not isinstance(found, bool) and math.copysign(1, found) < 0:
            # Python has no negative literals; an AST with one would differ from the AST of its source.
            return ast.UnaryOp(ast.USub(), ast.Constant(-found))
        return ast.Constant(found)

    def encode(self, result: Any) -> str:
        """Convert the value to JSON.

        Raises:
            InvalidData: It is of another kind.
        """
        # In Python, bool is a subclass of int.
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
    """An integer."""

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
        """Convert the number to JSON, always with a fraction.

        Raises:
            InvalidData: It is not finite.
        """
        # By PEP 484 an int may be used as a float; on the wire a double needs its fraction.
        if isinstance(result, int) and not isinstance(result, bool):
            try:
                result = float(result)
            except OverflowError as error:
                raise InvalidData("an integer is too large for a double") from error
        if isinstance(result, float) and not math.isfinite(result):
            raise InvalidData(f"{result} cannot be converted to JSON")
        return super().encode(result)


class StringType(_Scalar):
    """Text."""

    name = "string"
    annotations = frozenset({"str"})
    python_type = str
    kind = "a string"


class _Enumeration(_Scalar):
    """A value of a list; a type hint is an enumeration if it names a subclass of our enumerations."""

    def _check_extra(self, parameter: Parameter, found: Any, extra: Extra) -> None:
        allowed = extra.allowed_values
        if not isinstance(allowed, Unset) and found not in allowed:
            raise InvalidData(f"parameter {parameter.name}: {found!r} is not one of {', '.join(map(repr, allowed))}")

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Return the member by its name."""
        return names.enum_member(parameter, self._read(parameter))


class StringEnumType(_Enumeration):
    """Text of a list."""

    name = "string_enum"
    annotations = frozenset({"StrEnum"})
    python_type = str
    kind = "a string"

    def encode(self, result: Any) -> str:
        """Convert the value of the member to JSON."""
        return super().encode(getattr(result, "value", result))


class IntegerEnumType(_Enumeration):
    """An integer of a list."""

    name = "integer_enum"
    annotations = frozenset({"IntEnum"})
    python_type = int
    kind = "an integer"


class _Reference(ParameterType):
    """A part of the project, by its id."""

    result_type: ClassVar[type]
    what: ClassVar[str]

    @abc.abstractmethod
    def _find(self, reference: str, lookup: ProjectLookup) -> Any:
        """Return the referenced value at execution.

        Raises:
            NotFound: The id is unknown.
        """

    def _resolve(self, parameter: Parameter, lookup: ProjectLookup | None) -> Any:
        reference = read_reference(parameter)
        if lookup is None:
            raise InvalidData(f"parameter {parameter.name}: {self.what} is available in a project only")
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
        """Return a copy of the referenced value, in the world."""
        return copy.deepcopy(self._resolve(parameter, lookup))

    def encode(self, result: Any) -> str:
        """Convert the value to JSON.

        Raises:
            InvalidData: It is of another kind.
        """
        if not isinstance(result, self.result_type):
            raise InvalidData(f"{result!r:.80} is not a {self.result_type.__name__}")
        return encode(result)


class PoseType(_Reference):
    """A pose: the id of an orientation. Its action point provides the position."""

    name = "pose"
    annotations = frozenset({"Pose"})
    result_type = Pose
    what = "a pose"

    def _find(self, reference: str, lookup: ProjectLookup) -> Pose:
        point, named = lookup.orientation(reference)
        return global_pose(lookup, point, named.orientation)

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Return the pose by the names of action point and orientation."""
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
        """Return the position by the name of its action point."""
        return names.position(read_reference(parameter))


class JointsType(_Reference):
    """Joint values of the action's robot, by their id."""

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
        """Check that the id is known, and that the joints belong to the robot."""
        self._check_type(parameter, meta)
        joints = self._resolve(parameter, lookup)
        if robot_id is not None and joints.robot_id != robot_id:
            raise InvalidData(f"parameter {parameter.name}: joints {joints.name} belong to another robot")

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Return the joints by the names of action point and joints."""
        return names.joints(read_reference(parameter))


class ImageType(ParameterType):
    """An image, which can only be a result or a link to a result, never a literal."""

    name = "image"
    annotations = frozenset({"Image", "Image.Image"})

    def _refuse(self, parameter: Parameter) -> InvalidData:
        return InvalidData(f"parameter {parameter.name}: an image can only be linked to a result")

    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Reject the literal."""
        raise self._refuse(parameter)

    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Reject the literal."""
        raise self._refuse(parameter)

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Reject the literal."""
        raise self._refuse(parameter)

    def encode(self, result: Any) -> str:
        """Convert the image to JSON."""
        if not is_picture(result):
            raise InvalidData(f"{result!r:.80} is not an image")
        return encode(result)

    def decode_json(self, text: str, annotation: Any) -> Any:
        """Convert an image from JSON."""
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
"""Every parameter type by its name in the protocol."""

_BY_ANNOTATION: Final = {hint: kind for kind in PARAMETER_TYPES.values() for hint in kind.annotations}


def by_annotation(name: str) -> ParameterType | None:
    """Return the parameter type of a type hint, None when there is none.

    A dotted hint is matched by its end (`common.Pose`). For an enumeration pass its base class (StrEnum, IntEnum).
    """
    parts = name.split(".")
    return _BY_ANNOTATION.get(".".join(parts[-2:])) or _BY_ANNOTATION.get(parts[-1])


def parameter_type(name: str) -> ParameterType:
    """Return the parameter type of a name.

    Raises:
        InvalidData: There is no such type.
    """
    try:
        return PARAMETER_TYPES[name]
    except KeyError:
        raise InvalidData(f"there is no parameter type {name!r:.80}") from None

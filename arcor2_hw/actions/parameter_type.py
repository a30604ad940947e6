"""The base of all parameter types: how a parameter is read, checked, compiled and displayed (protocol, section 9.4)."""

import abc
import ast
from typing import Any, ClassVar, Protocol

import msgspec

from arcor2_hw.actions.json_values import decode_json, encode
from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project_index import ProjectLookup
from arcor2_hw.exceptions import InvalidData


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
        raise InvalidData(
            "parameter {name}: the value is not JSON: {reason}", name=parameter.name, reason=error
        ) from error


def read_reference(parameter: Parameter) -> str:
    """Return the id in `parameter.value`.

    Raises:
        InvalidData: It is not an id; the message names the parameter.
    """
    found = read_json(parameter)
    if not isinstance(found, str) or not found:
        raise InvalidData("parameter {name}: {value} is not an id", name=parameter.name, value=parameter.value[:80])
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
            raise InvalidData(
                "parameter {name} must be of type {wanted}, not {type}",
                name=parameter.name,
                wanted=wanted,
                type=parameter.type,
            )


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
        raise InvalidData(
            "parameter {name}: its declaration is invalid: {reason}", name=meta.name, reason=error
        ) from error

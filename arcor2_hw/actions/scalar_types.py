"""Parameter types of JSON literals: booleans, numbers, texts and enumerations."""

import ast
import math
from typing import Any, ClassVar

from arcor2_hw.actions.json_values import encode
from arcor2_hw.actions.parameter_type import Extra, ParameterType, ScriptNames, extra_of, read_json
from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project_index import ProjectLookup
from arcor2_hw.exceptions import InvalidData


class _Scalar(ParameterType):
    """A JSON literal of exactly one kind."""

    python_type: ClassVar[type]
    kind: ClassVar[str]

    def _read(self, parameter: Parameter) -> Any:
        found = read_json(parameter)
        # type() instead of isinstance(), because true is not an integer, and 1 is not a double.
        if type(found) is not self.python_type:
            raise InvalidData(
                "parameter {name}: {value} is not {type}",
                name=parameter.name,
                value=parameter.value[:80],
                type=self.kind,
            )
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
            raise InvalidData("{result!r:.80} is not {type}", result=result, type=self.kind)
        return encode(self.python_type(result))


class _Number(_Scalar):
    def _check_extra(self, parameter: Parameter, found: Any, extra: Extra) -> None:
        low = -math.inf if isinstance(extra.minimum, Unset) else extra.minimum
        high = math.inf if isinstance(extra.maximum, Unset) else extra.maximum
        if not low <= found <= high:
            raise InvalidData(
                "parameter {name}: {found} is not within {low} and {high}",
                name=parameter.name,
                found=found,
                low=low,
                high=high,
            )


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
            raise InvalidData("{result} cannot be converted to JSON", result=result)
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
            raise InvalidData(
                "parameter {name}: {found!r} is not one of {allowed}",
                name=parameter.name,
                found=found,
                allowed=", ".join(map(repr, allowed)),
            )

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

"""The names that a loop or function of a script can use."""

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.data.project import ActionParameter, Retry
from arcor2_server.build.reading.errors import NotUnderstood
from arcor2_server.build.reading.module import Script
from arcor2_server.build.reading.values import Values
from arcor2_server.documents.comparisons import Comparisons, Reference


@dataclass(slots=True)
class Call:
    """The call of an action in the script.

    Args:
        line: its line, from 1.
        name: name of the action (`an`).
        object_id: id of the scene object.
        type_name: its object type.
        declared: the called method.
        arguments: the arguments by parameter.
        outputs: the variables for its results.
    """

    line: int
    name: str
    object_id: str
    type_name: str
    declared: ObjectAction
    arguments: dict[str, ast.expr]
    outputs: list[str]
    results: dict[str, tuple[int, str, int]] = field(default_factory=dict)
    """Results of other calls that its arguments use, by parameter: number of the call, flow, number of the result."""
    passed: dict[str, str] = field(default_factory=dict)
    """The parameters of the function around the call that its arguments pass on, by parameter."""
    error: str = ""
    """The variable for its error; empty if it is not stored."""
    retry: Retry | Unset = UNSET


class Use(NamedTuple):
    """A use of a result or the error of call `source`: by call `user`, or by a condition after it."""

    user: int
    source: int
    line: int
    name: str
    in_condition: bool = False
    of_error: bool = False


@dataclass(slots=True)
class Scope:
    """The names that a loop or function can use, and its calls so far.

    Args:
        script: the script around it.
        values: reads arguments.
        parameters: the parameters of the function, by variable; None in the loop.
    """

    script: Script
    values: Values
    parameters: Mapping[str, ActionParameter] | None = None
    calls: list[Call] = field(default_factory=list)
    uses: list[Use] = field(default_factory=list)
    results: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Number of the call and of the result, by variable."""
    errors: dict[str, int] = field(default_factory=dict)
    """Number of the call, by the variable for its error."""
    stored: set[str] = field(default_factory=set)
    """The project parameters in which results are stored."""
    _lines: dict[str, int] = field(default_factory=dict)
    """The lines that define variables of the loop or function."""

    @property
    def stores(self) -> bool:
        """Whether calls may store results in variables of the project. Those of functions may not."""
        return self.parameters is None

    def parameter(self, name: str) -> ActionParameter | None:
        """Return a parameter of the function by its variable, None if there is no such parameter."""
        return None if self.parameters is None else self.parameters.get(name)

    def claim(self, name: str, line: int) -> None:
        """Store the line that defines a variable. Raise NotUnderstood if its name is already defined."""
        if self.parameters is not None and (name in self.parameters or name == "an"):
            raise NotUnderstood(line, "{name} is a parameter of the function", name=name)
        for lines in (self.script.lines, self._lines):
            if name in lines:
                raise NotUnderstood(line, "{name} is already defined in line {row}", name=name, row=lines[name])
        self._lines[name] = line

    def kind(self, reference: Reference) -> str:
        """Return the type of a compared value."""
        if reference.parameter:
            return next(kind for key, kind in self.values.parameters.values() if key == reference.parameter)
        return self.calls[reference.action].declared.returns[reference.output]

    def kinds(self, conditions: Iterable[Comparisons]) -> dict[Reference, str]:
        """Return the types of the values that conditions compare."""
        compared = {what for condition in conditions for one in condition.comparisons for what in one.compared()}
        return {what: self.kind(what) for what in compared}

"""Checks of functions, their parameters and results."""

from typing import Final

from arcor2_hw.actions.parameter_types import PARAMETER_TYPES
from arcor2_hw.data.project import FlowTypes, FunctionReturns, ProjectFunction
from arcor2_hw.data.project_index import ProjectLookup
from arcor2_hw.exceptions import InvalidData
from arcor2_server.documents.checks.actions import action_meta
from arcor2_server.documents.checks.names import check_name
from arcor2_server.documents.checks.object_types import Types
from arcor2_server.documents.item_indexes import link_of

PASSED: Final = frozenset(PARAMETER_TYPES) - {"image"}
"""The types of parameters of functions. An image has no literal."""


def check_function(function: ProjectFunction, lookup: ProjectLookup, types: Types) -> None:
    """Raise InvalidData or NotFound for a function with an invalid name, parameter or result.

    Its actions and logic are not checked, nor whether its name is free.
    """
    check_name(function.name, "function")
    names: set[str] = set()
    for parameter in function.parameters:
        check_name(parameter.name, "parameter")
        if parameter.name in names:
            raise InvalidData(
                "The function {name} has two parameters {parameter}.", name=function.name, parameter=parameter.name
            )
        names.add(parameter.name)
        if parameter.type not in PASSED:
            raise InvalidData(
                "The function {name}: {type} cannot be the type of the parameter {parameter}.",
                name=function.name,
                type=parameter.type,
                parameter=parameter.name,
            )
    for result in function.returns:
        try:
            kind = type_of_result(function, result, lookup, types)
        except InvalidData as error:
            raise InvalidData("The function {name}: {reason}", name=function.name, reason=error) from error
        if kind != result.type:
            raise InvalidData(
                "The function {name}: the result {link} is {type}, not {other}.",
                name=function.name,
                link=result.link,
                type=kind,
                other=result.type,
            )


def type_of_result(function: ProjectFunction, result: FunctionReturns, lookup: ProjectLookup, types: Types) -> str:
    """Return the type of a result of a function. Raise InvalidData or NotFound if it does not exist."""
    link = link_of(result)
    if link is None or link[1] != FlowTypes.DEFAULT:
        raise InvalidData("{link!r} is not <action id>/default/<output index>.", link=result.link)
    source = next((action for action in function.actions if action.id == link[0]), None)
    if source is None:
        raise InvalidData("it has no action {id}, whose result it returns.", id=link[0])
    returns = action_meta(source, lookup, types).returns
    if link[2] >= min(len(returns), len(source.outputs())):
        raise InvalidData(
            "{source} has no named result number {index}. Name its results.", source=source.name, index=link[2]
        )
    return returns[link[2]]

"""Conversion of arguments from JSON by the type hints of a method, and of results to JSON."""

import functools
import inspect
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import msgspec

from arcor2_hw.actions.decorator import with_present_names
from arcor2_hw.actions.json_values import decode_json, decode_picture, encode
from arcor2_hw.exceptions import InvalidData

OBJECTS: Final = "arcor2_hw.objects"
"""The package of the base classes."""


def encode_shown(value: Any) -> str:
    """Return a value as JSON for display; `repr` of a value that JSON cannot represent."""
    try:
        return encode(value)
    except InvalidData:
        return msgspec.json.encode(repr(value)[:200]).decode()


def results(value: Any) -> list[str]:
    """Return the results of an action in JSON: none, one, or the members of a tuple."""
    if value is None:
        return []
    if isinstance(value, tuple):
        return [encode(member) for member in value]
    return [encode(value)]


def _hint(annotation: Any, module: str) -> Any:
    """Evaluate one hint. A hint that exists only for type checkers remains text."""
    if not isinstance(annotation, str):
        return annotation
    try:
        return eval(annotation, vars(sys.modules[module]))  # noqa: S307 - this process runs that source anyway
    except Exception:  # noqa: BLE001 - a hint may be anything
        return annotation


@functools.cache
def _signature(function: Callable[..., Any]) -> tuple[inspect.Signature, Mapping[str, Any]]:
    signature = inspect.signature(function)
    try:
        hints = typing.get_type_hints(function)
    except (NameError, TypeError, AttributeError):
        hints = {p.name: _hint(p.annotation, function.__module__) for p in signature.parameters.values()}
    return signature, {name: hint for name, hint in hints.items() if hint is not inspect.Parameter.empty}


@functools.cache
def _inherited(cls: type, name: str) -> Mapping[str, Any]:
    """Return the hints of a method. Missing hints are those of the method that it overrides."""
    hints: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        function = base.__dict__.get(name)
        if isinstance(function, types.FunctionType):
            hints |= _signature(function)[1]
    return hints


def return_hint(bound: types.MethodType) -> Any:
    """Return the type hint of the result of a method; None if it returns nothing or has no hint."""
    cls: type = type(bound.__self__)
    return _inherited(cls, bound.__name__).get("return")


def decode_result(cls: type, name: str, raw: bytes, whose: str) -> Any:
    """Decode the result of a method or property from JSON by its type hint.

    Args:
        cls: The object type.
        name: Name of the method or property.
        raw: The result; not empty.
        whose: Name of the device, for messages.

    Raises:
        InvalidData: The result is of another type, or it has no type hint and is more than a number, a text or a list.
    """
    hint = _result_hint(cls, name)
    try:
        value = _decode(raw, Any if hint is None else hint)
    except (InvalidData, UnicodeDecodeError) as error:
        raise InvalidData(
            "{whose}: the result of {function}: {reason}", whose=whose, function=name, reason=error
        ) from error
    if hint is None and isinstance(value, dict):
        raise InvalidData(
            "{whose}: the result of {function} has no type hint, so it cannot be passed to another computer",
            whose=whose,
            function=name,
        )
    return value


@functools.cache
def _result_hint(cls: type, name: str) -> Any:
    member = inspect.getattr_static(cls, name)
    if isinstance(member, property) and member.fget is not None:
        return _signature(member.fget)[1].get("return")
    return _inherited(cls, name).get("return")


def _decode(raw: bytes, hint: Any) -> Any:
    name = hint if isinstance(hint, str) else getattr(hint, "__name__", "")
    module = "" if isinstance(hint, str) else getattr(hint, "__module__", "")
    if name.endswith("Image") and (isinstance(hint, str) or module.startswith("PIL")):
        return decode_picture(raw.decode())
    return decode_json(raw.decode(), Any if isinstance(hint, str) else hint)


def _positions(cls: type, name: str, given: Iterable[str]) -> list[str]:
    """Return the names by which the server calls a method, in the order of its parameters.

    For a method of a base class that is the order of its declaration there. For a method that returns the values of a
    dynamic parameter it is the order of `given`. For any other method the result is empty, because it is called by
    name.
    """
    for base in cls.__mro__:
        declared = base.__dict__.get(name)
        if base.__module__.startswith(OBJECTS) and isinstance(declared, types.FunctionType):
            return list(_signature(declared)[0].parameters)[1:]
    dynamic = getattr(cls, "DYNAMIC_PARAMS", {})
    offers = any(isinstance(value, tuple) and value[:1] == (name,) for value in dynamic.values())
    return list(given) if offers else []


def _own_names(cls: type, function: Callable[..., Any], given: Iterable[str]) -> dict[str, str]:
    """Map the names of arguments to the parameters of a method where they differ.

    ARCOR2 calls the methods of its base classes by position, so object types written for it may name the parameters
    freely.
    """
    parameters = _signature(function)[0].parameters
    places = [p.name for p in list(parameters.values())[1:] if p.kind is p.POSITIONAL_OR_KEYWORD]
    called = _positions(cls, function.__name__, given)
    pairs = zip(called, places, strict=False)
    return {name: own for name, own in pairs if name not in parameters and own not in called}


def decode_arguments(bound: Any, arguments: Mapping[str, bytes], whose: str) -> dict[str, Any]:
    """Decode the arguments of a bound method from JSON by its hints.

    Args:
        bound: The method.
        arguments: JSON by name of the parameter.
        whose: Name of the device, for messages.

    Raises:
        InvalidData: An argument is unknown, missing or of the wrong type.
    """
    function = bound.__func__ if isinstance(bound, types.MethodType) else bound
    signature, hints = _signature(function)
    if function is not bound:
        cls: type = type(bound.__self__)
        hints = _inherited(cls, function.__name__)
        own = _own_names(cls, function, arguments)
        hints = {own.get(name, name): hint for name, hint in hints.items()} | dict(_signature(function)[1])
        arguments = with_present_names(function, {own.get(name, name): raw for name, raw in arguments.items()})
    parameters = list(signature.parameters.values())
    takes_any = any(p.kind is p.VAR_KEYWORD for p in parameters)
    result: dict[str, Any] = {}
    for name, raw in arguments.items():
        if name not in signature.parameters and not takes_any:
            raise InvalidData(
                "{whose}: {function} has no parameter {name}", whose=whose, function=function.__name__, name=name
            )
        try:
            result[name] = _decode(raw, hints.get(name, Any))
        except (InvalidData, UnicodeDecodeError) as error:
            raise InvalidData(
                "{whose}: {function}: parameter {name}: {reason}",
                whose=whose,
                function=function.__name__,
                name=name,
                reason=error,
            ) from error
    missing = [
        p.name
        for p in parameters[1 if bound is not function else 0 :]
        if p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) and p.name not in result
    ]
    if missing:
        raise InvalidData(
            "{whose}: {function} requires {missing}",
            whose=whose,
            function=function.__name__,
            missing=", ".join(missing),
        )
    return result

"""Calls of functions of a script: they are announced like actions, and everything inside belongs to the call."""

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

from arcor2_hw.exceptions import InvalidData, ProgramFinished
from arcor2_hw.runtime.branches import Action
from arcor2_hw.runtime.lane import on_any_lane
from arcor2_hw.runtime.program import Program

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")


def function_of(program: Program, body: F) -> F:
    """Wrap a function of a script. Its calls have the name of their action, as calls of actions have: `an="..."`.

    Args:
        program: the program.
        body: the function.
    """
    signature = inspect.signature(body)
    named = "an" in signature.parameters
    what = getattr(body, "__name__", "function")

    @functools.wraps(body)
    def call(*arguments: Any, an: str | None = None, **keywords: Any) -> Any:
        shown = [*arguments, *keywords.values()]
        if named:
            keywords["an"] = an
        return announced(program, what, an, shown, lambda _: body(*arguments, **keywords))

    return cast("F", call)


def announced(
    program: Program, name: str, an: str | None, shown: Sequence[Any], body: Callable[[Action], T], *, own: bool = False
) -> T:
    """Run a call of a function, or parallel work, as an action that contains other actions.

    Args:
        program: the program.
        name: name of the called function, for messages.
        an: name of the action.
        shown: values of the parameters.
        body: receives the announced action and returns the result.
        own: whether `body` is code of this library, which is not interrupted, and whose result is not reported.
    """
    if on_any_lane():
        raise InvalidData("the function {what} cannot be called inside an action", what=name)
    main = program.in_main_thread
    program.inside = program.inside or main
    try:
        entered = program.function_begins(name, an, shown)
        try:
            if main:
                program.inside = own
            value = body(entered)
        except ProgramFinished:
            program.inside = program.inside or main
            program.function_ended(entered, None)
            raise
        except BaseException as error:
            program.inside = program.inside or main
            program.function_failed(entered, error)
            raise
        program.inside = program.inside or main
        program.function_ended(entered, None if own else value)
        return value
    finally:
        if main:
            program.inside = False

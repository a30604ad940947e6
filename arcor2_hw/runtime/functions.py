"""Calls of functions of a script: they are announced like actions, and everything inside belongs to the call."""

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar, cast

from arcor2_hw.exceptions import InvalidData, ProgramFinished
from arcor2_hw.runtime.lane import on_any_lane
from arcor2_hw.runtime.program import Program

F = TypeVar("F", bound=Callable[..., Any])


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
        if on_any_lane():
            raise InvalidData("the function {what} cannot be called inside an action", what=what)
        shown = [*arguments, *keywords.values()]
        if named:
            keywords["an"] = an
        main = program.in_main_thread
        program.inside = program.inside or main
        try:
            entered = program.function_begins(what, an, shown)
            try:
                if main:
                    program.inside = False
                value = body(*arguments, **keywords)
            except ProgramFinished:
                program.inside = program.inside or main
                program.function_ended(entered, None)
                raise
            except BaseException as error:
                program.inside = program.inside or main
                program.function_failed(entered, error)
                raise
            program.inside = program.inside or main
            program.function_ended(entered, value)
            return value
        finally:
            if main:
                program.inside = False

    return cast("F", call)

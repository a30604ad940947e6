"""Continues an interrupted program without repeating the completed actions of its present cycle."""

import ast
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from arcor2_hw.data.parts import DoneAction, RunCheckpoint, RunningAction
from arcor2_hw.exceptions import ERROR_KINDS, Arcor2Error, Conflict, ProgramInterrupted
from arcor2_hw.runtime.branches import Action, Branch
from arcor2_hw.runtime.recovery import decode_results


class Continuation:
    """The actions of the interrupted cycle. The script runs from its start; they return their stored results.

    The program is held, so that a person decides, at the first action that was not completed, at the first repeated
    action of a branch, and at each action that was running.

    Args:
        run: the interrupted run. Its results are complete.
    """

    def __init__(self, run: RunCheckpoint) -> None:
        self._lock = threading.Lock()
        kept, repeated = run.split_done()
        self._done: dict[str, deque[DoneAction]] = {}
        for each in kept:
            self._done.setdefault(each.branch, deque()).append(each)
        first = {each.branch: each for each in reversed(repeated)}
        unfinished = [RunningAction(0, each.action_id, each.name, each.branch) for each in first.values()]
        self._unfinished = {(each.branch, each.action_id): each for each in (*unfinished, *run.actions)}
        self._first = True

    def take(self, branch: Branch, action: str | None, name: str) -> DoneAction | None:
        """Return the outcome of the next action of a branch; None if it was not completed.

        Raises:
            Conflict: the interrupted program has done another action here.
        """
        with self._lock:
            waiting = self._done.get(branch.id)
            if not waiting:
                return None
            done = waiting.popleft()
            if done.action_id != action:
                raise Conflict(
                    "The program cannot continue: it was at {expected}, not at {action}. Start it from its beginning.",
                    expected=done.name,
                    action=name,
                )
            return done

    @property
    def unfinished(self) -> list[RunningAction]:
        """The actions about which a person still has to decide."""
        with self._lock:
            return list(self._unfinished.values())

    def interruption(self, branch: Branch, action: Action, name: str) -> ProgramInterrupted | None:
        """Return why a person has to decide about an action that was not completed; None if that is not necessary."""
        key = branch.id, action.id or ""
        with self._lock:
            first, self._first = self._first, False
            if self._unfinished.pop(key, None) is not None:
                return ProgramInterrupted(
                    "{action} was interrupted. Check what it has done, then decide how the program continues.",
                    action=name,
                )
            if first:
                return ProgramInterrupted("The program was interrupted before {action}.", action=name)
        return None


def set_variables(script: ast.Module, values: Mapping[str, str]) -> None:
    """Let a script start with other values of its variables, such as `count: int = 0`.

    Args:
        script: the syntax tree of the script, which is changed.
        values: the values by the name of the variable, in JSON.

    Raises:
        Conflict: the script assigns no initial value to one of the variables.
    """
    assigned: dict[str, ast.AnnAssign] = {}
    for body in (each.body for each in script.body if isinstance(each, ast.FunctionDef)):
        for statement in body:
            if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
                assigned.setdefault(statement.target.id, statement)
    for name, value in values.items():
        if (found := assigned.get(name)) is None or found.value is None:
            raise Conflict(
                "The program cannot continue: the script has no variable {name}. Start it from its beginning.",
                name=name,
            )
        start: Any = msgspec.json.decode(value)
        if isinstance(found.annotation, ast.Name) and found.annotation.id == "float":
            start = float(start)
        found.value = ast.copy_location(ast.Constant(start), found.value)


def value_of(done: DoneAction, method: Any) -> Any:
    """Return the stored result of an action. Raises the error that the program has handled."""
    if done.error:
        error = ERROR_KINDS.get(done.error, Arcor2Error)(done.text)
        vars(error)["code"] = done.code
        raise error
    return decode_results(method, done.results) if done.results else None


def kind_of(error: BaseException) -> str:
    """Return the kind of an error by which a program handles it."""
    kinds: Iterable[tuple[str, type[Arcor2Error]]] = ERROR_KINDS.items()
    return next((code for code, kind in kinds if isinstance(error, kind)), Arcor2Error.code)

"""Statistics of a run: cycles and their durations, good and bad parts, counters."""

import contextlib
import time
from collections.abc import Callable, Sequence, Set
from typing import Final

import msgspec
from msgspec import UNSET

from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import CounterValue, RunStatistics, VariableValue
from arcor2_hw.data.events import ActionStateAfterData, ActionStateBeforeData, PackageInfoData
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.object_types.registry import ObjectTypes

COUNTER: Final = "CounterActions"
"""The object type of counters."""
_START: Final = "START"


class _Before(msgspec.Struct):
    data: ActionStateBeforeData


class _After(msgspec.Struct):
    data: ActionStateAfterData


def _initial_value(counter: SceneObject) -> int:
    for parameter in counter.parameters:
        if parameter.name == "start":
            return _whole_number(parameter.value) or 0
    return 0


def _whole_number(text: str) -> int | None:
    try:
        return msgspec.json.decode(text.encode(), type=int)
    except msgspec.MsgspecError:
        return None


def verdicts_of(info: PackageInfoData, types: ObjectTypes) -> set[str]:
    """Return the ids of the actions whose result says that a part is good."""
    objects = {each.id: each.type for each in info.scene.objects}
    found = set()
    for action in info.project.all_actions():
        object_id, _, method = action.type.partition("/")
        with contextlib.suppress(Arcor2Error):  # the type may be only in the package
            if types.action(objects.get(object_id, ""), method).meta.verdict is True:
                found.add(action.id)
    return found


class RunStatisticsCollector:
    """Collects the statistics of a run from the events of its actions.

    A cycle starts with the first action of the program, and is complete when this action starts again. A run that
    finishes in its first cycle has completed it.

    Args:
        info: the scene and project of the running package.
        verdicts: ids of the actions whose result says that a part is good.
        clock: the time, s.
    """

    def __init__(self, info: PackageInfoData, verdicts: Set[str], clock: Callable[[], float] = time.monotonic) -> None:
        self._verdicts = verdicts
        self._clock = clock
        self._first = next((item.end for item in info.project.logic if item.start == _START), "")
        self._counters = {each.id: each for each in info.scene.objects if each.type == COUNTER}
        self._methods = {action.id: tuple(action.type.partition("/")[::2]) for action in info.project.all_actions()}
        self._cycles = 0
        self._began: float | None = None
        self._paused = False
        self._last: float | None = None
        self._total = 0.0
        self._timed = 0
        self._held = 0.0
        self._judged = {True: 0, False: 0}
        self._values: dict[str, int] = {}
        self._given: dict[str, list[str]] = {}
        self._variables = {one.name: one for one in info.project.parameters if one.variable}
        self._present = {name: one.value for name, one in self._variables.items()}
        self._outputs = {
            action.id: action.outputs()
            for point in info.project.action_points
            for action in point.actions
            if not self._variables.keys().isdisjoint(action.outputs())
        }

    def statistics(self) -> RunStatistics:
        """Return the present statistics."""
        return RunStatistics(
            self._cycles,
            UNSET if self._last is None else round(self._last, 3),
            UNSET if self._timed == 0 else round(self._total / self._timed, 3),
            self._judged[True] if self._verdicts else UNSET,
            self._judged[False] if self._verdicts else UNSET,
            [CounterValue(each, self._counters[each].name, value) for each, value in self._values.items()],
            [VariableValue(one.id, name, self._present[name]) for name, one in self._variables.items()] or UNSET,
            round(self._held, 3) or UNSET,
        )

    def set_held(self, seconds: float) -> None:
        """Set the time for which the program was held, s."""
        self._held = seconds

    def handle_paused(self) -> None:
        """Exclude the present cycle from the durations, because the program is paused."""
        self._paused = True

    def handle_start(self, encoded: bytes, attempt: int = 1) -> bool:
        """Handle ActionStateBefore; a repeated action starts no cycle. Return whether the statistics have changed."""
        data = msgspec.json.decode(encoded, type=_Before).data
        if isinstance(data.action_id, Unset):
            return False
        if self._methods.get(data.action_id, ("", ""))[0] in self._counters:
            self._given[data.action_id] = [] if isinstance(data.parameters, Unset) else data.parameters
        if not isinstance(data.thread_id, Unset):  # another thread of a script
            return False
        self._first = self._first or data.action_id
        if data.action_id != self._first or attempt > 1:
            return False
        complete = self._complete()
        self._began, self._paused = self._clock(), False
        return complete

    def handle_result(self, encoded: bytes) -> bool:
        """Handle ActionStateAfter. Return whether the statistics have changed."""
        data = msgspec.json.decode(encoded, type=_After).data
        results = [] if isinstance(data.results, Unset) else data.results
        stored = self._store(data.action_id, results)
        if data.action_id in self._verdicts and results in (["true"], ["false"]):
            self._judged[results == ["true"]] += 1
            return True
        object_id, method = self._methods.get(data.action_id, ("", ""))
        if object_id not in self._counters:
            return stored
        before = self._values.get(object_id)
        value = self._counted(object_id, method, self._given.pop(data.action_id, []) or results, results)
        if value is not None:
            self._values[object_id] = value
        return stored or value != before

    def _store(self, action_id: str, results: Sequence[str]) -> bool:
        """Store the results of an action in variables. Return whether one of these has changed."""
        changed = False
        for output, value in zip(self._outputs.get(action_id, ()), results, strict=False):
            if output in self._variables and self._present[output] != value:
                self._present[output] = value
                changed = True
        return changed

    def handle_finished(self) -> None:
        """Count a run that finished in its first cycle."""
        if self._cycles == 0:
            self._complete()

    def _complete(self) -> bool:
        if self._began is None:
            return False
        self._cycles += 1
        if not self._paused:
            self._last = self._clock() - self._began
            self._total += self._last
            self._timed += 1
        return True

    def _counted(self, object_id: str, method: str, given: list[str], results: list[str]) -> int | None:
        """Return the value of a counter after an action, None if the action does not reveal it."""
        match method:
            case "increment" | "decrement" | "value" if results:
                return _whole_number(results[0])
            case "set_value" if given:
                return _whole_number(given[0])
            case "reset":
                return _initial_value(self._counters[object_id])
        return self._values.get(object_id)

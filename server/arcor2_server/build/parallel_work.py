"""Checks that concurrent calls use different devices."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from arcor2_hw.data.project import CALL, Action, ProjectFunction
from arcor2_hw.data.project_index import ProjectIndex
from arcor2_hw.exceptions import InvalidProject
from arcor2_server.documents.logic_graph import Flow


class _Use(NamedTuple):
    """The first action of a branch that uses a device. call: the branch."""

    call: Action
    action: Action


def check_parallel_work(program: Flow, functions: Sequence[tuple[ProjectFunction, Flow]], index: ProjectIndex) -> None:
    """Raise InvalidProject if two branches use the same device, or if a branch contains parallel work.

    Args:
        program: the logic of the program.
        functions: the functions that the program calls, each before its callers.
        index: the items of scene and project.
    """
    used: dict[str, dict[str, Action]] = {}
    """The devices of each function, also through calls, with the first action that uses them."""
    nested: dict[str, Action] = {}
    """The functions that contain parallel work, also through calls."""
    for function, flow in functions:
        devices: dict[str, Action] = {}
        for action in flow.actions:
            key, _, method = action.type.partition("/")
            if action.is_parallel:
                nested.setdefault(function.id, action)
            elif method == CALL and key in used:
                for device, user in used[key].items():
                    devices.setdefault(device, user)
                if key in nested:
                    nested.setdefault(function.id, nested[key])
            else:
                devices.setdefault(key, action)
        used[function.id] = devices
    for flow in (program, *(flow for _, flow in functions)):
        for number, branches in flow.parallel.items():
            _check(flow.actions[number], [flow.actions[one] for one in branches], used, nested, index)


def _check(
    parallel: Action,
    calls: Sequence[Action],
    used: Mapping[str, Mapping[str, Action]],
    nested: Mapping[str, Action],
    index: ProjectIndex,
) -> None:
    first: dict[str, _Use] = {}
    for call in calls:
        function = call.type.partition("/")[0]
        if function in nested:
            raise InvalidProject(
                "action {name!r}: its branch {call!r} contains other parallel work, {inner!r}",
                name=parallel.name,
                call=call.name,
                inner=nested[function].name,
            )
        for device, action in used.get(function, {}).items():
            other = first.setdefault(device, _Use(call, action))
            if other.call is call:
                continue
            raise InvalidProject(
                "action {name!r}: {action!r} of the branch {call!r} and {other_action!r} of the branch {other_call!r} "
                "use the same device {device}",
                name=parallel.name,
                action=other.action.name,
                call=other.call.name,
                other_action=action.name,
                other_call=call.name,
                device=index.scene_object(device).name,
            )

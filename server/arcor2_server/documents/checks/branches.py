"""Checks of the branches of parallel actions."""

from arcor2_hw.data.project import CALL, Action
from arcor2_hw.data.project_index import ProjectLookup
from arcor2_hw.exceptions import InvalidData
from arcor2_server.documents.item_indexes import links
from arcor2_server.documents.logic_graph import branches_problem


def check_branches(action: Action, lookup: ProjectLookup) -> None:
    """Raise InvalidData or NotFound if the branches of an action are not calls next to it."""
    if not action.is_parallel:
        if action.branches:
            raise InvalidData("{name}: only parallel work has branches.", name=action.name)
        return
    branches = action.branches or []
    if (problem := branches_problem(branches)) is not None:
        raise InvalidData("{name}: {reason}.", name=action.name, reason=problem)
    for key in branches:
        call = lookup.action(key)
        if call.type.partition("/")[2] != CALL or lookup.function_of(key) != lookup.function_of(action.id):
            raise InvalidData(
                "{name}: {call} is not a call of a function next to it.", name=action.name, call=call.name
            )
        for source, _, _ in links(call):
            if source in branches:
                raise InvalidData(
                    "{name}: {call} uses a result of {other}, which runs at the same time.",
                    name=action.name,
                    call=call.name,
                    other=lookup.action(source).name,
                )

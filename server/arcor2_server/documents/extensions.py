"""Fields of projects that clients of the original do not know, and that survive when such a client stores a project."""

from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import Action, LogicItem, Project


def keep_extensions(sent: Project, stored: Project) -> Project:
    """Return a sent project with the functions, names of errors and error exits that it lacks, by the ids of its items.

    An empty name or list removes an error.
    """
    present = {function.id for function in sent.functions}
    functions = [*sent.functions, *(function for function in stored.functions if function.id not in present)]
    logic = [*stored.logic, *(item for function in stored.functions for item in function.logic)]
    errors = {action.id: action.error_output for action in stored.all_actions() if action.error_output}
    exits = {item.id: item.error_kinds for item in logic if item.is_error_exit}

    def action(one: Action) -> Action:
        missing = isinstance(one.error_output, Unset) and one.id in errors
        return replace(one, error_output=errors[one.id]) if missing else one

    def item(one: LogicItem) -> LogicItem:
        missing = isinstance(one.error_kinds, Unset) and one.id in exits
        return replace(one, error_kinds=exits[one.id]) if missing else one

    if errors:
        points = [replace(point, actions=[action(one) for one in point.actions]) for point in sent.action_points]
        functions = [replace(one, actions=[action(each) for each in one.actions]) for one in functions]
        sent = replace(sent, action_points=points)
    if exits:
        functions = [replace(one, logic=[item(each) for each in one.logic]) for one in functions]
        sent = replace(sent, logic=[item(one) for one in sent.logic])
    return replace(sent, functions=functions)

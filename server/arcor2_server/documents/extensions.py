"""Fields of projects that clients of the original do not know, and that survive when such a client stores a project."""

from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.project import Action, LogicItem, Project


def keep_extensions(sent: Project, stored: Project) -> Project:
    """Return a sent project with the names of errors and the error exits that it lacks, by the ids of its items.

    An empty name or list removes them.
    """
    errors = {a.id: a.error_output for point in stored.action_points for a in point.actions if a.error_output}
    exits = {item.id: item.error_kinds for item in stored.logic if item.is_error_exit}

    def action(one: Action) -> Action:
        missing = isinstance(one.error_output, Unset) and one.id in errors
        return replace(one, error_output=errors[one.id]) if missing else one

    def item(one: LogicItem) -> LogicItem:
        missing = isinstance(one.error_kinds, Unset) and one.id in exits
        return replace(one, error_kinds=exits[one.id]) if missing else one

    if errors:
        points = [replace(point, actions=[action(one) for one in point.actions]) for point in sent.action_points]
        sent = replace(sent, action_points=points)
    return replace(sent, logic=[item(one) for one in sent.logic]) if exits else sent

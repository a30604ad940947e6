"""Extensions: project fields that clients of the original do not know, and that are kept when these store a project."""

from typing import Final

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.project import Action, LogicItem, Project
from arcor2_hw.messages import Message, translatable

_NAMES: Final = translatable(
    {
        "functions": "functions",
        "parallel": "parallel work",
        "errors": "error exits",
        "comparisons": "conditions with comparisons",
        "variables": "variables",
        "retries": "automatic retries",
    }
)


def extensions_of(project: Project) -> list[Message]:
    """Return the names of the extensions in a project, which clients of the original cannot show or edit."""
    actions = list(project.all_actions())
    logic = [*project.logic, *(item for function in project.functions for item in function.logic)]
    contained = {
        "functions": bool(project.functions),
        "parallel": any(action.is_parallel for action in actions),
        "errors": any(item.is_error_exit for item in logic),
        "comparisons": any(item.has_comparisons for item in logic),
        "variables": any(parameter.variable for parameter in project.parameters),
        "retries": any(action.retry for action in actions),
    }
    return [Message.of(_NAMES[key]) for key, found in contained.items() if found]


def keep_extensions(sent: Project, stored: Project) -> Project:
    """Return a sent project with the functions and fields that it lacks, by the ids of its items.

    These fields are the names of errors, retries, branches, error exits, comparisons, which parameters are variables,
    and the script. An empty text or list removes them, and so does the count 0 of a retry. A condition replaces
    comparisons.
    """
    present = {function.id for function in sent.functions}
    functions = [*sent.functions, *(function for function in stored.functions if function.id not in present)]
    logic = [*stored.logic, *(item for function in stored.functions for item in function.logic)]
    errors = {action.id: action.error_output for action in stored.all_actions() if action.error_output}
    branches = {action.id: action.branches for action in stored.all_actions() if action.branches}
    retries = {action.id: action.retry for action in stored.all_actions() if action.retry}
    variables = {parameter.id for parameter in stored.parameters if parameter.variable}
    steps = {item.id: item for item in logic if item.is_error_exit or item.has_comparisons}

    def action(action: Action) -> Action:
        if isinstance(action.error_output, Unset) and action.id in errors:
            action = replace(action, error_output=errors[action.id])
        if isinstance(action.retry, Unset) and action.id in retries:
            action = replace(action, retry=retries[action.id])
        elif action.retry and action.retry.count == 0:
            action = replace(action, retry=UNSET)
        if isinstance(action.branches, Unset) and action.id in branches:
            action = replace(action, branches=branches[action.id])
        return action

    def item(item: LogicItem) -> LogicItem:
        if (known := steps.get(item.id)) is None:
            return item
        kinds = known.error_kinds if isinstance(item.error_kinds, Unset) else item.error_kinds
        missing = isinstance(item.when, Unset) and isinstance(item.condition, Unset)
        return replace(item, error_kinds=kinds, when=known.when if missing else item.when)

    if variables:
        parameters = [
            replace(one, variable=True) if isinstance(one.variable, Unset) and one.id in variables else one
            for one in sent.parameters
        ]
        sent = replace(sent, parameters=parameters)
    if errors or retries or branches:
        points = [replace(point, actions=[action(one) for one in point.actions]) for point in sent.action_points]
        functions = [replace(one, actions=[action(each) for each in one.actions]) for one in functions]
        sent = replace(sent, action_points=points)
    if steps:
        functions = [replace(one, logic=[item(each) for each in one.logic]) for one in functions]
        sent = replace(sent, logic=[item(one) for one in sent.logic])
    script = stored.script if isinstance(sent.script, Unset) else sent.script or UNSET
    return replace(sent, functions=functions, script=script)

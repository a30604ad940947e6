"""`arcor2-hw project dry-run`: predict the times of one cycle of a project, without devices."""

from pathlib import Path
from typing import Annotated, Final

import msgspec
from cyclopts import Parameter

from arcor2_hw.client import Client
from arcor2_hw.client.dry_runs import dry_run
from arcor2_hw.data.base import Unset
from arcor2_hw.data.dry_run import DurationSource, Prediction
from arcor2_hw.data.project import END, Project
from arcor2_hw.data.rpc import GetDryRunData
from arcor2_hw.data.run_trace import chrome_trace
from arcor2_hw.exceptions import Conflict, DeviceTimeout, InvalidData, NotFound
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.export_files import print_json, print_line
from arcor2_server.cli.server_connection import HERE, Server, run
from arcor2_server.cli.trace_tables import show_trace
from arcor2_server.files import replace_file

USER: Final = "arcor2-hw dry-run"
FIRST_EVENTS: Final = ("OpenProject", "OpenScene", "ShowMainScreen", "PackageState")
"""Events of which a new client receives one, depending on what is open."""


def project_dry_run(
    project: Annotated[str, Parameter(help="Name of the project, or its id.")],
    /,
    *,
    first: Annotated[str, Parameter(name="--from", help="Name or id of the action to start with.")] = "",
    branch: Annotated[
        list[str] | None, Parameter(negative=(), help="Branch to take, as ACTION=NEXT, or ACTION=END. Repeatable.")
    ] = None,
    output: Annotated[
        Path | None,
        Parameter(name=["--output", "-o"], help="Write a file that chrome://tracing and ui.perfetto.dev open."),
    ] = None,
    save: Annotated[Path | None, Parameter(help="Write the trace for `arcor2-hw package compare`.")] = None,
    as_json: Annotated[bool, Parameter(name="--json", help="Print JSON.", negative=())] = False,
    server: Server = HERE,
) -> int:
    """Predict cycle time, bottleneck and first problem of a project, without devices.

    The project is opened for this if nothing is open. An open project is checked with its unsaved changes.
    The exit status is 15 if an action would fail.
    """

    async def work() -> ExitStatus:
        async with server.client() as client:
            opened, document = await _open(client, project)
            try:
                found = await dry_run(
                    client,
                    from_action=_action(document, first) if first else None,
                    branches=dict(_branch(document, one) for one in branch or []),
                )
            finally:
                if opened:
                    await client.close_project(force=True)
        prediction = found.prediction
        assert not isinstance(prediction, Unset)
        if output is not None:
            trace = prediction.trace
            content = chrome_trace(f"dry run of {document.name}", trace.devices, trace.spans)
            replace_file(output, msgspec.json.encode(content))
        if save is not None:
            replace_file(save, msgspec.json.format(msgspec.json.encode(prediction.trace)))
        if as_json:
            print_json(found)
        else:
            _show(found, prediction)
        return ExitStatus.OK if isinstance(prediction.problem, Unset) else ExitStatus.DIFFERENT

    try:
        return run("project dry-run", work)
    except KeyboardInterrupt:
        return fail("project dry-run", "interrupted; the dry run was cancelled", ExitStatus.INTERRUPTED)


async def _open(client: Client, wanted: str) -> tuple[bool, Project]:
    """Return whether the project was opened by this command, and the project.

    Raises:
        Conflict: another document is open, or a program runs.
        NotFound: the project does not exist.
    """
    try:
        event = await client.next_event(*FIRST_EVENTS)
    except DeviceTimeout:
        raise Conflict("The state of the server is unknown. Try again.") from None
    if event.event == "OpenProject":
        project: Project = event.data.project
        if wanted not in (project.name, project.id):
            raise Conflict("The project {name} is open. Close it first.", name=project.name)
        return False, project
    if event.event != "ShowMainScreen":
        raise Conflict("A scene is open or a program is running. Close or stop it first.")
    known = {key: entry.id for entry in await client.list_projects() for key in (entry.name, entry.id)}
    if wanted not in known:
        raise NotFound("The server at {url} has no project {wanted}.", url=client.url, wanted=wanted)
    await client.register_user(user_name=USER)
    await client.open_project(id=known[wanted])
    opened = await client.next_event("OpenProject")
    return True, opened.data.project


def _action(project: Project, wanted: str) -> str:
    """Return the id of an action by its name or id."""
    for action in project.all_actions():
        if wanted in (action.name, action.id):
            return action.id
    raise NotFound("The project {name} has no action {wanted}.", name=project.name, wanted=wanted)


def _branch(project: Project, text: str) -> tuple[str, str]:
    action, equals, following = text.partition("=")
    if not equals:
        raise InvalidData("A branch is ACTION=NEXT or ACTION=END, not {text!r}.", text=text)
    return _action(project, action), END if following == END else _action(project, following)


def _show(found: GetDryRunData, prediction: Prediction) -> None:
    show_trace(prediction.trace)
    names = {span.action_id: span.name for span in prediction.trace.spans}
    unknown = [names[one.action_id] for one in prediction.durations if one.source is DurationSource.UNKNOWN]
    if unknown:
        print_line(f"unknown duration, counted as 0 s: {', '.join(unknown)}")
    for assumption in prediction.assumptions:
        print_line(f"assumption: {assumption.text}")
    problem = prediction.problem
    if isinstance(problem, Unset):
        print_line("problems: none")
    else:
        pose = problem.pose
        place = "" if isinstance(pose, Unset) else " at x {:.3f}, y {:.3f}, z {:.3f} m".format(*pose.position)
        print_line(f"problem: {problem.name}: {problem.reason}{place}")
    print_line(f"dry run {found.dry_run.number} of revision {found.dry_run.revision}")

"""`arcor2-hw package`: list packages, past runs and their traces, and run a package while showing its progress."""

import asyncio
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
from cyclopts import App, Parameter
from rich.markup import escape
from rich.table import Table

from arcor2_hw.client import RequestFailed, Rest
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.editor import Run
from arcor2_hw.data.held import HoldChoice, OnError
from arcor2_hw.data.package import PackageStateEnum, PackageSummary
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.exceptions import ConnectionLost, InvalidData, NotFound
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.server_connection import HERE, Failed, Server, run
from arcor2_server.cli.tables import console
from arcor2_server.cli.trace_tables import show_comparison, show_trace

app = App(name="package", help="List and run packages, and show past runs.")


@app.command(name="list")
def list_packages(*, server: Server = HERE) -> int:
    """List the packages of a running server."""

    async def work() -> None:
        async with server.client() as client:
            _show(sorted(await client.list_packages(), key=lambda summary: summary.package_meta.built))

    return run("package list", work)


def _show(summaries: list[PackageSummary]) -> None:
    table = Table("id", "name", "project", "built", "executed", box=None, pad_edge=False)
    for summary in summaries:
        meta, project = summary.package_meta, summary.project_meta
        table.add_row(
            summary.id,
            meta.name,
            "" if isinstance(project, Unset) else project.name,
            meta.built,
            "never" if isinstance(meta.executed, Unset) else meta.executed,
        )
    console().print(table if summaries else "There are no packages. Build one from a project first.")


@app.command(name="runs")
def list_runs(
    package: Annotated[str, Parameter(help="Id of a package: show only its runs.")] = "",
    *,
    limit: Annotated[int, Parameter(help="Maximum number of runs, newest first.")] = 20,
    server: Server = HERE,
) -> int:
    """List past runs with user, start and outcome."""

    async def work() -> None:
        async with server.client() as client:
            _show_runs((await client.list_runs(limit=limit, package_id=package or UNSET)).runs)

    return run("package runs", work)


def _show_runs(runs: list[Run]) -> None:
    table = Table("run", "package", "started", "by", "end", "after", "last action", "error", box=None, pad_edge=False)
    for one in runs:
        ended, by, last, error = one.ended, one.started_by, one.last_action, one.error
        by = "" if isinstance(by, Unset) else by
        stopped = "" if isinstance(one.stopped_by, Unset) else f" by {one.stopped_by}"
        seconds = "" if isinstance(ended, Unset) else f"{_seconds(one.started, ended):.1f} s"
        table.add_row(
            str(one.number),
            one.package_name,
            one.started,
            by,
            f"{one.end}{stopped}",
            seconds,
            "" if isinstance(last, Unset) else last.name or last.id,
            "" if isinstance(error, Unset) else error,
        )
    console().print(table if runs else "There are no runs.")


def _seconds(start: str, end: str) -> float:
    return (datetime.fromisoformat(end) - datetime.fromisoformat(start)).total_seconds()


@app.command(name="trace")
def trace_of_run(
    number: Annotated[int, Parameter(help="Number of the run, see `arcor2-hw package runs`.")],
    *,
    output: Annotated[
        Path | None,
        Parameter(name=["--output", "-o"], help="Write a file that chrome://tracing and ui.perfetto.dev open."),
    ] = None,
    server: Server = HERE,
) -> int:
    """Show the actions of each device in a run with their times, or write them to a file for a trace viewer."""

    async def work() -> None:
        async with server.rest() as rest:
            if output is None:
                show_trace(await rest.run_trace(number))
            else:
                await rest.chrome_trace(number, output)

    return run("package trace", work)


@app.command(name="compare")
def compare_runs(
    first: Annotated[
        str,
        Parameter(
            help="Number of a run, see `arcor2-hw package runs`, or a file of `arcor2-hw project dry-run --save`."
        ),
    ],
    second: Annotated[str, Parameter(help="Number or file to compare it with.")],
    *,
    server: Server = HERE,
) -> int:
    """Compare two runs or dry runs action by action: how long each action, a cycle and the devices took."""

    async def work() -> None:
        async with server.rest() as rest:
            traces = [await _trace_of(rest, each) for each in (first, second)]
        show_comparison(traces[0], traces[1], (_title(first), _title(second)))

    return run("package compare", work)


async def _trace_of(rest: Rest, text: str) -> RunTrace:
    """Return the trace of a run by its number, or that in a file.

    Raises:
        NotFound: the run or the file does not exist.
        InvalidData: the file contains no trace.
    """
    if text.isdecimal():
        return await rest.run_trace(int(text))
    try:
        content = await asyncio.to_thread(Path(text).read_bytes)
    except OSError as error:
        raise NotFound("{path} cannot be read: {reason}.", path=text, reason=error.strerror) from None
    try:
        return msgspec.json.decode(content, type=RunTrace)
    except msgspec.MsgspecError as error:
        raise InvalidData("{path} contains no trace: {reason}.", path=text, reason=error) from None


def _title(text: str) -> str:
    return f"run {text}" if text.isdecimal() else Path(text).stem


@app.command(name="run")
def run_package(
    package: Annotated[
        str, Parameter(help="Id or name of the package. Of several with the same name, the newest is run.")
    ],
    *,
    paused: Annotated[bool, Parameter(help="Pause before the first action.")] = False,
    hold: Annotated[
        bool,
        Parameter(help="Hold the program at a failed action until a person decides. Without it, the program ends."),
    ] = False,
    server: Server = HERE,
) -> int:
    """Run a package on a running server, and show its progress until it ends."""
    try:
        return run("package run", lambda: _run(server, package, paused, hold))
    except KeyboardInterrupt:
        reason = "interrupted; the program continues, stop it in the editor"
        return fail("package run", reason, ExitStatus.INTERRUPTED)


async def _run(server: Server, wanted: str, paused: bool, hold: bool) -> ExitStatus:
    out = console()
    async with server.client() as client:
        if hold:
            await client.subscribe_events({"Held"})
        summaries = await client.list_packages()
        named = sorted(
            (summary for summary in summaries if wanted in (summary.id, summary.package_meta.name)),
            key=lambda summary: summary.package_meta.built,
        )
        if not named:
            raise NotFound("The server at {url} has no package {wanted}.", url=client.url, wanted=wanted)
        chosen = named[-1].id
        try:
            await client.run_package(chosen, start_paused=paused, on_error=OnError.HOLD if hold else UNSET)
        except RequestFailed as error:
            raise Failed(ExitStatus.PROGRAM_FAILED, str(error)) from error
        actions: dict[str, str] = {}
        problem = ""
        async for event in client.events():
            match event.event:
                case "PackageInfo":
                    actions = {a.id: a.name for a in event.data.project.all_actions()}
                case "ActionStateBefore" if not isinstance(event.data.action_id, Unset):
                    out.print(actions.get(event.data.action_id, event.data.action_id))
                case "ActionStateAfter" if not isinstance(event.data.results, Unset):
                    out.print(f"  -> {', '.join(event.data.results)}")
                case "Held":
                    out.print(escape(f"held at {event.data.action_name}: {event.data.text}"))
                    out.print(f"  decide: {', '.join(event.data.choices)}")
                case "ProjectException":
                    problem = event.data.message
                case "PackageState" if event.data.package_id == chosen:
                    out.print(f"[dim]{event.data.state}[/dim]")
                    if event.data.state is PackageStateEnum.STOPPED:
                        break
        else:
            raise ConnectionLost("The connection to {url} broke. The program may still be running.", url=client.url)
        if problem:
            return fail("package run", problem, ExitStatus.PROGRAM_FAILED)
    return ExitStatus.OK


@app.command
def decide(
    choice: Annotated[HoldChoice, Parameter(help="How the program continues.")],
    results: Annotated[list[str] | None, Parameter(help="For `result`: the results, each as JSON.")] = None,
    *,
    exit_id: Annotated[str, Parameter(help="For `error_exit`: id of the logic item; default: the first exit.")] = "",
    yes: Annotated[bool, Parameter(help="Repeat an action that may have been executed partly.")] = False,
    server: Server = HERE,
) -> int:
    """Decide how a program that is held at a failed action continues."""

    async def work() -> ExitStatus:
        async with server.client() as client:
            held = (await client.get_held()).held
            if isinstance(held, Unset):
                return fail("package decide", "The program is not held.", ExitStatus.PROGRAM_FAILED)
            try:
                await client.decide_held(
                    number=held.number, choice=choice, results=results or [], exit_id=exit_id, confirmed=yes
                )
            except RequestFailed as error:
                raise Failed(ExitStatus.PROGRAM_FAILED, str(error)) from error
            console().print(f"{held.action_name}: {choice}")
        return ExitStatus.OK

    return run("package decide", work)

"""`arcor2-hw package`: list packages, past runs and their traces, and run a package while showing its progress."""

from datetime import datetime
from pathlib import Path
from typing import Annotated, Final

from cyclopts import App, Parameter
from rich.markup import escape
from rich.table import Table

from arcor2_hw.client import RequestFailed
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.editor import Run
from arcor2_hw.data.package import PackageStateEnum, PackageSummary
from arcor2_hw.data.run_trace import RunTrace
from arcor2_hw.data.trace_comparison import compare, summarize
from arcor2_hw.exceptions import ConnectionLost, NotFound
from arcor2_server.cli.exit_status import ExitStatus, fail
from arcor2_server.cli.server_connection import HERE, Failed, Server, printable, run
from arcor2_server.cli.tables import console

LONGEST_WAITS: Final = 3
"""Number of waits shown with a trace, longest first."""

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
def show_trace(
    number: Annotated[int, Parameter(help="Number of the run, see `arcor2-hw package runs`.")],
    *,
    output: Annotated[
        Path | None,
        Parameter(name=["--output", "-o"], help="Write a file that chrome://tracing and ui.perfetto.dev open."),
    ] = None,
    server: Server = HERE,
) -> int:
    """Show when each device executed which action in a run, or write it to a file for a trace viewer."""

    async def work() -> None:
        async with server.rest() as rest:
            if output is None:
                _show_trace(await rest.run_trace(number))
            else:
                await rest.chrome_trace(number, output)

    return run("package trace", work)


def _show_trace(trace: RunTrace) -> None:
    times = summarize(trace)
    names = {device.id: device.name for device in trace.devices}
    out = console()
    table = Table("start", "duration", "device", "action", "branch", "error", box=None, pad_edge=False)
    for span in trace.spans:
        texts = (names.get(span.device, ""), span.name, span.branch or "", span.error or "")
        table.add_row(f"{span.start:.3f} s", f"{span.duration:.3f} s", *(escape(printable(text)) for text in texts))
    out.print(table if trace.spans else "The run has executed no actions.")
    out.print(f"cycle: {times.cycle:.3f} s, {times.cycles} complete; all: {times.whole:.3f} s")
    for device in times.devices:
        out.print(f"{escape(printable(device.name))}: busy {device.busy:.3f} s, {device.share:.0%}")
    for wait in times.waits[:LONGEST_WAITS]:
        out.print(f"wait of {wait.duration:.3f} s at {wait.start:.3f} s, before {escape(printable(wait.before))}")
    if trace.omitted:
        out.print(f"The first {trace.omitted} actions are not stored.")


@app.command(name="compare")
def compare_runs(
    first: Annotated[int, Parameter(help="Number of a run, see `arcor2-hw package runs`.")],
    second: Annotated[int, Parameter(help="Number of the run to compare it with.")],
    *,
    server: Server = HERE,
) -> int:
    """Compare two runs action by action: how long each action, a cycle and the devices took."""

    async def work() -> None:
        async with server.rest() as rest:
            _show_comparison(await rest.run_trace(first), await rest.run_trace(second))

    return run("package compare", work)


def _show_comparison(first: RunTrace, second: RunTrace) -> None:
    old, new = summarize(first), summarize(second)
    names = {device.id: device.name for device in (*first.devices, *second.devices)}
    out = console()
    table = Table("device", "action", f"run {first.run}", f"run {second.run}", "difference", box=None, pad_edge=False)
    for one in compare(old, new):
        difference = one.difference
        table.add_row(
            escape(printable(names.get(one.device, ""))),
            escape(printable(one.name)),
            *("" if isinstance(value, Unset) else f"{value:.3f} s" for value in (one.first, one.second)),
            "" if difference is None else f"{difference:+.3f} s",
        )
    out.print(table)
    out.print(f"cycle: {old.cycle:.3f} s, {new.cycle:.3f} s, {new.cycle - old.cycle:+.3f} s")
    shares = {device.id: f"{device.share:.0%}" for device in old.devices}
    for device in new.devices:
        before = shares.pop(device.id, "-")
        out.print(f"{escape(printable(device.name))}: busy {before}, {device.share:.0%}")
    for key, before in shares.items():
        out.print(f"{escape(printable(names[key]))}: busy {before}, -")


@app.command(name="run")
def run_package(
    package: Annotated[
        str, Parameter(help="Id or name of the package. Of several with the same name, the newest is run.")
    ],
    *,
    paused: Annotated[bool, Parameter(help="Pause before the first action.")] = False,
    server: Server = HERE,
) -> int:
    """Run a package on a running server, and show its progress until it ends."""
    try:
        return run("package run", lambda: _run(server, package, paused))
    except KeyboardInterrupt:
        reason = "interrupted; the program continues, stop it in the editor"
        return fail("package run", reason, ExitStatus.INTERRUPTED)


async def _run(server: Server, wanted: str, paused: bool) -> ExitStatus:
    out = console()
    async with server.client() as client:
        summaries = await client.list_packages()
        named = sorted(
            (summary for summary in summaries if wanted in (summary.id, summary.package_meta.name)),
            key=lambda summary: summary.package_meta.built,
        )
        if not named:
            raise NotFound("The server at {url} has no package {wanted}.", url=client.url, wanted=wanted)
        chosen = named[-1].id
        try:
            await client.run_package(chosen, start_paused=paused)
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

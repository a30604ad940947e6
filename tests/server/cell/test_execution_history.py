"""The history of runs, the trace of actions, shared breakpoints, and pausing by a client."""

import asyncio
import time
from typing import Any

import msgspec
import pytest

from arcor2_hw.data.editor import Run, RunEnd, TraceEntry
from arcor2_hw.data.rpc import ListRunsArgs
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import ConnectionLost, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.execution import runs
from arcor2_server.execution.runs import Runs, RunStart
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.shared_data import SharedData
from arcor2_server.websocket.hub import Hub
from tests.runtime.conftest import scene_object
from tests.server.cell.conftest import Recorder, Server, serving
from tests.server.cell.test_execution import LAMP, PROJECT, until_stopped, write

EVENTS = {"RunChanged", "RunStatistics", "ExecutionTrace"}
BEFORE = b'{"event": "ActionStateBefore", "data": {"action_id": "act", "thread_id": 7}}'
LOST = Message.of("{device}: {reason}", device="lamp", reason=ConnectionLost("No answer on {port}.", port="COM1"))
AFTER = b'{"event": "ActionStateAfter", "data": {"action_id": "act", "results": ["1"]}}'


def subscribe(server: Server, *names: str) -> None:
    server.services.hub.subscribe(server.client, set(names) or EVENTS, True)  # type: ignore[arg-type]


async def newest_run(server: Server, codes: bool = False) -> Run:
    found: list[Run] = (await server.ask("ListRuns", {"limit": 1}, codes=codes)).runs
    return found[0]


def data_of(server: Server, name: str) -> list[dict[str, Any]]:
    return [event["data"] for event in server.client.got if event["event"] == name]


@serving()
async def test_a_run_is_recorded_from_start_to_end(server: Server) -> None:
    subscribe(server)
    assert (await server.ask("ListRuns", {})).runs == []
    assert (await server.ask("GetExecutionTrace", {})).run == 0
    write(server, 'for n in ("a", "b"): lamp.blink(2, an=n)')
    await server.ask("RunPackage", {"id": "pkg_1"})
    await until_stopped(server)
    async with asyncio.timeout(30):  # names are added concurrently
        while (await newest_run(server)).package_name != "demo":
            await asyncio.sleep(0.01)
    run = await newest_run(server)
    assert (run.number, run.package_id, run.started_by, run.end) == (1, "pkg_1", "alice", RunEnd.FINISHED)
    assert (run.project_id, run.project_name, run.project_modified) == (PROJECT.id, PROJECT.name, PROJECT.modified)
    assert isinstance(run.ended, str)
    assert run.started < run.ended
    assert (run.actions, run.temporary, run.start_paused) == (2, False, False)
    assert (run.last_action.id, run.last_action.name) == ("act_b", "b")  # type: ignore[union-attr]
    ends = [event["end"] for event in data_of(server, "RunChanged")]
    assert (ends[0], ends[-1]) == ("running", "finished")
    trace = data_of(server, "ExecutionTrace")
    assert (run.statistics.cycles, data_of(server, "RunStatistics")[0]) == (1, {"run": 1, "cycles": 0, "counters": []})  # type: ignore[union-attr]
    assert [(entry["number"], "duration" in entry) for entry in trace] == [(1, False), (1, True), (2, False), (2, True)]
    assert trace[0] | {"started": ""} == {
        "run": 1,
        "number": 1,
        "action_id": "act_a",
        "name": "a",
        "started": "",
        "parameters": ["2"],
    }
    assert trace[1]["results"] == ["2"]
    answer = await server.ask("GetExecutionTrace", {"limit": 1})
    assert (answer.run, [entry.number for entry in answer.entries]) == (1, [2])
    answer = await server.ask("GetExecutionTrace", {"before": 2})
    assert [entry.action_id for entry in answer.entries] == ["act_a"]


@serving()
async def test_a_run_records_how_it_ended(server: Server) -> None:
    subscribe(server)
    write(server, 'lamp.blink(1, an="a")\nlamp.wait(an="b")', "pkg_wait")
    write(server, 'lamp.blink(1, an="a")\nlamp.blink("x" + 1, an="b")', "pkg_script")
    write(server, 'lamp.hold_all("soon", an="c")', "pkg_action")
    bob = Recorder("bob")
    server.services.hub.add(bob)  # type: ignore[arg-type]
    await server.ask("RunPackage", {"id": "pkg_wait", "start_paused": True})
    await server.client.state("paused", "PackageState")
    assert ((await newest_run(server)).end, (await newest_run(server)).start_paused) == (RunEnd.RUNNING, True)
    await server.ask("ResumePackage")
    await server.client.event("ActionStateBefore", lambda data: data["action_id"] == "act_b")
    await server.ask("StopPackage", client=bob)
    await server.client.state("stopped", "PackageState")
    run = await newest_run(server)
    assert (run.end, run.started_by, run.stopped_by) == (RunEnd.STOPPED, "alice", "bob")
    assert run.last_action.name == "b"  # type: ignore[union-attr]

    await server.ask("RunPackage", {"id": "pkg_script"})
    await server.client.state("stopped", "PackageState")
    run = await newest_run(server)
    assert (run.end, run.error_type, run.last_action.name) == (RunEnd.FAILED, "TypeError", "a")  # type: ignore[union-attr]
    assert run.error

    await server.ask("RunPackage", {"id": "pkg_action"}, client=bob)
    exception = await server.client.event("ProjectException")
    await server.client.state("stopped", "PackageState")
    run = await newest_run(server)
    assert (run.end, run.error, run.started_by) == (RunEnd.FAILED, exception["message"], "bob")
    assert run == run.untranslated()
    translatable = await newest_run(server, codes=True)
    assert (translatable.error, translatable.key) == (run.error, exception["key"])
    assert msgspec.to_builtins(translatable.values) == exception["values"]

    await server.ask("RunPackage", {"id": "pkg_wait"})
    await server.client.event("ActionStateBefore", lambda data: data["action_id"] == "act_b")
    host = server.services.execution._host.host
    assert host is not None
    host.kill()
    await server.client.state("stopped", "PackageState")
    run = await newest_run(server)
    assert (run.end, run.error_type) == (RunEnd.LOST, "ConnectionLost")
    numbers = [one.number for one in (await server.ask("ListRuns", {"package_id": "pkg_wait"})).runs]
    assert numbers == [4, 1]
    assert [one.number for one in (await server.ask("ListRuns", {"before": 3, "project_id": PROJECT.id})).runs] == [
        2,
        1,
    ]
    assert (await server.ask("ListRuns", {"project_id": "pro_none"})).runs == []


@serving()
async def test_an_exception_names_its_action(server: Server) -> None:
    server.types.add("Lamp", LAMP)
    write(server, 'lamp.blink(1, an="a")\nlamp.hold_all("soon", an="b")')
    subscribe(server)
    await server.ask("RunPackage", {"id": "pkg_1"})
    exception = await server.client.event("ProjectException")
    assert exception["action_id"] == "act_b"
    assert exception["message"].startswith("lamp")
    entries = (await server.ask("GetExecutionTrace", {})).entries
    assert entries[0].error
    assert entries[0].action_id == "act_b"
    # Whether an error can be translated depends on the client.
    server.services.runs.ended(m.ActionFailed(entries[0].number, 0.1, LOST))
    (translatable,) = (await server.ask("GetExecutionTrace", {"limit": 1}, codes=True)).entries
    assert (translatable.error, translatable.key, translatable.values) == (LOST.text, LOST.key, LOST.values)
    assert (await server.ask("GetExecutionTrace", {"limit": 1})).entries == [translatable.untranslated()]


# ---------------------------------------------------------------------------------------------- shared breakpoints
class Shared:
    """Breakpoints that users set on a project, in place of the database."""

    def __init__(self, *ids: str) -> None:
        self.stored = (set(ids), "alice")

    async def breakpoints(self, project_id: str) -> tuple[set[str], str]:
        assert project_id == PROJECT.id
        return self.stored

    async def put_breakpoints(self, project_id: str, ids: set[str], user: str) -> None:
        self.stored = (ids, user)


@serving()
async def test_shared_breakpoints_apply_on_request_and_can_change(server: Server) -> None:
    shared: Any = Shared("act_b", "acp_gone")
    server.services.breakpoints._data = shared
    await server.open(Scene("scene", id="scn_1", objects=[scene_object("lamp", "Lamp")]), PROJECT)
    write(server, 'for n in ("a", "b", "c", "a"): lamp.blink(2, an=n)')
    await server.ask("RunPackage", {"id": "pkg_1"})  # without the option
    assert "paused" not in await until_stopped(server)
    server.client.got.clear()
    await server.ask("RunPackage", {"id": "pkg_1", "shared_breakpoints": True, "breakpoints": ["act_c"]})
    for expected in ("act_b", "act_c"):
        await server.client.event("ActionStateBefore", lambda data, wanted=expected: data["action_id"] == wanted)
        await server.client.state("paused", "PackageState")
        await server.services.breakpoints.change(PROJECT.id, {"act_a"}, {"act_b"}, "bob")
        await server.ask("ResumePackage")
    await server.client.event("ActionStateBefore", lambda data: data["action_id"] == "act_a")
    await server.client.state("paused", "PackageState")
    await server.ask("ResumePackage")
    await server.client.state("stopped", "PackageState")
    await server.services.breakpoints.change(PROJECT.id, set(), {"act_a"}, "bob")  # no run is affected


# ---------------------------------------------------------------------------------------------- stored runs
async def test_the_newest_runs_and_actions_are_stored(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "MAX_RUNS", 5)
    monkeypatch.setattr(runs, "MAX_ACTIONS", 3)
    storage = await Storage.open(ServerSettings(data_dir=tmp_path))
    try:
        history = Runs(Hub())
        await history.open(SharedData(storage))
        for _ in range(8):
            number = history.begin("pkg", RunStart(), temporary=False)
            for action in range(1, 6):
                history.announced(m.ProgramEvent("ActionStateBefore", BEFORE, action, "a", time.time()))
                history.announced(m.ProgramEvent("ActionStateAfter", AFTER, action, time=0.1))
            if number == 7:
                history.end(number, RunEnd.FAILED, error=LOST, error_type="ConnectionLost")
            elif number != 8:
                history.end(number, RunEnd.FINISHED)
        assert [run.number for run in history.find(ListRunsArgs(limit=100))] == [8, 7, 6, 5, 4]
        assert history.find(ListRunsArgs(limit=1))[0].actions == 5
        _, entries = history.trace(100)
        assert [entry.number for entry in entries] == [5, 4, 3]
        assert entries[0] == TraceEntry(8, 5, "act", entries[0].started, "a", duration=0.1, results=["1"], thread_id=7)
        assert len((await history.run_trace(8)).spans) == 5
        history.ended(m.ActionFailed(1, 0.1))  # no longer stored
        await history.close()
        again = Runs(Hub())
        await again.open(SharedData(storage))
        await again.close()
        assert [(run.number, run.end.value) for run in again.find(ListRunsArgs(limit=100))] == [
            (8, "lost"),
            (7, "failed"),
            *((number, "finished") for number in (6, 5, 4)),
        ]
        stored = await again.run_trace(7)
        assert ([span.number for span in stored.spans], stored.spans[4].duration, stored.spans[4].thread_id) == (
            [1, 2, 3, 4, 5],
            0.1,
            7,
        )
        for missing in (3, 8, 9):  # too old, lost, never existed
            with pytest.raises(NotFound):
                await again.run_trace(missing)
        failed = again.find(ListRunsArgs(limit=100))[1]
        assert (failed.error, failed.key, failed.values) == (LOST.text, LOST.key, LOST.values)
        assert again.begin("pkg", RunStart(), temporary=False) == 9
        await again.close()
    finally:
        await storage.close()

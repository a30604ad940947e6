"""StopAll stops all devices with one request and immediately reports those that cannot be stopped."""

import os
import signal
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from arcor2_hw.data.geometry import Position
from arcor2_hw.data.project import Action, ActionPoint, Flow, Project
from arcor2_hw.data.rpc import StopAllData, StopKind
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.stop_all import HOST_SILENT
from arcor2_server.rpc import operation as _operation  # noqa: F401 - for its handlers
from tests.runtime.conftest import Package, scene_object
from tests.server.core.serving import until

from .conftest import Server, action, serving

TYPES = {
    "Screwdriver": """
class Screwdriver(Generic):
    _ABSTRACT = False
    def __init__(self, obj_id, name, settings=None):
        super().__init__(obj_id, name, settings)
        self.stopped = threading.Event()
    def stop(self):
        self.stopped.set()
    @action
    def run(self, *, an: str | None = None) -> None:
        Path(STARTED_FILE).touch()
        if self.stopped.wait(300):
            self.stopped.clear()
            raise Cancelled("stopped")
""",
    "Timer": """
class Timer(Generic):
    _ABSTRACT = False
    CANCEL_MAPPING = {"run": "cancel"}
    def __init__(self, obj_id, name, settings=None):
        super().__init__(obj_id, name, settings)
        self.cancelled = threading.Event()
    def cancel(self):
        self.cancelled.set()
    @action
    def run(self, *, an: str | None = None) -> None:
        Path(STARTED_FILE).touch()
        if self.cancelled.wait(300):
            raise Cancelled("cancelled")
""",
    "Press": """
class Press(Generic):
    _ABSTRACT = False
    @action
    def run(self, *, an: str | None = None) -> None:
        Path(STARTED_FILE).touch()
        time.sleep(300)
""",
    "Stubborn": """
class Stubborn(Generic):
    _ABSTRACT = False
    def stop(self):
        time.sleep(300)
    @action
    def run(self, *, an: str | None = None) -> None:
        Path(STARTED_FILE).touch()
        time.sleep(300)
""",
    "Slow": """
class Slow(Generic):
    _ABSTRACT = False
    def connect(self, timeout=5.0):
        time.sleep(0.6)
    def disconnect(self):
        time.sleep(0.6)
    def stop(self):
        pass
    @action
    def run(self, *, an: str | None = None) -> None:
        Path(STARTED_FILE).touch()
        pass
""",
}
NAMES = [name.lower() for name in TYPES]
PROJECT = Project(
    "project",
    "scn_1",
    id="pro_1",
    modified="2026-01-02T00:00:00+00:00",
    action_points=[
        ActionPoint(
            "p",
            Position(),
            id="acp_1",
            actions=[Action(f"{n}_1", f"obj_{n}/run", f"act_{n}", [], [Flow()]) for n in NAMES],
        )
    ],
)


def sources(server: Server, *names: str) -> dict[str, str]:
    started_file = f"STARTED_FILE = {str(server.services.settings.data_dir / 'started_file')!r}"
    return {name.capitalize(): started_file + TYPES[name.capitalize()] for name in names}


def devices(*names: str) -> Callable[[Server], Awaitable[None]]:
    async def prepare(server: Server) -> None:
        for name, source in sources(server, *names).items():
            server.types.add(name, source, [action("run", cancellable=name == "Timer")])
        objects = [SceneObject(name, name.capitalize(), id=f"obj_{name}") for name in names]
        await server.open(Scene("scene", id="scn_1", objects=objects), PROJECT)

    return prepare


async def until_running(server: Server) -> None:
    """Wait until the device executes its action."""
    path = server.services.settings.data_dir / "started_file"
    await until(path.exists)
    path.unlink()


async def start_action(server: Server, name: str) -> None:
    await server.ask("ExecuteAction", {"action_id": f"act_{name}"})
    await server.client.event("ActionExecution")
    await until_running(server)


async def stop_all(server: Server, codes: bool = False) -> StopAllData:
    data = await server.ask("StopAll", codes=codes)
    assert isinstance(data, StopAllData)
    return data


def not_stopped(data: StopAllData) -> dict[str, Any]:
    return {outcome.name: outcome.reason for outcome in data.outcomes if not outcome.stopped}


async def until_action_ended(server: Server) -> None:
    await until(lambda: server.services.online.running_action is None)


@serving(devices("screwdriver", "timer"))
async def test_a_single_action_is_stopped_with_or_without_cancel_mapping(server: Server) -> None:
    await server.start()
    for name in ("screwdriver", "timer"):
        await start_action(server, name)
        data = await stop_all(server)
        of_action = [outcome for outcome in data.outcomes if outcome.kind is StopKind.ACTION]
        assert [(one.id, one.name, one.stopped) for one in of_action] == [(f"act_{name}", f"{name}_1", True)]
        assert not_stopped(data) == {}
        await server.client.event("ActionCancelled")
        await until_action_ended(server)
    assert all(event["event"] != "ActionResult" for event in server.client.got)


@serving(devices("screwdriver", "press"))
async def test_an_action_that_cannot_be_stopped_is_reported_at_once(server: Server) -> None:
    await server.start()
    await start_action(server, "press")
    with pytest.raises(RequestRefused):
        await server.ask("StopScene")
    data = await stop_all(server)
    assert {outcome.name for outcome in data.outcomes if outcome.stopped} == {"screwdriver"}
    assert "press: run cannot be stopped" in not_stopped(data)["press_1"]
    assert all(word in not_stopped(data)["press_1"] for word in ("Press", "stop()", "CANCEL_MAPPING"))
    assert all(outcome == outcome.untranslated() for outcome in data.outcomes)
    (action,) = [each for each in (await stop_all(server, codes=True)).outcomes if not each.stopped]
    assert action.reason == not_stopped(data)["press_1"]
    assert str(action.key).startswith("{device}: {method} cannot be stopped, because {kind} has neither")
    assert action.values == {"device": "press", "method": "run", "kind": "Press"}
    assert server.services.online.running_action is not None
    assert all(event["event"] != "ActionCancelled" for event in server.client.got)
    await server.ask("StopScene")
    await server.client.state("stopped")
    await until_action_ended(server)


@serving(devices("screwdriver", "stubborn"))
async def test_a_stop_that_hangs_is_reported_and_delays_no_other_device(server: Server) -> None:
    await server.start()
    await start_action(server, "stubborn")
    data = await stop_all(server)
    assert set(not_stopped(data)) == {"stubborn_1"}
    assert "stop did not finish within 2 s" in not_stopped(data)["stubborn_1"]
    assert {outcome.name for outcome in data.outcomes if outcome.stopped} == {"screwdriver"}


@serving(devices("slow"))
async def test_stop_all_works_while_the_scene_starts_and_stops(server: Server) -> None:
    await server.ask("StartScene")
    await server.client.state("starting")
    assert not_stopped(await stop_all(server)) == {}
    await server.client.state("started")
    await server.ask("StopScene")
    await server.client.state("stopping")
    assert not_stopped(await stop_all(server)) == {}
    assert "message" not in await server.client.state("stopped")
    assert (await stop_all(server)).outcomes == []


@serving(devices("press"))
async def test_a_stop_cancels_an_action_that_has_not_reached_its_device(server: Server) -> None:
    await server.start()
    await server.ask("ExecuteAction", {"action_id": "act_press"})
    await stop_all(server)  # before the call has reached the device
    await server.client.event("ActionCancelled")
    await until_action_ended(server)


@serving(devices("screwdriver", "timer"))
async def test_devices_of_a_frozen_host_are_reported(server: Server) -> None:
    await server.start()
    await start_action(server, "screwdriver")
    host = server.services.online.host.host
    assert host is not None
    os.kill(host.pid, signal.SIGSTOP)
    try:
        data = await stop_all(server, codes=True)
    finally:
        os.kill(host.pid, signal.SIGCONT)
    assert set(not_stopped(data)) == {"timer", "screwdriver_1"}
    timer = next(outcome for outcome in data.outcomes if outcome.name == "timer")
    assert (timer.key, timer.values) == ("{device}: {reason}", {"device": "timer", "reason": HOST_SILENT})
    assert all("does not answer" in reason for reason in not_stopped(data).values())


def write(server: Server, script: str, name: str) -> None:
    directory = server.services.settings.packages_dir / "pkg_1"
    body = f'device = res.objects["obj_{name}"]\n{script}'
    kind = name.capitalize()
    Package(directory).write(sources(server, name), [scene_object(name, kind)], PROJECT, body)


@serving()
async def test_a_program_is_stopped_with_its_devices(server: Server) -> None:
    write(server, "device.run(an='screwdriver_1')", "screwdriver")
    await server.ask("RunPackage", {"id": "pkg_1"})
    await until_running(server)
    data = await stop_all(server)
    assert {(outcome.kind, outcome.name, outcome.stopped) for outcome in data.outcomes} == {
        (StopKind.PROGRAM, "pkg_1", True),
        (StopKind.DEVICE, "screwdriver", True),
    }
    await server.client.state("stopping", "PackageState")
    await server.client.state("stopped", "PackageState")
    assert all(event["event"] != "ProjectException" for event in server.client.got)


@serving()
async def test_a_starting_program_is_stopped_before_its_first_action(server: Server) -> None:
    write(server, "device.run(an='screwdriver_1')", "screwdriver")
    await server.ask("RunPackage", {"id": "pkg_1"})
    data = await stop_all(server)
    assert [(outcome.kind, outcome.stopped) for outcome in data.outcomes] == [(StopKind.PROGRAM, True)]
    await server.client.state("stopped", "PackageState")
    assert all(event["event"] not in ("ActionStateBefore", "PackageInfo") for event in server.client.got)


@serving()
async def test_a_stopped_program_reports_a_device_that_cannot_be_stopped(server: Server) -> None:
    write(server, "device.run(an='press_1')", "press")
    await server.ask("RunPackage", {"id": "pkg_1"})
    await until_running(server)
    data = await stop_all(server)
    assert set(not_stopped(data)) == {"press"}
    await server.client.state("stopped", "PackageState")

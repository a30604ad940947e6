"""The open project is run as a temporary package and reopened afterwards."""

import asyncio
import shutil
from pathlib import Path
from typing import Any

import pytest

from arcor2_hw.data.rpc import ListRunsArgs
from arcor2_hw.exceptions import StorageError
from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused, until, until_event

CLOSED = ["ProjectClosed", "PackageChanged/add", "PackageState started", "PackageState running", "PackageInfo"]
OPENED = ["PackageState stopping", "PackageState stopped", "PackageChanged/remove", "OpenProject"]


def event_summary(actor: Actor) -> list[str]:
    """Return a summary of the events, without the single actions."""
    events = []
    for event in actor.events():
        name, data = event["event"], event.get("data", {})
        if name in ("PackageState", "SceneState"):
            events.append(f"{name} {data['state']}")
        elif not name.startswith("ActionState"):
            events.append("/".join(filter(None, (name, event.get("change_type")))))
    return events


async def project(stage: Stage, actor: Actor, *, seconds: str = "0.05", **more: str) -> str:
    """Create and save a project that waits in a loop, with more objects. Return the action's id."""
    await stage.place(actor, time="TimeActions", **more)
    await actor.ask("SaveScene")
    scene = stage.services.session.require_scene()
    await actor.ask("NewProject", scene_id=scene.id, name="round")
    await actor.ask("AddActionPoint", name="ap", position={"x": 0, "y": 0, "z": 0})
    point = stage.services.session.require_project().action_points[0].id
    flows = [{"type": "default", "outputs": []}]
    parameters = [{"name": "seconds", "type": "double", "value": seconds}]
    kind = f"{stage.ids['time']}/sleep"
    await actor.ask("AddAction", action_point_id=point, name="nap", type=kind, parameters=parameters, flows=flows)
    (action,) = stage.services.session.require_project().action_points[0].actions
    await actor.ask("AddLogicItem", start="START", end=action.id)
    await actor.ask("AddLogicItem", start=action.id, end="END")
    await actor.ask("SaveProject")
    return action.id


async def test_a_project_runs_and_is_reopened(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice, bob, stranger = await stage.person("alice"), await stage.person("bob"), await stage.person()
        assert "No scene is open" in await refused(stranger, "TemporaryPackage")
        action = await project(stage, alice)
        opened = stage.services.session.require_project()
        await alice.lock(opened.action_points[0].id)
        assert "lock" in await refused(stranger, "TemporaryPackage")
        await alice.ask("WriteUnlock", object_id=opened.action_points[0].id)
        await alice.ask("AddActionPoint", name="more", position={"x": 0, "y": 0, "z": 0})
        assert "has unsaved changes" in await refused(stranger, "TemporaryPackage")
        await alice.ask("SaveProject")
        saved = stage.services.session.require_project()
        for person in (alice, bob, stranger):
            person.take()

        # No user has to be registered for it.
        await stranger.ask("TemporaryPackage")
        assert "response" in stranger.take()[0], "the answer comes before all events"
        before = await until_event(bob, "ActionStateBefore")
        assert before == {"action_id": action, "parameters": ["0.05"]}
        (package,) = await alice.ask("ListPackages")
        assert package["package_meta"]["name"] == "Temporary package for project 'round'."
        for name, args in (
            ("NewScene", {"name": "x"}),
            ("OpenScene", {"id": saved.scene_id}),
            ("OpenProject", {"id": saved.id}),
            ("RunPackage", {"id": package["id"]}),
            ("DeletePackage", {"id": package["id"]}),
        ):
            with pytest.raises(Exception, match=r"run|program"):
                await alice.ask(name, **args)
        await alice.ask("StopPackage")
        again = await until_event(bob, "OpenProject")
        assert again["project"]["id"] == saved.id
        assert len(again["project"]["action_points"]) == 2
        assert event_summary(bob) == CLOSED + OPENED
        assert await alice.ask("ListPackages") == []
        assert not stage.services.session.has_changes
        assert (await alice.ask("Undo"))["request"] == "AddActionPoint", "the history continues after a run"
        assert len(stage.services.session.require_project().action_points) == 1
        await alice.ask("AddActionPoint", name="another", position={"x": 0, "y": 0, "z": 0})


async def test_an_online_scene_is_online_again_after_the_run(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        action = await project(stage, alice)
        await stage.start(alice)
        await alice.ask("TemporaryPackage", start_paused=True)
        await until_event(alice, "PackageState", state="paused")
        await alice.ask("StepAction")
        await until_event(alice, "ActionStateAfter", action_id=action)
        await until(lambda: stage.services.execution.state.value == "paused")
        await alice.ask("StopPackage")
        await until_event(alice, "OpenProject")
        await until_event(alice, "SceneState", state="started")
        events = event_summary(alice)
        assert events[:3] == ["SceneState stopping", "SceneState stopped", "ProjectClosed"]
        assert events[-3:] == ["OpenProject", "SceneState starting", "SceneState started"]
        assert "ShowMainScreen" not in events
        await stage.stop(alice)


async def test_the_project_is_reopened_when_its_program_cannot_start(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        await project(stage, alice)
        alice.take()
        await alice.ask("TemporaryPackage", breakpoints=["acp_none"])
        await until_event(alice, "OpenProject")
        events = event_summary(alice)
        assert "ProjectException" in events
        assert events[-3:] == ["PackageState stopped", "PackageChanged/remove", "OpenProject"]
        await alice.ask("CloseProject")


async def test_after_a_run_a_deleted_project_leads_to_the_list_of_projects(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        await project(stage, alice)
        key = stage.services.session.require_project().id
        await alice.ask("TemporaryPackage", start_paused=True)
        await until_event(alice, "PackageState", state="paused")
        await alice.ask("DeleteProject", id=key)
        alice.take()
        await alice.ask("StopPackage")
        screen = await until_event(alice, "ShowMainScreen")
        assert screen == {"what": "ProjectsList", "highlight": key}
        await until(lambda: not stage.services.execution.busy)
        await alice.ask("NewScene", name="next")


async def test_a_project_that_cannot_be_built_stays_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        await project(stage, alice)

        async def full(*_: Any) -> str:
            raise StorageError("The disk is full.")

        with monkeypatch.context() as patch:
            patch.setattr(stage.services.build, "build", full)
            assert await refused(alice, "TemporaryPackage") == "The disk is full."
        assert stage.services.session.project is not None
        assert not stage.services.execution.busy
        # Of three simultaneous requests, one runs the project and the others are refused.
        outcomes = await asyncio.gather(*(alice.ask("TemporaryPackage") for _ in range(3)), return_exceptions=True)
        assert sum(outcome is None for outcome in outcomes) == 1
        await until_event(alice, "PackageState", state="running")
        await alice.ask("StopPackage")
        await until_event(alice, "OpenProject")


async def test_a_server_ended_during_the_run_leaves_no_package_and_reopens_the_project(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice = await stage.person("alice")
        await project(stage, alice)
        await alice.ask("TemporaryPackage")
        await until_event(alice, "ActionStateBefore")
        packages = stage.services.settings.packages_dir
        assert len(list(packages.glob("pkg_*"))) == 1
    assert list(packages.glob("pkg_*")) == []
    async with open_stage(tmp_path) as stage:
        project_again = stage.services.session.require_project()
        assert (project_again.name, stage.services.session.has_changes) == ("round", False)


async def test_a_server_killed_during_the_run_cleans_up_at_its_next_start(tmp_path: Path) -> None:
    """A kill or a power cut leaves the directory as it is during a run."""
    copied, data = tmp_path / "copied", tmp_path / "data"
    data.mkdir()
    async with open_stage(data) as stage:
        alice = await stage.person("alice")
        await project(stage, alice)
        await alice.ask("TemporaryPackage")
        await until_event(alice, "ActionStateBefore")
        await until(lambda: stage.services.runs._writing is None)  # the data on the disk matter here
        await asyncio.to_thread(shutil.copytree, data, copied)
    packages = copied / "packages"
    (package,) = packages.glob("pkg_*")
    for unfinished in (".new-x", ".old-y", f".{package.name}-z"):
        (packages / unfinished).mkdir()
    kept = packages / "pkg_kept"
    shutil.copytree(package, kept)
    async with open_stage(copied) as stage:
        opened = stage.services.session.require_project()
        assert (opened.name, stage.services.session.has_changes) == ("round", False)
        assert list(packages.iterdir()) == [kept]
        (run,) = stage.services.runs.find(ListRunsArgs(limit=10))
        assert (run.end, run.temporary, run.project_name, run.started_by) == ("lost", True, "round", "alice")
        assert "server" in str(run.error)

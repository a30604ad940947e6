"""Which starts, resumes and settings mode and authority allow, and when clients are notified."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from arcor2_hw.data.cell_state import CellAuthority, CellJob, CellMode, PlcLink
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.events import SceneStateEnum
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Conflict
from arcor2_server.audit.changes import collecting
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.runs import RunStart
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.packml.record import CellFile

PLC, OPERATOR, TECHNICIAN = RunStart(by_plc=True), RunStart(role=Role.OPERATOR), RunStart(role=Role.TECHNICIAN)
A, M = CellAuthority, CellMode


class Parts:
    """The parts of the server next to the cell, with the members that the cell uses."""

    def __init__(self) -> None:
        self.state, self.before_start, self.before_resume, self.on_state = PackageStateEnum.STOPPED, [], [], []
        self.program = SimpleNamespace(number=1)
        self.events: list[Any] = []
        self.online = SimpleNamespace(before_start=[], state=SceneStateEnum.STOPPED)

    def broadcast(self, event: Any) -> None:
        self.events.append(event)

    def get(self, number: int) -> Any:
        return SimpleNamespace(end=RunEnd.FINISHED)

    def require_no_program(self) -> None:
        if self.state is not PackageStateEnum.STOPPED:
            raise RequestRefused("A program is running. Stop it first.")

    def pause(self) -> None:
        self.enter(PackageStateEnum.PAUSING)

    def enter(self, state: PackageStateEnum) -> None:
        self.state = state
        for notify in self.on_state:
            notify()

    def permits(self, start: RunStart) -> bool:
        try:
            for check in self.before_start:
                check(start)
        except RequestRefused:
            return False
        return True


def new_cell(tmp_path: Path) -> tuple[PackmlCell, Parts]:
    parts: Any = Parts()
    cell = PackmlCell(parts, parts, parts, parts.online, parts, CellFile(tmp_path / "cell-state.json"))
    cell.link = lambda: PlcLink("127.0.0.1:502", alive=True)
    return cell, parts


@pytest.mark.parametrize(
    ("authority", "mode", "allowed"),
    [
        (A.HUB, M.PRODUCE, [OPERATOR, TECHNICIAN]),
        (A.HUB, M.CHANGEOVER, [OPERATOR, TECHNICIAN]),
        (A.HUB, M.MAINTENANCE, [TECHNICIAN]),
        (A.HUB, M.MANUAL, []),
        (A.PLC, M.PRODUCE, [PLC]),
        *[(A.PLC, mode, []) for mode in (M.CHANGEOVER, M.MAINTENANCE, M.MANUAL)],
        *[(A.NOBODY, mode, []) for mode in M],
    ],
)
async def test_mode_and_authority_determine_who_may_start(
    tmp_path: Path, authority: CellAuthority, mode: CellMode, allowed: list[RunStart]
) -> None:
    cell, parts = new_cell(tmp_path)
    with collecting() as changes:
        await cell.set_mode(mode, "")
        await cell.set_authority(authority, "")
    expected = [("mode", M.PRODUCE, mode), ("authority", A.HUB, authority)]
    assert [(each.id, each.before, each.after) for each in changes] == [
        each for each in expected if each[1] is not each[2]
    ]
    assert [start for start in (OPERATOR, TECHNICIAN, PLC) if parts.permits(start)] == allowed
    [may_go_online] = parts.online.before_start
    if authority is A.PLC:
        with pytest.raises(RequestRefused, match="The PLC has the authority"):
            may_go_online()
    else:
        may_go_online()


async def test_settings_cannot_change_while_a_program_runs_or_the_scene_is_online(tmp_path: Path) -> None:
    cell, parts = new_cell(tmp_path)
    parts.online.state = SceneStateEnum.STARTED
    with pytest.raises(RequestRefused, match="scene is online"):
        await cell.set_authority(A.PLC, "")
    parts.online.state = SceneStateEnum.STOPPED
    parts.enter(PackageStateEnum.RUNNING)
    with pytest.raises(RequestRefused, match="program is running"):
        await cell.set_authority(A.PLC, "")
    with pytest.raises(RequestRefused, match="program is running"):
        await cell.set_mode(M.MANUAL, "")
    cell.link = lambda: None
    with pytest.raises(RequestRefused, match="--plc-modbus"):
        await cell.set_authority(A.PLC, "")
    with pytest.raises(Conflict, match="number 3"):
        await cell.set_jobs([CellJob(3, "pkg_a"), CellJob(3, "pkg_b")], "")
    assert (cell.authority, cell.data().mode, cell.jobs) == (A.HUB, M.PRODUCE, [])


async def test_clients_see_each_change_once_and_resume_only_their_own_hold(tmp_path: Path) -> None:
    cell, parts = new_cell(tmp_path)
    parts.enter(PackageStateEnum.RUNNING)
    parts.enter(PackageStateEnum.RUNNING)
    [may_resume] = parts.before_resume
    cell.hold(by_plc=True)
    parts.enter(PackageStateEnum.PAUSED)
    with pytest.raises(RequestRefused, match="The PLC holds the program"):
        may_resume()
    await cell.set_authority(A.NOBODY, "")
    may_resume()
    parts.enter(PackageStateEnum.STOPPED)
    seen = [(each.data.state.value, each.data.held_by_plc) for each in parts.events if each.event == "CellChanged"]
    assert seen == [
        ("execute", False),
        ("holding", True),
        ("held", True),
        ("held", False),
        ("complete", False),
    ]

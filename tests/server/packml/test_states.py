"""The PackML state of the cell: any sequence of commands and states of a program."""

import pytest
from hypothesis import given, strategies as st

from arcor2_hw.data.cell_state import CellMode, CellStateName
from arcor2_hw.data.editor import RunEnd
from arcor2_hw.data.package import PackageStateEnum as P
from arcor2_hw.data.packml import ALLOWED, MachineCommand, MachineState
from arcor2_server.errors import RequestRefused
from arcor2_server.packml.states import STATES, CellStates

C, S = MachineCommand, MachineState
ENDS = [RunEnd.FINISHED, RunEnd.STOPPED, RunEnd.FAILED, RunEnd.LOST]
NEXT = {
    P.STOPPED: [P.STARTED],
    P.STARTED: [P.RUNNING, P.STOPPING, P.STOPPED],
    P.RUNNING: [P.PAUSING, P.STOPPING, P.STOPPED],
    P.PAUSING: [P.PAUSED, P.STOPPING, P.STOPPED],
    P.PAUSED: [P.RESUMING, P.STOPPING, P.STOPPED],
    P.RESUMING: [P.RUNNING, P.STOPPING, P.STOPPED],
    P.STOPPING: [P.STOPPED],
}
AFTER = {S.IDLE: {C.RESET}, S.STOPPED: {C.CLEAR, C.STOP}, S.ABORTED: {C.ABORT}, S.ABORTING: {C.ABORT}}


@given(st.data())
def test_commands_change_the_state_only_as_packml_allows(data: st.DataObject) -> None:
    states, program = CellStates(), P.STOPPED
    for _ in range(data.draw(st.integers(1, 30))):
        before = states.present
        command = data.draw(st.sampled_from([None, C.RESET, C.CLEAR, C.STOP, C.ABORT]))
        if command is None:
            program = data.draw(st.sampled_from(NEXT[program]))
            outcome = data.draw(st.sampled_from(ENDS)) if program is P.STOPPED else RunEnd.RUNNING
            states.program_changed(program, outcome)
            if before is S.ABORTING:  # an abort is completed, however the program ends
                assert states.present is (S.ABORTED if program is P.STOPPED else S.ABORTING)
        elif before in ALLOWED[command]:
            states.command(command, active=program is not P.STOPPED)
            assert states.present is before or command in AFTER[states.present]
        else:
            with pytest.raises(RequestRefused, match=command.name.lower()):
                states.command(command, active=program is not P.STOPPED)
            assert states.present is before
        assert states.present in STATES
        is_inactive = states.present in (S.STOPPED, S.IDLE, S.COMPLETE, S.ABORTED)
        assert is_inactive is (program is P.STOPPED)


@pytest.mark.parametrize(
    ("end", "state"),
    [
        (RunEnd.FINISHED, S.COMPLETE),
        (RunEnd.STOPPED, S.STOPPED),
        (RunEnd.FAILED, S.ABORTED),
        (RunEnd.LOST, S.ABORTED),
    ],
)
def test_the_end_of_a_run_decides_the_state(end: RunEnd, state: MachineState) -> None:
    states = CellStates()
    states.program_changed(P.RUNNING, RunEnd.RUNNING)
    assert states.present is S.EXECUTE
    states.program_changed(P.STOPPED, end)
    assert states.present is state


def test_names_and_numbers_of_states_match() -> None:
    assert {each.name for each in CellStateName} == {each.name for each in STATES}
    assert [each.value for each in CellMode] == ["produce", "maintenance", "manual", "changeover"]

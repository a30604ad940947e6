"""The fake tester's behaviour over time, with a simulated clock."""

from hypothesis import given, settings, strategies as st

from arcor2_fakes.functional_tester.board import Board
from arcor2_fakes.functional_tester.station import (
    DOOR_MAY_MOVE,
    RUNNING,
    Answer,
    Command,
    Fault,
    Refusal,
    State,
    Station,
)


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def station_with(clock: Clock, board: Board | None = None) -> Station:
    station = Station(clock=clock, test_time=1.0)
    if board is not None:
        station.push_door(opening=True)
        station.put_board(board)
        station.push_door(opening=False)
    return station


def after(station: Station, clock: Clock, seconds: float) -> State:
    clock.now += seconds
    station.advance()
    return station.state


def test_the_result_does_not_depend_on_the_time_step() -> None:
    histories = []
    for step in (0.01, 5.0):
        clock = Clock()
        station = station_with(clock, Board("A1"))
        station.command(Command.RESET)
        after(station, clock, 0.25)
        assert station.command(Command.START) is Answer.ACCEPTED
        end = clock.now + 5.0
        while clock.now < end:
            after(station, clock, step)
        histories.append((station.state, station.results, station.clamped))
    assert histories[0] == histories[1]
    assert histories[0][0] is State.COMPLETE


def test_hold_pauses_the_test() -> None:
    clock = Clock()
    station = station_with(clock, Board("A1"))
    station.command(Command.RESET)
    after(station, clock, 0.25)
    station.command(Command.START)
    assert after(station, clock, 0.3 + 0.6) is State.EXECUTE
    assert station.command(Command.HOLD) is Answer.ACCEPTED
    assert after(station, clock, 30.0) is State.HELD
    assert station.command(Command.UNHOLD) is Answer.ACCEPTED
    assert after(station, clock, 0.1 + 0.35) is State.EXECUTE
    assert not station.results
    assert after(station, clock, 0.1) is State.COMPLETING
    assert len(station.results) == 1


def test_the_door_needs_time_and_reverses_at_its_position() -> None:
    clock = Clock()
    station = station_with(clock)
    station.move_door(opening=True)
    after(station, clock, 0.3)
    assert (station.door_open, station.door_closed) == (False, False)
    station.move_door(opening=False)
    after(station, clock, 0.29)
    assert not station.door_closed
    after(station, clock, 0.02)
    assert station.door_closed


def test_emergency_stop_halts_the_door() -> None:
    clock = Clock()
    station = station_with(clock)
    station.move_door(opening=True)
    after(station, clock, 0.2)
    station.press_emergency_stop(pressed=True)
    after(station, clock, 3.0)
    assert station.door == "between"
    station.move_door(opening=True)
    after(station, clock, 3.0)
    assert station.door == "between"


DO = st.one_of(
    st.sampled_from([("command", int(command)) for command in Command]),
    st.sampled_from([("command", 6), ("open", 0), ("close", 0), ("put", 0), ("take", 0)]),
    st.sampled_from([("push", 0), ("push", 1), ("press", 0), ("press", 1)]),
    st.sampled_from([("fault", int(fault)) for fault in Fault if fault]),
    st.sampled_from([("arm", int(fault)) for fault in Fault if fault]),
)


@settings(max_examples=300, deadline=None)
@given(steps=st.lists(st.tuples(DO, st.floats(0.0, 2.0)), max_size=40))
def test_invariants_hold_for_random_events(steps: list[tuple[tuple[str, int], float]]) -> None:
    clock = Clock()
    station = station_with(clock, Board("A1", "short"))
    for (what, value), pause in steps:
        door, had = station.door, station.board
        may_move = station.state in DOOR_MAY_MOVE and not station.emergency_stop_pressed
        match what:
            case "command":
                answer = station.command(value)
                if answer is not Answer.ACCEPTED and value == Command.START:
                    assert station.state is not State.STARTING
            case "open" | "close":
                station.move_door(opening=what == "open")
                assert may_move or station.door == door
            case "put" | "take":
                try:
                    station.put_board(Board("B2")) if what == "put" else station.take_board()
                except Refusal:
                    assert station.board == had
                else:
                    assert station.door_open
                    assert (station.board is None) == (what == "take")
            case "push":
                station.push_door(opening=bool(value))
            case "press":
                station.press_emergency_stop(pressed=bool(value))
            case "fault" | "arm":
                station.inject(Fault(value), armed=what == "arm")
        before = len(station.results)
        clock.now += pause
        station.advance()
        assert len(station.results) <= before + 1
        if station.state in RUNNING:
            assert station.door_closed
            assert station.board is not None
            assert station.fault is Fault.NONE
        if station.fault is not Fault.NONE or station.emergency_stop_pressed:
            assert station.state in (State.ABORTING, State.ABORTED)
        if station.clamped:
            assert station.state not in DOOR_MAY_MOVE
        assert [result.number for result in station.results] == list(range(1, len(station.results) + 1))


def test_a_power_cycle_resets_settings_but_not_board_and_door() -> None:
    clock = Clock()
    station = station_with(clock, Board("A1"))
    station.watchdog_ms, station.test_program = 5000, 3
    station.command(Command.RESET)
    after(station, clock, 0.25)
    station.command(Command.START)
    assert after(station, clock, 0.8) is State.EXECUTE
    station.power_cycle()
    assert (station.state, station.clamped, station.watchdog_ms, station.test_program) == (State.STOPPED, False, 0, 1)
    assert after(station, clock, 10.0) is State.STOPPED
    assert station.results == []
    assert station.board == Board("A1")
    station.move_door(opening=True)
    after(station, clock, 0.25)
    station.power_cycle()
    after(station, clock, 5.0)
    assert not station.door_open
    assert not station.door_closed
    station.press_emergency_stop(pressed=True)
    station.power_cycle()
    assert (station.state, station.fault) == (State.ABORTED, Fault.EMERGENCY_STOP)

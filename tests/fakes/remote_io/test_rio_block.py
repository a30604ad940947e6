"""The fake block's behaviour over time, with a simulated clock."""

import pytest

from arcor2_fakes.remote_io.block import ACKNOWLEDGE, RELEASE, Block, OutputLocked, WatchdogState


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def block(clock: Clock) -> Block:
    """Return a block with a watchdog on DO0 (off), DO1 (on), DO2 (hold) and AO0 (7)."""
    block = Block(clock)
    dog = block.watchdogs[0]
    dog.time_ms, dog.do_guarded, dog.do_switched, dog.do_safe = 500, 0b111, 0b011, 0b010
    dog.ao_guarded, dog.ao_switched, dog.ao_safe = 0b11, 0b01, [7, 8]
    for number in range(4):
        block.write_digital(number, on=number != 1)
    block.write_analog(0, 100)
    block.write_analog(1, 200)
    return block


def after(block: Block, clock: Clock, seconds: float) -> list[bool]:
    clock.now += seconds
    block.advance()
    return block.outputs[:4]


def test_watchdog_expires_and_locks_its_outputs(block: Block, clock: Clock) -> None:
    dog = block.watchdogs[0]
    assert after(block, clock, 60.0) == [True, False, True, True]  # off until it is triggered
    for _ in range(5):
        block.trigger(dog, 7)
        assert after(block, clock, 0.4) == [True, False, True, True]
    assert after(block, clock, 0.2) == [False, True, True, True]
    assert block.analog_outputs == [7, 200]
    assert dog.state is WatchdogState.EXPIRED
    block.trigger(dog, 7)  # too late
    assert dog.state is WatchdogState.EXPIRED
    for digital in (0b001, 0b100):
        with pytest.raises(OutputLocked):
            block.check_unlocked(digital=digital)
    with pytest.raises(OutputLocked):
        block.check_unlocked(analog=0b10)
    block.check_unlocked(digital=0b1000)
    block.command(dog, ACKNOWLEDGE)
    block.check_unlocked(digital=0b111, analog=0b11)
    assert after(block, clock, 60.0) == [False, True, True, True]  # no output returns by itself


def test_release_is_the_safe_state_at_once(block: Block, clock: Clock) -> None:
    dog = block.watchdogs[0]
    block.trigger(dog, 7)
    block.command(dog, ACKNOWLEDGE)  # nothing to acknowledge
    assert dog.state is WatchdogState.RUNNING
    block.command(dog, RELEASE)
    assert block.outputs[:4] == [False, True, True, True]
    assert (dog.state, dog.number) == (WatchdogState.OFF, 0)


def test_the_result_does_not_depend_on_the_time_step() -> None:
    histories = []
    for step in (0.01, 5.0):
        clock = Clock()
        block = Block(clock)
        dog = block.watchdogs[2]
        dog.time_ms, dog.do_guarded, dog.do_switched, dog.do_safe = 500, 0b110, 0b110, 0b010
        block.trigger(dog, 1)
        block.pulse(0, 700)  # not guarded
        block.pulse(1, 300)  # ends before the watchdog, which switches it on
        block.pulse(2, 900)  # ended by the watchdog
        end = clock.now + 5.0
        while clock.now < end:
            after(block, clock, step)
        histories.append([(round(at - 100.0, 6), number, on) for at, number, on in block.history])
    assert histories[0] == histories[1]
    assert histories[0][3:] == [(0.3, 1, False), (0.5, 1, True), (0.5, 2, False), (0.7, 0, False)]


def test_a_write_ends_a_pulse(block: Block, clock: Clock) -> None:
    block.pulse(1, 100)
    block.write_digital(1, on=True)
    assert after(block, clock, 1.0)[1] is True
    block.pulse(1, 100)
    block.pulse(1, 0)
    assert block.outputs[1] is False

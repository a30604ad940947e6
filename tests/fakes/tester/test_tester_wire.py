"""The fake tester from the host's side: pymodbus and the registers of the device page."""

import contextlib
import logging
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException

from tests.fakes.conftest import FakeProcess, run_fake

RESET, START, STOP, HOLD, UNHOLD, ABORT, CLEAR = 1, 2, 3, 4, 5, 8, 9
STOPPED, IDLE, EXECUTE, ABORTED, HELD, COMPLETE = 2, 4, 6, 9, 11, 17


class Host:
    """A minimal host, written from the device page."""

    def __init__(self, address: str, timeout: float = 2.0) -> None:
        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
        host, port = address.split(":")
        self.client = ModbusTcpClient(host, port=int(port), timeout=timeout, retries=0)
        assert self.client.connect()

    def close(self) -> None:
        self.client.close()

    def inputs(self) -> list[int]:
        answer = self.client.read_input_registers(0, count=17, device_id=1)
        assert not answer.isError(), answer
        return answer.registers

    @property
    def state(self) -> int:
        return self.inputs()[0]

    @property
    def switches(self) -> list[bool]:
        answer = self.client.read_discrete_inputs(0, count=5, device_id=1)
        assert not answer.isError(), answer
        return answer.bits[:5]

    def _write_pair(self, address: int, value: int) -> int:
        sequence = self.client.read_holding_registers(address + 1, count=1, device_id=1).registers[0]
        sequence = (sequence + 1) & 0xFFFF
        answer = self.client.write_registers(address, [value, sequence], device_id=1)
        assert not answer.isError(), answer
        return sequence

    def command(self, code: int) -> int:
        sequence = self._write_pair(0, code)
        words = self.inputs()
        assert words[1] == sequence
        return words[2]

    def door(self, code: int) -> None:
        self._write_pair(3, code)

    def floats(self) -> tuple[float, ...]:
        return struct.unpack(">3f", struct.pack(">6H", *self.inputs()[6:12]))


@pytest.fixture(scope="module")
def one_tester() -> Iterator[FakeProcess]:
    with FakeProcess("functional_tester", "--time-scale", "20", "--test-time", "2", "--seed", "7") as tester:
        yield tester


@pytest.fixture
def tester(one_tester: FakeProcess) -> FakeProcess:
    """Reset the tester to its factory state. One process serves all tests of this file."""
    one_tester.control.do("renew")
    return one_tester


@pytest.fixture
def host(tester: Any) -> Iterator[Host]:
    with contextlib.closing(Host(tester.ready["modbus"])) as host:
        yield host


def load(tester: Any, host: Host, wait_for: Callable[..., Any], code: str, defect: str | None = None) -> None:
    host.door(1)
    wait_for(lambda: host.switches[0])
    if tester.truth()["board"] is not None:
        tester.control.do("take_board")
    tester.control.do("put_board", code=code, defect=defect)
    host.door(2)
    wait_for(lambda: host.switches[1])


def ready_to_start(tester: Any, host: Host, wait_for: Callable[..., Any], defect: str | None = None) -> None:
    load(tester, host, wait_for, "B1", defect)
    assert host.command(RESET) == 0
    wait_for(lambda: host.state, lambda state: state == IDLE)


def test_the_result_depends_on_the_board(tester: Any, host: Host, wait_for: Callable[..., Any]) -> None:
    assert host.state == STOPPED
    assert host.switches == [False, True, False, False, False]
    values = {}
    for number, (code, defect) in enumerate([("G1", None), ("S1", "short"), ("O1", "open"), ("L1", "leakage")], 1):
        load(tester, host, wait_for, code, defect)
        assert host.command(RESET) == 0
        wait_for(lambda: host.state, lambda state: state == IDLE)
        assert host.command(START) == 0
        wait_for(lambda: host.switches[3])
        wait_for(lambda: host.state, lambda state: state == COMPLETE)
        words = host.inputs()
        assert words[4] == (1 if defect is None else 2)
        assert words[5] == words[12] == number
        values[code] = host.floats()
    assert words[12:15] == [4, 1, 3]
    assert host.switches == [False, True, True, False, False]
    assert 4.75 < values["G1"][0] < 5.25
    assert 0.1 < values["G1"][1] < 0.15
    assert values["S1"][1] > 1.0 > values["S1"][0] - 3.0
    assert values["O1"][2] > 10.0
    assert 0.15 < values["L1"][1] < 0.25
    results = tester.truth()["results"]
    assert [(r["code"], r["result"]) for r in results] == [
        ("G1", "pass"),
        ("S1", "fail"),
        ("O1", "fail"),
        ("L1", "fail"),
    ]
    assert results[0]["measured"]["supply_current"] == pytest.approx(values["G1"][1], rel=1e-6)


def test_results_are_available_before_complete(tester: Any, host: Host, wait_for: Callable[..., Any]) -> None:
    ready_to_start(tester, host, wait_for)
    host.command(START)
    seen = []
    deadline = time.monotonic() + 30.0
    while not seen or seen[-1][0] != COMPLETE:
        assert time.monotonic() < deadline
        words = host.inputs()
        seen.append((words[0], words[4:12]))
    for state, results in seen:
        assert (results[0] != 0) == (results[1] != 0) == any(results[2:])
        assert state != COMPLETE or results[0]


def test_a_seed_makes_values_repeatable(start_fake: Callable[..., Any], wait_for: Callable[..., Any]) -> None:
    measured = []
    for seed in ("3", "3", "4"):
        fake = start_fake("functional_tester", "--time-scale", "50", "--seed", seed)
        host = Host(fake.ready["modbus"])
        ready_to_start(fake, host, wait_for)
        host.command(START)
        wait_for(lambda: host.state, lambda state: state == COMPLETE)  # noqa: B023
        measured.append(host.floats())
        host.client.close()
    assert measured[0] == measured[1] != measured[2]


def test_refusals_name_their_reason(tester: Any, host: Host, wait_for: Callable[..., Any]) -> None:
    assert host.command(START) == 1
    assert host.command(7) == 2
    assert host.command(HOLD) == 1
    assert host.command(UNHOLD) == 1
    assert host.command(CLEAR) == 1
    assert host.command(RESET) == 0
    wait_for(lambda: host.state, lambda state: state == IDLE)
    assert host.command(START) == 4
    host.door(1)
    assert host.command(START) == 3
    wait_for(lambda: host.switches[0])
    tester.control.do("put_board", code="B1")
    host.door(2)
    wait_for(lambda: host.switches[1])
    host.client.write_register(2, 10, device_id=1)
    assert host.command(START) == 5
    host.client.write_register(2, 9, device_id=1)
    assert host.command(RESET) == 1
    assert host.command(START) == 0
    wait_for(lambda: host.state, lambda state: state == COMPLETE)
    assert tester.truth()["results"][0]["program"] == 9


def test_a_command_needs_a_new_sequence_number(host: Host) -> None:
    host.command(RESET)
    before = host.inputs()[1]
    host.client.write_register(0, ABORT, device_id=1)
    host.client.write_registers(0, [ABORT, before], device_id=1)
    assert host.state not in (8, ABORTED)
    host.client.write_register(1, (before + 1) & 0xFFFF, device_id=1)
    assert host.state in (8, ABORTED)


def test_hold_stop_and_abort_give_no_result(tester: Any, host: Host, wait_for: Callable[..., Any]) -> None:
    ready_to_start(tester, host, wait_for)
    host.command(START)
    wait_for(lambda: host.state, lambda state: state == EXECUTE)
    assert host.command(HOLD) == 0
    wait_for(lambda: host.state, lambda state: state == HELD)
    assert host.command(STOP) == 0
    wait_for(lambda: host.state, lambda state: state == STOPPED)
    assert host.command(ABORT) == 0
    wait_for(lambda: host.state, lambda state: state == ABORTED)
    assert host.command(STOP) == 1
    words = host.inputs()
    assert (words[3], words[4], words[5], words[12]) == (0, 0, 0, 0)
    assert not host.switches[3]


def test_the_door_stays_closed_during_a_test(wait_for: Callable[..., Any]) -> None:
    with (
        FakeProcess("functional_tester", "--time-scale", "20", "--test-time", "200") as tester,
        contextlib.closing(Host(tester.ready["modbus"])) as host,
    ):
        ready_to_start(tester, host, wait_for)
        host.command(START)
        wait_for(lambda: host.state, lambda state: state == EXECUTE)
        result = host.inputs()[2]
        host.door(1)
        assert host.switches[:2] == [False, True]
        assert host.inputs()[2] == result
        with pytest.raises(Exception, match="door is closed"):
            tester.control.do("take_board")
        tester.control.do("push_door", opening=True)
        wait_for(lambda: host.state, lambda state: state == ABORTED)
        assert host.inputs()[3] == 102
        assert tester.truth()["tested"] == 0


def test_a_board_goes_in_only_through_an_open_door(tester: Any, host: Host, wait_for: Callable[..., Any]) -> None:
    with pytest.raises(Exception, match="door is closed"):
        tester.control.do("put_board", code="B1")
    host.door(1)
    wait_for(lambda: host.switches[0])
    with pytest.raises(Exception, match="defect"):
        tester.control.do("put_board", code="B1", defect="melted")
    tester.control.do("put_board", code="B1")
    with pytest.raises(Exception, match="B1 is already in the fixture"):
        tester.control.do("put_board", code="B2")
    assert tester.control.do("take_board") == "B1"
    assert not host.switches[2]


@pytest.mark.parametrize("fault", [101, 102, 103, 104, 105])
def test_a_fault_ends_the_test_without_a_result(
    tester: Any, host: Host, wait_for: Callable[..., Any], fault: int
) -> None:
    ready_to_start(tester, host, wait_for)
    tester.control.do("fault", code=fault, armed=True)
    host.command(START)
    wait_for(lambda: host.state, lambda state: state == ABORTED)
    assert host.inputs()[3:6] == [fault, 0, 0]
    assert host.switches == [fault == 102, fault != 102, fault != 101, False, False]
    assert host.command(RESET) == 1
    assert host.command(CLEAR) == 0
    wait_for(lambda: host.state, lambda state: state == STOPPED)
    assert host.inputs()[3] == 0


def test_emergency_stop_cannot_be_cleared_while_pressed(tester: Any, host: Host, wait_for: Callable[..., Any]) -> None:
    tester.control.do("emergency_stop")
    wait_for(lambda: host.state, lambda state: state == ABORTED)
    assert host.switches[4]
    assert host.inputs()[3] == 106
    assert host.command(CLEAR) == 1
    host.door(1)
    assert tester.truth()["door"] == "closed"
    tester.control.do("emergency_stop", pressed=False)
    assert host.command(CLEAR) == 0
    wait_for(lambda: host.state, lambda state: state == STOPPED)


def test_the_watchdog_detects_a_silent_host(start_fake: Callable[..., Any], wait_for: Callable[..., Any]) -> None:
    tester = start_fake("functional_tester", "--time-scale", "20", "--test-time", "100")
    host = Host(tester.ready["modbus"])
    host.client.write_register(5, 1000, device_id=1)
    ready_to_start(tester, host, wait_for)
    host.command(START)
    end = time.monotonic() + 1.5
    while time.monotonic() < end:
        assert host.state in (3, EXECUTE)  # each request triggers the watchdog
    silent_since = time.monotonic()
    tester.control.wait_until(lambda truth: truth["state"] == "Aborted")
    assert time.monotonic() - silent_since > 0.9
    assert tester.truth()["fault"] == 105
    host.client.close()


def test_the_life_counter_runs_at_10_hz(host: Host) -> None:
    began = time.monotonic()
    first, read = host.inputs()[15], time.monotonic()
    time.sleep(0.6)
    shortest = time.monotonic() - read
    counted = host.inputs()[15] - first
    assert shortest * 10.0 - 2.0 < counted < (time.monotonic() - began) * 10.0 + 2.0


def test_identification(host: Host) -> None:
    from pymodbus.pdu.mei_message import ReadDeviceInformationRequest

    answer = host.client.execute(False, ReadDeviceInformationRequest(read_code=1, object_id=0))
    assert list(answer.information.values()) == [b"Fake Test Systems", b"FT-100", b"1.2"]


def test_illegal_requests_get_exceptions(host: Host) -> None:
    client = host.client
    assert client.read_input_registers(10, count=8, device_id=1).exception_code == 2
    assert client.read_input_registers(17, count=1, device_id=1).exception_code == 2
    assert client.read_holding_registers(6, count=1, device_id=1).exception_code == 2
    assert client.read_discrete_inputs(0, count=6, device_id=1).exception_code == 2
    assert client.read_discrete_inputs(5, count=1, device_id=1).exception_code == 2
    assert client.write_registers(5, [0, 0], device_id=1).exception_code == 2
    assert client.write_registers(3, [3, 1], device_id=1).exception_code == 3
    assert client.read_coils(0, count=1, device_id=1).exception_code == 1
    assert client.write_coil(3000, True, device_id=1).exception_code == 1
    assert client.read_holding_registers(3, count=2, device_id=1).registers == [0, 0]
    assert client.read_holding_registers(0, count=1, device_id=9).isError()


@pytest.mark.parametrize("fault", ["silence", "reset", "half_frame", "garbage"])
def test_a_faulty_wire_gives_no_answer_and_recovers(tester: Any, fault: str) -> None:
    host = Host(tester.ready["modbus"], timeout=0.3)
    assert host.state == STOPPED
    tester.control.do(fault)
    with pytest.raises((ModbusException, OSError)):  # the library passes a reset on unchanged
        host.inputs()
    tester.control.do("heal")
    host.client.close()
    host = Host(tester.ready["modbus"])
    assert host.state == STOPPED
    host.client.close()


def test_refuse_closes_the_port_and_slow_delays(tester: Any) -> None:
    host = Host(tester.ready["modbus"])
    tester.control.do("slow", seconds=0.3)
    began = time.monotonic()
    assert host.state == STOPPED
    assert time.monotonic() - began > 0.28
    host.client.close()
    tester.control.do("refuse")
    assert not host.client.connect()
    tester.control.do("heal")
    assert host.client.connect()
    assert host.state == STOPPED
    host.client.close()


def test_commands_during_silence_do_not_arrive(tester: Any) -> None:
    host = Host(tester.ready["modbus"], timeout=0.2)
    tester.control.do("silence")
    with pytest.raises(ModbusException):
        host.client.write_registers(0, [ABORT, 1], device_id=1)
    assert tester.truth()["state"] == "Stopped"
    host.client.close()


def test_the_fake_ends_on_sigterm_and_reports_errors(start_fake: Callable[..., Any]) -> None:
    fake = start_fake("functional_tester")
    taken = fake.ready["modbus"].split(":")[1]
    for arguments, status in ((["--port", taken], 1), (["--control", "nowhere"], 2)):
        ended = run_fake("functional_tester", *arguments)
        assert ended.returncode == status
        assert ended.stderr.startswith("functional_tester: ")
        assert len(ended.stderr.strip().splitlines()) == 1
    assert fake.terminate() == 0


def test_a_power_cycle_clears_the_registers(tester: Any, host: Host, wait_for: Callable[..., Any]) -> None:
    load(tester, host, wait_for, "A1")
    assert host.command(RESET) == 0
    wait_for(lambda: host.state == IDLE)
    assert host.client.write_register(2, 5, device_id=1).registers == [5]
    tester.control.do("power_cycle")
    host.client.close()  # the connection was reset
    assert host.client.connect()
    assert host.client.read_holding_registers(0, count=6, device_id=1).registers == [0, 0, 1, 0, 0, 0]
    assert host.inputs()[:3] == [STOPPED, 0, 0]
    assert host.command(RESET) == 0
    wait_for(lambda: host.state == IDLE)

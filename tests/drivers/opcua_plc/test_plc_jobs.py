"""Jobs and control: the handshake step by step, errors with their code, one owner at a time."""

import time
from collections.abc import Callable
from typing import Any

import pytest

from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_hw.exceptions import Cancelled, DeviceFault, DeviceTimeout, NotInControl, OutOfRange, Refused
from tests.drivers.opcua_plc.conftest import BackgroundCall
from tests.fakes.conftest import FakeProcess


def handshake(fake: FakeProcess) -> list[tuple[str, Any]]:
    """Return the values of the handshake that the host wrote, without its life sign."""
    written = [tuple(each) for each in fake.truth()["written"]]
    return [(name.removeprefix("Handshake."), value) for name, value in written if "HostLife" not in name]


def test_a_job_follows_the_handshake(fake: FakeProcess, plc: OpcUaPlc) -> None:
    before, done = len(handshake(fake)), len(fake.truth()["done"])
    began = time.monotonic()
    plc.run_job(2)
    assert time.monotonic() - began >= 0.6, "3 s, five times as fast"
    assert handshake(fake)[before:] == [("Number", 2), ("Request", True), ("Request", False)]
    truth = fake.truth()
    assert truth["step"] == "idle"
    assert truth["done"][done:] == [2]
    plc.run_job(1)
    assert fake.truth()["done"][done:] == [2, 1]


def test_a_job_error_carries_the_plc_code(fake: FakeProcess, plc: OpcUaPlc) -> None:
    fake.control.do("job_error", code=417)
    with pytest.raises(DeviceFault, match=r"plc at opc.tcp.*job 1 ended with error 417") as fault:
        plc.run_job(1)
    assert fault.value.fault_code == 417
    with pytest.raises(DeviceFault) as fault:
        plc.run_job(9)
    assert fault.value.fault_code == 92
    assert fake.truth()["step"] == "idle"
    plc.run_job(1)


def test_a_job_that_takes_too_long_is_stopped(fake: FakeProcess, plc: OpcUaPlc) -> None:
    fake.control.do("stuck")
    with pytest.raises(DeviceTimeout, match=r"job 1 took longer than 0.5 s; the PLC is busy"):
        plc.run_job(1, 0.5)
    fake.control.wait_until(lambda t: t["step"] == "idle")
    assert not fake.truth()["moving"]


def test_an_unanswered_request_is_withdrawn(fake: FakeProcess, plc: OpcUaPlc) -> None:
    fake.control.do("deaf")
    with pytest.raises(DeviceTimeout, match=r"the start of job 1 took longer than 2 s; the PLC is idle"):
        plc.run_job(1)
    assert handshake(fake)[-1] == ("Request", False)


def test_a_job_is_stopped(fake: FakeProcess, plc: OpcUaPlc) -> None:
    plc.write_digital("valve", True)
    running = BackgroundCall(lambda: plc.run_job(3))
    fake.control.wait_until(lambda t: t["moving"])
    with pytest.raises(Refused, match=r"is busy \(job 3\): job 1 has to wait"):
        plc.run_job(1)
    plc.stop()
    assert not fake.truth()["moving"], "stop returned before standstill"
    assert isinstance(running.outcome(), Cancelled)
    assert fake.truth()["points"]["Valve"] is True, "a stop switched an output"
    plc.run_job(1)


def test_a_plc_that_is_not_idle_refuses_a_job(fake: FakeProcess, plc: OpcUaPlc, make: Callable[..., OpcUaPlc]) -> None:
    fake.control.do("stuck")
    running = BackgroundCall(lambda: plc.run_job(1, 30.0))
    fake.control.wait_until(lambda t: t["moving"])
    other = make(fake.ready["url"], host_number=2)
    other.connect()
    with pytest.raises(NotInControl, match="control is refused: host 1 has it"):
        other.take_control()
    with pytest.raises(NotInControl, match="job 1 is refused: host 1 has control"):
        other.run_job(1)
    plc.stop()
    assert isinstance(running.outcome(), Cancelled)


def test_control_is_refused_while_another_host_has_it(fake: FakeProcess, observed: OpcUaPlc, wait_for: Any) -> None:
    fake.control.do("stranger", number=77)
    wait_for(observed.control_owner, lambda owner: owner == "host 77")
    before = fake.truth()["writes"]
    with pytest.raises(NotInControl, match="host 77"):
        observed.take_control()
    with pytest.raises(NotInControl, match="writing lamp is refused"):
        observed.write_digital("lamp", True)
    assert fake.truth()["writes"] == before
    fake.control.do("stranger", number=0)
    observed.take_control()
    assert observed.control_owner() == "us"


def test_control_taken_by_another_host_is_detected(fake: FakeProcess, plc: OpcUaPlc, wait_for: Any) -> None:
    running = BackgroundCall(lambda: plc.run_job(3))
    fake.control.wait_until(lambda t: t["moving"])
    fake.control.do("stranger", number=77)
    assert isinstance(running.outcome(), NotInControl)
    wait_for(plc.control_owner, lambda owner: owner == "host 77")
    with pytest.raises(NotInControl, match="host 77 has control"):
        plc.write_digital("lamp", True)


def test_control_is_released(fake: FakeProcess, plc: OpcUaPlc) -> None:
    plc.write_digital("lamp", True)
    assert fake.truth()["owner"] == 1
    plc.release_control()
    truth = fake.truth()
    assert (truth["owner"], truth["points"]["Lamp"]) == (0, True)
    life = truth["host_life"]
    time.sleep(0.5)
    assert fake.truth()["host_life"] == life, "it sends a life sign without control"
    plc.take_control()
    plc.disconnect()
    assert fake.truth()["owner"] == 0


def test_numbers_out_of_the_plc_type_are_refused(fake: FakeProcess, plc: OpcUaPlc) -> None:
    with pytest.raises(OutOfRange, match="number of a job must be -32768 to 32767, not 40000"):
        plc.run_job(40000)
    with pytest.raises(AssertionError):
        plc.run_job(1, 0.0)

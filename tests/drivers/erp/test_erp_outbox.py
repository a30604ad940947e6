"""Results: on disk before the action returns, at the service exactly once and in order, despite faults in between."""

import itertools
import time

import pytest

from arcor2_drivers.erp.erp_service import ErpService
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import DeviceTimeout
from tests.drivers.erp.conftest import serials
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for


@pytest.fixture
def order(fake: FakeProcess) -> str:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=1000)
    return "A-1"


def test_results_arrive_in_order_with_their_values(fake: FakeProcess, erp: ErpService, order: str) -> None:
    for number in range(20):
        erp.report_result(order, f"S-{number}", number % 3 > 0, f"{number} V")
    erp.wait_until_sent(30.0)
    results = fake.truth()["results"]
    assert [(r["serial"], r["passed"], r["note"]) for r in results] == [
        (f"S-{n}", n % 3 > 0, f"{n} V") for n in range(20)
    ]
    assert {r["station"] for r in results} == {"cell"}
    assert [r["finished"] for r in results] == sorted(r["finished"] for r in results)
    assert fake.truth()["repeated"] == 0
    state = erp.outbox().value
    assert (state.waiting, state.refused, state.since, state.last_error) == (0, 0, None, "")


def test_production_continues_while_the_service_is_down(fake: FakeProcess, erp: ErpService, order: str) -> None:
    fake.control.do("refuse")
    fake.control.do("reset")
    for number in range(30):
        erp.report_result(order, f"S-{number}", True)
    fake.control.wait_until(lambda t: t["connections"] == 0)
    wait_for(lambda: erp.connection is Connection.LOST)
    state = erp.outbox().value
    assert state.waiting == 30
    assert "planning at http" in state.last_error
    with pytest.raises(DeviceTimeout, match="30 results are still waiting"):
        erp.wait_until_sent(0.1)
    fake.control.do("heal")
    erp.wait_until_sent(30.0)
    assert serials(fake) == [f"S-{n}" for n in range(30)]
    wait_for(lambda: erp.connection is not Connection.LOST)
    assert erp.health is Health.NORMAL


@pytest.mark.parametrize("fault", ["lose_answers", "half_frame", "garbage", "silence", "reset"])
def test_each_result_arrives_once_with_any_fault_of_the_answer(
    fake: FakeProcess, erp: ErpService, order: str, fault: str
) -> None:
    erp.report_result(order, "S-0", True)
    erp.wait_until_sent(30.0)
    if fault == "lose_answers":
        fake.control.do("lose_answers", count=2)
    else:
        fake.control.do(fault)
    erp.report_result(order, "S-1", True)
    erp.report_result(order, "S-2", False)
    if fault == "lose_answers":
        fake.control.wait_until(lambda t: t["repeated"] >= 1)
    else:
        time.sleep(0.7)
        fake.control.do("heal")
    erp.wait_until_sent(30.0)
    assert serials(fake) == ["S-0", "S-1", "S-2"]


def test_an_error_status_after_storing_does_not_duplicate_a_result(
    fake: FakeProcess, erp: ErpService, order: str
) -> None:
    fake.control.do("fail", status=500, count=2, path="/results", done=True)
    erp.report_result(order, "S-1", True)
    erp.wait_until_sent(30.0)
    assert serials(fake) == ["S-1"]
    assert fake.truth()["repeated"] == 2


def test_an_answer_to_another_message_is_ignored(fake: FakeProcess, erp: ErpService, order: str) -> None:
    fake.control.do("mistake", count=1)
    erp.report_result(order, "S-1", True)
    erp.wait_until_sent(30.0)
    assert serials(fake) == ["S-1"]


def test_retry_after_is_respected(fake: FakeProcess, erp: ErpService, order: str) -> None:
    fake.control.do("fail", status=503, count=1, retry_after=2, path="/results")
    erp.report_result(order, "S-1", True)
    erp.wait_until_sent(30.0)
    requests = [each["at"] for each in fake.control.do("received") if '"S-1"' in each["body"]][-2:]
    assert requests[1] - requests[0] >= 2.0


def test_retries_back_off_while_the_service_fails(fake: FakeProcess, erp: ErpService, order: str) -> None:
    fake.control.do("fail", status=503, count=-1, path="/results")

    def requests() -> list[float]:
        return [each["at"] for each in fake.control.do("received") if each["path"] == "/results"]

    before = len(requests())
    erp.report_result(order, "S-1", True)
    attempts = wait_for(lambda: requests()[before:], lambda times: len(times) >= 5)
    pauses = [later - earlier for earlier, later in itertools.pairwise(attempts)]
    assert all(pause >= least for pause, least in zip(pauses, (0.15, 0.3, 0.4, 0.4), strict=False)), pauses
    fake.control.do("work")
    erp.wait_until_sent(30.0)
    assert serials(fake) == ["S-1"]


def test_a_rejected_message_blocks_only_its_order(fake: FakeProcess, erp: ErpService, order: str) -> None:
    fake.control.do("add_order", order="B-1", product="PCB", quantity=1)
    fake.control.do("fail", status=500, count=1, path="/results")
    erp.report_result(order, "S-1", True)
    erp.report_result(order, "S-2", True)
    erp.report_result("B-1", "S-3", True)
    erp.wait_until_sent(30.0)
    arrived = [result["serial"] for result in fake.truth()["results"]]
    assert arrived == ["S-3", "S-1", "S-2"]

"""Waiting and rejected results, and the owner of an outbox."""

import time
from collections.abc import Callable

import pytest

from arcor2_drivers.erp.erp_service import ErpService
from arcor2_hw.data.device import Health
from arcor2_hw.exceptions import Cancelled, NotFound, Refused
from tests.drivers.erp.conftest import BackgroundCall, outcome_after, serials
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for


@pytest.fixture
def order(fake: FakeProcess) -> str:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=1000)
    return "A-1"


def results_asked(fake: FakeProcess) -> int:
    return sum(each["path"] == "/results" for each in fake.control.do("received"))


def test_refused_results_are_stored_separately_and_named(fake: FakeProcess, erp: ErpService, order: str) -> None:
    fake.control.do("forbid", order=order)
    fake.control.do("add_order", order="B-1", product="PCB", quantity=1)
    erp.report_result(order, "S-1", True)
    erp.report_result("B-1", "S-2", True)
    erp.report_result("C-9", "S-3", True)
    erp.wait_until_sent(30.0)
    assert [result["serial"] for result in fake.truth()["results"]] == ["S-2"]
    refused = erp.refused()
    assert [(each.order_id, each.why) for each in refused] == [
        ("A-1", "422: the order A-1 is forbidden"),
        ("C-9", "404: order C-9 does not exist"),
    ]
    (alarm,) = erp.alarms()
    assert alarm.code == "results_refused"
    assert "2 results" in alarm.text
    assert "A-1" in alarm.text
    assert erp.health is Health.CHECK_FUNCTION
    before = results_asked(fake)
    time.sleep(1.0)
    assert results_asked(fake) == before, "the rejected result is sent again and again"
    fake.control.do("forbid", order=order, on=False)
    assert erp.resend_refused() == 2
    erp.wait_until_sent(30.0)
    assert serials(fake) == ["S-1"]
    assert [each.order_id for each in erp.refused()] == ["C-9"]
    erp.acknowledge("results_refused")
    assert erp.alarms() == []
    assert erp.resend_refused() == 0
    with pytest.raises(NotFound):
        erp.acknowledge("results_refused")


def test_results_that_wait_too_long_raise_an_alarm(
    fake: FakeProcess, make: Callable[..., ErpService], order: str
) -> None:
    erp = make(fake.ready["url"], waiting_alarm=1.0)
    erp.connect()
    fake.control.do("fail", status=503, count=-1, path="/results")
    erp.report_result(order, "S-1", True)
    assert erp.alarms() == []
    (alarm,) = wait_for(erp.alarms)
    assert alarm.code == "results_wait"
    assert "503" in alarm.text
    assert erp.alarms()[0].since == alarm.since
    fake.control.do("work")
    erp.wait_until_sent(30.0)
    assert erp.alarms() == []


def test_an_outbox_has_one_owner(fake: FakeProcess, erp: ErpService, make: Callable[..., ErpService]) -> None:
    second = make(fake.ready["url"])
    with pytest.raises(Refused, match="another program has opened the outbox"):
        second.connect(0.5)
    make(fake.ready["url"], station="other").connect()
    erp.disconnect()
    second.connect()
    assert second.results_waiting() == 0


def test_results_go_only_to_their_service(fake: FakeProcess, make: Callable[..., ErpService], order: str) -> None:
    elsewhere = make(fake.ready["url"] + "/other")
    with pytest.raises(Refused, match="404"):
        elsewhere.connect()
    erp = make(fake.ready["url"])
    erp.connect()
    fake.control.do("fail", status=503, count=-1, path="/results")
    erp.report_result(order, "S-1", True)
    erp.disconnect()
    fake.control.do("work")
    other = make(fake.ready["url"] + "/")
    other.connect()
    assert other.results_waiting() == 0
    assert serials(fake) == []


def test_disconnecting_from_a_silent_service_keeps_all_results(
    fake: FakeProcess, make: Callable[..., ErpService], order: str
) -> None:
    erp = make(fake.ready["url"], request_timeout=10.0)
    erp.connect()
    fake.control.do("silence")
    erp.report_result(order, "S-1", True)
    time.sleep(0.2)
    began = time.monotonic()
    erp.disconnect()
    assert time.monotonic() - began < 8.0, "it waits for the request"
    fake.control.do("heal")
    erp.connect(60.0)
    erp.wait_until_sent(30.0)
    assert serials(fake) == ["S-1"]


def test_stop_ends_waiting_for_the_outbox(fake: FakeProcess, erp: ErpService, order: str) -> None:
    fake.control.do("fail", status=503, count=-1, path="/results")
    erp.report_result(order, "S-1", True)
    waiting = BackgroundCall(lambda: erp.wait_until_sent(60.0))
    assert isinstance(outcome_after(waiting, erp.stop), Cancelled)
    fake.control.do("work")
    erp.wait_until_sent(30.0)
    assert serials(fake) == ["S-1"]

"""Orders: accepted once, returned until done, not lost with a lost answer, available without the service."""

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from arcor2_drivers.erp.erp_service import ErpService
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import Arcor2Error, Cancelled, ConnectionLost, DeviceError, NotConnected, OutOfRange, Refused
from tests.drivers.erp.conftest import BackgroundCall
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

NONE = (False, "", "", 0, 0)


def posts(fake: FakeProcess) -> list[str]:
    return [each["path"] for each in fake.control.do("received")[-50:] if each["method"] == "POST"]


def test_connecting_only_reads_the_status(fake: FakeProcess, make: Callable[..., ErpService]) -> None:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=1)
    before = len(posts(fake))
    erp = make(fake.ready["url"])
    erp.connect()
    identity = erp.identify()
    assert (identity.model, identity.firmware) == ("Fake planning", "1.4.0")
    erp.disconnect()
    assert len(posts(fake)) == before
    assert fake.truth()["orders"][0]["station"] == ""


def test_an_order_is_returned_until_each_piece_is_reported(fake: FakeProcess, erp: ErpService) -> None:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=2)
    fake.control.do("add_order", order="A-2", product="Cover", quantity=1)
    assert erp.next_order() == (True, "A-1", "PCB", 2, 2)
    assert erp.next_order() == (True, "A-1", "PCB", 2, 2)
    erp.report_result("A-1", "S-1", True)
    assert erp.next_order() == (True, "A-1", "PCB", 2, 1)
    assert fake.truth()["orders"][1]["station"] == "", "the second order was taken too early"
    erp.report_result("A-1", "S-2", False)
    assert erp.next_order() == (True, "A-2", "Cover", 1, 1)
    erp.report_result("A-2", "S-3", True)
    assert erp.next_order() == NONE
    assert [order["station"] for order in fake.truth()["orders"]] == ["cell", "cell"]


def test_the_current_order_needs_no_service_and_survives_a_restart(
    fake: FakeProcess, erp: ErpService, make: Callable[..., ErpService]
) -> None:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=3)
    assert erp.next_order()[4] == 3
    erp.report_result("A-1", "S-1", True)
    erp.wait_until_sent(30.0)
    fake.control.do("silence")
    assert erp.next_order() == (True, "A-1", "PCB", 3, 2)
    erp.report_result("A-1", "S-2", True)
    erp.disconnect()
    fake.control.do("heal")
    again = make(fake.ready["url"])
    again.connect()
    assert again.next_order() == (True, "A-1", "PCB", 3, 1)
    again.wait_until_sent(30.0)
    assert [result["serial"] for result in fake.truth()["results"]] == ["S-1", "S-2"]


def test_an_order_survives_a_lost_answer(fake: FakeProcess, erp: ErpService, make: Callable[..., ErpService]) -> None:
    for number in (1, 2):
        fake.control.do("add_order", order=f"A-{number}", product="PCB", quantity=1)
    fake.control.do("lose_answers", count=1)
    with pytest.raises(ConnectionLost, match="planning at http"):
        erp.next_order()
    assert fake.truth()["orders"][0]["station"] == "cell", "the service has assigned the order"
    erp.disconnect()  # the request is stored: another process repeats it
    again = make(fake.ready["url"])
    again.connect()
    assert again.next_order()[1] == "A-1"
    assert [order["station"] for order in fake.truth()["orders"]] == ["cell", ""]
    assert fake.truth()["repeated"] == 1


def test_waiting_for_an_order_survives_a_connection_loss(fake: FakeProcess, erp: ErpService) -> None:
    assert erp.next_order(0.3) == NONE
    before = len(posts(fake))
    waiting = BackgroundCall(lambda: erp.next_order(60.0))
    wait_for(lambda: len(posts(fake)) > before)
    fake.control.do("power_cycle", seconds=0.5)
    time.sleep(0.2)
    fake.control.do("add_order", order="A-9", product="PCB", quantity=4)
    assert waiting.outcome() == (True, "A-9", "PCB", 4, 4)


def test_stop_ends_waiting_for_an_order(fake: FakeProcess, erp: ErpService) -> None:
    waiting = BackgroundCall(lambda: erp.next_order(60.0))
    wait_for(lambda: posts(fake))
    with pytest.raises(Refused, match="busy with another call of next_order"):
        erp.next_order()
    erp.stop()
    assert isinstance(waiting.outcome(), Cancelled)
    before = len(posts(fake))
    time.sleep(0.4)
    assert len(posts(fake)) == before, "it continues asking after the stop"
    assert erp.next_order() == NONE


def test_disconnecting_ends_waiting(fake: FakeProcess, erp: ErpService) -> None:
    waiting = BackgroundCall(lambda: erp.next_order(60.0))
    wait_for(lambda: posts(fake))
    erp.disconnect()
    assert isinstance(waiting.outcome(), DeviceError)
    assert erp.connection is Connection.OFFLINE
    with pytest.raises(NotConnected):
        erp.report_result("A-1", "S-1", True)


def test_an_order_is_closed_after_its_results_are_sent(fake: FakeProcess, erp: ErpService) -> None:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=5)
    fake.control.do("add_order", order="A-2", product="PCB", quantity=1)
    erp.next_order()
    fake.control.do("fail", status=503, count=2)
    erp.report_result("A-1", "S-1", True)
    erp.close_order("A-1", "no more boards")
    erp.wait_until_sent(30.0)
    assert fake.truth()["orders"][0]["closed"]
    delivered = [each["path"] for each in fake.control.do("received") if each["path"] in ("/results", "/orders/close")]
    assert delivered[-2:] == ["/results", "/orders/close"]
    assert erp.next_order()[1] == "A-2"


def test_an_answer_to_another_request_is_ignored(fake: FakeProcess, erp: ErpService) -> None:
    fake.control.do("add_order", order="A-1", product="PCB", quantity=1)
    fake.control.do("mistake", count=1)
    with pytest.raises(DeviceError, match="key of another request"):
        erp.next_order()
    assert erp.next_order()[1] == "A-1"


@pytest.mark.parametrize(
    ("order", "serial", "note", "named"),
    [("", "S", "", "order_id"), ("A", " ", "", "serial"), ("A", "S", "x" * 201, "note"), ("A\n", "S", "", "order_id")],
)
def test_invalid_texts_are_refused(erp: ErpService, order: str, serial: str, note: str, named: str) -> None:
    with pytest.raises(OutOfRange, match=f"planning at .*{named} must be"):
        erp.report_result(order, serial, True, note)
    assert erp.results_waiting() == 0


def test_an_outbox_that_cannot_be_written_is_named(
    fake: FakeProcess, make: Callable[..., ErpService], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("no directory")
    erp = make(fake.ready["url"], outbox=str(tmp_path / "file"))
    with pytest.raises(Arcor2Error, match=r"planning at .*outbox"):
        erp.connect()
    assert erp.connection is Connection.OFFLINE

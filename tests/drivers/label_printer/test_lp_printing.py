"""The label printer's driver: labels are printed and counted once, faults are named, nothing is sent twice."""

from collections.abc import Callable
from typing import Any

import pytest

from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotFound,
    OutOfRange,
    Refused,
)
from arcor2_hw.testing.life import BackgroundCall
from tests.fakes.conftest import FakeProcess

on_both = pytest.mark.parametrize("fake", ["tcp", "pty"], indirect=True)
LABEL = "^XA^FO10,10^A0N,30^FDby hand^FS^XZ"


def texts(fake: FakeProcess) -> list[list[str]]:
    return [[field["text"] for field in label["fields"]] for label in fake.truth()["labels"]]


@on_both
def test_connecting_only_asks_and_labels_are_printed_once(fake: FakeProcess, printer: ZplPrinter) -> None:
    printer.connect()  # has no effect when connected
    assert printer.identify() == Identity("", "ZT411-203dpi", "99J204200001", "V92.21.39Z")
    assert (printer.status(), printer.counter(), printer.ready()) == ("ready", 0, True)
    assert fake.truth()["received"].count("format") == 0
    assert (printer.connection, printer.health, printer.alarms()) == (Connection.ONLINE, Health.NORMAL, [])

    assert printer.print_label("Board", "passed", "PCB-0001") == "printer-1"
    assert texts(fake) == [["Board", "passed", "PCB-0001"]]  # the label is printed when the call returns
    assert printer.print(LABEL) == "printer-2"
    assert texts(fake)[1:] == [["by hand"]]
    assert printer.labels_printed() == 2
    printer.disconnect()
    printer.disconnect()
    with pytest.raises(NotConnected, match=f"^printer at {fake.ready['port']} is not connected"):
        printer.print(LABEL)


def test_data_cannot_contain_commands(fake: FakeProcess, printer: ZplPrinter) -> None:
    nasty = ["^XZ^XA^FDx^FS^XZ", "~JA~HS_5E\\&{code} \u0159\u00b5\u20ac", "A>;B>0^PQ9~"]
    assert printer.print_label(*nasty) == "printer-1"
    assert texts(fake) == [nasty]
    assert fake.truth()["counter"] == 1
    assert fake.truth()["received"].count("format") == 1
    for bad, name in ((("a\nb", "", "1"), "title"), (("", "x" * 201, "1"), "text"), (("", "", "\u20ac"), "code")):
        with pytest.raises(OutOfRange, match=f"^printer at .*: {name} "):
            printer.print_label(*bad)
    with pytest.raises(OutOfRange, match="code must not be empty"):
        printer.print_label("", "", "")
    assert fake.truth()["received"].count("format") == 1


@pytest.mark.parametrize("fake", ["flags"], indirect=True)
def test_faults_that_prevent_printing_are_named_and_nothing_is_sent(
    fake: FakeProcess, printer: ZplPrinter, wait_for: Callable[..., Any]
) -> None:
    for command, on, off, code in (
        ("media", {"labels": 0}, {"labels": 9}, "paper_out"),
        ("head_open", {"on": True}, {"on": False}, "head_open"),
        ("ribbon_out", {"on": True}, {"on": False}, "ribbon_out"),
        ("pause", {"on": True}, {"on": False}, "paused"),
        ("hot", {"on": True}, {"on": False}, "too_hot"),
    ):
        fake.control.do(command, **on)
        with pytest.raises(DeviceFault, match=rf"^printer at {fake.ready['port']}: .*; nothing was sent") as raised:
            printer.print(LABEL)
        assert raised.value.fault_code == code == printer.status()
        [alarm] = printer.alarms()
        assert alarm.code == code
        assert alarm.remedy in str(raised.value)
        assert printer.health is Health.CHECK_FUNCTION
        fake.control.do(command, **off)
    assert printer.print(LABEL) == "printer-1"
    assert (printer.alarms(), fake.truth()["counter"]) == ([], 1)


@pytest.mark.parametrize("cause", [("media", {"labels": 0}, {"labels": 9}), ("head_open", {"on": 1}, {"on": 0})])
def test_no_reply_means_media_out_or_head_open(
    fake: FakeProcess, printer: ZplPrinter, wait_for: Callable[..., Any], cause: tuple[str, Any, Any]
) -> None:
    command, on, off = cause
    fake.control.do(command, **on)
    for _ in range(2):  # within the time limit, and after the line was given up
        with pytest.raises(DeviceFault, match="out of labels, its head is open, or the line is broken") as raised:
            printer.print(LABEL)
        assert raised.value.fault_code == "no_reply"
        wait_for(lambda: printer.connection, lambda state: state is Connection.LOST)
    assert [alarm.code for alarm in printer.alarms()] == ["no_reply"]
    fake.control.do(command, **off)
    wait_for(lambda: printer.connection, lambda state: state is Connection.BACK)
    assert printer.alarms() == []
    assert printer.print(LABEL) == "printer-1"
    assert fake.truth()["received"].count("format") == 1


@pytest.mark.parametrize("fake", ["flags"], indirect=True)
def test_a_fault_during_printing_leaves_the_label_unconfirmed(
    fake: FakeProcess, make: Callable[..., ZplPrinter], wait_for: Callable[..., Any]
) -> None:
    printer = make(fake.ready["port"], print_timeout=0.3)
    printer.connect()
    fake.control.do("media", labels=1)
    assert printer.print(LABEL) == "printer-1"
    fake.control.do("media", labels=0)
    with pytest.raises(DeviceFault, match="it is out of labels; load labels and close the head; nothing was sent"):
        printer.print(LABEL)
    fake.control.do("media", labels=5)

    # between reading the status and printing
    send = printer.line.send

    def send_and_pause(data: bytes) -> None:
        if data.startswith(b"^XA"):
            fake.control.do("pause", on=True)
        send(data)

    printer.line.send = send_and_pause  # type: ignore[method-assign]
    with pytest.raises(DeviceFault, match=r"it is paused.*the label was sent and may come out later") as raised:
        printer.print(LABEL)
    assert raised.value.fault_code == "paused"
    for call in (lambda: printer.print(LABEL), lambda: printer.print_label("a", "b", "c")):
        with pytest.raises(Refused, match="it is unknown whether the last label was printed"):
            call()
    with pytest.raises(Refused, match="the label is still waiting in the printer: it is paused"):
        printer.last_came_out()
    fake.control.do("pause", on=False)
    fake.control.wait_until(lambda truth: truth["counter"] == 2)
    assert printer.last_came_out() is True
    printer.line.send = send  # type: ignore[method-assign]
    assert printer.print(LABEL) == "printer-3"
    assert fake.truth()["received"].count("format") == 3
    with pytest.raises(Refused, match="every label was confirmed"):
        printer.last_came_out()


def test_a_missing_label_is_not_sent_again(fake: FakeProcess, printer: ZplPrinter) -> None:
    fake.control.do("forgetful", on=True)
    with pytest.raises(DeviceTimeout, match="has not counted the label within 1 s; it is not sent again"):
        printer.print(LABEL)
    assert [alarm.code for alarm in printer.alarms()] == ["unconfirmed"]
    assert not printer.ready()
    with pytest.raises(Refused):
        printer.print(LABEL)
    assert fake.truth()["received"].count("format") == 1
    assert printer.last_came_out() is False
    fake.control.do("forgetful", on=False)
    assert printer.print(LABEL) == "printer-1"
    with pytest.raises(NotFound):
        printer.acknowledge("unconfirmed")


@on_both
def test_nothing_is_sent_again_after_a_loss(
    fake: FakeProcess, printer: ZplPrinter, wait_for: Callable[..., Any]
) -> None:
    send = printer.line.send

    def send_and_lose(data: bytes) -> None:
        send(data)
        if data.startswith(b"^XA"):
            fake.control.wait_until(lambda truth: "format" in truth["received"])
            fake.control.do("unplug")

    printer.line.send = send_and_lose  # type: ignore[method-assign]
    with pytest.raises(ConnectionLost, match=f"^printer at {fake.ready['port']}: the connection was lost"):
        printer.print(LABEL)
    printer.line.send = send  # type: ignore[method-assign]
    fake.control.wait_until(lambda truth: truth["counter"] == 1)  # the printer completed the label that it had received
    wait_for(lambda: printer.connection, lambda state: state is Connection.LOST)
    assert printer.health is Health.FAILURE
    fake.control.do("plug")
    wait_for(lambda: printer.connection, lambda state: state is Connection.BACK)
    with pytest.raises(Refused, match="it is unknown whether the last label was printed"):
        printer.print(LABEL)
    assert printer.last_came_out() is True
    assert printer.print(LABEL) == "printer-2"
    assert fake.truth()["received"].count("format") == 2


@pytest.mark.parametrize("fake", ["pty"], indirect=True)
def test_labels_of_another_host(fake: FakeProcess, printer: ZplPrinter) -> None:
    with printer.line.held():
        fake.control.do("pause")
        printer.line.send(b"^XA^FDtheirs^FS^PQ2^XZ")
        fake.control.wait_until(lambda truth: truth["waiting"] == 1)
        fake.control.do("pause", on=False)
        with pytest.raises(Refused, match="is printing labels of another client; nothing was sent"):
            printer.print(LABEL)
    fake.control.wait_until(lambda truth: truth["counter"] == 2)
    assert printer.print(LABEL) == "printer-3"


@on_both
@pytest.mark.parametrize("fault", ["silence", "half_frame", "garbage"])
def test_invalid_answers_of_the_device_are_typed_errors(
    fake: FakeProcess, printer: ZplPrinter, wait_for: Callable[..., Any], fault: str
) -> None:
    with printer.line.held():
        fake.control.do(fault)
        with pytest.raises(DeviceFault, match=f"^printer at {fake.ready['port']} does not answer") as raised:
            printer.print(LABEL)
    assert "~HS within 0.4 s" in raised.value.detail
    fake.control.do("heal")
    wait_for(lambda: printer.connection, lambda state: state is Connection.BACK)
    assert printer.print(LABEL) == "printer-1"


@pytest.mark.parametrize(
    ("label", "why"),
    [
        ("hello", "must start with"),
        ("^XA^XZ", "must start with"),
        ("^XA^FDa^FS^XZ^XA^FDb^FS^XZ", "not allowed"),
        ("^XA^FDa^FS^PQ2^XZ", "PQ"),
        ("^XA^FDa^FS^pq10^XZ", "pq"),
        ("^XA~JA^XZ", "control commands"),
        ("^XA^CC#^XZ", "CC"),
        ("^XA" + "x" * 40000 + "^XZ", "longer"),
    ],
)
def test_only_a_single_label_is_sent(fake: FakeProcess, printer: ZplPrinter, label: str, why: str) -> None:
    with pytest.raises(OutOfRange, match=f"^printer at .*: the label .*{why}"):
        printer.print(label)
    assert "format" not in fake.truth()["received"]


@pytest.mark.parametrize("port", ["/dev/does-not-exist", "socket://127.0.0.1:1"])
def test_a_missing_port_is_named(make: Callable[..., ZplPrinter], port: str) -> None:
    printer = make(port)
    with pytest.raises(NotConnected, match=f"^printer at {port}: the port cannot be opened"):
        printer.connect(1.0)
    assert printer.connection is Connection.FAILED
    with pytest.raises(NotConnected, match=port):
        printer.print(LABEL)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("port", ""),
        ("baud_rate", 1),
        ("answer_timeout", float("nan")),
        ("print_timeout", 0.0),
        ("template", "no label"),
        ("template", "^XA{price}^XZ"),
        ("template", "^XA{code}^PQ3^XZ"),
    ],
)
def test_settings_out_of_range_name_the_parameter(name: str, value: Any) -> None:
    with pytest.raises(OutOfRange, match=f"^{name} must be"):
        ZplPrinterSettings(**{"port": "/dev/ttyUSB0", name: value})


@pytest.mark.parametrize("fake", ["flags"], indirect=True)
def test_stop_ends_the_wait_and_the_label_is_printed_once(fake: FakeProcess, printer: ZplPrinter) -> None:
    printing = BackgroundCall(lambda: printer.print(LABEL))
    while "format" not in fake.truth()["received"]:
        assert not printing.over
    printer.stop()
    error = printing.outcome(30.0, "printing that was stopped")
    assert isinstance(error, Cancelled)
    assert "not sent again" in str(error)
    assert [alarm.code for alarm in printer.alarms()] == ["unconfirmed"]
    fake.control.wait_until(lambda truth: truth["counter"] > 0)
    assert printer.last_came_out()
    assert printer.print(LABEL) == "printer-2"


def test_disconnecting_ends_the_wait_and_nothing_is_sent_again(
    fake: FakeProcess, make: Callable[..., ZplPrinter]
) -> None:
    printer = make(fake.ready["port"], print_timeout=30.0)
    printer.connect()
    fake.control.do("forgetful", on=True)
    printing = BackgroundCall(lambda: printer.print(LABEL))
    while "format" not in fake.truth()["received"]:
        assert not printing.over
    printer.disconnect()
    assert isinstance(printing.outcome(30.0, "printing while it disconnects"), DeviceError)
    fake.control.do("forgetful", on=False)
    printer.connect()
    assert fake.truth()["received"].count("format") == 1

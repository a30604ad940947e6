"""The screwdriver's driver with faults of controller and network: framing, lost messages, reboot, several clients."""

import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from arcor2_drivers.screwdriver.screwdriver import OpenProtocolScrewdriver
from arcor2_hw.data.device import Connection, LossKind
from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotInControl,
    Refused,
    Stale,
)
from tests.drivers.background_call import BackgroundCall
from tests.drivers.benches.screwdriver_bench import ORPHAN
from tests.fakes.conftest import FakeProcess

UP = (Connection.ONLINE, Connection.BACK)


# ------------------------------------------------------------------------------------------------ a scripted controller
RESULT = (
    b"02310061001         "
    b"010001" b"0201" b"03Press                    " b"04                         "
    b"0500" b"06001" b"070000" b"080000" b"091" b"101" b"111"
    b"12001080" b"13001320" b"14001200" b"15001234"
    b"1600020" b"1700090" b"1800055" b"1900056"
    b"202026-03-04:05:06:07" b"212026-01-02:03:04:05" b"222" b"23%010d\0"
)  # fmt: skip
WELCOME = b"00570002001         010001020103Press                    \0"


class Scripted:
    """A controller on TCP that answers as the specification shows, in pieces of `size` bytes."""

    def __init__(self, size: int = 10_000) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.05)
        self.address = "{}:{}".format(*self._server.getsockname())
        self.size = size
        self.answers: dict[bytes, bytes] = {}
        """Answers by MID that replace those of the specification."""
        self.received: list[bytes] = []
        self._line: socket.socket | None = None
        self._ended = False
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def end(self) -> None:
        self._ended = True
        self._thread.join(30.0)
        self._server.close()

    def send(self, data: bytes) -> None:
        assert self._line is not None
        for place in range(0, len(data), self.size):
            self._line.sendall(data[place : place + self.size])

    def _serve(self) -> None:
        while not self._ended:
            try:
                line, _ = self._server.accept()
            except TimeoutError:
                continue
            with line:
                line.settimeout(0.05)
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._line = line
                try:
                    self._answer(line)
                except OSError:
                    continue

    def _answer(self, line: socket.socket) -> None:
        stream = b""
        while not self._ended:
            try:
                data = line.recv(512)
            except TimeoutError:
                continue
            if not data:
                return
            *telegrams, stream = (stream + data).split(b"\0")
            for telegram in telegrams:
                mid, revision = telegram[4:8], telegram[8:11]
                self.received.append(mid)
                if mid in self.answers:
                    self.send(self.answers[mid])
                elif revision != b"001":
                    self.send(b"00260004001         " + mid + b"97\0")
                elif mid == b"0001":
                    self.send(WELCOME)
                elif mid == b"9999":
                    self.send(telegram + b"\0")
                elif mid not in (b"0062", b"0003"):
                    self.send(b"00240005001         " + mid + b"\0")


@pytest.fixture
def scripted() -> Iterator[Callable[..., Scripted]]:
    made: list[Scripted] = []

    def start(size: int = 10_000) -> Scripted:
        made.append(Scripted(size))
        return made[-1]

    yield start
    for each in made:
        each.end()


@pytest.fixture
def controlled(make: Callable[..., OpenProtocolScrewdriver]) -> Callable[..., OpenProtocolScrewdriver]:
    def connect(address: str, **settings: Any) -> OpenProtocolScrewdriver:
        screwdriver = make(address, **settings)
        screwdriver.connect()
        screwdriver.take_control()
        return screwdriver

    return connect


@pytest.mark.parametrize("size", [1, 19, 21, 230])
def test_partial_telegrams(
    scripted: Callable[..., Scripted], controlled: Callable[..., OpenProtocolScrewdriver], size: int
) -> None:
    controller = scripted(size)
    controller.answers[b"0043"] = b"00240005001         0043\0" + RESULT % 7
    assert controlled(controller.address).tighten() == (True, 12.34, 56.0)


def test_glued_telegrams(scripted: Callable[..., Scripted], controlled: Callable[..., OpenProtocolScrewdriver]) -> None:
    """A result right before and two right after a reply arrive in the same segment."""
    controller = scripted()
    controller.answers[b"0043"] = RESULT % 7 + b"00240005001         0043\0" + RESULT % 8 + RESULT % 9
    screwdriver = controlled(controller.address)
    assert screwdriver.tighten(3) == (True, 12.34, 56.0)
    assert controller.received.count(b"0062") == 3


@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        (b"00230005001         0018\0", "no NUL after a telegram of length 23"),
        (b"00190005001         0018\0", "length 19 is less than that of a header"),
        (b"\xff\xfe\xfd\xfc0005001         0018\0", "length is"),
        (b"0230" + (RESULT % 7)[4:-2] + b"\0", "the data field has 210 bytes instead of 211"),
    ],
)
def test_length_errors_end_the_connection(
    scripted: Callable[..., Scripted],
    controlled: Callable[..., OpenProtocolScrewdriver],
    wait_for: Callable[..., Any],
    bad: bytes,
    problem: str,
) -> None:
    controller = scripted()
    screwdriver = controlled(controller.address)
    controller.answers[b"0018"] = bad
    with pytest.raises(DeviceFault, match=f"^screwdriver at {controller.address} sent invalid data: {problem}"):
        screwdriver.select_program(3)
    del controller.answers[b"0018"]
    wait_for(lambda: screwdriver.connection is Connection.BACK)
    assert screwdriver.ready()
    with pytest.raises(NotInControl):
        screwdriver.select_program(3)


def test_a_reply_to_another_message_is_ignored(
    scripted: Callable[..., Scripted], controlled: Callable[..., OpenProtocolScrewdriver]
) -> None:
    controller = scripted()
    screwdriver = controlled(controller.address)
    controller.answers[b"0018"] = b"00240005001         0038\0" + b"00260004001         004227\0"
    with pytest.raises(DeviceTimeout, match=r"did not answer MID 0018 \(select program\) within 2 s"):
        screwdriver.select_program(3)


def test_unknown_messages_are_ignored(
    scripted: Callable[..., Scripted], controlled: Callable[..., OpenProtocolScrewdriver]
) -> None:
    controller = scripted()
    controller.answers[b"0018"] = b"00210211001         1\0" + b"00240005001         0018\0"
    controlled(controller.address).select_program(3)


def test_a_controller_that_rejects_every_revision_is_refused(
    scripted: Callable[..., Scripted], make: Callable[..., OpenProtocolScrewdriver]
) -> None:
    controller = scripted()
    controller.answers[b"0060"] = b"00260004001         006097\0"
    with pytest.raises(Refused, match=r"refused MID 0060 \(subscribe results\): it does not support this revision"):
        make(controller.address).connect()


def test_a_subscription_that_already_exists_is_used(
    scripted: Callable[..., Scripted], controlled: Callable[..., OpenProtocolScrewdriver]
) -> None:
    controller = scripted()
    controller.answers[b"0060"] = b"00260004001         006009\0"
    controller.answers[b"0070"] = b"00260004001         007011\0"
    controller.answers[b"0043"] = b"00240005001         0043\0" + RESULT % 7
    assert controlled(controller.address).tighten() == (True, 12.34, 56.0)


def test_a_tool_that_cannot_be_disabled_is_an_error(
    scripted: Callable[..., Scripted], controlled: Callable[..., OpenProtocolScrewdriver]
) -> None:
    controller = scripted()
    controller.answers[b"0043"] = b"00240005001         0043\0" + RESULT % 7
    controller.answers[b"0042"] = b"00260004001         004227\0"
    screwdriver = controlled(controller.address)
    with pytest.raises(Refused, match=r"refused MID 0042 \(disable tool\): the tool is inaccessible \(error 27\)"):
        screwdriver.tighten()
    assert screwdriver.last_result() == (True, 12.34, 56.0)


# ------------------------------------------------------------------------------------------------ lost messages
def test_a_result_is_sent_again_until_acknowledged_and_counts_once(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("lose_acknowledgements", number=3)
    for torque in (11.1, 12.2):
        fake.control.do("plan", torque=torque, angle=55)
    fake.control.do("pull", times=2)
    assert screwdriver.tighten(2) == (True, 12.2, 55.0)
    wait_for(lambda: not fake.truth()["unacknowledged"])
    assert fake.truth()["received"].count("0062") >= 3 + 2


def test_a_controller_that_gets_no_acknowledgement_disconnects(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("lose_acknowledgements", number=4)
    fake.control.do("tighten")
    wait_for(lambda: screwdriver.connection is Connection.BACK)
    assert screwdriver.last_result()[0]
    assert not screwdriver.in_control


def test_silence_is_detected_by_the_keep_alive_message(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    fake.control.do("silence")
    wait_for(lambda: screwdriver.connection is Connection.LOST)
    assert "did not answer the keep-alive message within 2 s" in str(screwdriver.observing.reason)
    fake.control.do("heal")
    wait_for(lambda: screwdriver.connection is Connection.BACK)
    assert screwdriver.ready()


def test_a_silent_controller_is_not_identified(fake: FakeProcess, screwdriver: OpenProtocolScrewdriver) -> None:
    assert screwdriver.identify().serial == "SN00012345"
    fake.control.do("silence")
    with pytest.raises(ConnectionLost, match=f"^screwdriver at {fake.ready['open_protocol']}"):
        screwdriver.identify()


def test_state_is_stale_before_the_connection_is_lost(
    fake: FakeProcess, make: Callable[..., OpenProtocolScrewdriver], wait_for: Callable[..., Any]
) -> None:
    screwdriver = make(fake.ready["open_protocol"], answer_timeout=5.0)
    screwdriver.connect()
    assert screwdriver.ready()
    screwdriver._controller.fresh_for = 0.5  # shorter than the time limit of the keep-alive message
    fake.control.do("silence")
    with pytest.raises(Stale, match="the newest state is"):
        wait_for(lambda: not screwdriver.ready())
    assert screwdriver.connection is Connection.ONLINE


@pytest.mark.parametrize("keep_alive", [0.3, 8.0])
def test_keep_alive_messages_hold_the_connection(
    start_fake: Callable[..., FakeProcess],
    make: Callable[..., OpenProtocolScrewdriver],
    wait_for: Callable[..., Any],
    keep_alive: float,
) -> None:
    """With a timeout of 3 s at the controller, a message each 0.3 s suffices and one each 8 s does not."""
    fake = start_fake("screwdriver", "--keep-alive-timeout", "3")
    screwdriver = make(fake.ready["open_protocol"], keep_alive=keep_alive)
    screwdriver.connect()
    if keep_alive < 1.0:
        wait_for(lambda: fake.truth()["received"].count("9999") >= 15)
        assert screwdriver.observing.losses == 0
    else:
        wait_for(lambda: screwdriver.observing.losses)


# ------------------------------------------------------------------------------------------------ reboot and clients
def test_only_observation_returns_after_a_reboot(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    call = BackgroundCall(screwdriver.tighten, 1, 30.0)
    wait_for(lambda: fake.truth()["enabled"])
    fake.control.do("power_cycle")
    with pytest.raises(ConnectionLost, match=f"^screwdriver at {fake.ready['open_protocol']}: the connection was lost"):
        call.result()
    wait_for(lambda: screwdriver.connection is Connection.BACK)
    assert not fake.truth()["enabled"]
    with pytest.raises(NotInControl, match="control ended when the connection was lost"):
        screwdriver.tighten()
    screwdriver.take_control()
    assert screwdriver.connection is Connection.ONLINE
    fake.control.do("pull")
    assert screwdriver.tighten()[0]
    assert fake.truth()["subscribed"] == 1


def test_a_loss_during_a_tightening_enables_nothing_again(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any]
) -> None:
    call = BackgroundCall(screwdriver.tighten, 1, 30.0)
    wait_for(lambda: fake.truth()["enabled"])
    fake.control.do("reset")
    with pytest.raises(ConnectionLost):
        call.result()
    wait_for(lambda: screwdriver.connection is Connection.BACK)
    assert fake.truth()["enabled"]  # the controller is not configured to lock the tool
    assert fake.truth()["received"].count("0043") == 1
    fake.control.do("plan", torque=1.0, angle=1)
    fake.control.do("pull")
    wait_for(lambda: fake.truth()["made"] == 1 and not fake.truth()["unacknowledged"])
    screwdriver.take_control()
    screwdriver.disable_tool()
    fake.control.do("pull")
    assert screwdriver.tighten()[0], "a result from before the call counted"


def test_a_controller_that_locks_the_tool_on_a_loss(
    start_fake: Callable[..., FakeProcess],
    controlled: Callable[..., OpenProtocolScrewdriver],
    wait_for: Callable[..., Any],
) -> None:
    fake = start_fake("screwdriver", "--lock-on-loss")
    screwdriver = controlled(fake.ready["open_protocol"])
    screwdriver.enable_tool()
    fake.control.do("reset")
    wait_for(lambda: not fake.truth()["enabled"])
    wait_for(lambda: screwdriver.connection is Connection.BACK)
    assert not fake.truth()["enabled"]


def test_a_second_client_is_refused(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpenProtocolScrewdriver], wait_for: Callable[..., Any]
) -> None:
    fake = start_fake("screwdriver", "--clients", "1", "--keep-alive-timeout", "1.5")
    address = fake.ready["open_protocol"]
    first, second = make(address), make(address)
    first.connect()
    refused = rf"^screwdriver at {address} refused the connection: another client is connected \(error 96\)$"
    with pytest.raises(NotConnected, match=refused):
        second.connect()
    assert second.connection is Connection.FAILED
    assert first.ready()
    first.disconnect()
    wait_for(lambda: fake.truth()["clients"] == 0)
    second.connect()
    assert second.ready()


def test_reconnecting_to_a_controller_that_still_serves_the_broken_connection(
    start_fake: Callable[..., FakeProcess], make: Callable[..., OpenProtocolScrewdriver], wait_for: Callable[..., Any]
) -> None:
    """The controller refuses the driver with error 96 until its keep-alive timeout has ended the old session."""
    fake = start_fake("screwdriver", "--clients", "1", "--keep-alive-timeout", "1.5")
    host, _, port = fake.ready["open_protocol"].rpartition(":")
    with socket.create_connection((host, int(port))) as dead:  # like the remains of a connection without a cable
        dead.sendall(b"002000010010        \0")
        assert dead.recv(100).startswith(b"00570002001")
        screwdriver = make(fake.ready["open_protocol"])
        with pytest.raises(NotConnected, match="another client is connected"):
            screwdriver.connect()
        assert dead.recv(100) == b""  # after the timeout
    screwdriver.connect()
    assert screwdriver.ready()


def test_the_tool_keeps_its_state_when_the_process_is_killed(
    fake: FakeProcess, make: Callable[..., OpenProtocolScrewdriver], wait_for: Callable[..., Any]
) -> None:
    assert OpenProtocolScrewdriver.loss_reaction.kind is LossKind.HOLDS
    process = subprocess.Popen([sys.executable, "-c", ORPHAN, fake.ready["open_protocol"]])
    try:
        wait_for(lambda: fake.truth()["enabled"], within=30.0)
    finally:
        process.kill()
        process.wait()
    wait_for(lambda: fake.truth()["clients"] == 0)
    assert fake.truth()["enabled"]
    screwdriver = make(fake.ready["open_protocol"])
    screwdriver.connect()
    screwdriver.take_control()
    screwdriver.disable_tool()
    assert not fake.truth()["enabled"]


@pytest.mark.parametrize("fault", ["silence", "half_frame", "garbage"])
def test_invalid_answers_are_typed_errors(
    fake: FakeProcess, screwdriver: OpenProtocolScrewdriver, wait_for: Callable[..., Any], fault: str
) -> None:
    fake.control.do(fault)
    with pytest.raises((DeviceTimeout, DeviceFault), match=f"^screwdriver at {fake.ready['open_protocol']} "):
        screwdriver.select_program(3)
    fake.control.do("heal")
    wait_for(lambda: screwdriver.connection is Connection.BACK)
    assert screwdriver.ready()


def test_an_absent_controller_is_named(make: Callable[..., OpenProtocolScrewdriver]) -> None:
    with pytest.raises(NotConnected, match=r"^screwdriver at 127\.0\.0\.1:1: the port cannot be opened"):
        make("127.0.0.1:1").connect(1.0)

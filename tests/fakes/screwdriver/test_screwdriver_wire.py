"""The fake tightening controller from the client's side: a socket, and bytes at the positions of the specification."""

import socket
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.fakes.conftest import FakeProcess


class Client:
    """A client without the driver's codec: it splits telegrams by their lengths."""

    def __init__(self, fake: FakeProcess) -> None:
        host, _, port = str(fake.ready["open_protocol"]).rpartition(":")
        self.line = socket.create_connection((host, int(port)), timeout=10.0)

    def exact(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            more = self.line.recv(size - len(data))
            assert more, f"closed after {data!r}"
            data += more
        return data

    def telegram(self) -> bytes:
        head = self.exact(4)
        body = self.exact(int(head) - 4)
        assert self.exact(1) == b"\0"
        return head + body

    def ask(self, telegram: bytes) -> bytes:
        self.line.sendall(telegram + b"\0")
        return self.telegram()

    def closed(self) -> bool:
        try:
            return self.line.recv(1) == b""
        except ConnectionResetError:
            return True


@pytest.fixture(scope="module")
def running() -> Iterator[FakeProcess]:
    """Start one fake without options for a file, because starting one takes longer than most tests."""
    with FakeProcess("screwdriver", "--duration", "0.1") as fake:
        yield fake


@pytest.fixture
def connect(
    running: FakeProcess, start_fake: Callable[..., FakeProcess]
) -> Iterator[Callable[..., tuple[FakeProcess, Client]]]:
    made: list[Client] = []

    def start(*options: str) -> tuple[FakeProcess, Client]:
        fake = start_fake("screwdriver", "--duration", "0.1", *options) if options else running
        fake.control.do("renew")
        made.append(Client(fake))
        return fake, made[-1]

    yield start
    for client in made:
        client.line.close()


Connect = Callable[..., tuple[FakeProcess, Client]]
START = b"00200001001         "


def test_nothing_is_answered_before_the_start(connect: Connect) -> None:
    _, client = connect()
    client.line.sendall(b"00200042001         \0" + b"00209999001         \0")
    welcome = client.ask(START)
    assert welcome == b"00570002001         010001020103Fake controller          "
    assert client.ask(b"00200042001         ") == b"00240005001         0042"
    assert client.ask(START) == b"00260004001         000196"  # already started


@pytest.mark.parametrize(("revision", "length"), [(1, 57), (2, 62), (3, 125), (4, 163), (5, 173), (6, 221)])
def test_lengths_of_the_start_acknowledge(connect: Connect, revision: int, length: int) -> None:
    """Data of 37, 42 and 105 bytes in revisions 1 to 3 (Nexo, table 7-7 and following), then 143, 153 and 201."""
    _, client = connect()
    welcome = client.ask(b"00200001%03d         " % revision)
    assert welcome[:11] == b"%04d0002%03d" % (length, revision)
    assert len(welcome) == length


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        (b"00230018001         002", b"0005001         0018"),
        (b"00230018001         099", b"0004001         001802"),
        (b"00220018001         02", b"0004001         001801"),
        (b"00220038001         01", b"0005001         0038"),
        (b"00240038002         0001", b"0005001         0038"),
        (b"00240038002         0099", b"0004001         003817"),
        (b"00240038003         0001", b"0004001         003897"),
        (b"00200060003         ", b"0004001         006097"),
        (b"00200063001         ", b"0004001         006310"),
        (b"00200073001         ", b"0004001         007312"),
        (b"00200078001         ", b"0004001         007858"),
        (b"00200214001         ", b"0004001         021499"),
        (b"00209999001         ", b"9999001         "),
    ],
)
def test_replies(connect: Connect, request_: bytes, answer: bytes) -> None:
    _, client = connect()
    client.ask(START)
    assert client.ask(request_)[4:] == answer


def test_a_result_of_revision_1_byte_by_byte(connect: Connect) -> None:
    fake, client = connect()
    client.ask(START)
    client.ask(b"00230018001         007")
    assert client.ask(b"00200060001         ") == b"00240005001         0060"
    assert client.ask(b"00200060001         ") == b"00260004001         006009"
    fake.control.do("plan", torque=12.34, angle=56)
    fake.control.do("tighten")
    result = client.telegram()
    assert result[:20] == b"02310061001         "
    assert result[20:40] == b"010001020103Fake con"
    assert result[84:88] == b"0500"  # positions 85 to 88 of the table: number 05, job
    assert result[88:93] == b"06007"
    assert result[105:114] == b"091101111"
    assert result[138:146] == b"15001234"
    assert result[167:174] == b"1900056"
    assert result[216:219] == b"222"
    assert result[219:231] == b"230000000001"
    client.line.sendall(b"00200062001         \0")
    fake.control.wait_until(lambda truth: not truth["unacknowledged"])


@pytest.mark.parametrize("binary", [False, True])
def test_a_result_of_revision_2_byte_by_byte(connect: Connect, binary: bool) -> None:
    fake, client = connect(*(["--binary"] if binary else []))
    client.ask(START)
    client.ask(b"00240038002         0003")
    client.ask(b"00200060002         ")
    fake.control.do("plan", torque=3.5, angle=95)
    fake.control.do("tighten")
    result = client.telegram()
    assert result[:20] == b"03850061002         "
    assert result[84:90] == b"050003"
    assert result[90:95] == b"06001"
    assert (b"\0" in result) is binary
    assert result[118:130] == b"110122130142"  # NOK, no batch, torque low, angle high
    assert result[181:189] == b"24000350"
    assert result[210:217] == b"2800095"
    assert result[301:313] == b"410000000001"


def test_an_event_is_sent_four_times_and_then_the_connection_is_closed(connect: Connect) -> None:
    fake, client = connect("--response-timeout", "0.2")
    client.ask(START)
    client.ask(b"00200060001         ")
    fake.control.do("tighten")
    fake.control.do("tighten")
    sent = [client.telegram() for _ in range(4)]
    assert {telegram[-10:] for telegram in sent} == {b"0000000001"}
    assert client.closed()


def test_no_acknowledgement_is_expected_with_the_no_ack_flag(connect: Connect) -> None:
    fake, client = connect("--response-timeout", "0.1")
    client.ask(START)
    client.ask(b"002000600011        ")
    for _ in range(2):
        fake.control.do("tighten")
    assert [client.telegram()[-1:] for _ in range(2)] == [b"1", b"2"]
    assert fake.truth()["unacknowledged"] == 0


def test_alarms_from_before_and_after_the_subscription(connect: Connect) -> None:
    fake, client = connect()
    client.ask(START)
    fake.control.do("alarm", code="E404", text="Tool overheated")
    assert client.ask(b"00200070002         ") == b"00240005001         0070"
    status = client.telegram()
    assert status[:38] == b"00570076002         " + b"01102E404 031040" + b"05"
    client.line.sendall(b"00200077001         \0")
    assert client.ask(b"00200078001         ") == b"00240005001         0078"
    assert client.telegram() == b"00250074002         E404 "
    client.line.sendall(b"00200075001         \0")
    fake.control.do("alarm", code="E405", text="Cable", tool_ready=True)
    alarm = client.telegram()
    assert len(alarm) == 106
    assert alarm[:35] == b"01060071002         " + b"01E405 021031" + b"04"
    assert alarm[54:] == b"05" + b"Cable".ljust(50)


def test_a_silent_client_is_disconnected(connect: Connect) -> None:
    _, client = connect("--keep-alive-timeout", "0.3")
    client.ask(START)
    assert client.closed()


@pytest.mark.parametrize("bad", [b"00190042001        \0", b"00200042001         X", b"GET / HTTP/1.1\r\n\r\n"])
def test_a_length_error_closes_the_connection(connect: Connect, bad: bytes) -> None:
    _, client = connect()
    client.ask(START)
    client.line.sendall(bad + b"00200042001         \0")
    assert client.closed()


def test_the_trigger_works_only_while_the_tool_is_enabled(connect: Connect) -> None:
    fake, client = connect()
    client.ask(START)
    fake.control.do("pull")
    assert not fake.truth()["running"]
    client.ask(b"00200043001         ")
    fake.control.wait_until(lambda truth: truth["made"] == 1)
    assert fake.truth()["pulls"] == 0


def test_with_the_option_automatic_an_enabled_tool_tightens_again_and_again(connect: Connect) -> None:
    fake, client = connect("--automatic")
    client.ask(START)
    client.ask(b"00200043001         ")
    fake.control.wait_until(lambda truth: truth["made"] >= 3)
    client.ask(b"00200042001         ")
    assert not fake.truth()["running"]


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        ("plan", {"torque": -1.0, "angle": 1}),
        ("plan", {"torque": 1.0, "angle": 100_000}),
        ("pull", {"times": -1}),
        ("alarm", {"code": "TOOLONG"}),
        ("lose_acknowledgements", {"number": -1}),
    ],
)
def test_wrong_commands_are_refused(connect: Connect, command: str, arguments: dict[str, Any]) -> None:
    fake, _ = connect()
    with pytest.raises(Exception, match=r"0 to|1 to 4"):
        fake.control.do(command, **arguments)

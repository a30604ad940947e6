"""The Modbus link on a socket and a pty: exact frames, and late, incomplete or foreign answers."""

import contextlib
import os
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator

import pytest

from arcor2_hw.exceptions import ConnectionLost, DeviceFault, DeviceTimeout, NotConnected
from arcor2_hw.objects.modbus_link import ModbusLink
from tests.waiting import WITHIN, wait_for

Script = Callable[[bytes], bytes | None]
"""Returns the answer to a request, or None for no answer."""


class Peer:
    """Listen, answer each request by `script`, and record the requests."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self.requests: list[bytes] = []
        self.connections: list[socket.socket] = []
        self.script: Script = lambda _: None
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            self.connections.append(connection)
            self._threads.append(threading.Thread(target=self._serve, args=(connection,)))
            self._threads[-1].start()

    def _serve(self, connection: socket.socket) -> None:
        try:
            while request := connection.recv(300):
                self.requests.append(request)
                answer = self.script(request)
                if answer:
                    connection.sendall(answer)
        except OSError:
            pass  # the link has closed

    def end(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._threads[0].join()
        for connection in self.connections:
            with contextlib.suppress(OSError):  # reset by a test
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()
        for thread in self._threads:
            thread.join()


@pytest.fixture
def peer() -> Iterator[Peer]:
    peer = Peer()
    yield peer
    peer.end()


@pytest.fixture
def link(peer: Peer) -> Iterator[ModbusLink]:
    link = ModbusLink("press", "127.0.0.1", peer.port, unit_id=1, request_timeout=WITHIN)
    link.open(WITHIN)
    yield link
    link.close()


def adu(pdu: str, number: int = 1, unit: int = 1) -> bytes:
    """Return a PDU with its MBAP header (Modbus messaging on TCP/IP 1.0b, 3.1.3)."""
    data = bytes.fromhex(pdu)
    return number.to_bytes(2, "big") + b"\0\0" + (len(data) + 1).to_bytes(2, "big") + bytes([unit]) + data


BITS_20_TO_38 = "1011001111010110101"  # CDh, 6Bh, 05h, each from its lowest bit

# Modbus application protocol 1.1b3: section, example request and answer, called method and its result.
EXAMPLES: list[tuple[str, str, str, Callable[[ModbusLink], object], object]] = [
    (
        "6.1",
        "01 0013 0013",
        "01 03 CD6B05",
        lambda link: link.read_coils(0x13, 19),
        [bit == "1" for bit in BITS_20_TO_38],
    ),
    (
        "6.2",
        "02 00C4 0016",
        "02 03 ACDB35",
        lambda link: link.read_discrete_inputs(0xC4, 22),
        [bit == "1" for bit in "0011010111011011101011"],
    ),
    (
        "6.3",
        "03 006B 0003",
        "03 06 022B 0000 0064",
        lambda link: link.read_holding_registers(0x6B, 3),
        [555, 0, 100],
    ),
    ("6.4", "04 0008 0001", "04 02 000A", lambda link: link.read_input_registers(8, 1), [10]),
    ("6.5", "05 00AC FF00", "05 00AC FF00", lambda link: link.write_coil(0xAC, True), None),
    ("6.6", "06 0001 0003", "06 0001 0003", lambda link: link.write_register(1, 3), None),
    (
        "6.11",
        "0F 0013 000A 02 CD01",
        "0F 0013 000A",
        lambda link: link.write_coils(0x13, [bit == "1" for bit in "1011001110"]),
        None,
    ),
    ("6.12", "10 0001 0002 04 000A 0102", "10 0001 0002", lambda link: link.write_registers(1, 0x0A, 0x0102), None),
]


@pytest.mark.parametrize(
    ("request_", "answer", "call", "result"), [e[1:] for e in EXAMPLES], ids=[e[0] for e in EXAMPLES]
)
def test_frames_match_the_modbus_specification(
    peer: Peer, link: ModbusLink, request_: str, answer: str, call: Callable[[ModbusLink], object], result: object
) -> None:
    peer.script = lambda _: adu(answer)
    assert call(link) == result
    assert peer.requests == [adu(request_)]


def test_exceptions_match_the_modbus_specification(peer: Peer, link: ModbusLink) -> None:
    """Section 7: reading a coil that does not exist."""
    peer.script = lambda _: adu("81 02")
    with pytest.raises(DeviceFault) as refused:
        link.read_coils(0x04A1, 1)
    assert peer.requests == [adu("01 04A1 0001")]
    assert str(refused.value) == (
        f"press at 127.0.0.1:{peer.port} refused reading coils 1185 to 1185: illegal address (exception 2)"
    )
    assert refused.value.fault_code == 2


def test_the_identification_is_read(peer: Peer, link: ModbusLink) -> None:
    """Section 6.21, the basic objects, with texts chosen by this test."""
    objects = b"".join(bytes([number, len(text)]) + text for number, text in enumerate((b"Maker", b"P-7", b"V2.11")))
    peer.script = lambda _: adu("2B 0E 01 01 00 00 03" + objects.hex())
    identity = link.identify()
    assert (identity.vendor, identity.model, identity.firmware) == ("Maker", "P-7", "V2.11")
    assert peer.requests == [adu("2B 0E 01 00")]


# ------------------------------------------------------------------------------------------------ faults on TCP
def test_answers_with_another_transaction_id_are_ignored(peer: Peer, link: ModbusLink) -> None:
    """Send the answer of another transaction, that of another unit, and the right one in one segment."""
    peer.script = lambda _: adu("04 02 0001", number=7) + adu("04 02 0002", unit=9) + adu("04 02 0003")
    assert link.read_input_registers(0, 1) == [3]


def test_an_answer_in_pieces_is_assembled(peer: Peer, link: ModbusLink) -> None:
    def script(_: bytes) -> None:
        for byte in adu("04 02 0003"):
            peer.connections[0].sendall(bytes([byte]))
            time.sleep(0.002)

    peer.script = script
    assert link.read_input_registers(0, 1) == [3]
    assert len(peer.requests) == 1


def test_the_time_limit_is_exact_although_bytes_keep_arriving(peer: Peer, link: ModbusLink) -> None:
    ended = threading.Event()

    def script(_: bytes) -> None:
        while not ended.wait(0.02):
            peer.connections[-1].sendall(b"\0")

    peer.script = script
    start = time.monotonic()
    with (
        link.limited(0.2),
        pytest.raises(DeviceTimeout, match=r"no valid answer within 0.2 s .*; it may have been executed$"),
    ):
        link.write_register(0, 1)
    assert time.monotonic() - start > 0.19
    ended.set()
    assert len(peer.requests) == 1


def test_a_read_is_repeated_once_and_a_write_never(peer: Peer, link: ModbusLink) -> None:
    with link.limited(0.2):
        with pytest.raises(DeviceTimeout, match=r"no answer within 0.2 s \(reading input registers 0 to 0\) twice$"):
            link.read_input_registers(0, 1)
        wait_for(lambda: len(peer.requests) == 2)
        with pytest.raises(DeviceTimeout, match="it may have been executed"):
            link.write_coil(0, True)
    wait_for(lambda: len(peer.requests) == 3)
    assert len(peer.connections) == 3  # so that late answers are not received
    peer.script = lambda request: adu("04 02 0005", number=int.from_bytes(request[:2], "big"))
    assert link.read_input_registers(0, 1) == [5]


def test_too_few_registers_are_an_error(peer: Peer, link: ModbusLink) -> None:
    peer.script = lambda _: adu("04 02 0005")
    with pytest.raises(DeviceFault, match="sent 1 of 3 input registers"):
        link.read_input_registers(0, 3)


def test_a_connection_closed_by_the_device_stays_lost(peer: Peer, link: ModbusLink) -> None:
    peer.script = lambda _: peer.connections[0].shutdown(socket.SHUT_RDWR)
    for _ in range(2):
        with pytest.raises(ConnectionLost, match=f"^press at 127.0.0.1:{peer.port}: the connection was lost$"):
            link.read_input_registers(0, 1)
    assert len(peer.connections) == 1
    peer.script = lambda _: adu("04 02 0005")
    link.open(WITHIN)
    assert link.read_input_registers(0, 1) == [5]


def test_close_wakes_waiting_threads(peer: Peer) -> None:
    link = ModbusLink("press", "127.0.0.1", peer.port, request_timeout=2.0 * WITHIN)
    link.open(WITHIN)
    received = threading.Event()
    peer.script = lambda _: received.set()
    failed: list[Exception] = []

    def ask() -> None:
        try:
            link.read_input_registers(0, 1)
        except (ConnectionLost, NotConnected) as error:
            failed.append(error)

    thread = threading.Thread(target=ask)
    thread.start()
    assert received.wait(WITHIN)
    link.close()
    thread.join(WITHIN)
    assert failed
    with pytest.raises(NotConnected, match="is not connected"):
        link.write_coil(0, True)


def test_an_interrupted_request_leaves_the_line_usable(peer: Peer, link: ModbusLink) -> None:
    """A stop may interrupt a thread anywhere; its answer must not be returned to the next request."""

    class Interrupted(BaseException):
        pass

    client = link._client
    assert client is not None
    calls: list[int | None] = []

    def interrupted(size: int | None) -> bytes:
        calls.append(size)
        raise Interrupted

    client.recv = interrupted  # type: ignore[method-assign]
    peer.script = lambda _: adu("04 02 0001")
    with pytest.raises(Interrupted):
        link.read_input_registers(0, 1)
    assert calls
    peer.script = lambda _: adu("04 02 0002")
    assert link.read_input_registers(0, 1) == [2]
    assert len(peer.connections) == 2


def test_requests_of_several_threads_do_not_mix(peer: Peer, link: ModbusLink) -> None:
    def script(request: bytes) -> bytes:
        return adu(f"04 02 {request[8:10].hex()}", number=int.from_bytes(request[:2], "big"))

    peer.script = script
    wrong: list[object] = []

    def ask(address: int) -> None:
        wrong.extend(answer for _ in range(50) if (answer := link.read_input_registers(address, 1)) != [address])

    threads = [threading.Thread(target=ask, args=(address,)) for address in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert len(peer.connections) == 1


def test_an_unreachable_device_is_named() -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))  # not listening: refuses
        link = ModbusLink("press", *unused.getsockname())
        with pytest.raises(NotConnected, match=r"^press at 127\.0\.0\.1:.* cannot be reached: connection refused"):
            link.open(WITHIN)
    with pytest.raises(NotConnected, match="the port cannot be opened"):
        ModbusLink("press", serial_port="/dev/none").open(1.0)


# ------------------------------------------------------------------------------------------------ RTU
@pytest.fixture
def line() -> Iterator[tuple[int, ModbusLink]]:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    link = ModbusLink("press", serial_port=os.ttyname(theirs), baudrate=115200, unit_id=1, request_timeout=WITHIN)
    link.open(WITHIN)
    yield ours, link
    link.close()
    os.close(ours)
    os.close(theirs)


def answer_on(end: int, answers: list[bytes], delay: float = 0.0) -> tuple[threading.Thread, list[bytes]]:
    """Answer one request per answer, in pieces of some bytes."""
    requests: list[bytes] = []

    def serve() -> None:
        for answer in answers:
            requests.append(os.read(end, 300))
            time.sleep(delay)
            os.write(end, answer[:3])
            time.sleep(0.01)
            os.write(end, answer[3:])

    thread = threading.Thread(target=serve)
    thread.start()
    return thread, requests


def test_rtu_frames_have_a_checksum(line: tuple[int, ModbusLink]) -> None:
    """The checksums are well-known examples: reading ten registers, and one register with the value 10."""
    end, link = line
    thread, requests = answer_on(end, [bytes.fromhex("0103020000B844")])
    with pytest.raises(DeviceFault, match="sent 1 of 10 holding registers"):
        link.read_holding_registers(0, 10)
    thread.join()
    assert requests == [bytes.fromhex("01030000000AC5CD")]


def test_an_rtu_answer_with_a_wrong_checksum_is_ignored(line: tuple[int, ModbusLink]) -> None:
    end, link = line
    thread, requests = answer_on(end, [bytes.fromhex("0103020000B845")] * 2)
    with link.limited(0.5), pytest.raises(DeviceTimeout, match="no valid answer"):
        link.read_holding_registers(0, 1)
    thread.join()
    assert len(requests) == 2


def test_a_late_answer_on_a_serial_line_is_discarded(line: tuple[int, ModbusLink]) -> None:
    """The late answer arrives while the line is drained, and the repeated read gets its own answer."""
    end, link = line
    late, fresh = bytes.fromhex("0103020000B844"), bytes.fromhex("010302000A3843")

    def serve() -> None:
        os.read(end, 300)
        time.sleep(1.5)  # the request times out after 1 s, the line is drained until 2 s
        os.write(end, late)
        os.read(end, 300)
        os.write(end, fresh)

    thread = threading.Thread(target=serve)
    thread.start()
    with link.limited(1.0):
        assert link.read_holding_registers(0, 1) == [10]
    thread.join()


def test_rtu_frames_are_separated_by_silence(line: tuple[int, ModbusLink]) -> None:
    """Modbus over serial line 1.02, 2.5.1.1: at least 1.75 ms above 19200 bit/s."""
    end, link = line
    gaps: list[float] = []

    def serve() -> None:
        answered = 0.0
        for _ in range(20):
            os.read(end, 300)
            if answered:
                gaps.append(time.monotonic() - answered)
            answered = time.monotonic()
            os.write(end, bytes.fromhex("0103020000B844"))

    thread = threading.Thread(target=serve)
    thread.start()
    for _ in range(20):
        assert link.read_holding_registers(0, 1) == [0]
    thread.join()
    assert min(gaps) >= 0.00175

"""The fake conveyor on its wire: Lawicel commands byte by byte, and CiA 402 with the canopen library."""

import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest

from tests.fakes.conftest import FakeProcess


class Adapter:
    """A raw Lawicel client."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self.socket = socket.create_connection((host, int(port)), 2.0)
        self.buffer = b""
        self.frames: list[str] = []

    def send(self, *commands: str) -> None:
        for command in commands:
            self.socket.sendall(command.encode() + b"\r")

    def token(self) -> bytes:
        """Return the next token up to CR, or a BEL."""
        while True:
            for end in range(len(self.buffer)):
                if self.buffer[end : end + 1] in (b"\r", b"\a"):
                    found, self.buffer = self.buffer[: end + 1], self.buffer[end + 1 :]
                    return found
            received = self.socket.recv(4096)
            assert received, "closed"
            self.buffer += received

    def answer(self) -> bytes:
        """Return the next token that is not a frame."""
        while (token := self.token()).startswith(b"t"):
            self.frames.append(token[:-1].decode())
        return token

    def frame(self, prefix: str) -> str:
        """Return the next frame with this prefix."""
        while True:
            for frame in self.frames:
                if frame.startswith(prefix):
                    self.frames.remove(frame)
                    return frame
            token = self.token()
            if token.startswith(b"t"):
                self.frames.append(token[:-1].decode())

    def sdo(self, request: str) -> str:
        self.frames = [frame for frame in self.frames if not frame.startswith("t585")]
        self.send("t6058" + request)
        return self.frame("t585")[5:]


@pytest.fixture(scope="module")
def fake() -> Iterator[FakeProcess]:
    fake = FakeProcess("conveyor")
    fake.control.wait_until(lambda truth: truth["booted"])
    yield fake
    fake.end()


@pytest.fixture
def adapter(fake: FakeProcess) -> Iterator[Adapter]:
    fake.control.do("heal")
    fake.control.do("power_cycle", belt=0)
    fake.control.wait_until(lambda truth: truth["booted"])
    adapter = Adapter(fake.ready["can"])
    adapter.send("S6", "O")
    assert (adapter.answer(), adapter.answer()) == (b"\r", b"\r")
    yield adapter
    adapter.socket.close()


def test_lawicel_commands_are_answered(fake: FakeProcess) -> None:
    adapter = Adapter(fake.ready["can"])
    try:
        for command, answer in [
            ("t0002", b"\a"),  # not open
            ("V", b"V1013\r"),
            ("C", b"\a"),
            ("S6", b"\r"),
            ("O", b"\r"),
            ("S6", b"\a"),  # not while open
            ("t12", b"\a"),
            ("t1232AA", b"\a"),  # one byte short
            ("t1232AABB", b"z\r"),
            ("what", b"\a"),
            ("C", b"\r"),
        ]:
            adapter.send(command)
            assert adapter.answer() == answer, command
    finally:
        adapter.socket.close()


def test_adapters_receive_the_frames_of_others_in_order(fake: FakeProcess, adapter: Adapter) -> None:
    other = Adapter(fake.ready["can"])
    try:
        other.send("O")
        other.answer()
        sent = [f"t1232{number:04X}" for number in range(500)]
        adapter.send(*sent)
        assert [other.frame("t123") for _ in sent] == sent
        assert not [frame for frame in adapter.frames if frame.startswith("t123")]
    finally:
        other.socket.close()


def test_sdo_frames(adapter: Adapter) -> None:
    assert adapter.sdo("4000100000000000") == "4300100092010200"  # 1000h: servo drive, profile 402
    assert adapter.sdo("4041600000000000")[:8] == "4B416000"  # two bytes
    assert adapter.sdo("4000200000000000") == "8000200000000206"  # no such object
    assert adapter.sdo("4018100900000000") == "8018100911000906"  # no such subindex
    assert adapter.sdo("2341600000000000") == "8041600002000106"  # read only
    assert adapter.sdo("23406000FF000000") == "8040600012000706"  # too long
    assert adapter.sdo("2F60600002000000") == "8060600030000906"  # a mode that the drive does not have
    assert adapter.sdo("2F60600003000000") == "6060600000000000"
    assert adapter.sdo("4008100000000000") == "4108100010000000"  # 16 bytes, in segments
    text = b""
    for request, head in (("60", "00"), ("70", "10"), ("60", "0B")):
        answer = adapter.sdo(request + "00" * 7)
        assert answer[:2] == head
        text += bytes.fromhex(answer[2:])
    assert text.rstrip(b"\0") == b"SD-48 belt servo"


def test_nmt_and_boot_up(fake: FakeProcess, adapter: Adapter) -> None:
    assert adapter.frame("t705") == "t70517F"  # heartbeat: pre-operational
    adapter.send("t00020105")
    fake.control.wait_until(lambda truth: truth["nmt"] == 5)
    adapter.send("t00020205")  # stopped: SDO is not served
    fake.control.wait_until(lambda truth: truth["nmt"] == 4)
    adapter.send("t00028105")  # reset node
    while adapter.frame("t705") != "t705100":
        pass


def enable(adapter: Adapter, mode: str) -> None:
    adapter.sdo(f"2F606000{mode}000000")
    for word in ("06", "07", "0F"):
        adapter.sdo(f"2B406000{word}000000")
    assert adapter.sdo("4041600000000000")[8:10] == "37"  # Operation enabled


def test_the_states_follow_the_control_word(fake: FakeProcess, adapter: Adapter) -> None:
    adapter.sdo("2B4060000F000000")  # not from Switch on disabled
    assert fake.truth()["state"] == "switch_on_disabled"
    enable(adapter, "03")
    adapter.sdo("2B40600007000000")
    assert fake.truth()["state"] == "switched_on"
    adapter.sdo("2B40600006000000")
    assert fake.truth()["state"] == "ready_to_switch_on"
    fake.control.do("emergency", code=0x3210)
    assert adapter.frame("t085") == "t08581032050000000000"
    adapter.sdo("2B40600080000000")
    assert fake.truth()["state"] == "switch_on_disabled"
    assert adapter.frame("t085") == "t08580000000000000000"


def test_the_set_point_handshake(fake: FakeProcess, adapter: Adapter) -> None:
    enable(adapter, "01")
    adapter.sdo("237A6000E8030000")  # 1000 counts
    status = "4041600000000000"

    def bit12() -> bool:
        return bool(bytes.fromhex(adapter.sdo(status)[10:12])[0] & 0x10)

    assert not bit12()
    began = time.monotonic()
    adapter.sdo("2B4060001F000000")
    assert bit12()
    adapter.sdo("2B4060000F000000")
    assert not bit12()
    assert fake.truth()["position"] < 1000  # it takes time
    fake.control.wait_until(lambda truth: truth["position"] == 1000 and truth["velocity"] == 0.0)
    # 5000 counts/s at most, 20000 counts/s²: up and down in 2 * sqrt(1000 / 20000)
    assert time.monotonic() - began > 0.4


@pytest.mark.parametrize(
    ("option", "state"), [(0, "operation_enabled"), (1, "fault"), (2, "switch_on_disabled"), (3, "switch_on_disabled")]
)
def test_heartbeat_loss_causes_the_reaction_of_6007h(
    fake: FakeProcess, adapter: Adapter, option: int, state: str
) -> None:
    adapter.sdo("2316100196007F00")  # 150 ms of node 127
    adapter.sdo(f"2B076000{option:02X}000000")
    adapter.send("t00020105")
    enable(adapter, "03")
    adapter.sdo("23FF6000E8030000")
    time.sleep(0.2)  # not watched before the first heartbeat
    assert fake.truth()["state"] == "operation_enabled"
    adapter.send("t77F105")
    assert adapter.frame("t085").startswith("t08583081")
    truth = fake.control.wait_until(lambda truth: truth["state"] == state and truth["nmt"] == 127)
    if option:
        fake.control.wait_until(lambda truth: truth["velocity"] == 0.0)
    else:
        assert truth["velocity"] > 0.0


def test_tpdo_mapping_and_timer(fake: FakeProcess, adapter: Adapter) -> None:
    """CiA 301, 7.5.2.35 to 38: a mapping is changed while the PDO is invalid and its count 0; type 255, event timer."""
    default = adapter.sdo("4001180100000000")
    assert default == "4301180185020000"  # 280h + node
    assert adapter.sdo("2F011A0000000000") == "80011A0000000106"  # valid: unsupported access, 06010000h
    assert adapter.sdo("2301180185020080") == "6001180100000000"  # bit 31: invalid
    assert adapter.sdo("23011A0120006460") == "80011A0100000106"  # the count is not 0
    assert adapter.sdo("2F011A0000000000") == "60011A0000000000"
    assert adapter.sdo("23011A0120008160") == "80011A0141000406"  # 6081h is not mappable: 06040041h
    assert adapter.sdo("23011A0120006460") == "60011A0100000000"  # 6064h, 32 bits
    assert adapter.sdo("23011A0220006C60") == "60011A0200000000"  # 606Ch, 32 bits
    assert adapter.sdo("2F011A0003000000") == "80011A0042000406"  # more than is mapped: 06040042h
    assert adapter.sdo("2F011A0002000000") == "60011A0000000000"
    assert adapter.sdo("2F01180201000000") == "8001180230000906"  # SYNC is not modelled: 06090030h
    assert adapter.sdo("2B01180514000000") == "6001180500000000"  # 20 ms
    assert adapter.sdo("2301180185020000") == "6001180100000000"
    time.sleep(0.1)
    assert not [frame for frame in adapter.frames if frame.startswith("t285")]  # not before Operational
    adapter.send("t00020105")
    first = adapter.frame("t285")
    assert first == "t28580000000000000000"
    began = time.monotonic()
    for _ in range(20):
        adapter.frame("t285")
    assert time.monotonic() - began > 0.3
    adapter.send("t00028005")  # Pre-operational: no more
    adapter.sdo("4000100000000000")
    time.sleep(0.1)
    sent = fake.truth()["pdos_sent"][1]
    time.sleep(0.1)
    assert fake.truth()["pdos_sent"][1] == sent


def test_segmented_download_and_its_aborts(fake: FakeProcess, adapter: Adapter) -> None:
    """CiA 301, 7.2.4.3: a download in segments, as some masters use for every object."""
    assert adapter.sdo("2183600004000000") == "6083600000000000"  # 6083h, 4 bytes will follow
    assert adapter.sdo("0710270000000000") == "2000000000000000"  # 4 of 7 bytes used, last segment
    assert adapter.sdo("4083600000000000") == "4383600010270000"
    assert adapter.sdo("2083600000000000") == "6083600000000000"  # without a size, in two segments
    assert adapter.sdo("0A20000000000000") == "2000000000000000"  # 2 bytes
    assert adapter.sdo("1B03000000000000") == "3000000000000000"  # 2 bytes, toggled, the last
    assert adapter.sdo("4083600000000000") == "4383600020000300"
    assert adapter.sdo("2183600004000000") == "6083600000000000"
    assert adapter.sdo("1700000000000000") == "8083600000000305"  # the toggle bit is not alternated
    assert adapter.sdo("0700000000000000") == "8083600001000405"  # no transfer is active
    assert adapter.sdo("2183600003000000") == "6083600000000000"
    assert adapter.sdo("0710270000000000") == "8083600010000706"  # not the announced length
    assert adapter.sdo("2183600008000000") == "6083600000000000"
    assert adapter.sdo("0010270000000000") == "2000000000000000"
    assert adapter.sdo("1D00000000000000") == "8083600012000706"  # too long for the object
    assert adapter.sdo("2141600002000000") == "8041600002000106"  # read only
    assert adapter.sdo("2100200002000000") == "8000200000000206"  # no such object
    assert adapter.sdo("A083600000000000") == "8083600001000405"  # block upload
    assert adapter.sdo("C283600004000000") == "8083600001000405"  # block download
    assert adapter.sdo("4083600000000000") == "4383600020000300"  # none of them changed it
    assert adapter.sdo("2260600003FFFFFF") == "6060600000000000"  # expedited without a size: as long as the object
    assert fake.truth()["mode"] == 3
    adapter.send("t6058" + "8083600000000000")  # an abort of the client is not answered
    assert adapter.sdo("4000100000000000") == "4300100092010200"


def test_error_objects(fake: FakeProcess, adapter: Adapter) -> None:
    """CiA 301, 7.5.2.2, 7.5.2.4 and 7.5.2.17: error register, stored errors, COB-ID of the emergencies."""
    assert adapter.sdo("4014100000000000") == "4314100085000000"  # 80h + node
    assert adapter.sdo("4003100000000000") == "4F03100000000000"
    assert adapter.sdo("4003100100000000") == "8003100124000008"  # no data
    fake.control.do("emergency", code=0x3210)
    assert adapter.frame("t085") == "t08581032050000000000"
    assert adapter.sdo("4001100000000000") == "4F01100005000000"  # generic, voltage
    adapter.sdo("2B40600080000000")
    assert adapter.frame("t085") == "t08580000000000000000"
    assert adapter.sdo("4001100000000000") == "4F01100000000000"
    assert adapter.sdo("2314100086000000") == "8014100030000906"  # it is changed while it is invalid
    assert adapter.sdo("2314100085000080") == "6014100000000000"
    fake.control.do("emergency", code=0x4210)
    adapter.sdo("2B40600080000000")
    assert adapter.sdo("2314100086000000") == "6014100000000000"
    fake.control.do("emergency", code=0x2310)
    assert adapter.frame("t086") == "t08681023030000000000"
    assert not [frame for frame in adapter.frames if frame.startswith("t085")]
    assert adapter.sdo("4003100000000000") == "4F03100003000000"
    assert adapter.sdo("4003100100000000") == "4303100110230000"  # the newest first
    assert adapter.sdo("4003100300000000") == "4303100310320000"
    assert adapter.sdo("2F03100001000000") == "8003100030000906"  # only 0 clears
    assert adapter.sdo("2F03100000000000") == "6003100000000000"
    assert adapter.sdo("4003100000000000") == "4F03100000000000"


def test_a_lost_master_is_a_communication_error(fake: FakeProcess, adapter: Adapter) -> None:
    adapter.sdo("2316100164007F00")  # 100 ms of node 127
    adapter.send("t77F105")
    assert adapter.frame("t085") == "t08583081110000000000"
    assert adapter.sdo("4001100000000000") == "4F01100011000000"
    adapter.send("t77F105")
    assert adapter.frame("t085") == "t08580000000000000000"


def test_rpdos_are_received_as_mapped(fake: FakeProcess, adapter: Adapter) -> None:
    """CiA 402-2 default: 1 control word, 2 with mode, 3 with target position, 4 with target velocity."""
    assert adapter.sdo("4001140100000000") == "4301140105030000"  # 300h + node
    assert adapter.sdo("4000140200000000") == "4F001402FF000000"
    assert adapter.sdo("4002160200000000") == "4302160220007A60"
    adapter.send("t20520600")  # not before Operational
    adapter.sdo("4000100000000000")
    assert fake.truth()["state"] == "switch_on_disabled"
    adapter.send("t00020105", "t305306000 3".replace(" ", ""))  # profile velocity
    adapter.send("t20520700", "t20520F00")
    fake.control.wait_until(lambda truth: truth["state"] == "operation_enabled" and truth["mode"] == 3)
    adapter.send("t50560F00E8030000")
    fake.control.wait_until(lambda truth: truth["velocity"] == 1000.0)
    adapter.send("t50580F00D0070000FFFF")  # longer than mapped: the rest is ignored
    fake.control.wait_until(lambda truth: truth["velocity"] == 2000.0)
    adapter.send("t50550F00E80300")  # too short
    assert adapter.frame("t085") == "t08581082000000000000"
    assert fake.truth()["parameters"]["target_velocity"] == 2000
    adapter.send("t30531F0007")  # a mode that the drive does not have; the control word is executed
    adapter.send("t00028005")  # Pre-operational
    adapter.send("t50560F0000000000")
    adapter.sdo("4000100000000000")
    assert fake.truth()["parameters"]["target_velocity"] == 2000
    assert fake.truth()["mode"] == 3


def test_an_rpdo_sets_the_target_before_the_control_word(fake: FakeProcess, adapter: Adapter) -> None:
    adapter.send("t00020105")
    enable(adapter, "01")
    adapter.send("t40561F00E8030000")
    fake.control.wait_until(lambda truth: truth["position"] == 1000)


def test_rpdo_mapping(fake: FakeProcess, adapter: Adapter) -> None:
    assert adapter.sdo("2F00160000000000") == "8000160000000106"  # valid: unsupported access
    assert adapter.sdo("2300140105020080") == "6000140100000000"
    assert adapter.sdo("2F00160000000000") == "6000160000000000"
    assert adapter.sdo("2300160120006460") == "8000160141000406"  # the position actual value cannot be written
    assert adapter.sdo("2300160108000500") == "6000160100000000"  # a dummy of 8 bits
    assert adapter.sdo("230016022000FF60") == "6000160200000000"
    assert adapter.sdo("2F00160002000000") == "6000160000000000"
    assert adapter.sdo("2F00140201000000") == "8000140230000906"  # SYNC is not modelled
    assert adapter.sdo("2300140110030000") == "6000140100000000"  # 310h
    adapter.send("t00020105", "t2055AA78000000", "t3105AA39300000")
    fake.control.wait_until(lambda truth: truth["parameters"]["target_velocity"] == 12345)


def test_a_stopped_node_sends_no_emergency(fake: FakeProcess, adapter: Adapter) -> None:
    adapter.send("t00020205")
    fake.control.wait_until(lambda truth: truth["nmt"] == 4)
    fake.control.do("emergency", code=0x3210)
    adapter.send("t00028005")
    assert adapter.sdo("4001100000000000") == "4F01100005000000"
    assert not [frame for frame in adapter.frames if frame.startswith("t085")]


def test_socketcand_and_slcan_share_a_bus(fake: FakeProcess, adapter: Adapter) -> None:
    host, _, port = fake.ready["socketcand"].rpartition(":")
    with socket.create_connection((host, int(port)), 2.0) as client:

        def receive_frame(prefix: bytes) -> bytes:
            came = b""
            while True:
                came += client.recv(1)
                if came.endswith(b">"):
                    if came.startswith(prefix):
                        return came
                    came = b""

        assert client.recv(100) == b"< hi >"
        client.sendall(b"< send 605 8 40 0 10 0 0 0 0 0 >")
        assert client.recv(100) == b"< error unknown command >"  # the bus is not open
        client.sendall(b"< open can0 >")
        assert client.recv(100) == b"< ok >"
        client.sendall(b"< rawmode >")
        assert receive_frame(b"< ok") == b"< ok >"
        client.sendall(b"< send 605 8 40 0 10 0 0 0 0 0 >")
        assert receive_frame(b"< frame 585 ").split()[-2] == b"4300100092010200"
        assert adapter.frame("t605") == "t60584000100000000000"  # a frame sent by one member reaches the others
        client.sendall(b"< send 605 3 40 0 >")
        assert receive_frame(b"< error") == b"< error could not send frame >"


def test_python_can_reads_and_writes(fake: FakeProcess, adapter: Adapter) -> None:
    with can.Bus(
        interface="slcan", channel=f"socket://{fake.ready['can']}", bitrate=500000, sleep_after_open=0.0
    ) as bus:
        bus.send(can.Message(arbitration_id=0x605, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
        deadline = time.monotonic() + 30.0
        while time.monotonic() < deadline:
            message = bus.recv(0.5)
            if message is not None and message.arbitration_id == 0x585:
                assert bytes(message.data).hex() == "4300100092010200"
                return
    pytest.fail("no answer")


def test_invalid_arguments_and_unknown_commands_are_refused(fake: FakeProcess, start_fake: Callable[..., Any]) -> None:
    for command, arguments in (("emergency", {"code": 0}), ("nothing", {})):
        with pytest.raises(Exception, match=command if command == "nothing" else "1 to 65535"):
            fake.control.do(command, **arguments)

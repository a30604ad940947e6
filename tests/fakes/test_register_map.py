"""Fakes with a register map: number formats, word order, addresses, bits and gaps; and the ends of text lines."""

import asyncio
import struct
from typing import Any, ClassVar

import pytest

from arcor2_fakes.register_map import MapTables, RegisterMap, coil, discrete_input, holding_register, input_register
from arcor2_fakes.registers import PANEL, MappedDevice, Refusal, answer_line, text_line


class Press(MappedDevice):
    names = ("owner",)
    places: ClassVar = {
        "force": input_register(100, "float32"),
        "swapped": input_register(102, "float32", low_first=True),
        "position": input_register(104, "int32"),
        "energy": input_register(106, "uint64", low_first=True),
        "offset": input_register(65535, "int16"),
        "homed": input_register(200, bit=0),
        "hot": input_register(200, bit=15),
        "program": holding_register(10),
        "target": holding_register(12, "float32"),
        "owner": holding_register(30),
        "lamp": holding_register(20, bit=3),
        "start": coil(4000),
        "door": discrete_input(7),
    }

    def changed(self, name: str, value: Any) -> None:
        if name == "start" and value and not self.registers.program:
            raise Refusal("no program")


@pytest.fixture
def press() -> Press:
    return Press()


def asked(press: Press, request: str) -> str:
    return MapTables(press).answer(bytes.fromhex(request)).hex()


def read(press: Press, function: int, address: int, count: int) -> bytes:
    answer = MapTables(press).answer(struct.pack(">BHH", function, address, count))
    assert answer[:2] == bytes((function, 2 * count)), answer
    return answer[2:]


def test_numbers_have_the_format_of_their_place(press: Press) -> None:
    press.registers.force = press.registers.swapped = 12.5
    press.registers.position, press.registers.energy, press.registers.offset = -70000, 0x1122334455667788, -2
    assert read(press, 4, 100, 2) == struct.pack(">f", 12.5)
    assert read(press, 4, 102, 2) == struct.pack(">f", 12.5)[2:] + struct.pack(">f", 12.5)[:2]
    assert read(press, 4, 104, 2) == struct.pack(">i", -70000)
    assert read(press, 4, 106, 4).hex() == "7788556633441122"
    assert read(press, 4, 65535, 1) == b"\xff\xfe"
    assert read(press, 4, 101, 2) == struct.pack(">f", 12.5)[2:] * 2  # parts of two numbers


def test_bits_share_a_register(press: Press) -> None:
    press.registers.homed = press.registers.hot = True
    assert read(press, 4, 200, 1) == b"\x80\x01"
    press.registers.homed = False
    assert read(press, 4, 200, 1) == b"\x80\x00"
    assert asked(press, "0600140008") == "0600140008"
    assert press.registers.lamp is True
    assert read(press, 3, 20, 1) == b"\x00\x08"


def test_coils_and_discrete_inputs(press: Press) -> None:
    press.registers.program, press.registers.door = 3, True
    assert asked(press, "050fa0ff00") == "050fa0ff00"
    assert press.registers.start is True
    assert asked(press, "010fa00001") == "010101"
    assert asked(press, "0200070001") == "020101"
    assert press.written == [["start", True]]


def test_a_number_of_two_registers_is_written_at_once_or_in_parts(press: Press) -> None:
    whole = struct.pack(">BHHB", 16, 12, 2, 4) + struct.pack(">f", 1.5)
    assert MapTables(press).answer(whole) == whole[:5]
    assert press.registers.target == 1.5
    asked(press, "06000cc0a0")  # the high word of -5.0 and the low word of 1.5
    assert press.registers.target == -5.0
    assert press.written == [["target", 1.5], ["target", -5.0]]


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("0400630001", "8402"),
        ("04006e0001", "8402"),
        ("0400690006", "8402"),
        ("0300000001", "8302"),
        ("06000b0001", "8602"),
        ("0100000001", "8102"),
        ("0500000000", "8502"),
        ("0200080001", "8202"),
    ],
)
def test_addresses_outside_the_map_do_not_exist(press: Press, request_: str, answer: str) -> None:
    assert asked(press, request_) == answer


def test_a_refused_write_changes_nothing(press: Press) -> None:
    start = "050fa0ff00"
    assert asked(press, start) == "8506"
    assert (press.registers.start, press.written) == (0, [])
    press.registers.program, press.owner = 1, PANEL
    assert asked(press, start) == "8506"
    press.owner = 0
    assert asked(press, start) == start


def test_the_watchdog_counts_from_the_last_request(press: Press) -> None:
    press.guard(0.2)
    press.heard()
    assert press.owner == press.registers.owner == 1
    press.spoke -= 1.0
    press.update()
    assert press.owner == press.registers.owner == 0


@pytest.mark.parametrize(
    ("places", "named"),
    [
        ({"a": input_register(1, "uint32"), "b": input_register(2)}, "b: address 2 belongs to a"),
        ({"a": input_register(1, bit=1), "b": input_register(1)}, "b: address 1 belongs to a"),
        ({"a": input_register(1), "b": input_register(1, bit=1)}, "b: address 1 belongs to a"),
        ({"a": input_register(1, bit=1), "b": input_register(1, bit=1)}, "b: address 1 belongs to a"),
        ({"a": input_register(65535, "float32")}, "a: address 65535 is not in the table"),
        ({"a": coil(-1)}, "a: address -1 is not in the table"),
    ],
)
def test_impossible_maps_are_refused(places: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=f"^{named}"):
        RegisterMap(places)


@pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n", b"\x03"])
async def test_text_lines_have_the_end_of_the_device(press: Press, end: bytes) -> None:
    line = text_line(press, answer_line, "127.0.0.1", 0, None, end)
    await line.plug()
    reader, writer = await asyncio.open_connection("127.0.0.1", int(line.port.rpartition(":")[2]))
    press.owner = 7
    writer.write(b"R 0 1" + end + b"R 0")
    assert await reader.readuntil(end) == b"= 7" + end
    writer.write(b" 1" + end)
    assert await reader.readuntil(end) == b"= 7" + end
    writer.close()
    await writer.wait_closed()
    await line.unplug()

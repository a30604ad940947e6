"""ZPL answers byte for byte, and fields that cannot contain commands."""

import pytest
from hypothesis import given, strategies as st

from arcor2_drivers.label_printer.zpl import BadLabel, check_label, field, identity, number, status, variable

ONE, TWO, THREE = (
    b"\x02030,0,0,1245,000,0,0,0,000,0,0,0\x03\r\n",
    b"\x02000,0,0,0,1,2,6,0,00000000,1,000\x03\r\n",
    b"\x021234,0\x03\r\n",
)


def test_host_status_is_read() -> None:
    found = status(ONE + TWO + THREE)
    assert found is not None
    assert found.idle
    assert (found.paper_out, found.paused, found.head_open, found.ribbon_out) == (False,) * 4
    busy = status(
        b"noise"
        + ONE.replace(b"030,0,0,1245,000", b"030,1,1,1245,002")
        + TWO.replace(b"000,0,0,0,1", b"000,0,1,1,1").replace(b"00000000", b"00000007")
        + THREE
    )
    assert busy is not None
    assert (busy.paper_out, busy.paused, busy.head_open, busy.ribbon_out) == (True,) * 4
    assert (busy.formats_waiting, busy.labels_left, busy.idle) == (2, 7, False)


@pytest.mark.parametrize(
    "data", [b"", ONE, ONE + TWO, TWO + ONE + THREE, ONE + TWO + THREE[:-1], ONE.replace(b",0,0,1245", b",x,0,1245")]
)
def test_an_incomplete_answer_is_not_a_status(data: bytes) -> None:
    assert status(data) is None


def test_other_answers() -> None:
    assert identity(b"\x02ZT411-203dpi,V92.21.39Z,8,65536KB\x03\r\n") == ("ZT411-203dpi", "V92.21.39Z")
    assert identity(b"\x02a,b\x03\r\n") is None
    assert (number(b'"105"'), number(b'"?"'), number(b'"10'), variable(b'"?"')) == (105, None, None, "?")


@given(st.text(st.characters(exclude_categories=["C"]), max_size=100), st.booleans())
def test_fields_escape_commands(text: str, barcode: bool) -> None:
    try:
        data = field(text, barcode)
    except BadLabel:
        assert barcode or not text.isprintable()
        return
    inside = data.removeprefix("^FH_^FD").removesuffix("^FS")
    assert not set(inside) & set("^~\\")
    check_label(f"^XA{data}^XZ")


@given(st.binary(max_size=200))
def test_random_bytes_raise_nothing(data: bytes) -> None:
    for read in (status, identity, number, variable):
        read(data)
    assert status(data + ONE + TWO + THREE) is not None or data.endswith(b"\x02")

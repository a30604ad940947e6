"""Lines of the reader: with any fragmentation or noise, only complete, valid lines are returned."""

from hypothesis import given, strategies as st

from arcor2_drivers.barcode_reader import lines
from arcor2_drivers.barcode_reader.lines import MAX_CODE, MAX_LINE, LineBuffer
from arcor2_hw.data.device import Health, Identity

codes = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), min_size=1, max_size=MAX_CODE)
framings = st.sampled_from(["{}\r", "{}\r\n", "\x02{}\x03\r", "\x02{}\x03\r\n"])


def cut(data: bytes, places: list[int]) -> list[bytes]:
    """Split data at these positions."""
    at = sorted({place % (len(data) + 1) for place in places})
    return [data[start:end] for start, end in zip([0, *at], [*at, len(data)], strict=True)]


def feed(data: bytes, places: list[int]) -> list[str]:
    buffer = LineBuffer()
    return [line for piece in cut(data, places) for line in buffer.feed(piece)]


@given(st.lists(st.tuples(codes, framings)), st.lists(st.integers(min_value=0)))
def test_lines_are_read_with_any_framing_and_fragmentation(sent: list[tuple[str, str]], places: list[int]) -> None:
    data = "".join(framing.format(code) for code, framing in sent).encode()
    assert feed(data, places) == [code for code, _ in sent]


@given(st.binary(max_size=3000), st.lists(st.integers(min_value=0)))
def test_random_bytes_give_only_printable_lines(data: bytes, places: list[int]) -> None:
    found = feed(data, places)
    assert found == feed(data, [])
    for line in found:
        assert 1 <= len(line) <= MAX_LINE
        assert line.isascii()
        assert line.isprintable()


@given(st.binary(max_size=3 * MAX_LINE).map(lambda data: data.replace(b"\r", b"")), codes)
def test_a_line_after_noise_is_read(noise: bytes, code: str) -> None:
    assert feed(noise + b"\r" + code.encode() + b"\r", [])[-1:] == [code]


def test_an_endless_line_is_dropped() -> None:
    buffer = LineBuffer()
    for _ in range(1000):
        assert buffer.feed(b"x" * 1000) == []
        assert len(buffer._rest) <= MAX_LINE
    assert buffer.feed(b"x\rNEXT\r") == ["NEXT"]
    assert buffer.garbage == 1


def test_incomplete_framing_is_dropped() -> None:
    assert feed(b"\x02HALF\rA\x03\r\x02\x02B\x03\r\x02C\x03\r", []) == ["C"]


@given(st.text(max_size=300))
def test_status_words_are_not_codes(text: str) -> None:
    for word in (
        "ERROR",
        "LON",
        "LOFF",
        "VER",
        "STAT",
        "RST",
        "OK,RST",
        f"ERR,{text},00",
        f"STAT,{text}",
        f"VER,{text}",
    ):
        assert not lines.is_code(word)
    assert not lines.is_code("")
    assert not lines.is_code("x" * (MAX_CODE + 1))
    assert lines.is_code("VERY")
    assert lines.is_code("ERRATA 1")


@given(st.text(max_size=100))
def test_answers_are_parsed_or_ignored(text: str) -> None:
    for line in (text, f"STAT,{text}", f"VER,{text}"):
        assert isinstance(lines.status(line), lines.Status | None)
        assert isinstance(lines.identity(line), Identity | None)


def test_answers() -> None:
    assert lines.status("STAT,0,FAIL") == lines.Status(False, Health.FAILURE, "FAIL")
    assert lines.status("STAT,2,OK") is None
    assert lines.identity("VER,Acme,M,1,2.0") == Identity("Acme", "M", "1", "2.0")
    assert lines.identity("VER,Acme,M,1") is None

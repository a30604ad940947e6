"""MT-SICS lines from the manual, and random bytes."""

import pytest
from hypothesis import given, strategies as st

from arcor2_drivers.scale.sics import MAX_LINE, Answer, answers


@pytest.mark.parametrize(
    ("line", "meaning"),
    [
        (b"S S     100.00 g", Answer("S", "S", 0.1, "g")),
        (b"S D      -0.5 kg", Answer("S", "D", -0.5, "kg")),
        (b"S S 100.00 g", Answer("S", "S", 0.1, "g")),
        (b"S S     1234567 mg", Answer("S", "S", 1.234567, "mg")),
        (b"S S       2.00 lb", Answer("S", "S", None, "lb")),
        (b"S I", Answer("S", "I")),
        (b"S +", Answer("S", "+")),
        (b"S -", Answer("S", "-")),
        (b"Z A", Answer("Z", "A")),
        (b"T S      10.00 g", Answer("T", "S", 0.01, "g")),
        (b"TA A      0.00 g", Answer("TA", "A", 0.0, "g")),
        (b'I4 A "B021002593"', Answer("I4", "A", text="B021002593")),
        (b"ES", Answer("ES")),
        (b"ET", Answer("ET")),
        (b"EL", Answer("EL")),
    ],
)
def test_a_line_is_read(line: bytes, meaning: Answer) -> None:
    assert answers(line + b"\r\n") == [meaning]
    assert answers(b"noise\r\n" + line + b"\r\n" + line) == [meaning]  # the last line is incomplete


@pytest.mark.parametrize(
    "line", [b"S S nan g", b"S S 1e5 g", b"S S 100,00 g", b"S S 1 0 g", b"S S 10.00", b"S S g", b"X S 1.0 g", b""]
)
def test_invalid_lines_are_not_answers(line: bytes) -> None:
    assert answers(line + b"\r\n") == []


@given(st.binary(max_size=300))
def test_random_bytes_raise_nothing(data: bytes) -> None:
    for answer in answers(data + b"\r\n"):
        assert answer.value is None or abs(answer.value) < 1e10
    assert len(answers(b"S S " + b" " * MAX_LINE + b"1.0 g\r\n")) == 0

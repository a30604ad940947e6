"""RTDE framing as a pure function."""

import struct

import pytest
from hypothesis import given, strategies as st

from arcor2_fakes.ur.rtde import FORMATS, INPUTS, MAX_NAMES, OUTPUTS, Deframer, FramingError, Kind, pack, split_names

frames = st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=300)), max_size=8)


@given(frames, st.lists(st.integers(1, 50), min_size=1))
def test_frames_are_complete_however_the_bytes_are_split(sent, cuts):
    stream = b"".join(pack(kind, payload) for kind, payload in sent)
    deframer, received, at, n = Deframer(), [], 0, 0
    while at < len(stream):
        size = cuts[n % len(cuts)]
        received += deframer.feed(stream[at : at + size])
        at, n = at + size, n + 1
    assert received == sent


def test_bytes_on_the_wire():
    assert pack(Kind.REQUEST_PROTOCOL_VERSION, b"\x00\x02") == b"\x00\x05V\x00\x02"
    assert pack(Kind.START) == b"\x00\x03S"


@pytest.mark.parametrize("size", [0, 1, 2])
def test_invalid_sizes_are_refused(size):
    with pytest.raises(FramingError):
        list(Deframer().feed(struct.pack(">HB", size, Kind.DATA)))


def test_names():
    assert split_names(b"actual_q,timestamp,") == ["actual_q", "timestamp"]
    with pytest.raises(FramingError):
        split_names(b"a,\xff")
    with pytest.raises(FramingError):
        split_names(b",".join([b"x"] * (MAX_NAMES + 1)))


def test_every_variable_has_a_type_with_a_format():
    assert {*OUTPUTS.values(), *INPUTS.values()} <= FORMATS.keys()

"""The driver's codec on telegrams written from the tables of the specification."""

import re

import pytest
from hypothesis import given, strategies as st

from arcor2_drivers.screwdriver import telegrams
from arcor2_drivers.screwdriver.telegrams import AlarmReport, Mid, Result, Telegram, TelegramBuffer
from arcor2_hw.data.device import Identity

FIRST = (
    b"02310061001         "  # length, MID, revision; the rest of the header is blank
    b"010004" b"0201" b"03Wheel left               " b"04WVWZZZ1JZ3W386752        "
    b"0512" b"06034" b"070006" b"080002" b"091" b"101" b"111"
    b"12001080" b"13001320" b"14001200" b"15001187"
    b"1600020" b"1700090" b"1800055" b"1900061"
    b"202026-03-04:05:06:07" b"212026-01-02:03:04:05" b"222" b"230000004711\0"
)  # fmt: skip
"""A result, revision 1."""
SECOND = (
    b"03850061002         "
    b"010004" b"0201" b"03Wheel left               " b"04WVWZZZ1JZ3W386752        "
    b"051234" b"06034" b"0702" b"08\x02\0\0\0\0" b"090006" b"100002"
    b"110" b"122" b"130" b"141" b"151" b"161" b"171" b"181" b"191" b"20\0\x08\0\0\0\0\0\0\0\0"
    b"21001080" b"22001320" b"23001200" b"24000505"
    b"2500020" b"2600090" b"2700055" b"2800012"
    b"2900000" b"3009999" b"3100720" b"32000" b"33150" b"34080"
    b"35000000" b"36000000" b"37000000" b"38000000" b"39000000" b"40000000"
    b"414294967295" b"4200001" b"4300000" b"44TOOL0000012345"
    b"452026-03-04:05:06:07" b"462026-01-02:03:04:05\0"
)  # fmt: skip
"""A result, revision 2, whose bit fields are bytes, as in older controllers."""
OF_FIRST = Result(4711, 34, 12, True, 11.87, 61.0, "2026-03-04:05:06:07")
OF_SECOND = Result(4294967295, 34, 1234, False, 5.05, 12.0, "2026-03-04:05:06:07")


def decoded(stream: bytes) -> list[Telegram]:
    return TelegramBuffer().feed(stream)


@pytest.mark.parametrize(("stream", "expected"), [(FIRST, OF_FIRST), (SECOND, OF_SECOND)])
def test_results_of_both_revisions(stream: bytes, expected: Result) -> None:
    assert len(stream) == int(stream[:4]) + 1
    [telegram] = decoded(stream)
    assert telegram.mid == Mid.RESULT
    assert telegrams.result(telegram) == expected


@pytest.mark.parametrize("size", [1, 7, 20, 231, 232, 400])
def test_partial_and_glued_telegrams(size: int) -> None:
    """Splits are by length, since the bit fields of the second telegram contain NUL."""
    stream = FIRST + SECOND + b"00209999001         \0" + FIRST
    buffer, found = TelegramBuffer(), []
    for place in range(0, len(stream), size):
        found += buffer.feed(stream[place : place + size])
    assert [each.mid for each in found] == [61, 61, 9999, 61]
    assert [telegrams.result(found[i]) for i in (0, 1, 3)] == [OF_FIRST, OF_SECOND, OF_FIRST]


def test_results_of_higher_revisions_have_more_fields_at_the_end() -> None:
    [telegram] = decoded(SECOND.replace(b"03850061002", b"04190061003")[:-1] + b"47Set 34                   4814901\0")
    assert telegram.revision == 3
    assert telegrams.result(telegram) == OF_SECOND


@pytest.mark.parametrize("revision", [998, 999])
def test_the_light_and_variable_revisions_are_refused(revision: int) -> None:
    with pytest.raises(ValueError, match=f"^revision {revision} of MID 0061 is not supported"):
        telegrams.result(Telegram(61, revision, b"0001"))


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (FIRST[20:-2], "the data field has 210 bytes instead of 211"),
        (FIRST[20:-1] + b"0", "the data field has 212 bytes instead of 211"),
        (FIRST[20:-1].replace(b"05120", b"06120"), "field 05 starts with b'06'"),
        (FIRST[20:-1].replace(b"15001187", b"15001x87"), "field 15 is b'001x87'"),
        (b"", "field 01 starts with b''"),
    ],
)
def test_wrong_lengths_and_fields_are_errors(data: bytes, problem: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(problem)}$"):
        telegrams.result(Telegram(61, 1, data))


@pytest.mark.parametrize(
    ("stream", "problem"),
    [
        (b"00190005001         0018\0", "length 19 is less"),
        (b"0x240005001         0018\0", "length is b'0x24'"),
        (b"00230005001         0018\0", "no NUL after a telegram of length 23"),
        (b"HTTP/1.1 400 Bad Request\r\n", "length is b'HTTP'"),
    ],
)
def test_a_stream_that_is_not_open_protocol_is_an_error(stream: bytes, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        decoded(stream)


@given(st.binary(max_size=200))
def test_random_bytes_raise_only_value_errors(data: bytes) -> None:
    try:
        found = decoded(data)
    except ValueError:
        return
    assert len(found) <= len(data) // 21


@given(mid=st.sampled_from([2, 4, 5, 61, 71, 74, 76]), revision=st.integers(1, 999), data=st.binary(max_size=300))
def test_random_data_fields_raise_only_value_errors(mid: int, revision: int, data: bytes) -> None:
    decode = {
        2: telegrams.identity,
        4: telegrams.rejected,
        5: telegrams.accepted,
        61: telegrams.result,
        71: telegrams.alarm,
        74: telegrams.cleared,
        76: telegrams.alarm,
    }[mid]
    try:
        decode(Telegram(mid, revision, data))
    except ValueError:
        return


def test_requests_have_a_header_of_twenty_bytes() -> None:
    assert telegrams.encode(Mid.SELECT_PROGRAM, b"007") == b"002300180010        007\0"
    assert telegrams.encode(Mid.START, revision=6) == b"002000010060        \0"


def test_a_blank_or_zero_revision_is_the_first() -> None:
    for revision in (b"   ", b"000", b"001"):
        assert decoded(b"00209999" + revision + b"         \0") == [Telegram(9999, 1)]


START = b"010001020103Airbag                   "
MORE = b"04BRC052.0                06V1.400             07V3.2               "
LAST = b"08RBU Gold                09A1234567891000111001"


@pytest.mark.parametrize(
    ("revision", "data", "expected"),
    [
        (1, START, Identity("", "Airbag", "", "")),
        (2, START + b"04ACT", Identity("Atlas Copco", "Airbag", "", "")),
        (3, START + MORE, Identity("Bosch Rexroth", "Airbag", "", "V1.400")),
        (5, START + MORE + LAST, Identity("Bosch Rexroth", "Airbag", "A123456789", "V1.400")),
    ],
)
def test_identity_by_revision(revision: int, data: bytes, expected: Identity) -> None:
    assert telegrams.identity(Telegram(Mid.START_ACKNOWLEDGE, revision, data)) == expected


STAMP = b"2026-03-04:05:06:07"


@pytest.mark.parametrize(
    ("mid", "revision", "data", "expected"),
    [
        (71, 1, b"010105" b"020" b"031" b"04" + STAMP, AlarmReport("0105", False)),
        (71, 2, b"01E0404" b"021" b"031" b"04" + STAMP + b"05" + b"Hot".ljust(50), AlarmReport("E0404", True, "Hot")),
        (76, 1, b"011" b"020105" b"031" b"040" b"05" + STAMP, AlarmReport("0105", False)),
        (76, 2, b"011" b"02E0404" b"031" b"041" b"05" + STAMP, AlarmReport("E0404", True)),
        (76, 1, b"010" b"020000" b"031" b"041" b"05" + STAMP, None),
    ],
)  # fmt: skip
def test_alarms_by_revision(mid: int, revision: int, data: bytes, expected: AlarmReport | None) -> None:
    assert telegrams.alarm(Telegram(mid, revision, data)) == expected


def test_error_codes_have_two_digits_and_from_revision_2_on_three() -> None:
    assert telegrams.rejected(Telegram(4, 1, b"001802")) == (18, 2)
    assert telegrams.rejected(Telegram(4, 2, b"0018101")) == (18, 101)

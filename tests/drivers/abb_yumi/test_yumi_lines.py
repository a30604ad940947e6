"""Lines of the motion server, settings, and late answers, without a controller."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from arcor2_drivers.abb_yumi import nominal
from arcor2_drivers.abb_yumi.arm_line import ArmLine
from arcor2_drivers.abb_yumi.motion_lines import MAX_LINE_LENGTH, Code, answer, check, line
from arcor2_drivers.abb_yumi.settings import YumiSettings
from arcor2_fakes.abb_yumi import kinematics, protocol
from arcor2_hw.exceptions import DeviceFault, DeviceTimeout, NotInControl, OutOfRange

WRONG = [
    ("host", " "),
    ("user", ""),
    ("rws_port", 0),
    ("left_port", 70000),
    ("right_port", 6102),
    ("left_mass", 0.6),
    ("right_mass", 0.0),
    ("left_tcp_z", 2.0),
    ("right_cog_x", float("nan")),
    ("max_tcp_speed", 2.0),
    ("max_joint_speed", 0.0),
    ("clearance", -0.1),
    ("watchdog", 1.0),
    ("poll_period", 0.0),
]


@pytest.mark.parametrize(("name", "value"), WRONG)
def test_an_invalid_setting_is_named(name: str, value: Any) -> None:
    with pytest.raises(OutOfRange) as error:
        YumiSettings(**{"host": "10.0.0.1", name: value})
    assert name in str(error.value)


QUOTED = [
    (line(7, Code.MOVE_JOINTS, [1.5]), b"7 30 1.5*667\n"),
    (line(1, Code.HELLO), b"1 1*260\n"),
    (line(9999, Code.STOP), b"9999 91*418\n"),
    (line(2, Code.BEGIN, [0.4]), b"2 2 0.4*275\n"),
    (line(12, Code.KEEP_ALIVE), b"12 90*713\n"),
    (line(3, Code.ZONE, [0.0]), b"3 5 0*642\n"),
    (line(4, Code.SPEED, [125.0, 28.6479]), None),
    (line(5, Code.STAGE_POSITION, [-9.5784, 182.6099, 198.6278, -2.8456]), b"5 21 -9.578 182.61 198.628 -2.846*"),
]


@pytest.mark.parametrize(("made", "expected"), QUOTED)
def test_lines_match_the_examples_of_the_readme(made: bytes, expected: bytes | None) -> None:
    text, _, number = made.decode().strip().rpartition("*")
    by_hand = 0
    for place in range(len(text)):
        by_hand += (place + 1) * ord(text[place])
    assert int(number) == by_hand % 997
    if expected is not None and expected.endswith(b"\n"):
        assert made == expected
    elif expected is not None:
        assert made.startswith(expected)


joint = st.floats(-290.0, 290.0)
part = st.floats(-1.0, 1.0)


@example(9999, [-0.123456] * 7)
@example(9999, [-279.9999] * 7)
@given(st.integers(1, 9999), st.lists(joint, min_size=7, max_size=7))
def test_seven_joints_fit_and_the_server_reads_them(sequence: int, joints: list[float]) -> None:
    made = line(sequence, Code.STAGE_JOINTS, joints)
    assert len(made) <= MAX_LINE_LENGTH + 1
    number, code, values = protocol.parsed(made.decode().rstrip("\n"))
    assert (number, code) == (sequence, 20)
    assert values == pytest.approx(joints, abs=5.1e-4)


@example([-0.123456] * 3, [-0.123456] * 4)
@given(st.lists(st.floats(-499.0, 499.0), min_size=3, max_size=3), st.lists(part, min_size=4, max_size=4))
def test_a_tool_fits_into_a_line(position: list[float], quaternion: list[float]) -> None:
    assert len(line(9999, Code.TOOL, [*position, *quaternion])) <= MAX_LINE_LENGTH + 1


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=2, max_size=40), st.data())
def test_the_checksum_detects_two_swapped_characters(text: str, data: st.DataObject) -> None:
    place = data.draw(st.integers(0, len(text) - 2))
    swapped = text[:place] + text[place + 1] + text[place] + text[place + 2 :]
    assert (check(text) == check(swapped)) is (text == swapped)


@pytest.mark.parametrize("raw", [b"", b"1 1 0", b"1 1 0*1", b"\xff\x00*3", b"1 1*260", b"a b c*571", b"*0"])
def test_a_garbled_answer_is_a_typed_error(raw: bytes) -> None:
    with pytest.raises(DeviceFault) as error:
        answer(raw)
    assert error.value.fault_code == "garbled"


def test_non_finite_numbers_are_not_sent() -> None:
    for value in (float("nan"), float("inf")):
        with pytest.raises(ValueError):
            line(1, Code.SPEED, [value, 1.0])


@pytest.mark.parametrize("arm", ["left", "right"])
def test_two_derivations_of_the_kinematics_agree(arm: str) -> None:
    low, high = kinematics.LIMITS.T
    q = np.random.default_rng(4).uniform(low, high, (50, 7))
    theirs = kinematics.Kinematics(arm).frames(q)
    assert nominal.frames(arm, q) == pytest.approx(theirs, abs=1e-9) or np.allclose(
        nominal.frames(arm, q)[:, 6], theirs[:, 6], atol=1e-9
    )


@pytest.mark.parametrize("arm", ["left", "right"])
def test_nominal_inverse_kinematics_inverts_forward_kinematics(arm: str) -> None:
    rng, home = np.random.default_rng(5), kinematics.HOME[arm]
    for _ in range(20):
        q = np.clip(home + rng.normal(0.0, 0.3, 7), *np.array(nominal.LIMITS).T)
        flange = nominal.frames(arm, q[None, :])[0, 6]
        found, missed = nominal.nearest(arm, flange, home)
        assert missed < 1e-4
        assert np.allclose(nominal.frames(arm, found[None, :])[0, 6], flange, atol=2e-4)


@pytest.fixture
def pair() -> Iterator[tuple[ArmLine, socket.socket]]:
    """Return a line whose other end is a socket of the test."""
    ours, theirs = socket.socketpair()
    watch, other_end = socket.socketpair()
    made = ArmLine("yumi", "left", "127.0.0.1", 1, lambda _: None)

    def keep_answering() -> None:
        rest = b""
        with contextlib.suppress(OSError):  # unread data at the end of the line cause a reset
            while data := other_end.recv(4096):
                *lines, rest = (rest + data).split(b"\n")
                for each in lines:
                    sequence, code, _ = protocol.parsed(each.decode())
                    other_end.sendall(protocol.framed(f"{sequence} {code} 0 0 1"))

    answering = threading.Thread(target=keep_answering)
    answering.start()
    made.attach(ours, watch, 0.4)
    yield made, theirs
    made.end(NotInControl("the test is over"))
    other_end.shutdown(socket.SHUT_RDWR)
    answering.join(20.0)
    for each in (theirs, other_end):
        each.close()


def test_a_late_answer_is_not_used_for_a_later_request(pair: tuple[ArmLine, socket.socket]) -> None:
    made, server = pair
    with pytest.raises(DeviceTimeout) as error:
        made.ask(Code.FORWARD_POSITION, within=0.1)
    assert "127.0.0.1:1" in str(error.value)
    first = server.recv(200).decode().strip()
    sequence = first.split()[0]
    answered: list[tuple[float, ...]] = []
    asking = threading.Thread(target=lambda: answered.append(made.ask(Code.FORWARD_POSITION)))
    asking.start()
    second = server.recv(200).decode().split()[0]
    assert second != sequence
    server.sendall(protocol.framed(f"{sequence} 41 0 1 1 1 1"))
    server.sendall(protocol.framed(f"{second} 40 0 2 2 2 2"))  # another command's code
    server.sendall(protocol.framed(f"{second} 41 0 3 3 3 3"))
    asking.join(30.0)
    assert answered == [(3.0, 3.0, 3.0, 3.0)]


def test_an_answer_received_in_pieces_is_joined(pair: tuple[ArmLine, socket.socket]) -> None:
    made, server = pair
    answered: list[tuple[float, ...]] = []
    asking = threading.Thread(target=lambda: answered.append(made.ask(Code.HAND_STATE)))
    asking.start()
    sequence = server.recv(200).decode().split()[0]
    whole = protocol.framed(f"{sequence} 53 0 12.5")
    for each in (whole[:3], whole[3:9], whole[9:]):
        server.sendall(each)
    asking.join(30.0)
    assert answered == [(12.5,)]


def test_garbage_ends_the_line(pair: tuple[ArmLine, socket.socket]) -> None:
    made, server = pair
    server.sendall(b"\x00\x01\x02 nonsense\n")
    with pytest.raises(DeviceFault) as error:
        made.ask(Code.HAND_STATE, within=30.0)
    assert error.value.fault_code == "garbled"

"""The fake YuMi on the wire: HTTP with digest authentication, motion servers, kinematics, motion, faults."""

import hashlib
import math
import re
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from arcor2_fakes.abb_yumi.arm import Motion
from arcor2_fakes.abb_yumi.kinematics import HOME, LIMITS, Kinematics, NotReachable, quaternion
from arcor2_fakes.abb_yumi.protocol import Rejected, framed, parsed
from arcor2_hw.testing.addresses import own_loopback
from tests.fakes.conftest import FakeProcess

HOST = own_loopback()
RWS, LEFT, RIGHT = 8080, 6101, 6111
AUTH = ("Default User", "robotics", "validusers@robapi.abb")


@pytest.fixture(scope="module")
def module_fake() -> Iterator[FakeProcess]:
    fake = FakeProcess("abb_yumi", "--host", HOST)
    fake.control.do("truth")
    yield fake
    fake.end()


@pytest.fixture
def fake(module_fake: FakeProcess) -> FakeProcess:
    module_fake.control.do("heal")
    module_fake.control.do("renew")
    return module_fake


class Http:
    """A minimal HTTP client: one request, one answer."""

    def __init__(self) -> None:
        self.socket = socket.create_connection((HOST, RWS), 2.0)
        self.cookie = ""

    def ask(self, method: str, target: str, body: str = "", authorization: str = "") -> tuple[int, str, str]:
        lines = [f"{method} {target} HTTP/1.1", f"Host: {HOST}", f"Content-Length: {len(body)}"]
        if authorization:
            lines.append(f"Authorization: {authorization}")
        if self.cookie:
            lines.append(f"Cookie: {self.cookie}")
        self.socket.sendall(("\r\n".join(lines) + "\r\n\r\n" + body).encode())
        data = b""
        while b"\r\n\r\n" not in data:
            data += self.socket.recv(65536)
        head, _, rest = data.partition(b"\r\n\r\n")
        length = re.search(rb"(?i)content-length: (\d+)", head)
        while length and len(rest) < int(length[1]):
            rest += self.socket.recv(65536)
        if found := re.search(rb"(?i)set-cookie: ([^;]+);", head):
            self.cookie = found[1].decode()
        return int(head.split()[1]), head.decode(), rest.decode()

    def login(self) -> None:
        status, head, _ = self.ask("GET", "/rw/system")
        assert status == 401
        nonce = re.search(r'nonce="(\w+)"', head)
        assert nonce is not None
        status, _, _ = self.ask("GET", "/rw/system", authorization=digest("GET", "/rw/system", nonce[1], AUTH[1]))
        assert status == 200
        assert self.cookie.startswith("-http-session-=")

    def close(self) -> None:
        self.socket.close()


def digest(method: str, uri: str, nonce: str, password: str) -> str:
    def md5(text: str) -> str:
        return hashlib.md5(text.encode()).hexdigest()

    user, _, realm = AUTH
    middle = f"{nonce}:00000001:abc:auth"
    answer = md5(f"{md5(f'{user}:{realm}:{password}')}:{middle}:{md5(f'{method}:{uri}')}")
    return (
        f'Digest username="{user}", realm="{realm}", nonce="{nonce}", uri="{uri}", '
        f'response="{answer}", qop=auth, nc=00000001, cnonce="abc"'
    )


@pytest.fixture
def http(fake: FakeProcess) -> Iterator[Http]:
    made = Http()
    made.login()
    yield made
    made.close()


class Line:
    """A client of one socket of the motion server."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection((HOST, port), 2.0)
        self.rest = b""
        self.sequence = 0

    def send(self, text: str) -> None:
        self.sequence += 1
        self.socket.sendall(framed(f"{self.sequence} {text}"))

    def receive(self, within: float = 20.0) -> list[float]:
        self.socket.settimeout(within)
        while b"\n" not in self.rest:
            data = self.socket.recv(4096)
            assert data, "closed"
            self.rest += data
        line, _, self.rest = self.rest.partition(b"\n")
        sequence, code, values = parsed(line.decode())
        return [sequence, code, *values]

    def ask(self, text: str) -> list[float]:
        self.send(text)
        return self.receive()[2:]

    def close(self) -> None:
        self.socket.close()


@pytest.fixture
def lines(fake: FakeProcess, http: Http) -> Iterator[Callable[[int], tuple[Line, Line]]]:
    """Start RAPID, and return the two sockets of an arm."""
    assert http.ask("POST", "/rw/mastership/rapid?action=request")[0] == 204
    assert http.ask("POST", "/rw/rapid/execution?action=resetpp")[0] == 204
    assert http.ask("POST", "/rw/rapid/execution?action=start")[0] == 204
    opened: list[Line] = []

    def connect(port: int) -> tuple[Line, Line]:
        pair = Line(port), Line(port + 1)
        opened.extend(pair)
        return pair

    yield connect
    for each in opened:
        each.close()


def test_a_wrong_password_is_refused(fake: FakeProcess) -> None:
    http = Http()
    _, head, _ = http.ask("GET", "/rw/system")
    nonce = re.search(r'nonce="(\w+)"', head)
    assert nonce is not None
    wrong = digest("GET", "/rw/system", nonce[1], "guess")
    assert http.ask("GET", "/rw/system", authorization=wrong)[0] == 401
    other_target = digest("GET", "/rw/panel/opmode", nonce[1], AUTH[1])
    assert http.ask("GET", "/rw/system", authorization=other_target)[0] == 401
    stale = digest("GET", "/rw/system", "0" * 32, AUTH[1])
    assert http.ask("GET", "/rw/system", authorization=stale)[0] == 401
    http.close()


def test_commands_need_mastership_of_their_session(http: Http) -> None:
    assert http.ask("POST", "/rw/rapid/execution?action=resetpp")[0] == 403
    assert http.ask("POST", "/rw/mastership/rapid?action=request")[0] == 204
    other = Http()
    other.login()
    status, _, body = other.ask("POST", "/rw/mastership/rapid?action=request")
    assert status == 403
    assert "Default User" in body
    assert http.ask("GET", "/logout")[0] == 200
    assert other.ask("POST", "/rw/mastership/rapid?action=request")[0] == 204
    other.close()


def test_motors_switch_on_only_in_automatic_mode(fake: FakeProcess, http: Http) -> None:
    target = "/rw/panel/ctrlstate?action=setctrlstate"
    fake.control.do("control_state", state="motoroff")
    fake.control.do("operation_mode", mode="MANR")
    assert http.ask("POST", target, "ctrl-state=motoron")[0] == 403
    fake.control.do("operation_mode", mode="AUTO")
    assert http.ask("POST", target, "ctrl-state=sideways")[0] == 400
    assert http.ask("POST", target, "ctrl-state=motoron")[0] == 204
    began = time.monotonic()
    fake.control.wait_until(lambda t: t["control_state"] == "motoron")
    assert time.monotonic() - began > 0.2
    fake.control.do("control_state", state="emergencystop")
    assert http.ask("POST", target, "ctrl-state=motoron")[0] == 403


def test_a_missing_resource_is_404(http: Http) -> None:
    for target in ("/", "/rw/nothing", "/rw/mastership/moon", "/rw/motionsystem/mechunits/ROB_X/jointtarget"):
        assert http.ask("GET", target)[0] == 404


def test_garbage_closes_the_http_connection(fake: FakeProcess) -> None:
    with socket.create_connection((HOST, RWS), 2.0) as raw:
        raw.sendall(b"\x00\x01 not http\r\n\r\n")
        raw.settimeout(2.0)
        assert raw.recv(100) == b""


def test_the_motion_server_checks_its_input(lines: Callable[[int], tuple[Line, Line]]) -> None:
    commands, watch = lines(LEFT)
    assert commands.ask("1") == [0, 1, 1]
    assert commands.ask("99") == [11]
    assert commands.ask("10 1") == [12]
    assert commands.ask("30 1") == [15]
    assert commands.ask("2 9") == [13]
    commands.socket.sendall(b"1 1*999\n")
    assert commands.receive()[2:] == [10]
    commands.socket.sendall(b"x" * 300 + b"\n")
    assert commands.receive()[2:] == [10]
    assert commands.ask("2 0.5") == [0]
    assert commands.ask("30 1") == [13]
    assert commands.ask("20 0 0 0 0 0 0 999") == [13]
    assert commands.ask("21 0 0 5000 0") == [13]
    assert commands.ask("22 1 1 1 1 0 0 0 0") == [13]
    assert watch.ask("90") == [0, 0, 1]
    assert watch.ask("30") == [11]
    right, _ = lines(RIGHT)
    assert right.ask("1") == [0, 1, 2]


def test_a_motion_is_answered_at_start_and_end(fake: FakeProcess, lines: Callable[[int], tuple[Line, Line]]) -> None:
    commands, watch = lines(LEFT)
    commands.ask("2 2")
    joints = [math.degrees(value) for value in HOME["left"]]
    joints[0] += 20.0
    assert commands.ask("20 " + " ".join(f"{value:.3f}" for value in joints)) == [0]
    began = time.monotonic()
    assert commands.ask("30 0.8") == [1]
    commands.send("10")  # not read while the arm moves
    watch.send("90")
    assert watch.receive(1.0)[2:] == [0, 1, 1]
    assert commands.receive()[1:] == [30, 0]
    assert time.monotonic() - began > 0.7
    assert commands.receive()[2:] == pytest.approx([0, *joints], abs=0.01)


def test_a_stop_is_answered_at_standstill(fake: FakeProcess, lines: Callable[[int], tuple[Line, Line]]) -> None:
    commands, watch = lines(RIGHT)
    commands.ask("2 2")
    joints = [math.degrees(value) for value in HOME["right"]]
    joints[5] += 100.0
    commands.ask("20 " + " ".join(f"{value:.3f}" for value in joints))
    commands.ask("30 3")
    fake.control.wait_until(lambda t: t["arms"]["right"]["speed"] > 0.3)
    sent = time.monotonic()
    assert watch.ask("91") == [0]
    assert fake.truth()["arms"]["right"]["speed"] == 0.0
    assert sent <= fake.control.do("stops")["right"][-1] <= time.monotonic()
    assert commands.receive()[1:] == [30, 2]
    assert abs(fake.truth()["arms"]["right"]["joints"][5]) < 99.0


def test_the_watchdog_stops_the_arm_without_keep_alives(
    fake: FakeProcess, lines: Callable[[int], tuple[Line, Line]]
) -> None:
    commands, _ = lines(LEFT)
    commands.ask("2 1")
    joints = [math.degrees(value) for value in HOME["left"]]
    joints[5] += 100.0
    commands.ask("20 " + " ".join(f"{value:.3f}" for value in joints))
    began = time.monotonic()
    commands.ask("30 3")
    assert commands.receive()[1:] == [30, 3]
    assert time.monotonic() - began > 0.9
    assert commands.ask("30 3") == [15]


def test_one_arm_waits_for_its_partner_for_a_limited_time(lines: Callable[[int], tuple[Line, Line]]) -> None:
    commands, watch = lines(LEFT)
    commands.ask("2 5")
    commands.ask("20 " + " ".join(f"{math.degrees(value):.3f}" for value in HOME["left"]))
    began = time.monotonic()
    commands.send("34 7 1")
    assert commands.receive()[1:] == [34, 20]
    assert time.monotonic() - began > 1.9
    commands.send("34 8 1")
    time.sleep(0.1)
    assert watch.ask("91") == [0]
    assert commands.receive()[1:] == [34, 2]


@pytest.mark.parametrize("arm", ["left", "right"])
def test_the_calibration_position_is_that_of_abb(arm: str) -> None:
    """From general knowledge of the robot: -9.58, +-182.61, 198.63 mm; 0.066, +-0.842, -0.111, +-0.523."""
    side = 1.0 if arm == "left" else -1.0
    flange = Kinematics(arm).forward(HOME[arm])
    assert flange[:3, 3] == pytest.approx([-0.00958, side * 0.18261, 0.19863], abs=1e-3)
    turned = np.array(quaternion(flange[:3, :3]))
    known = np.array([0.066, side * 0.8424, -0.1112, side * 0.5231])
    assert abs(float(turned @ known)) > 0.9999


@pytest.mark.parametrize("arm", ["left", "right"])
def test_inverse_kinematics_reach_pose_and_arm_angle(arm: str) -> None:
    kinematics, rng = Kinematics(arm), np.random.default_rng(3)
    found = 0
    for _ in range(30):
        q = np.clip(HOME[arm] + rng.normal(0.0, 0.4, 7), LIMITS[:, 0], LIMITS[:, 1])
        target = kinematics.describe(q)
        try:
            back = kinematics.reach(target, HOME[arm])
        except NotReachable:
            continue
        found += 1
        again = kinematics.describe(back)
        assert np.allclose(again.pose, target.pose, atol=1e-4)
        assert again.angle == pytest.approx(target.angle, abs=1e-3)
        assert again.configuration[:3] == target.configuration[:3]
    assert found >= 25


def test_a_motion_stays_within_axis_limits() -> None:
    start = HOME["left"]
    goal = start.copy()
    goal[0] += 2.0
    motion, dt, last, fastest, spent = Motion(np.array([start, goal]), 0.3), 0.002, start, 0.0, 0.0
    while not motion.advance(dt, 1.0):
        now = motion.at()
        fastest = max(fastest, float(np.abs(now - last).max()) / dt)
        last, spent = now, spent + dt
    assert fastest <= math.pi * 1.001
    assert spent > 2.0 / math.pi


@pytest.mark.parametrize("line", ["", "1", "1 1", "1 1*", "1 1*261", "a 1*1", "1 1 nan*100"])
def test_invalid_lines_are_rejected(line: str) -> None:
    with pytest.raises(Rejected):
        parsed(line)


def test_invalid_control_commands_are_refused(fake: FakeProcess) -> None:
    from arcor2_fakes.control import ControlError

    wrong: list[tuple[str, dict[str, Any]]] = [
        ("control_state", {"state": "sleepy"}),
        ("operation_mode", {"mode": "AUTOMATIC"}),
        ("collide", {"arm": "third"}),
        ("speed_ratio", {"percent": 120}),
        ("place", {"arm": "left", "joints": [0.0]}),
        ("place", {"arm": "left", "joints": [0.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0]}),
    ]
    for command, arguments in wrong:
        with pytest.raises(ControlError):
            fake.control.do(command, **arguments)

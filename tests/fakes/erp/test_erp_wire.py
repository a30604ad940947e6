"""The fake planning service, byte by byte: HTTP, idempotency keys, storage, injected faults."""

import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_fakes.control import ControlError, parse_address
from arcor2_fakes.erp.http import BadRequest, Requests
from tests.fakes.conftest import FakeProcess

RESULT = {"order": "A-1", "serial": "S", "passed": True, "note": "", "finished": "2026-01-01T00:00:00Z", "station": "c"}


def ask(fake: FakeProcess, method: str, path: str, key: str = "", body: Any = None) -> tuple[int, Any, str]:
    """Send a raw request; return status, body and head."""
    data = b"" if body is None else msgspec.json.encode(body)
    head = f"{method} {path} HTTP/1.1\r\nHost: x\r\nContent-Length: {len(data)}\r\nIdempotency-Key: {key}\r\n\r\n"
    with socket.create_connection(parse_address(fake.ready["url"].removeprefix("http://")), 30.0) as line:
        line.settimeout(30.0)
        line.sendall(head.encode() + data)
        came = b""
        while True:
            top, found, rest = came.partition(b"\r\n\r\n")
            if found:
                length = int(top.lower().split(b"content-length: ")[1].split(b"\r\n")[0])
                if len(rest) >= length:
                    return int(top.split(b" ")[1]), msgspec.json.decode(rest), top.decode()
            part = line.recv(4096)
            if not part:
                raise ConnectionResetError
            came += part


@pytest.fixture
def fake(start_fake: Callable[..., FakeProcess]) -> FakeProcess:
    return start_fake("erp", "--order", "A-1=PCB:2", "--order", "A-2=PCB:1")


def test_each_key_is_accepted_once(fake: FakeProcess) -> None:
    assert ask(fake, "GET", "/status")[:2] == (200, {"service": "Fake planning", "version": "1.4.0"})
    first = ask(fake, "POST", "/orders/next", "k1", {"station": "c"})
    assert first[:2] == (201, {"key": "k1", "order": {"id": "A-1", "product": "PCB", "quantity": 2}})
    again = ask(fake, "POST", "/orders/next", "k1", {"station": "c"})
    assert again[:2] == (200, {**first[1], "repeated": True})
    assert ask(fake, "POST", "/orders/next", "k2", {"station": "c"})[1]["order"]["id"] == "A-2"
    assert ask(fake, "POST", "/orders/next", "k3", {"station": "c"})[:2] == (200, {"key": "k3", "order": None})
    assert ask(fake, "POST", "/results", "k4", RESULT)[0] == 201
    assert ask(fake, "POST", "/results", "k4", RESULT)[0] == 200
    assert ask(fake, "POST", "/results", "k4", {**RESULT, "serial": "T"})[0] == 409
    assert fake.truth()["results"] == [RESULT]


@pytest.mark.parametrize(
    ("method", "path", "key", "body", "status"),
    [
        ("GET", "/nothing", "", None, 404),
        ("POST", "/status", "", None, 405),
        ("GET", "/results", "", None, 405),
        ("POST", "/results", "", RESULT, 400),
        ("POST", "/results", "k", {"order": "A-1"}, 422),
        ("POST", "/results", "k", {**RESULT, "order": "Z"}, 404),
        ("POST", "/orders/next", "k", [], 422),
    ],
)
def test_invalid_messages_are_refused(
    fake: FakeProcess, method: str, path: str, key: str, body: Any, status: int
) -> None:
    assert ask(fake, method, path, key, body)[0] == status
    assert fake.truth()["taken"] == 0


def test_injected_faults_take_effect(fake: FakeProcess) -> None:
    fake.control.do("lose_answers", count=1)
    with pytest.raises(ConnectionError):
        ask(fake, "POST", "/results", "k1", RESULT)
    assert len(fake.truth()["results"]) == 1
    fake.control.do("fail", status=503, count=1, retry_after=7)
    status, _, head = ask(fake, "POST", "/results", "k2", RESULT)
    assert status == 503
    assert "Retry-After: 7" in head
    assert len(fake.truth()["results"]) == 1
    fake.control.do("fail", status=500, count=1, done=True)
    assert ask(fake, "POST", "/results", "k2", RESULT)[0] == 500
    assert len(fake.truth()["results"]) == 2
    with pytest.raises(ControlError, match="status"):
        fake.control.do("fail", status=299)
    with pytest.raises(ControlError, match="quantity"):
        fake.control.do("add_order", order="A-1", product="PCB")


def test_a_power_cycle_keeps_accepted_messages(fake: FakeProcess) -> None:
    ask(fake, "POST", "/results", "k1", RESULT)
    fake.control.do("power_cycle", seconds=0.2)
    with pytest.raises(OSError):
        ask(fake, "GET", "/status")
    fake.control.do("heal")
    assert ask(fake, "POST", "/results", "k1", RESULT)[0] == 200
    assert len(fake.truth()["results"]) == 1


def test_the_store_survives_the_process(start_fake: Callable[..., FakeProcess], tmp_path: Path) -> None:
    arguments = ("erp", "--store", str(tmp_path / "plan"), "--order", "A-1=PCB:2", "--order", "A-2=PCB:1")
    first = start_fake(*arguments)
    ask(first, "POST", "/orders/next", "k1", {"station": "c"})
    ask(first, "POST", "/results", "k2", RESULT)
    ask(first, "POST", "/orders/close", "k3", {"order": "A-1", "reason": "r", "finished": "f", "station": "c"})
    truth = first.truth()
    first.process.kill()
    second = start_fake(*arguments)
    assert {key: second.truth()[key] for key in ("orders", "results", "taken")} == {
        key: truth[key] for key in ("orders", "results", "taken")
    }
    assert ask(second, "POST", "/results", "k2", RESULT)[0] == 200


def test_a_token_is_required(start_fake: Callable[..., FakeProcess]) -> None:
    assert ask(start_fake("erp", "--token", "t"), "GET", "/status")[0] == 401


def test_fragmented_and_pipelined_requests_are_served() -> None:
    raw = b"POST /a HTTP/1.1\r\nContent-Length: 3\r\nX-Y: z\r\n\r\nabcGET /b HTTP/1.1\r\n\r\n"
    whole = [(each.method, each.path, each.body) for each in Requests().feed(raw)]
    assert whole == [("POST", "/a", b"abc"), ("GET", "/b", b"")]
    pieces = Requests()
    found = [each for byte in raw for each in pieces.feed(bytes([byte]))]
    assert [(each.method, each.path, each.body) for each in found] == whole
    assert found[0].headers["x-y"] == "z"


@pytest.mark.parametrize(
    "raw",
    [
        b"nonsense\r\n\r\n",
        b"GET / HTTP/1.0\r\n\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: x\r\n\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: 99999999\r\n\r\n",
        b"POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n",
        b"x" * 20000,
    ],
)
def test_invalid_requests_are_refused(raw: bytes) -> None:
    with pytest.raises(BadRequest):
        list(Requests().feed(raw))

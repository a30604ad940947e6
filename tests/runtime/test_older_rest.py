"""REST client, JSON and action metadata of older sources: requests, answers and errors."""

import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from typing import Any

import pytest
from PIL import Image

from arcor2_hw.actions import action, deadline_of
from arcor2_hw.actions.decorator import DEFAULT_DEADLINE, OLDER_DEADLINE, StrEnum
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import ActionMetadata
from arcor2_hw.exceptions import DeviceError
from arcor2_hw.runtime.older import json as older_json, rest


class Service(ThreadingHTTPServer):
    daemon_threads = False

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.received_requests: list[tuple[str, str, bytes]] = []
        self.content: bytes = b""
        self.status = 200
        self.delay = 0.0
        self.connections = 0
        self.go_on = threading.Event()


class Handler(BaseHTTPRequestHandler):
    server: Service
    protocol_version = "HTTP/1.1"

    def setup(self) -> None:
        super().setup()
        self.server.connections += 1

    def record(self) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        self.server.received_requests.append((self.command, self.path, body))
        self.server.go_on.wait(self.server.delay)
        self.send_response(self.server.status)
        self.send_header("Content-Length", str(len(self.server.content)))
        self.end_headers()
        self.wfile.write(self.server.content)

    do_GET = do_PUT = do_POST = do_DELETE = do_PATCH = record  # noqa: N815

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        pass


@pytest.fixture
def service() -> Iterator[Service]:
    server = Service()
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    yield server
    server.go_on.set()
    rest.close()
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def url(service: Service) -> str:
    return f"http://127.0.0.1:{service.server_address[1]}/x"


class Kind(StrEnum):
    FAST = "fast"


@dataclass
class Order:
    order_id: str
    some_kind: Kind
    where_to: Pose
    not_given: int | None = None


class Own:
    """A class with its own conversion to and from dictionaries."""

    def __init__(self, value: int) -> None:
        self.value = value

    def to_dict(self) -> dict[str, Any]:
        return {"own_value": self.value}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> "Own":
        return cls(data["own_value"])


def test_requests_are_camel_case_and_results_snake_case(service: Service, url: str) -> None:
    order = Order("o1", Kind.FAST, Pose(Position(1, 2, 3)))
    service.content = b'{"orderId": "o2", "someKind": "fast", "whereTo": {"position": {"x": 1}}}'
    params = {"how_many": 2, "really": True, "kind": Kind.FAST, "left_out": None}
    found = rest.call(rest.Method.PUT, url, body=order, params=params, return_type=Order)
    assert found == Order("o2", Kind.FAST, Pose(Position(1)))
    method, path, body = service.received_requests[0]
    assert (method, path) == ("PUT", "/x?howMany=2&really=true&kind=fast")
    sent = json.loads(body)
    assert list(sent) == ["orderId", "someKind", "whereTo"]
    assert sent["whereTo"]["position"] == {"x": 1, "y": 2, "z": 3}


def test_results_are_converted_to_lists_scalars_bytes_and_classes(service: Service, url: str) -> None:
    service.content = b"[1, 2.5]"
    assert rest.call(rest.Method.GET, url, list_return_type=float) == [1.0, 2.5]
    assert rest.call(rest.Method.GET, url, return_type=bytes) == b"[1, 2.5]"
    assert rest.call(rest.Method.DELETE, url) is None
    service.content = b'[{"ownValue": 1}, {"ownValue": 2}]'
    found = rest.call(rest.Method.POST, url, body=[Own(3)], list_return_type=Own)
    assert [one.value for one in found] == [1, 2]
    assert service.received_requests[-1][2] == b'[{"ownValue":3}]'
    assert service.connections == 1  # kept open between calls


def test_a_picture_is_fetched(service: Service, url: str) -> None:
    with BytesIO() as file:
        Image.new("RGB", (4, 3), (1, 2, 3)).save(file, "PNG")
        service.content = file.getvalue()
    assert rest.get_image(url).size == (4, 3)
    service.content = b"no picture"
    with pytest.raises(rest.RestException, match="not a picture"):
        rest.get_image(url)


@pytest.mark.parametrize(
    ("status", "content", "words"),
    [
        (500, b'{"service":"S","message":"The gripper is open.","type":"General","description":""}', "gripper is open"),
        (404, b"<html>", "404 Not Found"),
        (409, b'{"message": null}', "409 Conflict"),
        (400, b"[]", "400 Bad Request"),
    ],
)
def test_an_error_has_the_message_of_the_service(
    service: Service, url: str, status: int, content: bytes, words: str
) -> None:
    service.status, service.content = status, content
    with pytest.raises(rest.RestHttpException, match=words) as caught:
        rest.call(rest.Method.PUT, url)
    assert caught.value.error_code == status
    assert f"PUT {url}" in str(caught.value)
    assert isinstance(caught.value, DeviceError)


@pytest.mark.parametrize(("content", "kind"), [(b"", int), (b"{", int), (b'"x"', int), (b"[]", Pose), (b"{}", Own)])
def test_an_invalid_answer_is_named(service: Service, url: str, content: bytes, kind: Any) -> None:
    service.content = content
    with pytest.raises(rest.RestException, match="not valid") as caught:
        rest.call(rest.Method.GET, url, return_type=kind)
    assert url in str(caught.value)


def test_a_silent_service_times_out(service: Service, url: str) -> None:
    service.delay = 30.0
    with pytest.raises(rest.RestException, match=r"PUT http://.*: no answer in time"):
        rest.call(rest.Method.PUT, url, timeout=rest.Timeout(read=0.2))
    with pytest.raises(rest.RestException, match="GET nowhere"):
        rest.call(rest.Method.GET, "nowhere")


def test_json_functions_convert_and_refuse() -> None:
    assert older_json.loads('{"a": [1, 2.0, null]}') == {"a": [1, 2.0, None]}
    assert older_json.loads_type("1", int) == 1
    assert json.loads(older_json.dumps({"pose": Pose(), "kind": Kind.FAST}))["kind"] == "fast"
    for wrong in ("", "{", "\ud800", b"\xff"):
        with pytest.raises(older_json.JsonException):
            older_json.loads(wrong)
    for text, kind in (("1", float), ("true", int), ("null", str)):
        with pytest.raises(older_json.JsonException, match=kind.__name__):
            older_json.loads_type(text, kind)
    with pytest.raises(older_json.JsonException):
        older_json.dumps(object())


def test_an_older_action_has_a_long_deadline() -> None:
    class Arm:
        def home(self, *, an: str | None = None) -> None: ...

        home.__action__ = ActionMetadata()  # type: ignore[attr-defined]

        @action
        def grip(self, *, an: str | None = None) -> None: ...

        @action(deadline=None)
        def wait(self, *, an: str | None = None) -> None: ...

        def pose(self) -> None: ...

    found = [deadline_of(getattr(Arm(), name)) for name in ("home", "grip", "wait", "pose")]
    assert found == [OLDER_DEADLINE, DEFAULT_DEADLINE, None, DEFAULT_DEADLINE]

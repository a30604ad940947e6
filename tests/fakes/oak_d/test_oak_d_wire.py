"""The fake camera as a client sees it: bytes of the stream, the scene, faults."""

import contextlib
import json
import socket
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arcor2_fakes.control import ControlError
from arcor2_fakes.oak_d.optics import Lens
from tests.fakes.conftest import FakeProcess, start_fake

__all__ = ["start_fake"]

WIDTH, HEIGHT = 320, 180
START_BGR = bytes.fromhex("4f414b53 01 02 001f 00000000 65f5c599") + b'{"client":"test","color":"bgr"}'
"""A start message: "OAKS", version 1, kind 2, 31 bytes of header, no payload, checksum."""


class Client:
    def __init__(self, address: str) -> None:
        host, port = address.rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), 20.0)

    def close(self) -> None:
        self.socket.close()

    def take(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            got = self.socket.recv(count - len(data))
            assert got, "the source closed the connection"
            data += got
        return data

    def message(self) -> tuple[int, dict[str, Any], bytes]:
        fixed = self.take(16)
        magic, version, kind, header, payload, check = struct.unpack(">4sBBHII", fixed)
        assert (magic, version) == (b"OAKS", 1)
        text = self.take(header)
        assert check == zlib.crc32(fixed[:12] + text)
        return kind, json.loads(text), self.take(payload)

    def frame(self) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
        while True:
            kind, header, payload = self.message()
            if kind == 3:
                size = header["color_bytes"]
                assert len(payload) == size + header["depth_bytes"]
                color = np.frombuffer(payload[:size], np.uint8).reshape(HEIGHT, WIDTH, 3)
                return header, color, np.frombuffer(payload[size:], "<u2").reshape(-1, WIDTH)

    def send(self, kind: int, **header: Any) -> None:
        text = json.dumps(header).encode()
        front = struct.pack(">4sBBHI", b"OAKS", 1, kind, len(text), 0)
        self.socket.sendall(front + struct.pack(">I", zlib.crc32(front + text)) + text)


@pytest.fixture(scope="module")
def running() -> Iterator[FakeProcess]:
    with FakeProcess("oak_d", "--width", str(WIDTH), "--height", str(HEIGHT)) as fake:
        yield fake


@pytest.fixture
def fake(running: FakeProcess) -> FakeProcess:
    running.control.do("heal")
    running.control.do("scene", things=[])
    return running


@pytest.fixture
def client(fake: FakeProcess) -> Iterator[Client]:
    made = Client(fake.ready["stream"])
    yield made
    made.close()


def box(name: str, x: float, **more: Any) -> dict[str, Any]:
    return {"name": name, "pose": {"position": [x, 0.0, 0.05]}, "size": [0.1, 0.1, 0.1], **more}


def test_a_stream_starts_with_hello_and_frames(fake: FakeProcess, client: Client) -> None:
    kind, hello, eeprom = client.message()
    assert kind == 1
    assert (hello["width"], hello["height"], hello["fps"]) == (WIDTH, HEIGHT, 30.0)
    [[socket_number, camera]] = json.loads(eeprom)["cameraData"]
    lens = Lens(WIDTH, HEIGHT)
    assert (socket_number, camera["width"], camera["intrinsicMatrix"][0][0]) == (0, WIDTH, lens.fx)
    before = fake.truth()
    assert before["watching"] == []
    client.socket.sendall(START_BGR)
    numbers, stamps = [], []
    for _ in range(10):
        header, color, depth = client.frame()
        numbers.append(header["number"])
        stamps.append(header["stamp"])
    assert numbers[0] == before["frames"]  # none was made before the client asked
    assert np.diff(numbers).min() >= 1
    assert np.diff(stamps).min() > 0.0
    assert stamps[-1] - stamps[0] > 8 / 30.0  # 9 periods; a delayed camera catches up one of them
    assert np.median(depth) == pytest.approx(800, abs=2)
    assert color.std() > 1.0  # noise
    assert fake.truth()["watching"] == ["test"]
    assert fake.truth()["rendered"] <= before["rendered"] + 2  # the scene does not change, so it is not rendered again
    client.send(4, asked=12.5)
    while (answer := client.message())[0] != 4:
        pass
    assert answer[1]["asked"] == 12.5
    assert answer[1]["at"] >= stamps[-1]


def test_the_scene_follows_the_world(fake: FakeProcess, client: Client) -> None:
    client.message()
    client.socket.sendall(START_BGR)
    fake.control.do("scene", things=[box("a", 0.15, color=[250, 0, 0]), box("b", -0.15, color=[0, 0, 250])])

    def columns() -> tuple[float, float]:
        """Return the columns of red and blue in the picture."""
        for _ in range(4):  # skip frames made before
            _, color, _ = client.frame()
        red = np.nonzero(color[..., 2].astype(int) - color[..., 0] > 100)[1]
        blue = np.nonzero(color[..., 0].astype(int) - color[..., 2] > 100)[1]
        return float(red.mean()) if len(red) else -1.0, float(blue.mean()) if len(blue) else -1.0

    red, blue = columns()
    assert red > WIDTH * 0.6
    assert 0 <= blue < WIDTH * 0.4
    fake.control.do("move", name="a", pose={"position": [0.0, 0.0, 0.05]})
    assert columns()[0] == pytest.approx(WIDTH / 2, abs=8)
    fake.control.do("move", poses={"a": {"position": [-0.15, 0.0, 0.05]}, "b": {"position": [0.15, 0.0, 0.05]}})
    red, blue = columns()
    assert red < WIDTH * 0.4 < WIDTH * 0.6 < blue
    fake.control.do("remove", name="a")
    assert columns()[0] == -1.0
    fake.control.do("scene", things=[])
    assert columns() == (-1.0, -1.0)
    for command, wrong in (
        ("move", {"name": "c", "pose": {"position": [0, 0, 0]}}),
        ("move", {"name": "c"}),
        ("place", {"thing": {"name": "c", "pose": {"position": [0, 0, 0]}}}),
        ("place", {"thing": box("c", float(10**6)) | {"size": [-1, 1, 1]}}),
        ("place", {"thing": {"name": "c", "pose": {"position": [0, 0, 0]}, "mesh": "/nowhere.stl"}}),
        ("scene", {"things": [box("c", 0.0), box("c", 0.1)]}),
        ("camera", {"pose": {"position": [0, 0, 0], "orientation": [0, 0, 0, 0]}}),
        ("remove", {"name": "c"}),
        ("overheat", {"temperature": 500}),
    ):
        with pytest.raises(ControlError):
            fake.control.do(command, **wrong)
    assert fake.truth()["things"] == []


def test_a_marker_is_detected_at_its_pose() -> None:
    import cv2

    from arcor2_fakes.oak_d.render import Renderer
    from arcor2_fakes.oak_d.scene import Pose, Scene

    lens = Lens(1280, 720)
    scene = Scene(Pose((0.0, 0.0, 0.6), (1.0, 0.0, 0.0, 0.0)), 0.0)
    scene.replace([box("a", 0.08, marker={"id": 7, "size": 0.06})])
    view = Renderer(lens).view(scene.camera, 0.0, scene.things)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    corners, ids, _ = detector.detectMarkers(view.color)
    assert np.ravel(ids).tolist() == [7]
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    truth = np.array([[x, -y, 0.5] for x, y in ((0.05, 0.03), (0.11, 0.03), (0.11, -0.03), (0.05, -0.03))])
    seen, _ = cv2.projectPoints(truth, np.zeros(3), np.zeros(3), matrix, np.array(lens.distortion))
    assert np.abs(np.asarray(corners[0]).reshape(4, 2) - seen[:, 0]).max() < 1.0  # pixels


def test_invalid_requests_are_refused(fake: FakeProcess) -> None:
    for wrong in (b"GET / HTTP/1.1\r\n\r\n", START_BGR[:12] + b"\0\0\0\0" + START_BGR[16:], b"OAKS\x02" + bytes(11)):
        with contextlib.closing(Client(fake.ready["stream"])) as client:
            client.message()
            client.socket.sendall(wrong)
            kind, header, _ = client.message()
            assert kind == 7
            assert header["reason"] in ("not a message of version 1", "wrong checksum")
            assert client.socket.recv(1) == b""


def exhaust(client: Client) -> None:
    for _ in range(50):
        client.frame()


def test_faults_of_the_wire_can_be_injected(fake: FakeProcess, client: Client) -> None:
    client.message()
    client.socket.sendall(START_BGR)
    client.frame()
    fake.control.do("depth_off")
    assert any(client.frame()[2].size == 0 for _ in range(6))
    fake.control.do("frozen")
    stamps = [client.frame()[0]["stamp"] for _ in range(8)]
    assert stamps[-1] == stamps[-2] == stamps[-3]
    fake.control.do("heal")
    fake.control.do("overheat", temperature=106)
    with pytest.raises((AssertionError, ConnectionResetError)):
        exhaust(client)
    assert fake.truth()["off"]


def test_a_scene_from_a_file(start_fake: Any, tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    file.write_text(json.dumps({"things": [box("a", 0.1)], "table_height": -0.1}))
    truth = start_fake("oak_d", "--scene", str(file)).truth()
    assert (truth["things"][0]["name"], truth["table_height"]) == ("a", -0.1)

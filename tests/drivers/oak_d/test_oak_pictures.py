"""Pictures of the OAK-D from a rendering fake: they match the scene, are synchronous and current."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import ColorCoding, OakDSettings
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.exceptions import NotConnected, OutOfRange
from arcor2_hw.objects.camera import Mode
from arcor2_hw.objects.frame import Frame, PictureNote, rays
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

from .conftest import PATIENCE


def in_world(camera: OakD, frame: Frame) -> np.ndarray:
    """Return the points of a frame in the world; the camera is above the table and points down."""
    points = camera.point_cloud(frame)
    return np.stack([points[..., 0], -points[..., 1], 0.8 - points[..., 2]], axis=-1)


def test_connecting_sets_nothing_and_imports_late(fake: FakeProcess, camera: OakD) -> None:
    camera.connect()  # has no effect when connected
    assert camera.identify() == Identity("Luxonis", "OAK-D (fake)", "FAKE000000000001", "fake 1.0")
    assert (camera.connection, camera.health, camera.alarms()) == (Connection.ONLINE, Health.NORMAL, [])
    assert fake.truth()["received"] == []
    assert camera.modes() == [Mode(640, 360, 30.0)]
    assert camera.depth_range() == (0.2, 10.0)
    assert camera.distortion_model() == "opencv 5"
    parameters = camera.color_camera_params
    assert parameters is not None
    assert parameters.fx == pytest.approx(456.25)
    assert parameters.dist_coefs == pytest.approx([0.08, -0.14, 0.0004, -0.0006, 0.05])
    camera.disconnect()
    with pytest.raises(NotConnected, match=f"^camera at {fake.ready['stream']} is not connected"):
        camera.capture()
    fake.control.wait_until(lambda truth: truth["clients"] == 0)
    sent = -1
    for _ in range(10):  # pictures being rendered are completed
        before, sent = sent, fake.truth()["frames"]
        if before == sent:
            break
        time.sleep(0.3)
    assert before == sent  # without a client it does nothing
    code = "import sys, arcor2_drivers.oak_d.oak_d; sys.exit('depthai' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_points_match_the_scene(camera: OakD) -> None:
    frame = camera.trigger()
    assert frame.depth is not None
    assert frame.color.shape == (360, 640, 3)
    assert frame.exposure == pytest.approx(0.01)
    points = in_world(camera, frame)
    red = (frame.color[..., 0] > 120) & (frame.color[..., 1] < 90)
    top = points[red & (points[..., 2] > 0.04)]
    middle = np.median(top, axis=0)
    assert middle == pytest.approx([0.1, 0.05, 0.06], abs=0.0015)
    assert np.ptp(np.percentile(top[:, 0], [2, 98])) == pytest.approx(0.08, abs=0.006)
    table = points[~red]
    assert np.nanmedian(table[:, 2]) == pytest.approx(0.0, abs=0.001)
    spread = np.nanstd(table[np.abs(table[:, 2]) < 0.01][:, 2])
    assert 0.0005 < spread < 0.003  # the noise of stereo at 0.8 m
    # The lens distorts the corner of the picture: without undistortion, it would be off by 6 mm.
    assert camera.color_camera_params is not None
    straight = (10 - camera.color_camera_params.cx) / camera.color_camera_params.fx
    assert abs(rays(camera.color_camera_params, 640, 360)[10, 10, 0] - straight) > 0.003


def test_colour_and_depth_are_synchronous(fake: FakeProcess, camera: OakD) -> None:
    """The board's red and its height are at the same place in every frame, while it moves."""
    stop = threading.Event()

    def move_board() -> None:
        step = 0
        while not stop.wait(0.02):
            step += 1
            x = 0.15 * np.sin(step / 5.0)
            fake.control.do("move", name="board", pose={"position": [float(x), 0.0, 0.03]})

    thread = threading.Thread(target=move_board)
    thread.start()
    try:
        places = []
        for _ in range(8):
            frame = camera.trigger()
            points = in_world(camera, frame)
            red = (frame.color[..., 0] > 120) & (frame.color[..., 1] < 90)
            high = points[..., 2] > 0.04
            assert (red & high).sum() > 0.8 * high.sum()
            places.append(float(np.median(points[high][:, 0])))
    finally:
        stop.set()
        thread.join()
    assert np.ptp(places) > 0.02


def test_pictures_are_taken_after_the_call(fake: FakeProcess, camera: OakD) -> None:
    for x in (-0.1, 0.0, 0.1):
        fake.control.do("move", name="board", pose={"position": [x, 0.0, 0.03]})
        began = time.monotonic()
        frame = camera.trigger()
        assert frame.monotonic > began
        points = in_world(camera, frame)
        assert np.median(points[points[..., 2] > 0.04][:, 0]) == pytest.approx(x, abs=0.003)
        picture = np.asarray(camera.color_image())
        red = (picture[..., 0] > 120) & (picture[..., 1] < 90)
        columns = np.nonzero(red)[1]
        assert (columns.mean() - 321.15) / 456.25 * 0.75 == pytest.approx(x, abs=0.008)


def test_depth_pictures_carry_their_parameters(camera: OakD) -> None:
    one, many = camera.depth_image(), camera.depth_image(12)
    assert one.mode == "I;16"
    assert one.size == (640, 360)
    note = PictureNote.of(one)
    assert note.camera == "camera"
    assert note.pose == camera.pose
    assert note.parameters == camera.color_camera_params

    def noise(picture: object) -> float:
        depth = np.asarray(picture)[200:300, 50:150].astype(float)
        return float(np.std(depth[depth > 0]))

    assert noise(many) < 0.75 * noise(one)
    with pytest.raises(OutOfRange, match="averaged_frames"):
        camera.depth_image(0)


def test_exposure_is_set(fake: FakeProcess, camera: OakD) -> None:
    bright = np.asarray(camera.color_image()).mean()
    camera.fix_exposure(0.004)
    assert fake.truth()["exposure"] == pytest.approx(0.004)
    frame = wait_for(camera.trigger, lambda frame: frame.exposure == pytest.approx(0.004))
    assert frame.color.mean() == pytest.approx(0.4 * bright, rel=0.1)
    camera.auto_exposure()
    assert fake.truth()["exposure"] is None
    for wrong in (0.0, 0.034, float("nan")):
        with pytest.raises(OutOfRange, match=f"^camera at {fake.ready['stream']}: exposure must be"):
            camera.fix_exposure(wrong)
    assert len(fake.truth()["received"]) == 2


def test_several_hosts_receive_jpeg(fake: FakeProcess, camera: OakD, make: Callable[..., OakD]) -> None:
    second = make(fake.ready["stream"], color_coding=ColorCoding.JPEG)
    second.connect(PATIENCE)
    raw, packed = camera.trigger(), second.trigger()
    assert packed.color.shape == raw.color.shape
    assert np.abs(raw.color.astype(int) - packed.color).mean() < 5.0
    assert sorted(fake.truth()["watching"]) == ["camera", "camera"]


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"address": "host:0:1"}, "address"),
        ({"address": "host:99999"}, "address"),
        ({"fps": 0.5}, "fps"),
        ({"fps": float("nan")}, "fps"),
        ({"max_age": 0.01}, "max_age"),
        ({"max_age": float("inf")}, "max_age"),
        ({"frame_timeout": 0.05}, "frame_timeout"),
        ({"white_limit": 0.0}, "white_limit"),
    ],
)
def test_settings_are_checked(wrong: dict[str, object], named: str) -> None:
    with pytest.raises(OutOfRange, match=f"^{named} must be"):
        OakDSettings(**wrong)  # type: ignore[arg-type]


def test_every_form_of_address_is_parsed() -> None:
    assert OakDSettings(" 10.0.0.7:5005 ").network == ("10.0.0.7", 5005)
    assert OakDSettings("[::1]:5005").network == ("::1", 5005)
    for camera in ("", "14442C10D13EABCE00", "192.168.1.20"):
        assert OakDSettings(camera).network is None

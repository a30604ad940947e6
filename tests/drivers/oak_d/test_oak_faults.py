"""Faults of the OAK-D: each is a typed error that names the camera, and the driver recovers."""

import contextlib
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import psutil
import pytest

from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_hw.data.device import Connection, Health
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceFault,
    DeviceTimeout,
    NoDepth,
    NotConnected,
    Overexposed,
    Stale,
)
from arcor2_hw.testing.life import BackgroundCall
from tests.fakes.conftest import FakeProcess
from tests.waiting import wait_for

from .conftest import PATIENCE


def fresh(camera: OakD) -> bool:
    try:
        camera.capture()
    except (Stale, ConnectionLost):
        return False
    return True


def back(camera: OakD) -> None:
    wait_for(lambda: camera.connection is Connection.BACK)
    wait_for(lambda: fresh(camera))


def test_a_frozen_picture_is_stale(fake: FakeProcess, camera: OakD) -> None:
    fake.control.do("frozen")
    time.sleep(0.6)
    with pytest.raises(Stale, match=f"^camera at {fake.ready['stream']}: the newest image is .* s old"):
        camera.capture()
    with pytest.raises(Stale, match=r"camera at .* sent no new image|the newest image"):
        camera.color_image()
    wait_for(lambda: camera.alarms())
    assert [alarm.code for alarm in camera.alarms()] == ["frozen"]
    assert camera.health is Health.FAILURE
    assert camera.connection is Connection.ONLINE  # it does send pictures
    fake.control.do("heal")
    wait_for(lambda: not camera.alarms())
    wait_for(lambda: fresh(camera))


def next_frame(camera: OakD) -> None:
    """Wait for a frame that shows changes made before the call."""
    with contextlib.suppress(DeviceFault):
        camera.trigger()


def test_invalid_pictures_are_errors(fake: FakeProcess, camera: OakD) -> None:
    fake.control.do("lens_covered")
    next_frame(camera)
    with pytest.raises(DeviceFault, match=r"^camera at .*: the image is black") as covered:
        camera.color_image()
    assert covered.value.fault_code == "dark"
    with pytest.raises(NoDepth, match=r"^camera at .*: only 0\.0% of the image has valid depth"):
        camera.depth_image()
    fake.control.do("heal")
    fake.control.do("overexposed")
    next_frame(camera)
    with pytest.raises(Overexposed, match=r"^camera at .* of the image is white"):
        camera.color_image()
    assert camera.depth_image().size == (640, 360)
    fake.control.do("heal")
    fake.control.do("depth_off")
    next_frame(camera)
    assert camera.color_image().size == (640, 360)
    frame = camera.trigger()
    assert frame.depth is None
    with pytest.raises(NoDepth, match="camera: the frame has no depth"):
        camera.point_cloud(frame)
    with pytest.raises(NoDepth):
        camera.depth_image()


def test_overheating_is_reported_before_shutdown(fake: FakeProcess, camera: OakD) -> None:
    fake.control.do("overheat", temperature=95)
    wait_for(lambda: camera.alarms())
    [alarm] = camera.alarms()
    assert (alarm.code, camera.health) == ("hot", Health.OFF_SPEC)
    assert camera.trigger().depth is not None
    fake.control.do("overheat", temperature=106)
    wait_for(lambda: camera.connection is Connection.LOST)
    fake.control.do("heal")
    back(camera)
    wait_for(lambda: not camera.alarms())


def test_the_exposure_is_restored_after_a_power_cycle(fake: FakeProcess, camera: OakD) -> None:
    camera.set_exposure(0.005)
    fake.control.do("power_cycle")
    wait_for(lambda: camera.connection is Connection.BACK)
    assert fake.truth()["exposure"] == pytest.approx(0.005)
    frame = camera.trigger()  # its clock restarted; ages are correct nevertheless
    assert time.monotonic() - frame.monotonic < 30.0


@pytest.mark.parametrize("fault", ["half_frame", "garbage", "wrong_checksum", "reset"])
def test_a_broken_stream_is_a_loss_and_recovers(fake: FakeProcess, camera: OakD, fault: str) -> None:
    fake.control.do(fault)
    wait_for(lambda: camera.connection is not Connection.ONLINE)
    if fault != "reset":
        with pytest.raises((ConnectionLost, DeviceFault), match=r"camera at 127\.0\.0\.1"):
            camera.capture()
    fake.control.do("heal")
    back(camera)


def test_a_slow_stream_gives_stale_pictures(fake: FakeProcess, camera: OakD) -> None:
    fake.control.do("slow", seconds=0.7)
    time.sleep(0.2)
    wait_for(lambda: not fresh(camera))
    fake.control.do("heal")
    wait_for(lambda: camera.connection is not Connection.LOST)
    wait_for(lambda: fresh(camera))


def test_another_protocol_is_refused(fake: FakeProcess, make: Callable[..., OakD]) -> None:
    control = make(fake.ready["control"])  # this server sends nothing before a request
    with pytest.raises(DeviceTimeout, match=f"^camera at {fake.ready['control']} sends nothing"):
        control.connect(0.5)
    fake.control.do("wrong_checksum")
    with pytest.raises(DeviceFault, match="the checksum of a message of kind hello is wrong"):
        make(fake.ready["stream"]).connect(2.0)


FORGETFUL = """
import sys
import threading
from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import OakDSettings
from arcor2_hw.data.geometry import Pose
camera = OakD("id", "camera", Pose(), None, OakDSettings(sys.argv[1]))
camera.connect(20.0)
kept = camera.trigger(), camera.newest(1.0)
"""


def test_a_program_that_does_not_disconnect_ends_cleanly(fake: FakeProcess) -> None:
    """depthai terminates the process if a pipeline still exists when the interpreter ends."""
    ended = subprocess.run(
        [sys.executable, "-c", FORGETFUL, fake.ready["stream"]], capture_output=True, text=True, timeout=60
    )
    assert (ended.returncode, ended.stderr) == (0, "")


def test_repeated_connections_leak_nothing(fake: FakeProcess, camera: OakD) -> None:
    process = psutil.Process()
    counts = []
    for _ in range(6):
        camera.disconnect()
        camera.connect(PATIENCE)
        counts.append((process.num_threads(), process.num_fds()))
    for held in zip(*counts, strict=True):
        assert max(held[3:]) <= max(held[:3]) + 1


def test_a_missing_camera_is_reported_at_once(make: Callable[..., OakD], monkeypatch: pytest.MonkeyPatch) -> None:
    import depthai as dai

    class NoDevice:
        """A missing device, whose opening would take 11.5 s."""

        getAllAvailableDevices = staticmethod(list)  # noqa: N815

        def __init__(self, *_: object) -> None:
            pytest.fail("it tries to open a missing device")

    monkeypatch.setattr(dai, "Device", NoDevice)
    for address, who in (("", "the only camera"), ("14442C10D13EABCE00", "14442C10D13EABCE00")):
        camera = make(address)
        with pytest.raises(NotConnected, match=f"^camera at {who} was not found") as raised:
            camera.connect(PATIENCE)
        assert raised.value.detail == "found: none"
    with pytest.raises(NotConnected, match=r"^camera at 127\.0\.0\.9 cannot be reached"):
        make("127.0.0.9").connect(2.0)


def test_a_missing_library_names_the_extra(make: Callable[..., OakD], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "depthai", None)
    for module in ("feed", "network_feed"):
        monkeypatch.delitem(sys.modules, f"arcor2_drivers.oak_d.{module}", raising=False)
    with pytest.raises(NotConnected, match=r"depthai is not installed.*arcor2-hw\[depthai\]"):
        make("127.0.0.1:1").connect(1.0)


def test_a_camera_that_starts_too_late_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    import depthai as dai

    from arcor2_drivers.oak_d import device_feed

    class Slow:
        closed = threading.Event()

        def __init__(self, _: object) -> None:
            time.sleep(0.4)

        def close(self) -> None:
            self.closed.set()

    monkeypatch.setattr(dai, "Device", Slow)
    with pytest.raises(DeviceTimeout, match=r"^camera at X did not start within 0\.1 s"):
        device_feed.boot("camera at X", dai.DeviceInfo("X"), 0.1)
    assert Slow.closed.wait(30.0)  # another driver can open it


def test_several_cameras_need_an_identifier(monkeypatch: pytest.MonkeyPatch) -> None:
    import depthai as dai

    from arcor2_drivers.oak_d import device_feed

    found = [dai.DeviceInfo("10.0.0.7"), dai.DeviceInfo("10.0.0.8")]
    monkeypatch.setattr(dai.Device, "getAllAvailableDevices", staticmethod(lambda: found))
    assert device_feed.find("camera", "10.0.0.8", 0.1).name == "10.0.0.8"
    with pytest.raises(NotConnected, match=r"^camera: 2 cameras found. Set address") as raised:
        device_feed.find("camera", "", 0.1)
    assert "10.0.0.7" in raised.value.detail


def test_stop_ends_the_wait_for_a_picture(fake: FakeProcess, camera: OakD) -> None:
    fake.control.do("frozen")
    waiting = BackgroundCall(camera.color_image)
    while not waiting.over:
        camera.stop()
        time.sleep(0.01)
    assert isinstance(waiting.error, Cancelled)
    fake.control.do("heal")
    wait_for(lambda: fresh(camera))
    assert camera.color_image().size == (640, 360)

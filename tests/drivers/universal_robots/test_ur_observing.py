"""Observation of a UR: typed errors that name the address, nothing written, no sample missed, recovery."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from arcor2_drivers.universal_robots.observer import Sample
from arcor2_drivers.universal_robots.rtde import RtdeStream
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.device import Connection
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Control, Mode, Power, ProgramState, Safety
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, NotConnected, NotFound, NotInControl, OutOfRange, Stale
from tests.waiting import wait_for

from .conftest import FakeUr, make


@pytest.fixture
def listener() -> Iterator[Callable[[Callable[[socket.socket], None]], str]]:
    """Return ``listener(behaviour)``: an address at whose RTDE port each client gets that behaviour."""
    servers: list[socket.socket] = []
    clients: list[socket.socket] = []
    threads: list[threading.Thread] = []

    def serve(server: socket.socket, behave: Callable[[socket.socket], None]) -> None:
        while True:
            try:
                client, _ = server.accept()
            except OSError:
                return
            clients.append(client)
            behave(client)

    def listen(behave: Callable[[socket.socket], None]) -> str:
        host = f"127.99.{len(servers) + 1}.{time.monotonic_ns() % 250 + 1}"
        server = socket.create_server((host, 30004))
        servers.append(server)
        threads.append(threading.Thread(target=serve, args=(server, behave)))
        threads[-1].start()
        return host

    yield listen
    for server in servers:
        server.shutdown(socket.SHUT_RDWR)
        server.close()
    for thread in threads:
        thread.join()
    for client in clients:
        client.close()


def test_a_robot_that_is_switched_off_is_named_with_its_address() -> None:
    robot = make("127.99.0.1")
    with pytest.raises(NotConnected, match=r"127\.99\.0\.1:30004"):
        robot.connect(1.0)
    assert robot.connection is Connection.FAILED
    with pytest.raises(NotConnected):
        robot.robot_joints()
    robot.disconnect()
    assert robot.connection is Connection.OFFLINE


def _reset(client: socket.socket) -> None:
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    client.close()


@pytest.mark.parametrize(
    ("behave", "error"),
    [
        (lambda client: None, DeviceTimeout),
        (_reset, ConnectionLost),
        (lambda client: client.sendall(b"\x00"), DeviceTimeout),
        (lambda client: client.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n"), ConnectionLost),
    ],
    ids=["silent", "reset", "half a frame", "another protocol"],
)
def test_another_server_is_a_typed_error_within_the_deadline(
    listener: Callable[[Callable[[socket.socket], None]], str],
    behave: Callable[[socket.socket], None],
    error: type[Exception],
) -> None:
    host = listener(behave)
    robot = make(host)
    with pytest.raises(error, match=f"{host}:30004"):
        robot.connect(0.5)
    robot.disconnect()


def test_a_reset_while_connecting_is_a_connection_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    def reset(*_: object) -> socket.socket:
        raise ConnectionResetError(104, "Connection reset by peer")

    monkeypatch.setattr(socket, "create_connection", reset)
    with pytest.raises(ConnectionLost, match=r"127\.0\.0\.9:30004"):
        RtdeStream.open("127.0.0.9", ["timestamp"], 0.2)


def test_connecting_observes_and_is_idempotent(fake: FakeUr) -> None:
    fake.do("foreign_program", on=True)
    before = fake.truth()
    robot = make(fake.host)
    try:
        robot.connect(30.0)
        robot.connect(30.0)
        assert len(robot.robot_joints()) == 6
        assert robot.state().program is ProgramState.FOREIGN
        owner = robot.control_owner()
        assert owner not in (None, "us")
        with pytest.raises(NotInControl, match=str(owner)):
            robot.take_control()
        after = fake.truth()
        assert after["program"] == before["program"]
        assert after["programs_killed"] == before["programs_killed"]
        assert after["scripts_taken"] == before["scripts_taken"]
        assert after["rtde_clients"] == before["rtde_clients"] + 1
    finally:
        robot.disconnect()
        robot.disconnect()
    assert fake.truth()["program"] == before["program"]


def test_the_state_is_complete(robot: UR5e, fake: FakeUr) -> None:
    state = robot.state()
    assert (state.mode, state.power, state.safety) == (Mode.AUTOMATIC_EXTERNAL, Power.OPERATIONAL, Safety.NORMAL)
    assert (state.program, state.control, state.moving) == (ProgramState.STOPPED, Control.REMOTE, False)
    assert state.not_ready_because == []
    fake.do("remote_control", on=False)
    fake.do("operational_mode", mode="MANUAL")
    fake.do("speed_slider", fraction=0.3)
    fake.do("safeguard_stop")
    wait_for(lambda: robot.state().control is Control.LOCAL)
    wait_for(lambda: robot.state().safety is Safety.SAFEGUARD_STOP)
    state = robot.state()
    assert state.mode is Mode.MANUAL_REDUCED_SPEED
    assert state.speed_override == pytest.approx(0.3)
    assert state.not_ready_because == ["safeguard stop", "local control"]
    assert [alarm.code for alarm in robot.alarms()] == ["safeguard_stop"]


def test_poses_are_in_the_world(fake: FakeUr) -> None:
    robot = make(
        fake.host,
        Pose(Position(1.0, 0.0, 0.5), Orientation.from_rotation_vector(0.0, 0.0, 1.5707963267948966)),
        tcp_z=0.0,
    )
    robot.connect(30.0)
    try:
        x, y, z = fake.truth()["tcp_pose"][:3]
        # base -> base_link: (x, y) -> (-x, -y); a quarter turn: (x, y) -> (-y, x); then the position of the object
        assert robot.get_end_effector_pose("tcp").position.distance_to(Position(1.0 + y, -x, 0.5 + z)) < 1e-9
        with pytest.raises(NotFound, match="gripper9"):
            robot.get_end_effector_pose("gripper9")
    finally:
        robot.disconnect()


def test_identify(robot: UR5e) -> None:
    identity = robot.identify()
    assert identity.vendor == "Universal Robots"
    assert identity.serial.isdigit()
    assert identity.firmware.startswith("5.25")


@pytest.mark.parametrize("fault", ["silence", "reset", "half_frame", "garbage"])
def test_observation_recovers_and_a_stale_state_is_an_error(robot: UR5e, fake: FakeUr, fault: str) -> None:
    old = robot.robot_joints()
    fake.do(fault)
    wait_for(lambda: robot.connection in (Connection.LOST, Connection.BACK))
    if fault != "reset":
        with pytest.raises((ConnectionLost, Stale), match=fake.host):
            robot.robot_joints()
    fake.do("heal")
    wait_for(lambda: robot.connection is Connection.BACK)
    assert robot.robot_joints() == old
    assert robot.control_owner() is None


def test_a_sample_is_available_as_soon_as_the_connection_is_back(robot: UR5e) -> None:
    """Reading the sample and reading the connection state are two steps; the connection may return in between."""
    observer = robot._observer
    fresh = observer._newest

    class Returning:
        online = False

        def check(self) -> None:
            observer._newest = robot_sample()

    def robot_sample() -> Sample:
        assert fresh is not None
        return fresh._replace(monotonic=time.monotonic())

    former, observer.observing = observer.observing, Returning()  # type: ignore[assignment]
    try:
        observer._newest = None
        assert observer.sample().q == robot_sample().q
    finally:
        observer.observing = former


def test_a_loss_and_the_recovery_are_logged_once(robot: UR5e, fake: FakeUr, caplog: pytest.LogCaptureFixture) -> None:
    fake.do("refuse")
    fake.do("reset")
    fake.do("refuse")
    wait_for(lambda: robot.connection is Connection.LOST)
    time.sleep(0.5)  # several attempts
    fake.do("heal")
    wait_for(lambda: robot.connection is Connection.BACK)
    logged = [record.message for record in caplog.records if record.name.endswith("observing")]
    changes = [kind for text in logged for kind in (" lost: ", " restored after ") if kind in text]
    assert changes
    # A busy machine may lose the connection once more.
    assert changes == [" lost: ", " restored after "] * (len(changes) // 2)


def test_no_sample_is_missed(fake: FakeUr, robot: UR5e) -> None:
    received, missed = robot.samples_received, robot.samples_missed
    began = fake.truth()["timestamp"]
    sent = 500 * (fake.control.wait_until(lambda t: t["timestamp"] > began + 1.0)["timestamp"] - began)
    wait_for(lambda: robot.samples_received - received > 0.96 * sent)
    assert robot.samples_missed - missed <= 0.005 * sent


def test_an_invalid_setting_of_the_model_is_refused() -> None:
    with pytest.raises(OutOfRange, match="payload_mass"):
        make("127.0.0.1", payload_mass=7.0)


def test_the_driver_works_from_any_folder() -> None:
    """It is copied into released packages under another name, so all internal imports must be relative."""
    folder = Path(__file__).parents[3] / "drivers" / "arcor2_drivers" / "universal_robots"
    files = list(folder.glob("*.py"))
    assert folder / "ur5e.py" in files
    for file in files:
        assert "arcor2_drivers" not in file.read_text(), file.name

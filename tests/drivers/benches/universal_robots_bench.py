"""The UR5e on its fake controller, on its own address."""

import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint, Safety
from arcor2_hw.exceptions import Refused
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Check
from arcor2_hw.testing.life import wait_until
from tests.drivers.fake_bench import ControllerBench
from tests.drivers.universal_robots.conftest import FakeUr

ORPHAN = """
import sys
from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.geometry import Pose
robot = UR5e("id", "orphan", Pose(), UrSettings(sys.argv[1], payload_mass=1.0, tcp_z=0.1))
robot.connect()
robot.take_control()
joints = robot.robot_joints()
joints[0].value += 3.0
robot.move_to_joints(joints, 0.5)
"""
ABSENT = "127.99.77.1"
STANDSTILL = 1e-3  # rad/s: the encoder noise of a real arm at standstill


class UR5eBench(ControllerBench):
    object_type = UR5e
    call_within = 4.0
    fake: FakeUr

    def start(self) -> None:
        self.fake = FakeUr("--time-scale", "0.1")

    def reset(self) -> None:
        self.fake.reset()
        truth = self.fake.control.wait_until(lambda truth: truth["robot_mode"] != "BOOTING")  # then it refuses power
        if truth["robot_mode"] != "RUNNING":
            self.fake.do("brake_release")
            self.fake.control.wait_until(lambda truth: truth["robot_mode"] == "RUNNING")

    def _build(self, host: str) -> UR5e:
        return UR5e("robot_id", "arm", Pose(), UrSettings(host, payload_mass=1.0, tcp_z=0.1))

    def make(self) -> UR5e:
        return self._build(self.address)

    def absent(self) -> tuple[Generic, str]:
        return self._build(ABSENT), ABSENT

    def writes(self) -> Any:
        truth = self.fake.truth()
        kept = ("scripts_taken", "programs_killed", "digital_outputs", "payload", "tcp_offset")
        return {key: truth[key] for key in kept}, self.fake.do("commands_taken")

    def turn(self, device: Generic, by: float) -> object:
        assert isinstance(device, UR5e)
        joints = device.robot_joints()
        joints[0].value += by if joints[0].value < 1.0 else -by
        device.move_to_joints(joints, 0.5)
        return device.last_move

    def running(self) -> bool:
        return bool(max(map(abs, self.fake.truth()["qd"])) > STANDSTILL)

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.address]

    def readings(self, device: Generic) -> Iterable[Check]:
        assert isinstance(device, UR5e)
        device.take_control()  # sends the tool to the controller
        self.turn(device, 0.4)
        wait_until(lambda: not device.state().moving, 1.0, "the report of standstill")
        truth = self.fake.truth()
        for joint, own in zip(device.robot_joints(), truth["q"], strict=True):
            yield Check(f"{joint.name}, rad", joint.value, own, 1e-4)
        x, y, z = truth["tcp_pose"][:3]
        place = device.get_end_effector_pose("tcp").position
        # ROS's base_link and the controller's base differ by half a turn about z.
        yield Check("the TCP's x, m", place.x, -x, 1e-4)
        yield Check("the TCP's y, m", place.y, -y, 1e-4)
        yield Check("the TCP's z, m", place.z, z, 1e-4)

    def results(self, device: Generic) -> Iterable[Check]:
        assert isinstance(device, UR5e)
        for on, by in ((True, 0.1), (False, -0.2)):
            self.fake.do("set_input", bit=3, on=on)
            yield self.polled("get_digital_input", lambda: device.get_digital_input(3), on)
            self.turn(device, by)
            real = self.fake.truth()["q"]
            yield self.polled("robot_joints", lambda: [joint.value for joint in device.robot_joints()], real, 1e-3)

    def beyond_limits(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, UR5e)
        joints = device.robot_joints()
        beyond = [Joint(joints[0].name, 6.5), *joints[1:]]
        here, far, tool = device.get_end_effector_pose("tcp"), Pose(Position(1.5, 0.0, 0.3)), (0.0, 0.0, 0.05)
        return {
            "a joint beyond its range": lambda: device.move_to_joints(beyond, 0.5),
            "a speed above 1": lambda: device.move_to_joints(joints, 1.5),
            "a speed of nothing": lambda: device.move_to_pose("tcp", here, 0.0),
            "a pose out of reach": lambda: device.move_to_pose("tcp", far, 0.5),
            "a path of nothing": lambda: device.move_path([]),
            "a blend of a metre": lambda: device.move_path([here], 1.0),
            "a contact force of 1 kN": lambda: device.move_until_contact((0.0, 0.0, -1.0), 1000.0, 0.1),
            "a jog of 10 m/s": lambda: device.jog((10.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            "a jog that is valid for a minute": lambda: device.jog(joint_velocities=[0.1] * 6, valid_for=60.0),
            "a load of 50 kg": lambda: device.set_tool(Pose(), 50.0, tool),
        }

    def works(self, device: Generic) -> Mapping[str, Callable[[], object]]:
        assert isinstance(device, UR5e)

        def near(up: float) -> Pose:
            pose = device.get_end_effector_pose("tcp")
            pose.position.z += up
            return pose

        def jogged() -> None:
            before = self.fake.truth()["q"][5]
            device.jog(joint_velocities=[0.0, 0.0, 0.0, 0.0, 0.0, 0.5], valid_for=0.3)
            self.fake.control.wait_until(lambda truth: truth["q"][5] > before + 0.02)
            device.stop()

        def measured() -> None:
            rates = [0.1, 0.2, -0.1, 0.3, -0.2, 0.5]
            joints, after = device.robot_joints(), device.robot_joints()
            for joint, rate in zip(after, rates, strict=True):
                joint.value += 0.001 * rate
            begin, end = (device.forward_kinematics("tcp", one).position for one in (joints, after))
            speed = begin.distance_to(end) / 0.001
            assert abs(device.tcp_speed(rates) - speed) < 0.02 * speed

        def touched() -> None:
            x, y, z = self.fake.truth()["tcp_pose"][:3]
            self.fake.do("obstacle", point=[x, y, z - 0.04], normal=[0.0, 0.0, 1.0], stiffness=5000.0)
            device.move_until_contact((0.0, 0.0, -1.0), 10.0, 0.1, 0.05)
            self.fake.do("no_obstacle")
            assert abs(self.fake.truth()["tcp_pose"][2] - (z - 0.04)) < 0.01

        def taught() -> None:
            device.set_hand_teaching_mode(True)
            assert self.fake.truth()["freedrive"]
            device.set_hand_teaching_mode(False)
            assert not self.fake.truth()["freedrive"]

        def tooled() -> None:
            device.set_tool(Pose(Position(0.0, 0.0, 0.15)), 1.5, (0.0, 0.0, 0.06))
            truth = self.fake.truth()
            assert (truth["payload"], truth["tcp_offset"][2]) == (1.5, 0.15)

        def collided() -> None:
            self.fake.do("protective_stop")
            wait_until(lambda: device.state().safety is Safety.PROTECTIVE_STOP, 2.0, "the protective stop")
            wait_until(acknowledged, 8.0, "the acknowledgement, which the controller refuses at first")
            assert self.fake.truth()["safety"] == "NORMAL"

        def acknowledged() -> bool:
            try:
                device.acknowledge_protective_stop("the suite")
            except Refused:
                return False
            return True

        def restarted() -> None:
            self.fake.do("violation")
            wait_until(lambda: device.state().safety is Safety.VIOLATION, 2.0, "telling the violation")
            device.restart_safety("the suite")
            assert self.fake.truth()["robot_mode"] == "POWER_OFF"

        def powered() -> None:
            device.power_on()
            assert self.fake.truth()["robot_mode"] == "IDLE"

        def released() -> None:
            device.release_brakes()
            assert self.fake.truth()["robot_mode"] == "RUNNING"

        return {
            "move_to_joints": lambda: self.turn(device, 0.1),
            "move_to_pose": lambda: device.move_to_pose("tcp", near(0.03), 0.5),
            "move_path": lambda: device.move_path([near(0.02), near(0.05)], 0.005),
            "move_until_contact": touched,
            "jog": jogged,
            "tcp_speed": measured,
            "stop": device.stop,
            "inverse_kinematics": lambda: device.inverse_kinematics("tcp", near(0.02)),
            "forward_kinematics": lambda: device.forward_kinematics("tcp", device.robot_joints()),
            "set_hand_teaching_mode": taught,
            "set_tool": tooled,
            "acknowledge_protective_stop": collided,
            "restart_safety": restarted,
            "power_on": powered,
            "release_brakes": released,
        }

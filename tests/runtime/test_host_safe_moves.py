"""Safe moves in the cell host: a robot avoids the current obstacles of the scene."""

import math
from pathlib import Path
from typing import Any

import pytest
import trimesh

import arcor2_drivers
from arcor2_hw.data import object_type
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Project
from arcor2_hw.data.robot import DhParameters, Joint, KinematicCalibration
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.runtime import messages as m

from .conftest import HostProcess, Package, open_scene, type_code

URDF = Path(next(iter(arcor2_drivers.__path__))) / "universal_robots" / "urdf" / "ur5e" / "ur5e.urdf"
NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
READY = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
ACROSS = (2.74, -1.57, 1.57, -1.57, -1.57, 0.0)
MEETING = (1.04, -1.57, 1.57, -1.57, -1.57, 0.0)
"""A pose of the tip that another arm can reach too."""
ARM = """
from arcor2_hw.objects.motion_path import MotionPath
from arcor2_hw.objects.urdf_robot import UrdfRobot
import ctypes

class Arm(UrdfRobot):
    _ABSTRACT = False
    urdf_package_name = "arm.urdf"

    def __init__(self, obj_id: str, name: str, pose: Pose) -> None:
        super().__init__(obj_id, name, pose)
        self.now = [Joint(f"{n}_joint", v) for n, v in START]
        self.count = 0
        self.silent = False
        self.stall = 0

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        if self.silent:
            raise Stale(f"{self.name} has reported nothing")
        ctypes.PyDLL(None).usleep(self.stall)  # holds the interpreter lock, like a machine that does not run the host
        return self.now

    def follow(self, path: MotionPath) -> None:
        self.count, self.now = len(path.waypoints), path.waypoints[-1]

    def stop(self) -> None:
        super().stop()

    def waypoints(self) -> int:
        return self.count

    def lose_signal(self) -> None:
        self.silent = True

    def stall_host(self) -> None:
        self.stall = 600_000
""".replace("START", repr(list(zip(NAMES, READY, strict=True))))
SLOW_ARM = f"""
{ARM}
class SlowArm(Arm):
    def stop(self) -> None:
        super().stop()
        self.stopped = True

    def follow(self, path: MotionPath) -> None:
        self.stopped = False
        goal = path.waypoints[-1]
        while abs(goal[0].value - self.now[0].value) > 0.01:
            if self.stopped:
                raise Cancelled(f"a move of {{self.name}} was stopped")
            time.sleep(0.01)
            turned = self.now[0].value + 0.01 * (1 if goal[0].value > self.now[0].value else -1)
            self.now = [Joint(goal[0].name, turned), *goal[1:]]
        self.now = goal
"""
"""An arm that turns its first joint at 1 rad/s, about 0.5 m/s at the tip."""
WALL = """
class Wall(CollisionObject):
    _ABSTRACT = False
"""
CLAW = """
from arcor2_hw.objects import Gripper
from arcor2_hw.objects.small import GripperState

@dataclass
class ClawSettings(Settings):
    robot: str = ""

class Claw(Gripper):
    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: ClawSettings) -> None:
        super().__init__(obj_id, name, settings)

    def activate(self) -> None:
        ...

    def grip(self, width: float, force: float, speed: float) -> tuple[bool, float]:
        self.attach_part()
        return True, width

    def release(self) -> None:
        self.detach_part()

    def state(self) -> GripperState:
        return GripperState.HOLDING
"""
MODELS = {"Wall": object_type.ObjectModel.of(object_type.Box("Wall", 0.04, 0.5, 1.0))}


def placed(name: str, kind: str, pose: Pose) -> SceneObject:
    return SceneObject(name, kind, pose, [], f"obj_{name}")


@pytest.fixture
def scene(host: HostProcess) -> HostProcess:
    types = [type_code("Arm", ARM), type_code("Wall", WALL)]
    objects = [
        placed("arm", "Arm", Pose()),
        placed("wall", "Wall", Pose(Position(0.0, 0.55, 0.5))),
        placed("other", "Arm", Pose(Position(5.0, 0.0, 0.0))),
    ]
    host.send(open_scene(types, *objects, models=MODELS, assets={"arm.urdf": str(URDF)}))
    host.expect(m.SceneOpened)
    return host


def joints(values: tuple[float, ...]) -> list[Joint]:
    return [Joint(f"{name}_joint", value) for name, value in zip(NAMES, values, strict=True)]


def go(host: HostProcess, values: tuple[float, ...], safe: bool = True) -> Any:
    return host.call("obj_arm", "move_to_joints", target_joints=joints(values), speed=0.5, safe=safe)


def test_a_safe_move_avoids_the_current_obstacles(scene: HostProcess) -> None:
    assert go(scene, ACROSS) is None
    assert scene.call("obj_arm", "waypoints") > 2
    # A wall that is disabled, and one that was moved away, are not obstacles.
    assert scene.call("obj_wall", "set_enabled", state=False) is None
    assert go(scene, READY) is None
    assert scene.call("obj_arm", "waypoints") == 2
    assert scene.call("obj_wall", "set_enabled", state=True) is None
    assert scene.call("obj_wall", "update_pose", new_pose=Pose(Position(0.0, 9.0, 0.0))) is None
    assert go(scene, ACROSS) is None
    assert scene.call("obj_arm", "waypoints") == 2
    tip = scene.call("obj_arm", "get_end_effector_pose", end_effector="tcp")
    at = Position(*(tip["position"][axis] for axis in "xyz"))
    assert go(scene, READY) is None
    assert scene.call("obj_wall", "update_pose", new_pose=Pose(at)) is None
    error = go(scene, ACROSS)
    assert isinstance(error, m.ErrorData)
    assert error.code == "kinematics"
    assert "arm/" in error.message.text
    assert "wall" in error.message.text


def test_a_move_is_refused_if_the_joints_of_another_robot_are_unknown(scene: HostProcess) -> None:
    assert go(scene, ACROSS) is None
    scene.call("obj_other", "lose_signal")
    error = go(scene, READY)
    assert isinstance(error, m.ErrorData)
    assert error.code == "refused"
    assert "The position of other is unknown" in error.message.text
    assert go(scene, READY, safe=False) is None


def test_a_stalled_host_does_not_make_the_joints_of_another_robot_unknown(scene: HostProcess) -> None:
    scene.call("obj_other", "stall_host")  # longer than JOINTS_TIMEOUT
    assert go(scene, ACROSS) is None


# ---------------------------------------------------------------------------------------------------- added bodies
TIP = Position(0.4922, 0.1334, 0.4878)
"""Position of the tip in READY, where the tool points down."""


def line(host: HostProcess, by: Position) -> Any:
    """Move the tip in a safe line from READY, and return the error or None."""
    assert go(host, READY, safe=False) is None
    target = Pose(TIP + by, UPSIDE_DOWN)
    return host.call("obj_arm", "move_to_pose", end_effector_id="tcp", target_pose=target, speed=0.5)


UPSIDE_DOWN = Orientation(math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)


def box(key: str, at: Position, x: float, y: float, z: float, **more: Any) -> m.AddBody:
    return m.AddBody(m.AddedBody(key, object_type.ObjectModel.of(object_type.Box(key, x, y, z)), Pose(at), **more))


def assert_collision(answer: Any, *names: str) -> None:
    assert isinstance(answer, m.ErrorData), answer
    assert answer.code == "kinematics"
    for name in names:
        assert name in answer.message.text


def test_an_added_body_is_an_obstacle_until_it_is_removed(scene: HostProcess, tmp_path: Path) -> None:
    up, aside = Position(0.0, 0.0, 0.2), Position(0.0, 0.25, 0.0)
    assert line(scene, aside) is None
    scene.send(box("crate", TIP + Position(0.0, 0.25, 0.0), 0.1, 0.1, 0.1))
    assert_collision(line(scene, aside), "arm/", "crate")
    scene.send(box("crate", TIP + Position(0.0, 9.0, 0.0), 0.1, 0.1, 0.1))
    assert line(scene, aside) is None, "it was moved"

    # A mesh brings its file and may be scaled; a body with an object's id replaces that object.
    mesh = tmp_path / "mesh"
    mesh.write_bytes(trimesh.creation.box((1.0, 1.0, 1.0)).export(file_type="stl"))
    model = object_type.ObjectModel.of(object_type.Mesh("lump", "lump.stl"))
    pose = Pose(TIP + Position(0.0, 0.25, 0.0))
    scene.send(m.AddBody(m.AddedBody("lump", model, pose, (0.1, 0.1, 0.1), str(mesh))))
    assert_collision(line(scene, aside), "lump")
    scene.send(m.AddBody(m.AddedBody("lump", model, Pose(TIP + Position(0.0, 0.0, 0.3)), (0.1, 0.1, 0.1), str(mesh))))
    assert line(scene, aside) is None
    scene.send(m.RemoveBodies(["lump"]))
    assert go(scene, READY, safe=False) is None
    scene.send(box("wall", Position(0.0, 9.0, 0.0), 0.1, 0.1, 0.1))
    assert go(scene, ACROSS) is None
    assert scene.call("obj_arm", "waypoints") > 2, "a body named like the wall does not replace it"
    scene.send(box("obj_wall", Position(0.0, 9.0, 0.0), 0.1, 0.1, 0.1))
    assert go(scene, READY) is None
    assert scene.call("obj_arm", "waypoints") == 2
    assert line(scene, up) is None


def pan(host: HostProcess) -> float:
    return float(host.call("obj_arm", "robot_joints")[0]["value"])


def test_a_move_stops_before_a_body_added_to_its_path(host: HostProcess) -> None:
    objects = [placed("arm", "SlowArm", Pose()), placed("wall", "Wall", Pose(Position(0.0, 9.0, 0.0)))]
    types = [type_code("SlowArm", SLOW_ARM), type_code("Wall", WALL)]
    host.send(open_scene(types, *objects, models=MODELS, assets={"arm.urdf": str(URDF)}))
    host.expect(m.SceneOpened)
    # A body added over REST, and moved by an edit of the scene.
    box_put_in = box("crate", Position(-0.1334, 0.4922, 0.4878), 0.1, 0.1, 0.1)
    wall_moved = Pose(Position(0.0, 0.55, 0.5))
    for name, change in (
        ("crate", lambda: host.send(box_put_in)),
        ("wall", lambda: host.call("obj_wall", "set_pose", pose=wall_moved)),
    ):
        move = host.begin("obj_arm", "move_to_joints", target_joints=joints(ACROSS), speed=0.5, safe=True)
        while pan(host) < 0.2:
            pass
        change()
        error = host.answer(move)
        assert isinstance(error, m.ErrorData), error
        assert error.code == "path_blocked"
        assert f"{name} came into its path" in error.message.text
        assert 0.2 < pan(host) < 1.2
        host.send(m.RemoveBodies(["crate"]))
        assert go(host, READY, safe=False) is None


def test_a_move_of_a_program_stops_before_an_added_body(host: HostProcess, package: Package) -> None:
    body = f"""
    from arcor2_hw.data.robot import Joint
    arm = res.objects["obj_arm"]
    goal = [Joint(f"{{name}}_joint", value) for name, value in zip({NAMES!r}, {ACROSS!r})]
    arm.move_to_joints(goal, 0.5)
    """
    project = Project("project", "scn_1", id="pro_1")
    directory = package.write({"SlowArm": SLOW_ARM}, [placed("arm", "SlowArm", Pose())], project, body)
    host.send(m.RunPackage("pkg_1", str(directory), assets={"arm.urdf": str(URDF)}))
    host.expect_state("running")
    while pan(host) < 0.2:
        pass
    host.send(box("crate", Position(-0.1334, 0.4922, 0.4878), 0.1, 0.1, 0.1))
    assert "crate came into its path" in host.expect_event("ProjectException")["message"]
    host.expect_state("stopped")


def test_a_held_body_collides_where_the_arm_does_not(scene: HostProcess) -> None:
    aside = Position(0.0, 0.25, 0.0)
    scene.send(box("table", TIP + Position(0.0, 0.25, -0.2), 0.1, 0.1, 0.02))
    assert line(scene, aside) is None
    rod = Position(0.0, 0.0, 0.16)
    scene.send(box("rod", rod, 0.03, 0.03, 0.3, robot="obj_arm", link="tcp"))
    assert_collision(line(scene, aside), "rod", "table")
    assert line(scene, Position(0.0, -0.1, 0.0)) is None, "it is not an obstacle for the robot that holds it"
    scene.send(box("rod", rod, 0.03, 0.03, 0.3, robot="obj_arm", link="claw"))
    error = line(scene, aside)
    assert isinstance(error, m.ErrorData)
    assert "claw, which is not a link of arm" in error.message.text
    scene.send(box("rod", rod, 0.03, 0.03, 0.3, robot="obj_of_another_scene", link="tcp"))
    assert line(scene, aside) is None
    scene.send(box("rod", TIP + aside, 0.03, 0.03, 0.3))
    assert_collision(line(scene, aside), "rod")


def held_parts(host: HostProcess) -> list[tuple[str, str]]:
    """Return names and links of the held parts in the last report of the host."""
    reported = [each for each in host.seen if isinstance(each, m.DeviceChanged) and each.object_id == "obj_arm"]
    return [(part.name, part.link) for part in reported[-1].held]


@pytest.mark.parametrize("alone", [True, False])
def test_a_gripped_part_collides_where_the_arm_does_not(host: HostProcess, alone: bool) -> None:
    named = [] if alone else [Parameter("robot", "string", '"arm"')]
    objects = [
        placed("arm", "Arm", Pose()),
        placed("wall", "Wall", Pose(Position(0.0, 9.0, 0.0))),
        SceneObject("claw", "Claw", UNSET, named, "obj_claw"),
    ]
    if not alone:
        objects.append(placed("other", "Arm", Pose(Position(5.0, 0.0, 0.0))))
    types = [type_code("Arm", ARM), type_code("Wall", WALL), type_code("Claw", CLAW)]
    host.send(open_scene(types, *objects, models=MODELS, assets={"arm.urdf": str(URDF)}))
    host.expect(m.SceneOpened)
    aside = Position(0.0, 0.25, 0.0)
    host.send(box("table", TIP + aside + Position(0.0, 0.0, -0.2), 0.1, 0.1, 0.02))
    assert go(host, READY) is None
    assert host.call("obj_claw", "set_part", size_x=0.05, size_y=0.05, size_z=0.3, offset_z=0.16) is None
    assert line(host, aside) is None
    assert go(host, READY) is None
    assert host.call("obj_claw", "grip", width=0.0, force=1.0, speed=1.0)[0]
    assert held_parts(host) == [("part of claw", "tcp")]
    assert_collision(line(host, aside), "part of claw", "table")
    assert host.call("obj_claw", "release") is None
    assert held_parts(host) == []
    assert line(host, aside) is None


def test_another_arm_is_an_obstacle_at_its_current_joints(host: HostProcess) -> None:
    objects = [placed("arm", "Arm", Pose()), placed("other", "Arm", Pose(Position(0.0, 1.0, 0.0)))]
    host.send(open_scene([type_code("Arm", ARM)], *objects, assets={"arm.urdf": str(URDF)}))
    host.expect(m.SceneOpened)
    assert go(host, ACROSS) is None
    assert host.call("obj_arm", "waypoints") == 2
    reaching = joints((-1.57, *READY[1:]))
    assert host.call("obj_other", "move_to_joints", target_joints=reaching, speed=0.5, safe=False) is None
    assert go(host, READY) is None
    assert host.call("obj_arm", "waypoints") > 2
    assert_collision(go(host, MEETING), "arm/", "other/")
    # In the opposite direction, too: neither robot moves into the other.
    assert go(host, MEETING, safe=False) is None
    home = joints(READY)
    assert host.call("obj_other", "move_to_joints", target_joints=home, speed=0.5, safe=False) is None
    answer = host.call("obj_other", "move_to_joints", target_joints=reaching, speed=0.5)
    assert_collision(answer, "arm/", "other/")
    # The gripped part counts as part of the robot.
    assert go(host, READY, safe=False) is None
    assert host.call("obj_other", "move_to_joints", target_joints=joints((1.57, *READY[1:])), speed=0.5) is None
    assert go(host, ACROSS) is None
    assert host.call("obj_arm", "waypoints") == 2
    host.send(box("beam", Position(0.27, 0.5, 0.0), 0.1, 1.0, 0.1, robot="obj_other", link="tcp"))
    assert_collision(go(host, MEETING), "arm/", "beam")


PAIR = """
from arcor2_hw.objects import MultiArmRobot

class Pair(MultiArmRobot):
    _ABSTRACT = False
    urdf_package_name = "arm.urdf"
    joint_count = 6

    def get_arm_ids(self) -> set[str]:
        return {"left"}

    def get_end_effectors_ids(self, arm_id: str | None = None) -> set[str]:
        return {"tcp"}

    def get_end_effector_pose(self, end_effector: str, arm_id: str | None = None) -> Pose:
        return Pose()

    def robot_joints(self, include_gripper: bool = False, arm_id: str | None = None) -> list[Joint]:
        return [Joint(f"{n}_joint", v) for n, v in START][: self.joint_count]

    def grippers(self, arm_id: str | None = None) -> set[str]:
        return set()

    def suctions(self, arm_id: str | None = None) -> set[str]:
        return set()

    def set_joint_count(self, count: int) -> None:
        self.joint_count = count
""".replace("START", repr(list(zip(NAMES, (-1.57, *READY[1:]), strict=True))))


def test_a_robot_with_several_arms_is_an_obstacle_if_all_joints_are_known(host: HostProcess) -> None:
    objects = [placed("arm", "Arm", Pose()), placed("pair", "Pair", Pose(Position(0.0, 1.0, 0.0)))]
    host.send(open_scene([type_code("Arm", ARM), type_code("Pair", PAIR)], *objects, assets={"arm.urdf": str(URDF)}))
    host.expect(m.SceneOpened)
    assert_collision(go(host, MEETING), "arm/", "pair/")
    host.call("obj_pair", "set_joint_count", count=3)
    error = go(host, MEETING)
    assert isinstance(error, m.ErrorData)
    assert error.code == "refused"
    assert "The position of pair is unknown" in error.message.text
    assert "wrist_1_joint" in error.message.text


# ---------------------------------------------------------------------------------------------------- calibration
def calibration(longer: float) -> KinematicCalibration:
    """Return the calibration of an arm with a longer upper arm."""
    half = math.pi / 2
    d, a = (0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996), (0.0, -0.425 - longer, -0.3922, 0.0, 0.0, 0.0)
    rows = zip(d, a, (half, 0.0, 0.0, half, -half, 0.0), strict=True)
    return KinematicCalibration([DhParameters(0.0, *row) for row in rows], "0x1")


def tip(host: HostProcess) -> Position:
    found = host.call("obj_arm", "get_end_effector_pose", end_effector="tcp")["position"]
    return Position(*(found[axis] for axis in "xyz"))


def test_the_kinematic_calibration_of_the_controller_is_used(host: HostProcess) -> None:
    objects = [placed("arm", "Arm", Pose())]
    calibrated = {"obj_arm": calibration(0.002), "obj_gone": calibration(0.003)}
    given = {"assets": {"arm.urdf": str(URDF)}, "calibrations": calibrated}
    host.send(open_scene([type_code("Arm", ARM)], *objects, **given))
    host.expect(m.SceneOpened)
    # With the upper arm upright it is higher by the extra length.
    assert tip(host).z - TIP.z == pytest.approx(0.002, abs=1e-4)
    host.send(m.Calibrate("obj_arm", None))
    assert tip(host).z - TIP.z == pytest.approx(0.0, abs=1e-4)
    host.send(m.Calibrate("obj_arm", calibration(0.004)))
    assert tip(host).z - TIP.z == pytest.approx(0.004, abs=1e-4)
    host.send(m.Calibrate("obj_arm", calibration(0.2)))
    error = host.call("obj_arm", "get_end_effector_pose", end_effector="tcp")
    assert isinstance(error, m.ErrorData)
    assert "another robot" in error.message.text

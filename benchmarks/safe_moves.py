"""Safe moves among 20 boxes: overhead of planning and monitoring, and time until a new obstacle stops a motion."""

import threading
import time
from pathlib import Path
from typing import Final

from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Cancelled, PathBlocked
from arcor2_hw.objects.motion_path import MotionPath
from arcor2_hw.objects.surroundings import EmptySurroundings, Obstacle
from arcor2_hw.objects.urdf_robot import UrdfRobot
from benchmarks.metrics import Metric, median, percentile
from benchmarks.models import UR5E

UR5E_URDF: Final = UR5E / "ur5e.urdf"
MOVES: Final = 100
STOPS: Final = 40
NAMES: Final = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
READY: Final = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
ACROSS: Final = (2.0, *READY[1:])


class Boxes(EmptySurroundings):
    """Twenty boxes near the arm that do not block it, and one that appears in its path."""

    def __init__(self) -> None:
        self.boxes = {
            f"box {n}": Pose(Position(0.15 * (n % 5) - 0.3, -0.5 - 0.1 * (n // 5), 0.1 * (n // 5))) for n in range(20)
        }

    def obstacles(self) -> list[Obstacle]:
        """Return the boxes."""
        return [Obstacle(name, Box(name, 0.1, 0.1, 0.1), at) for name, at in list(self.boxes.items())]

    def asset(self, asset_id: str) -> Path | None:  # noqa: ARG002
        """Return the model of the arm."""
        return UR5E_URDF


class InstantArm(UrdfRobot):
    """A UR5e that reaches its goal immediately, or waits on its path until it is stopped."""

    _ABSTRACT = False
    urdf_package_name = "ur5e.urdf"

    def __init__(self) -> None:
        super().__init__("id", "arm", Pose())
        self.now = _joints(READY)
        self.moving, self.stopped = threading.Event(), threading.Event()
        self.waits = False
        self.stopped_at = 0.0

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:  # noqa: ARG002
        """Return the present joint values."""
        return self.now

    def follow(self, way: MotionPath) -> None:
        """Go to the goal immediately, or wait until stopped."""
        self.moving.set()
        if self.waits:
            self.stopped.wait(5.0)
            raise Cancelled("stopped")
        self.now = way.waypoints[-1]

    def stop(self) -> None:
        """Stop."""
        self.stopped_at = time.perf_counter()
        super().stop()
        self.stopped.set()


def metrics() -> list[Metric]:
    """Measure moves whose motion takes no time, and stops for a box that appears."""
    arm, around = InstantArm(), Boxes()
    arm.surround(around)
    times = []
    for number in range(MOVES):
        began = time.perf_counter()
        arm.move_to_joints(_joints(READY if number % 2 else ACROSS), 0.5)
        times.append(time.perf_counter() - began)
    found = [Metric("safe_move_overhead_ms", median(times[2:]) * 1e3, MOVES - 2, "20 boxes, none on the path")]
    arm.waits, late = True, []
    for _ in range(STOPS):
        arm.now = _joints(READY)
        arm.moving.clear()
        arm.stopped.clear()
        mover = threading.Thread(target=_blocked, args=(arm,))
        mover.start()
        arm.moving.wait()
        time.sleep(0.1)
        began = time.perf_counter()
        around.boxes["crate"] = Pose(Position(-0.1334, 0.4922, 0.4878))
        mover.join()
        late.append(arm.stopped_at - began)
        del around.boxes["crate"]
    note = f"95th percentile {percentile(late, 95) * 1e3:.0f} ms; from the appearance to the call of stop"
    return [*found, Metric("safe_move_stop_after_change_ms", median(late) * 1e3, STOPS, note)]


def _blocked(arm: InstantArm) -> None:
    try:
        arm.move_to_joints(_joints(ACROSS), 0.5)
    except PathBlocked:
        return
    raise AssertionError("The arm was not stopped.")


def _joints(values: tuple[float, ...]) -> list[Joint]:
    return [Joint(f"{name}_joint", value) for name, value in zip(NAMES, values, strict=True)]

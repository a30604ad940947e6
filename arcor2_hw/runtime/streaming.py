"""Streaming of joints, end effector poses, observations and points, at the streaming period and at other rates."""

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any, Final, Literal

import msgspec

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.device import Observation
from arcor2_hw.data.events import Event, ObjectObservationsData, RobotEefData, RobotJointsData
from arcor2_hw.data.points import ObjectPointsData
from arcor2_hw.data.robot import EefPose
from arcor2_hw.exceptions import Arcor2Error, message_of
from arcor2_hw.objects import Generic, MultiArmRobot, Robot
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.clock import Clock
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.messages import Stream, StreamEvent
from arcor2_hw.runtime.points import PointReader
from arcor2_hw.runtime.recorder import Recorder

OBSERVATIONS: Final = "ObjectObservations"
"""The event with the observations of a device."""
POINTS: Final = "ObjectPoints"
"""The event with the points of a device."""
_Kind = Literal["joints", "eef", "observations", "points"]
_encode = msgspec.json.Encoder().encode


Send = Callable[[StreamEvent], None]


def _joints(robot: Robot, time_ms: float | Unset, record: Recorder) -> bytes:
    joints = robot.robot_joints(True)
    record.joints(robot, joints)
    return _encode(Event("RobotJoints", data=RobotJointsData(robot.id, joints, time_ms)))


def _eef(robot: Robot, time_ms: float | Unset) -> bytes:
    poses: list[EefPose] = []
    if isinstance(robot, MultiArmRobot):
        for arm in sorted(robot.get_arm_ids()):
            poses += [
                EefPose(eef, robot.get_end_effector_pose(eef, arm), arm)
                for eef in sorted(robot.get_end_effectors_ids(arm))
            ]
    else:
        poses = [EefPose(e, robot.get_end_effector_pose(e), UNSET) for e in sorted(robot.get_end_effectors_ids())]
    return _encode(Event("RobotEef", data=RobotEefData(robot.id, poses, time_ms)))


def _encoded(
    event: str, kind: type[ObjectObservationsData | ObjectPointsData], object_id: str, read: Callable[[], list[Any]]
) -> bytes:
    """Return the event with the values of a device, or with the reason why they are not known."""
    time_ms = round(time.monotonic() * 1e3, 3)
    try:
        data = kind(object_id, time_ms, read())
    except Exception as error:  # noqa: BLE001 - a driver may raise anything
        why = message_of(error)
        data = kind(object_id, time_ms, reason=why.text, **why.translation())
    return _encode(Event(event, data=data))


class Streams:
    """Read, send and record the state of devices. A device is not queried again before it has answered."""

    def __init__(self, send: Send, record: Recorder) -> None:
        self._send = send
        self._record = record
        self._pending: dict[tuple[str, str, float], Job] = {}
        self._points = PointReader()

    def send_observations(self, device: Device, rate: float) -> None:
        """Start to read and send the observations of a device. `rate`: of the stream, Hz."""
        if (instance := device.instance) is not None and not device.closing:
            self._begin(device, OBSERVATIONS, rate, self._observe, instance, rate)

    def send_points(self, device: Device, rate: float) -> None:
        """Start to read and send the points of a device. `rate`: of the stream, Hz."""
        if device.instance is not None and not device.closing:
            self._begin(device, POINTS, rate, self._read_points, device, rate)

    def send(self, device: Device, *, joints: bool, eef: bool, rate: float = 0.0) -> None:
        """Start to read and send joints or end effector poses of a robot. Other devices are ignored.

        rate: of the stream, Hz, whose events contain a timestamp; 0 for events without one.
        """
        robot = device.instance
        if not isinstance(robot, Robot) or device.closing:
            return
        self._begin(device, f"{joints=} {eef=}", rate, self._read_and_send, robot, joints, eef, rate)

    def _begin(self, device: Device, what: str, rate: float, function: Callable[..., None], *arguments: object) -> None:
        key = (device.id, what, rate)
        before = self._pending.get(key)
        if before is not None and not before.ended:
            return
        job = self._pending[key] = Job("stream", function, arguments)
        device.watch_lane.submit_or_fail(job)

    def _observe(self, instance: Generic, rate: float) -> None:
        def read() -> list[Observation]:
            observations = instance.observations()
            self._record.observed(instance, observations, time.monotonic())
            return observations

        encoded = _encoded(OBSERVATIONS, ObjectObservationsData, instance.id, read)
        self._send(StreamEvent(OBSERVATIONS, instance.id, encoded, rate))

    def _read_points(self, device: Device, rate: float) -> None:
        encoded = _encoded(POINTS, ObjectPointsData, device.id, lambda: self._points.read(device))
        self._send(StreamEvent(POINTS, device.id, encoded, rate))

    def _read_and_send(self, robot: Robot, joints: bool, eef: bool, rate: float) -> None:
        # A read error sends no event: clients see the age of the last one.
        time_ms: float | Unset = round(time.monotonic() * 1e3, 3) if rate else UNSET
        if joints:
            self._send(StreamEvent("RobotJoints", robot.id, _joints(robot, time_ms, self._record), rate))
        if eef:
            self._send(StreamEvent("RobotEef", robot.id, _eef(robot, time_ms), rate))


class RatedStreams:
    """Schedule streams at other rates. Each device, event and rate is read and encoded once per period."""

    def __init__(self, cell: Callable[[], Cell], clock: Clock, streams: Streams) -> None:
        self._cell = cell
        self._clock = clock
        self._streams = streams
        self._lock = threading.Lock()
        self._rates: dict[tuple[str, _Kind], frozenset[float]] = {}
        self._scheduled: set[tuple[str, _Kind, float]] = set()

    def set_rates(self, message: Stream) -> None:
        """Replace the stream rates of a device. Runs on the reader thread."""
        wanted: tuple[tuple[_Kind, list[float]], ...] = (
            ("joints", message.joints),
            ("eef", message.eef),
            ("observations", message.observations),
            ("points", message.points),
        )
        for kind, rates in wanted:
            with self._lock:
                self._rates[message.object_id, kind] = frozenset(rates)
                new = [rate for rate in rates if (message.object_id, kind, rate) not in self._scheduled]
                self._scheduled.update((message.object_id, kind, rate) for rate in new)
            for rate in new:
                self._send_periodically(message.object_id, kind, rate, time.monotonic())

    def _send_periodically(self, object_id: str, kind: "_Kind", rate: float, due: float) -> None:
        with self._lock:
            if rate not in self._rates[object_id, kind]:
                self._scheduled.discard((object_id, kind, rate))
                return
        with contextlib.suppress(Arcor2Error):  # the device has failed and may be retried later
            device = self._cell()[object_id]
            if kind == "observations":
                self._streams.send_observations(device, rate)
            elif kind == "points":
                self._streams.send_points(device, rate)
            else:
                self._streams.send(device, joints=kind == "joints", eef=kind == "eef", rate=rate)
        now = time.monotonic()
        following = max(due + 1.0 / rate, now)  # missed periods are skipped
        self._clock.after(following - now, lambda: self._send_periodically(object_id, kind, rate, following))

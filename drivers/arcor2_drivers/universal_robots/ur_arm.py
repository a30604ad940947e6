"""UrArm: taking control of a Universal Robots arm, moving it, stopping it."""

import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from typing import ClassVar, Final

from arcor2_hw.data.device import LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Control, Mode, MoveEnd, MoveResult
from arcor2_hw.exceptions import (
    Cancelled,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    OutOfRange,
    Refused,
    SafetyStop,
)

from .arrival import at_joints, at_pose
from .control import ControlSession
from .frames import from_vector, to_vector, world_from_base
from .geometry import flange
from .observer import Sample
from .program import Tool
from .session_times import POLL, REST_WITHIN, STANDING, TAKE_TIMEOUT
from .settings import MANUAL_TCP_SPEED, UrSettings, within
from .states import MAY_MOVE, REMEDIES, program_plays, safety_of
from .timing import SLOWEST_FRACTION, joint_budget, linear_budget
from .ur_observed import JOINTS, UrObserved

LOWER_ONLY: Final = ((5, 23), (10, 0))
"""From these versions on, ur_rtde 1.6.5 told to use the upper registers sends a program that does, but does not."""

SAME_TOOL: Final = (0.005, 0.02)
"""m and rad: by how much less the nominal model differs from the controller's TCP when both have the same tool."""
STOPS_WITHIN: Final = 1.5
"""Seconds to standstill when this computer freezes: FROZEN_AFTER, one period of the watchdog, and braking."""
TOLD_WITHIN: Final = 0.2
"""Seconds for a sample that knows the tool; the stream's own watch tells when none comes at all."""

log = logging.getLogger(__name__)


class UrArm(UrObserved):
    """A Universal Robots arm under control."""

    _ABSTRACT = True
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(STOPS_WITHIN)

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: UrSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._session: ControlSession | None = None
        self._take_again = False
        self._stops = 0
        self._teaching = False
        self._tool = Tool(settings.tcp, settings.payload_mass, settings.payload_cog)
        self._taking = threading.Lock()
        self.last_move: MoveResult | None = None

    # -------------------------------------------------------------------------------- control
    def disconnect(self) -> None:
        """Give control back and close; harmless when closed."""
        self.release_control()
        super().disconnect()

    def take_control(self) -> None:
        """Take control: start the control program with its watchdog, tool and payload. Harmless when it is ours.

        Raises NotInControl naming who has it, SafetyStop, Refused naming what is missing, ConnectionLost.
        """
        with self._taking:  # what uses our outputs may take control too, at the same time
            if not self._is_ours():
                self._take()

    def _take(self) -> None:
        self.tool()
        if self._session is not None:
            self._session.await_end()
        sample = self._observer.sample()
        control, _ = self._at_pendant(max_age=0.0)
        safety = safety_of(sample.safety_mode)
        if safety not in MAY_MOVE:
            raise SafetyStop(
                f"{self.name} cannot be controlled: {safety.value.replace('_', ' ')}",
                REMEDIES.get(safety, ""),
                safety.value,
            )
        if control is Control.LOCAL:
            raise NotInControl(f"{self.name} is in local control: the pendant has it", self._observer.address)
        if program_plays(sample.runtime):
            program = self._foreign_name() or "a program"
            raise NotInControl(f"{program} plays on {self.name}; stop it before taking control", self._observer.address)
        missing = self._obstacles(sample, control)
        if missing:
            raise Refused(f"{self.name} cannot be controlled: {', '.join(missing)}")
        session = ControlSession(self._observer, self._upper_registers(), self._ur.watchdog_frequency)
        session.open(TAKE_TIMEOUT, self._has_dashboard)
        try:
            self._tell_tool(session, self.tool())
            self._await_samples()
        except BaseException:
            session.end(NotInControl(f"control of {self.name} was not taken"))
            raise
        self._teaching = self._take_again = False
        self._session = session
        self._observer.observing.settled()

    def release_control(self) -> None:
        """Stop and give control back; harmless when it is not ours."""
        (session, self._session), self._take_again = (self._session, None), False
        if session is None or session.ended is not None:
            return
        newest = self._observer.newest()
        if newest is not None and newest.moving:
            self._stops += 1
            with contextlib.suppress(DeviceError):
                session.stop_motion(self._ur.stop_deceleration)
        session.release(NotInControl(f"control of {self.name} was given back"), 0.4)

    def control_owner(self) -> str | None:
        """Tell who has control: "us", the pendant, the program that plays, or nobody."""
        if self._is_ours():
            return "us"
        sample = self._observer.sample()
        if self._at_pendant()[0] is Control.LOCAL:
            return "pendant"
        if program_plays(sample.runtime):
            return self._foreign_name() or "a program"
        return None

    def _is_ours(self) -> bool:
        return self._session is not None and self._session.ended is None

    def _upper_registers(self) -> bool:
        version = self._observer.version[:2]
        lower_only = any(version[0] == major and version >= (major, minor) for major, minor in LOWER_ONLY)
        if self._ur.use_upper_range_registers and lower_only:
            log.info("%s: controller %d.%d needs the lower registers", self.name, *version)
        return self._ur.use_upper_range_registers and not lower_only

    def _controlled(self) -> ControlSession:
        """Give the living session. Raises what ended it, or NotInControl."""
        session = self._session
        if session is not None and session.ended is None:
            return session
        if self._take_again:  # it was our own stop that ended it
            self.take_control()
            assert self._session is not None
            return self._session
        self._observer.observing.check()
        why = f": {session.ended}" if session is not None else ""
        raise NotInControl(f"control of {self.name} is not taken{why}")

    def tool(self) -> Tool:
        """Give the tool that the controller is told of; Refused when nobody has stated its mass."""
        if self._tool.mass < 0.0:
            raise Refused(f"{self.name}: payload_mass is not set; state the mass at the flange first")
        return self._tool

    def _await_samples(self) -> None:
        """Wait for two samples more: the second was taken after now, and so with the tool that was told."""
        wanted, deadline = self.samples_received + 2, time.monotonic() + TOLD_WITHIN
        while self.samples_received < wanted and time.monotonic() < deadline:
            time.sleep(0.002)

    @staticmethod
    def _tell_tool(session: ControlSession, tool: Tool) -> None:
        session.do("the tool centre point", "setTcp", to_vector(tool.tcp))
        if tool.inertia is None:
            session.do("the payload", "setPayload", tool.mass, list(tool.cog))
        else:
            session.do("the payload", "setTargetPayload", tool.mass, list(tool.cog), list(tool.inertia))

    def get_end_effector_pose(self, end_effector: str) -> Pose:
        """Give the TCP of the settings in the world.

        Until control is taken the controller works with the tool that the pendant has set. Where that is another one,
        the pose is computed from the joints by the nominal model, which is some millimetres off.
        Raises NotFound, NotConnected, ConnectionLost, Stale.
        """
        self._check_end_effector(end_effector)
        sample = self._observer.sample()
        if self._is_ours():
            return self._world(sample)
        at = flange(self.dimensions, list(sample.q))
        ours, theirs = at * self._tool.tcp, from_vector(sample.tcp)
        same = ours.position.distance_to(theirs.position) < SAME_TOOL[0] and (
            ours.orientation.angle_to(theirs.orientation) < SAME_TOOL[1]
        )
        return self._world(sample) if same else world_from_base(self._pose) * ours

    # -------------------------------------------------------------------------------- moving
    def check_if_ready_to_move(self) -> None:
        """Raise what keeps the arm from moving now; return when nothing does."""
        super().check_if_ready_to_move()
        self._controlled()
        if self._teaching:
            raise Refused(f"{self.name} is in hand teaching mode")

    def _move_pose(self, target: Pose, linear: bool, speed: float, acceleration: float, stops: int) -> MoveResult:
        """Move; `stops` is the count of stops when the caller was called: one more since then, and nothing starts."""
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        within(f"{self.name}: acceleration", acceleration, 0.01, 1.0)
        vector = self._controller_vector(target)
        with self._moving():
            session = self._controlled()
            start = self._observer.sample()
            q = self._solve(session, vector, list(start.q))
            if not linear:
                return self._run_joints(session, start, q, speed, acceleration, stops)
            return self._run_line(session, start, vector, speed, acceleration, stops)

    def _move_joints(self, q: list[float], speed: float, acceleration: float, stops: int) -> MoveResult:
        within(f"{self.name}: speed", speed, 0.001, 1.0)
        within(f"{self.name}: acceleration", acceleration, 0.01, 1.0)
        with self._moving():
            session = self._controlled()
            return self._run_joints(session, self._observer.sample(), q, speed, acceleration, stops)

    def _run_line(
        self, session: ControlSession, start: Sample, vector: list[float], speed: float, acceleration: float, stops: int
    ) -> MoveResult:
        tcp_speed = min(speed * self._ur.max_tcp_speed, self._tcp_speed_cap())
        ramp = acceleration * self._ur.tcp_acceleration
        here, there = from_vector(start.tcp), from_vector(vector)
        distance = here.position.distance_to(there.position)
        budget = linear_budget(distance, here.orientation.angle_to(there.orientation), tcp_speed, ramp)
        return self._run(
            session,
            "a linear move",
            ("moveL", vector, tcp_speed, ramp, True),
            budget,
            at_pose(vector),
            tcp_speed / self._ur.max_tcp_speed,
            stops,
        )

    def _run_joints(
        self, session: ControlSession, start: Sample, q: list[float], speed: float, acceleration: float, stops: int
    ) -> MoveResult:
        joint_speed = min(speed * self._ur.max_joint_speed, self._joint_speed_cap())
        ramp = acceleration * self._ur.joint_acceleration
        return self._run(
            session,
            "a joint move",
            ("moveJ", q, joint_speed, ramp, True),
            joint_budget(start.q, q, joint_speed, ramp),
            at_joints(q),
            joint_speed / self._ur.max_joint_speed,
            stops,
        )

    def _tcp_speed_cap(self) -> float:
        manual = self._at_pendant()[1] in (Mode.MANUAL_REDUCED_SPEED, Mode.MANUAL_HIGH_SPEED)
        return MANUAL_TCP_SPEED if manual else math.inf

    def _joint_speed_cap(self) -> float:
        """Give the joint speed with which the TCP keeps its cap even if every joint adds its whole lever."""
        levers = 3.0 * self.reach + len(JOINTS) * math.hypot(*self._tool.tcp.position)
        return self._tcp_speed_cap() / levers

    @contextlib.contextmanager
    def _moving(self) -> Iterator[None]:
        if not self._move_lock.acquire(blocking=False):
            raise Refused(f"{self.name} is moving already")
        try:
            if self._teaching:
                raise Refused(f"{self.name} is in hand teaching mode")
            yield
        finally:
            self._move_lock.release()

    def _run(
        self,
        session: ControlSession,
        what: str,
        command: tuple[str, list[float], float, float, bool],
        budget: float,
        reached: Callable[[Sample], bool],
        speed: float,
        stops: int,
    ) -> MoveResult:
        """Start an asynchronous motion and wait for its end by what is observed."""
        began = time.monotonic()
        number, _ = self._observer.sample().operation(session.upper)
        try:
            session.do(what, *command, valid=lambda: self._stops == stops)
            self._wait_done(session, what, number, stops, budget, reached)
        except Cancelled:
            self._wait_rest(session)
            self._note(speed, began, MoveEnd.STOPPED)
            raise
        except SafetyStop:
            self._note(speed, began, MoveEnd.SAFETY)
            raise
        return self._note(speed, began, MoveEnd.DONE)

    def _wait_done(
        self,
        session: ControlSession,
        what: str,
        number: int,
        stops: int,
        budget: float,
        reached: Callable[[Sample], bool],
    ) -> None:
        last = time.monotonic()
        standing: float | None = None  # by the controller's time: this process may be held up
        while True:
            if self._stops != stops:
                raise Cancelled(f"{what} of {self.name} was stopped")
            if session.ended is not None:
                raise session.ended
            sample = self._observer.newest()
            assert sample is not None
            begun, running = sample.operation(session.upper)
            if begun != number and not running and not sample.moving and reached(sample):
                return
            now = time.monotonic()
            if sample.moving or running or standing is None:
                standing = sample.timestamp
            elif sample.timestamp - standing > STANDING:
                raise DeviceFault(f"{what} of {self.name} ended before its target")
            budget -= (now - last) * max(sample.speed_fraction, SLOWEST_FRACTION)
            last = now
            if budget < 0.0:
                self._stops += 1
                session.stop_motion(self._ur.stop_deceleration)
                raise DeviceTimeout(f"{what} of {self.name} did not end in the time computed for it; it was stopped")
            time.sleep(POLL)

    def _note(self, speed: float, began: float, end: MoveEnd) -> MoveResult:
        newest = self._observer.newest()
        assert newest is not None
        self.last_move = MoveResult(self._world(newest), speed, time.monotonic() - began, end)
        return self.last_move

    # -------------------------------------------------------------------------------- stopping
    def stop(self) -> None:
        """Stop what we move and return when it stands; called past everything else. It is no safety function.

        Raises NotInControl when a program that is not ours plays, DeviceTimeout when the arm does not come to rest.
        """
        self._stops += 1
        session = self._session
        if session is None or session.ended is not None:
            newest = self._observer.newest()
            if newest is not None and newest.moving and program_plays(newest.runtime):
                raise NotInControl(f"{self._foreign_name() or 'a program'} moves {self.name}, not we")
            return
        session.stop_motion(self._ur.stop_deceleration)
        if self._teaching and session.ended is None:
            self.set_hand_teaching_mode(False)
        self._wait_rest(session)
        if isinstance(session.ended, Cancelled):
            self._take_again = True  # a stop of ours costs nobody control

    def _wait_rest(self, session: ControlSession) -> None:
        until, dashboard_at = time.monotonic() + REST_WITHIN, time.monotonic() + REST_WITHIN / 2
        while True:
            newest = self._observer.newest()
            if newest is None or (session.ended is not None and not isinstance(session.ended, Cancelled)):
                return  # the controller stops it, by its watchdog or its safety system
            if not newest.moving and newest.age < POLL + 2.0 * self._observer.period:
                return
            now = time.monotonic()
            if now > until:
                raise DeviceTimeout(f"{self.name} did not come to rest within {REST_WITHIN:g} s of a stop")
            if now > dashboard_at and session.ended is None:
                session.stop_by_dashboard()
            time.sleep(POLL)

    # -------------------------------------------------------------------------------- kinematics of the controller
    def _solve(self, session: ControlSession, vector: list[float], near: list[float]) -> list[float]:
        # Asked first: without a solution get_inverse_kin ends the control program with an error.
        q: list[float] = []
        if session.ask("inverse kinematics", "getInverseKinematicsHasSolution", vector, near):
            q = session.ask("inverse kinematics", "getInverseKinematics", vector, near)
        if len(q) != len(JOINTS) or not all(map(math.isfinite, q)):
            position = ", ".join(f"{value:.3f}" for value in vector[:3])
            raise self.KinematicsException(
                f"{self.name} cannot reach the pose", f"in the controller's base: {position}"
            )
        return q

    def _controller_vector(self, pose: Pose) -> list[float]:
        vector = to_vector(world_from_base(self._pose).inverted() * pose)
        if not all(map(math.isfinite, vector)):
            raise OutOfRange(f"{self.name}: the numbers of a pose must be finite")
        return vector

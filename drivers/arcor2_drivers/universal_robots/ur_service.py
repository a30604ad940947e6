"""UrServiced: what a person does with the arm: jog, guide by hand, switch on, acknowledge stops."""

import logging
import math
import time
from collections.abc import Callable
from typing import Final, Literal

from arcor2_hw.data.geometry import Orientation, Pose
from arcor2_hw.data.robot import Control, Safety
from arcor2_hw.exceptions import DeviceTimeout, InvalidData, NotFound, NotInControl, OutOfRange, Refused

from .frames import turned, world_from_base
from .geometry import tcp_speed
from .observer import Sample
from .program import Tool
from .settings import within
from .states import MODE_IDLE, MODE_RUNNING, safety_of
from .ur_moves import UrMoving
from .ur_observed import JOINTS

POWER_WITHIN: Final = 20.0
"""Seconds from "power on" to idle: a controller takes six, one that checks its joints longer."""
BRAKES_WITHIN: Final = 20.0
SAFETY_WITHIN: Final = 5.0
POLL: Final = 0.02
INERTIA_FROM: Final = (5, 10)
MOST_INERTIA: Final = 133.0
"""kg m², the controller's own bound."""

log = logging.getLogger(__name__)


class UrServiced(UrMoving):
    """A Universal Robots arm and the people around it."""

    _ABSTRACT = True

    # -------------------------------------------------------------------------------- the tool
    def set_tool(
        self, tcp: Pose, mass: float, cog: tuple[float, float, float], inertia: tuple[float, ...] | None = None
    ) -> None:
        """Tell the controller of its tool: TCP in the flange, mass kg, centre of gravity m in the flange.

        `inertia`: Ixx, Iyy, Izz, Ixy, Ixz, Iyz in kg m² about the centre of gravity; None leaves it to the controller.
        Raises OutOfRange, Refused for an inertia before controller 5.10, Refused while moving, NotInControl.
        """
        within(f"{self.name}: mass", mass, 0.0, self.max_payload)
        for axis, value in zip("xyz", cog, strict=True):
            within(f"{self.name}: cog {axis}", value, -1.0, 1.0)
        if inertia is not None:
            if len(inertia) != 6:
                raise OutOfRange(f"{self.name}: inertia must be six numbers: Ixx, Iyy, Izz, Ixy, Ixz, Iyz")
            for value in inertia:
                within(f"{self.name}: inertia", value, -MOST_INERTIA, MOST_INERTIA)
            if self._observer.version[:2] < INERTIA_FROM:
                raise Refused(f"{self.name}: an inertia can be set from controller 5.10 on, not on this one")
        with self._moving():
            tool = Tool(tcp, mass, cog, inertia)
            self._tell_tool(self._controlled(), tool)
            self._tool = tool

    # -------------------------------------------------------------------------------- by hand, and by speed
    def get_hand_teaching_mode(self) -> bool:
        """Tell whether the arm can be moved by hand."""
        return self._teaching and self._is_ours()

    def set_hand_teaching_mode(self, enabled: bool) -> None:
        """Make the arm movable by hand, or stiff again. Refused without a stated payload, or while moving."""
        self.tool()
        session = self._controlled()
        if enabled and self.move_in_progress:
            raise Refused(f"{self.name} is moving already")
        if enabled:
            session.do("hand teaching", "teachMode")
        else:
            session.do("the end of hand teaching", "endTeachMode")
        self._teaching = enabled

    def jog(
        self,
        twist: tuple[float, float, float, float, float, float] | None = None,
        joint_velocities: list[float] | None = None,
        frame: Literal["world", "base", "tool", "user"] = "world",
        valid_for: float = 0.2,
        end_effector_id: str | None = None,
    ) -> None:
        """Move with a velocity that runs out by itself `valid_for` s from now. Raises OutOfRange, Refused as a move."""
        if end_effector_id is not None:
            self._check_end_effector(end_effector_id)
        within(f"{self.name}: valid_for", valid_for, 0.01, 1.0)
        if (twist is None) == (joint_velocities is None):
            raise OutOfRange(f"{self.name}: jog needs either twist or joint_velocities")
        stops = self._stops
        with self._moving():
            session = self._controlled()
            if joint_velocities is not None:
                limit = min(self._ur.max_joint_speed, self._joint_speed_cap())
                velocities = [*joint_velocities]
                if len(velocities) != len(JOINTS):
                    raise OutOfRange(f"{self.name}: joint_velocities must have {len(JOINTS)} numbers")
                for name, value in zip(JOINTS, velocities, strict=True):
                    within(f"{self.name}: velocity of {name}", value, -limit, limit)
                ramp = self._ur.joint_acceleration
                command = "speedJ"
            else:
                assert twist is not None
                linear, angular = self._turned_twist(twist, frame)
                within(
                    f"{self.name}: speed of the twist",
                    math.hypot(*linear),
                    0.0,
                    min(self._ur.max_tcp_speed, self._tcp_speed_cap()),
                )
                within(f"{self.name}: angular speed of the twist", math.hypot(*angular), 0.0, self._ur.max_joint_speed)
                ramp = self._ur.tcp_acceleration
                command, velocities = "speedL", [*linear, *angular]
            session.speed(command, velocities, ramp, valid_for, lambda: self._stops == stops)

    def tcp_speed(self, joint_velocities: list[float], end_effector_id: str | None = None) -> float:
        """Give the speed of the TCP, m/s, that joint rates (rad/s) give now, by the arm's nominal geometry."""
        if end_effector_id is not None:
            self._check_end_effector(end_effector_id)
        return tcp_speed(self.dimensions, list(self._observer.sample().q), joint_velocities, self._tool.tcp)

    def _turned_twist(
        self, twist: tuple[float, float, float, float, float, float], frame: str
    ) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        base = world_from_base(self._pose).orientation.inverted()
        by = {
            "world": base,
            "base": base * self._pose.orientation,
            "tool": Orientation.from_rotation_vector(*self._observer.sample().tcp[3:]),
        }.get(frame)
        if by is None:
            raise Refused(f"{self.name} has no frame {frame!r} to jog in")
        return turned(twist[:3], by), turned(twist[3:], by)

    # -------------------------------------------------------------------------------- what only a person decides
    def power_on(self) -> None:
        """Switch drive power on; brakes stay closed. Raises NotInControl in local control, Refused, DeviceTimeout."""
        if self._observer.sample().robot_mode >= MODE_IDLE:
            return
        self._order("power on", "Powering on")
        self._await("be switched on", lambda sample: sample.robot_mode >= MODE_IDLE, POWER_WITHIN)

    def release_brakes(self) -> None:
        """Release the brakes; the arm does not move. Raises NotInControl in local control, Refused, DeviceTimeout."""
        mode = self._observer.sample().robot_mode
        if mode == MODE_RUNNING:
            return
        if mode < MODE_IDLE:
            raise Refused(f"{self.name} has no power; the brakes cannot be released")
        self._order("brake release", "Brake releasing")
        self._await("release its brakes", lambda sample: sample.robot_mode == MODE_RUNNING, BRAKES_WITHIN)

    def acknowledge(self, code: str) -> None:
        """Refuse: a safety stop is acknowledged by a person by name; NotFound when `code` does not stand."""
        if code not in {alarm.code for alarm in self.alarms()}:
            raise NotFound(f"{self.name} has no alarm {code}")
        raise Refused(f"{code} of {self.name} needs the person who looked: acknowledge_protective_stop(confirmed_by)")

    def acknowledge_protective_stop(self, confirmed_by: str) -> None:
        """Unlock a protective stop; the old program is stopped before, so its motion does not continue.

        Raises Refused with the controller's words while it does not let itself be unlocked (5 s from the stop on).
        """
        self._confirmed(confirmed_by)
        if safety_of(self._observer.sample().safety_mode) is not Safety.PROTECTIVE_STOP:
            raise Refused(f"{self.name} is in no protective stop")
        self._end_old_program("a protective stop was acknowledged")
        self._order("unlock protective stop", "Protective stop releasing")
        log.warning("%s: protective stop acknowledged by %s", self.name, confirmed_by)
        self._await(
            "leave the protective stop",
            lambda sample: safety_of(sample.safety_mode) is not Safety.PROTECTIVE_STOP,
            SAFETY_WITHIN,
        )

    def restart_safety(self, confirmed_by: str) -> None:
        """Restart the safety system after a fault or violation; the arm is without power afterwards."""
        self._confirmed(confirmed_by)
        if safety_of(self._observer.sample().safety_mode) not in (Safety.FAULT, Safety.VIOLATION):
            raise Refused(f"{self.name} has neither a fault nor a violation of its safety system")
        self._end_old_program("the safety system was restarted")
        self._order("restart safety", "Restarting safety")
        log.warning("%s: safety system restarted by %s", self.name, confirmed_by)
        self._await(
            "restart its safety system",
            lambda sample: safety_of(sample.safety_mode) not in (Safety.FAULT, Safety.VIOLATION),
            POWER_WITHIN,
        )

    def _end_old_program(self, why: str) -> None:
        if self._session is not None:
            self._session.end(NotInControl(f"control of {self.name} ended: {why}"))
        self._take_again = False
        self._order("stop", "Stopped")

    def _confirmed(self, confirmed_by: str) -> None:
        if not confirmed_by.strip():
            raise InvalidData("confirmed_by must name the person who looked at the robot")

    def _order(self, command: str, expected: str) -> None:
        if not self._has_dashboard:
            raise Refused(f"{self.name} has no dashboard server: {command!r} has to be done at the pendant")
        if self._at_pendant(max_age=0.0)[0] is Control.LOCAL:
            raise NotInControl(f"{self.name} is in local control: {command!r} has to be done at the pendant")
        self._dashboard.do(command, expected)

    def _await(self, what: str, holds: Callable[[Sample], bool], within_s: float) -> None:
        until = time.monotonic() + within_s
        while not holds(self._observer.sample(max_age=0.5)):
            if time.monotonic() > until:
                raise DeviceTimeout(f"{self.name} did not {what} within {within_s:g} s")
            time.sleep(POLL)

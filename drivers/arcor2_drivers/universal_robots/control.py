"""Control: taking and releasing control of a UR arm, its tool, and hand teaching."""

import contextlib
import logging
import threading
from typing import Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Control as ControlMode, ProgramState
from arcor2_hw.exceptions import Cancelled, DeviceError, NotInControl, OutOfRange, Refused, SafetyStop
from arcor2_hw.keep_alive import once_within
from arcor2_hw.messages import Phrase
from arcor2_hw.objects.arm import StopCounter, label

from .arm import Arm
from .geometry import to_vector
from .observer import Observer, Sample
from .pendant import Pendant
from .program import Tool
from .session import ControlSession
from .states import MAY_MOVE, MODE_NAMES, MODE_RUNNING, REMEDIES, Runtime, program_plays, safety_of
from .timing import GUARD_PERIOD, PROGRAM_END_TIMEOUT, TAKE_TIMEOUT

LOWER_REGISTER_VERSIONS: Final = ((5, 23), (10, 0))
"""Versions from which ur_rtde 1.6.5 writes lower registers although its program reads upper ones."""
MIN_INERTIA_VERSION: Final = (5, 10)
"""First controller version that accepts an inertia."""
MAX_INERTIA: Final = 133.0
"""Maximum inertia that the controller accepts, kg m²."""
TOOL_REPORT_TIMEOUT: Final = 0.2
"""Time for a sample that is based on a new tool, s."""

log = logging.getLogger(__name__)


class Control:
    """Control of one arm: the session, the tool and the stop requests."""

    def __init__(self, arm: Arm, observer: Observer, pendant: Pendant) -> None:
        self._arm, self._observer, self._pendant = arm, observer, pendant
        self._taking = threading.Lock()
        self._retake = False
        self.session: ControlSession | None = None
        self.stops = StopCounter()
        self.teaching = False
        self.stated_tool = Tool(arm.settings.tcp, arm.settings.payload_mass, arm.settings.payload_cog)

    # -------------------------------------------------------------------------------- taking and releasing
    @property
    def ours(self) -> bool:
        """Return whether we have control."""
        return self.session is not None and self.session.ended is None

    def take(self) -> None:
        """Take control, unless we have it: start the control program with its watchdog, tool and payload.

        Raises:
            NotInControl: Another client, the pendant or another program has control.
            SafetyStop: A safety stop is active.
            Refused: Something is missing.
            ConnectionLost: The connection is lost.
        """
        with self._taking:  # devices at our outputs may take control at the same time
            if not self.ours:
                self._take()

    def _take(self) -> None:
        name, observer, tool = self._arm.name, self._observer, self.tool
        if self.session is not None:
            self.session.await_end()
        sample = observer.sample()
        control, _ = self._pendant.state(max_age=0.0)
        safety = safety_of(sample.safety_mode)
        if safety not in MAY_MOVE:
            raise SafetyStop(
                "{name} cannot be controlled: {safety}",
                REMEDIES.get(safety, ""),
                safety.value,
                name=name,
                safety=label(safety),
            )
        if control is ControlMode.LOCAL:
            raise NotInControl(
                "{name} is in local control. Select remote control at the pendant.", observer.address, name=name
            )
        if program_plays(sample.runtime) and not self._program_ends():
            program = self._pendant.program()
            raise NotInControl(
                "{program} plays on {name}. Stop it before taking control.",
                observer.address,
                program=program,
                name=name,
            )
        if missing := self.obstacles(sample, control):
            raise Refused("{name} cannot be controlled: {missing}", name=name, missing=", ".join(missing))
        for last in (False, True):
            session = ControlSession(observer, self.uses_upper_registers(), self._arm.settings.watchdog_frequency)
            session.open(TAKE_TIMEOUT, self._pendant.available)
            try:
                self.send_tool(session, tool)
                self._await_samples()
                break
            except BaseException as e:
                session.end(NotInControl("Control of {name} was not taken.", name=name))
                if last or not session.too_slow:
                    raise
                log.info("%s: taking control again: %s", name, e)
                session.await_end()
        self.teaching = self._retake = False
        self.session = session
        observer.observing.settled()

    def _program_ends(self) -> bool:
        """Return whether the playing program ends at once, like that of a client that has just disconnected."""
        return once_within(
            lambda: not program_plays(self._observer.sample().runtime), PROGRAM_END_TIMEOUT, GUARD_PERIOD
        )

    def release(self) -> None:
        """Stop the arm and release control, if we have it."""
        (session, self.session), self._retake = (self.session, None), False
        if session is None:
            return
        if session.ended is not None:
            session.await_end()
            return
        newest = self._observer.newest()
        if newest is not None and newest.moving:
            self.stops.request()
            with contextlib.suppress(DeviceError):
                session.stop_motion(self._arm.settings.stop_deceleration)
        session.release(NotInControl("Control of {name} was released.", name=self._arm.name), 0.4)

    def revoke(self, reason: str) -> None:
        """End the session and stop the program, so that an old motion cannot continue."""
        if self.session is not None:
            self.session.end(NotInControl("Control of {name} ended: {reason}.", name=self._arm.name, reason=reason))
        self._retake = False
        self._pendant.do("stop", "Stopped")

    def note_stop(self, session: ControlSession) -> None:
        """Take control again with the next command if our own stop has ended a session."""
        self._retake = isinstance(session.ended, Cancelled)

    def owner(self) -> str | None:
        """Return "us", "pendant", the name of the program that plays, or None."""
        if self.ours:
            return "us"
        sample = self._observer.sample()
        if self._pendant.state()[0] is ControlMode.LOCAL:
            return Phrase.of("pendant")
        return self._pendant.program() if program_plays(sample.runtime) else None

    def current(self) -> ControlSession:
        """Return the live session. Raise NotInControl, or why the controller is not observed."""
        session = self.session
        if session is not None and session.ended is None:
            return session
        if self._retake:
            self.take()
            assert self.session is not None
            return self.session
        self._observer.observing.check()
        if session is None:
            raise NotInControl("Control of {name} is not taken. Take control first.", name=self._arm.name)
        raise NotInControl("Control of {name} is not taken: {reason}", name=self._arm.name, reason=session.ended)

    def obstacles(self, sample: Sample, control: ControlMode) -> list[str]:
        """Return what prevents the arm from accepting commands."""
        found = []
        if sample.robot_mode != MODE_RUNNING:
            found.append(f"not switched on ({MODE_NAMES.get(sample.robot_mode, sample.robot_mode)})")
        safety = safety_of(sample.safety_mode)
        if safety not in MAY_MOVE:
            found.append(label(safety).text)
        if control is ControlMode.LOCAL:
            found.append("local control")
        return found

    def program_state(self, sample: Sample) -> ProgramState:
        """Return whether a program plays, and whether it is ours."""
        if not program_plays(sample.runtime):
            return ProgramState.STOPPED
        if not self.ours:
            return ProgramState.FOREIGN
        return ProgramState.PAUSED if sample.runtime in (Runtime.PAUSED, Runtime.PAUSING) else ProgramState.PLAYING

    def uses_upper_registers(self) -> bool:
        """Return whether the session uses the upper registers: if they are configured and supported."""
        version = self._observer.version[:2]
        lower_only = any(version[0] == major and version >= (major, minor) for major, minor in LOWER_REGISTER_VERSIONS)
        return self._arm.settings.use_upper_range_registers and not lower_only

    # -------------------------------------------------------------------------------- tool and hand teaching
    @property
    def tool(self) -> Tool:
        """Return the tool. Raise Refused if its mass is not set."""
        if self.stated_tool.mass < 0.0:
            raise Refused("{name}: payload_mass is not set. Enter the mass at the flange first.", name=self._arm.name)
        return self.stated_tool

    def set_tool(
        self, tcp: Pose, mass: float, cog: tuple[float, float, float], inertia: tuple[float, ...] | None
    ) -> None:
        """Set the tool. Raise OutOfRange, Refused or NotInControl."""
        arm = self._arm
        arm.within("mass", mass, 0.0, arm.model.max_payload)
        for axis, value in zip("xyz", cog, strict=True):
            arm.within(f"cog {axis}", value, -1.0, 1.0)
        if inertia is not None:
            if len(inertia) != 6:
                raise OutOfRange("{name}: inertia must be six numbers: Ixx, Iyy, Izz, Ixy, Ixz, Iyz.", name=arm.name)
            for value in inertia:
                arm.within("inertia", value, -MAX_INERTIA, MAX_INERTIA)
            if self._observer.version[:2] < MIN_INERTIA_VERSION:
                raise Refused("{name}: the controller accepts an inertia only from version 5.10 on.", name=arm.name)
        tool = Tool(tcp, mass, cog, inertia)
        self.send_tool(self.current(), tool)
        self.stated_tool = tool

    @staticmethod
    def send_tool(session: ControlSession, tool: Tool) -> None:
        """Send TCP and payload to the controller."""
        session.set("the tool center point", "setTcp", to_vector(tool.tcp))
        if tool.inertia is None:
            session.set("the payload", "setPayload", tool.mass, list(tool.cog))
        else:
            session.set("the payload", "setTargetPayload", tool.mass, list(tool.cog), list(tool.inertia))

    def _await_samples(self) -> None:
        """Wait for two samples, so that the second one is based on the new tool."""
        wanted = self._observer.samples_received + 2
        once_within(lambda: self._observer.samples_received >= wanted, TOOL_REPORT_TIMEOUT, 0.002)

    def set_teaching(self, enabled: bool) -> None:
        """Enable or disable hand teaching. Raise Refused if the payload is not set."""
        _ = self.tool
        what, command = ("hand teaching", "teachMode") if enabled else ("the end of hand teaching", "endTeachMode")
        self.current().do(what, command)
        self.teaching = enabled

"""Control: taking and releasing control of both arms, power, hand teaching, and reasons for the end of control."""

import contextlib
import logging
import threading
import time
from collections.abc import Iterable
from typing import Final

from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import ProgramState, Safety
from arcor2_hw.exceptions import ConnectionLost, DeviceError, DeviceFault, NotInControl, Refused, SafetyStop
from arcor2_hw.messages import Message, Phrase
from arcor2_hw.objects.arm import StopCounter, label

from .arms import Arms, other_arm
from .observer import UNITS, Observer, Panel, Sample, holder, lead_through_path, read_panel, read_running
from .rws import Rws
from .session import ControlSession, await_value, release_mastership, request_mastership, start_rapid, stop_rapid
from .settings import ARMS, MAX_PAYLOAD
from .states import AUTOMATIC, COLLISION, MOTORS_ON, REMEDIES, safety_of

MOTORS_ON_TIMEOUT: Final = 5.0
"""Time the controller may take to switch the motors on, s; a real one takes one or two seconds."""
RELEASE_TIMEOUT: Final = 0.5
"""Time for releasing control when disconnecting from a controller that is slow or does not answer, s."""
log = logging.getLogger(__name__)


class Control:
    """Control of both arms: the commanding session with the controller, mastership, and the motion servers."""

    def __init__(self, arms: Arms, observer: Observer) -> None:
        self._arms, self._observer = arms, observer
        self.session: ControlSession | None = None
        self.stops = {arm: StopCounter() for arm in ARMS}
        self.stopped_at = dict.fromkeys(ARMS, 0.0)
        self.collision_acknowledged = False
        self._controlled_since = 0.0
        self._rws: Rws | None = None
        self._mastership = False
        self._taking = threading.Lock()
        observer.on_sample = self._on_sample
        observer.on_lost = self._on_lost  # type: ignore[method-assign]

    # -------------------------------------------------------------------------------- taking and releasing
    @property
    def ours(self) -> bool:
        """Return whether we have control."""
        return self.session is not None and self.session.ended is None

    def take(self) -> None:
        """Take control, unless we have it: mastership, motors on, motion servers started from main.

        Raises:
            NotInControl: Another client, the pendant or another program has control.
            SafetyStop: A safety stop is active.
            Refused: Something is missing.
        """
        with self._taking:
            if self.ours:
                return
            name = self._arms.name
            self._arms.check_loads()
            self._observer.sample()
            rws = self.rws
            panel, state = self._ask(rws)
            self._check_takable(panel, state)
            running = read_running(rws)
            if running and not panel.ours:
                raise NotInControl(
                    "The RAPID program {programs} runs on {robot}. Stop it before taking control.",
                    rws.address,
                    programs=panel.program_names,
                    robot=name,
                )
            if not panel.ours:
                raise Refused(
                    "{name} has {program_names} loaded. Load Arcor2Left.pgf and Arcor2Right.pgf "
                    "into T_ROB_L and T_ROB_R.",
                    name=name,
                    program_names=panel.program_names,
                )
            self._take_mastership(rws)
            try:
                if state != MOTORS_ON:
                    self._motors_on(rws)
                if not running:
                    start_rapid(rws)
                self._open_session()
            except BaseException:
                self._release_mastership()
                raise
            self._observer.observing.settled()

    def _open_session(self) -> None:
        session = ControlSession(self._arms.name, self._arms.settings)
        try:
            session.open()
            for arm in ARMS:
                load = self._arms.loads[arm]
                assert load is not None
                session.set_tool(arm, self._arms.tools[arm], load)
        except BaseException:
            session.end(NotInControl("Control of {name} was not taken.", name=self._arms.name))
            raise
        self._controlled_since = time.monotonic()
        self.session = session
        self.collision_acknowledged = False  # a new collision must be acknowledged again

    def release(self) -> None:
        """Stop both arms and release control, if we have it. Motors and motion servers stay on."""
        session, self.session = self.session, None
        self.request_stop(ARMS)
        if session is not None:
            if session.ended is None and self._observer.observing.online:
                for arm in ARMS:
                    with contextlib.suppress(DeviceError):
                        self._end_lead_through(arm)
            session.end(NotInControl("Control of {name} was released.", name=self._arms.name))
        self._release_mastership()

    def disconnect(self) -> None:
        """Release control and close the commanding session with the controller."""
        online, rws = self._observer.observing.online, self._rws
        self._observer.leave()
        with contextlib.ExitStack() as limited:
            if rws is not None:
                limited.enter_context(rws.all_until(time.monotonic() + RELEASE_TIMEOUT))
            self.release()
            if rws is not None and online:
                rws.logout(RELEASE_TIMEOUT)  # the controller releases all mastership of the session
        if rws is not None:
            rws.close()
        self._rws, self._mastership = None, False

    def request_stop(self, arms: Iterable[str]) -> None:
        """Cancel the motions of arms."""
        for arm in arms:
            self.stopped_at[arm] = time.monotonic()
            self.stops[arm].request()

    def owner(self) -> str | None:
        """Return "us", "pendant", the holder of mastership, the RAPID program that runs, or None."""
        if self.ours:
            return "us"
        sample, panel = self._observer.sample(), self._observer.panel()
        if panel.operation_mode != AUTOMATIC:
            return Phrase.of("pendant")
        if panel.holder is not None and not self._mastership:
            return str(panel.holder)
        return panel.program_names if sample.running and not panel.ours else None

    def current(self) -> ControlSession:
        """Return the live session. Raise NotInControl, or why the controller is not observed."""
        session = self.session
        if session is not None and session.ended is None:
            return session
        self._observer.observing.check()
        if session is None:
            raise NotInControl("Control of {name} is not taken. Take control first.", name=self._arms.name)
        raise NotInControl("Control of {name} is not taken: {reason}", name=self._arms.name, reason=session.ended)

    @property
    def rws(self) -> Rws:
        """Return the session that commands the controller. Another session observes it."""
        if self._rws is None:
            each = self._arms.settings
            self._rws = Rws(self._arms.name, each.host, each.rws_port, each.user, each.password)
        return self._rws

    def stop_rapid(self) -> None:
        """Stop RAPID, which ends control: the second way to stop the arms."""
        try:
            stop_rapid(self.rws)
        finally:
            assert self.session is not None
            self.session.end(NotInControl("{name} was stopped by stopping RAPID.", name=self._arms.name), wait=False)
            self._return_mastership()

    def _ask(self, rws: Rws) -> tuple[Panel, str]:
        """Read the panel and the control state now."""
        panel = read_panel(rws)
        self._observer.note(panel)
        return panel, rws.value("/rw/panel/ctrlstate", "ctrlstate")

    def _check_takable(self, panel: Panel, state: str) -> None:
        """Raise what prevents switching on and taking control."""
        name = self._arms.name
        safety = safety_of(state, panel.collision == COLLISION and not self.collision_acknowledged)
        if safety is not Safety.NORMAL:
            raise SafetyStop(
                "{name} cannot be controlled: {safety}",
                REMEDIES.get(safety, ""),
                safety.value,
                name=name,
                safety=label(safety),
            )
        if panel.operation_mode != AUTOMATIC:
            raise NotInControl(
                "{robot} is in operating mode {mode}. Select automatic mode at the pendant.",
                self._observer.rws.address,
                robot=name,
                mode=panel.operation_mode,
            )

    def _take_mastership(self, rws: Rws) -> None:
        try:
            request_mastership(rws, "rapid")
        except Refused as e:
            client = holder(rws)
            if client is None:
                raise
            raise NotInControl(
                "{client} has mastership of {robot}.",
                f"{rws.address}: {e}; {e.detail}",
                client=client,
                robot=self._arms.name,
            ) from e
        self._mastership = True

    def _release_mastership(self) -> None:
        rws = self._rws
        if not self._mastership or rws is None or not self._observer.observing.online:
            return
        if not release_mastership(rws, "rapid"):
            return  # we still have mastership; the next call releases it
        self._mastership = False
        if (known := self._observer.known_panel) is not None:
            self._observer.note(known._replace(holder=None))

    def _return_mastership(self) -> None:
        """Release mastership after control ended by itself, so that other clients can take it."""
        with contextlib.suppress(DeviceError):
            self._release_mastership()

    # -------------------------------------------------------------------------------- state and end of control
    def safety(self, sample: Sample) -> Safety:
        """Return the safety state of a sample; a collision counts until it is acknowledged or RAPID runs again."""
        panel = self._observer.known_panel
        collided = panel is not None and panel.collision == COLLISION and not self.collision_acknowledged
        return safety_of(sample.control_state, collided and not sample.running)

    def program_state(self, sample: Sample, panel: Panel) -> ProgramState:
        """Return whether RAPID runs, and whether it runs our program."""
        if not sample.running:
            return ProgramState.STOPPED
        return ProgramState.PLAYING if panel.ours else ProgramState.FOREIGN

    def obstacles(self, sample: Sample, panel: Panel) -> list[str]:
        """Return what prevents the robot from accepting commands."""
        found = []
        safety = self.safety(sample)
        if safety is not Safety.NORMAL:
            found.append(label(safety).text)
        elif sample.control_state != MOTORS_ON:
            found.append("motors off")
        if panel.operation_mode != AUTOMATIC:
            found.append(f"operating mode {panel.operation_mode}")
        if not panel.ours:
            found.append(f"the RAPID program loaded is {panel.program_names}")
        if panel.speed_ratio <= 0.0:
            found.append("speed override 0 %")
        return found

    def _on_sample(self, sample: Sample) -> None:
        panel = self._observer.known_panel
        if panel is not None and panel.collision != COLLISION:
            self.collision_acknowledged = False
        session = self.session
        if session is None or session.ended is not None or sample.monotonic < self._controlled_since:
            return
        if sample.control_state != MOTORS_ON or not sample.running:
            session.end(self._why_stopped(), wait=False)
            self._return_mastership()

    def _on_lost(self, error: DeviceError) -> None:
        if (session := self.session) is not None:
            lost = ConnectionLost("The connection to {device} is lost.", str(error), device=self._observer.who)
            session.end(lost, wait=False)

    def _why_stopped(self) -> DeviceError:
        """Return why the program or the motors stopped.

        The controller is asked again: a sample is read in parts, and the cause may be newer than its control state.
        """
        rws, name = self._observer.rws, self._arms.name
        panel, state = self._ask(rws)
        safety = safety_of(state, panel.collision == COLLISION)
        code, title = self._last_event(rws)
        if safety is not Safety.NORMAL:
            return SafetyStop(
                "{safety} of {name} ({address})",
                f"{code} {title}".strip(),
                safety.value,
                safety=label(safety),
                name=name,
                address=rws.address,
            )
        if state != MOTORS_ON:
            return NotInControl(
                "The motors of {name} ({address}) were switched off.", f"{code} {title}", name=name, address=rws.address
            )
        cause = title or Message.of("the event log has no cause")
        return DeviceFault(
            "RAPID stopped on {name} ({address}): {cause}", f"{code}", code, name=name, address=rws.address, cause=cause
        )

    def _last_event(self, rws: Rws) -> tuple[str, str]:
        """Return number and title of the latest error in the event log, or of its latest entry."""
        try:
            events = rws.get("/rw/elog/0", lang="en", lim="5")
        except Refused:
            return "", ""
        errors = [event for event in events if event.get("msgtype") == "3"]
        newest = (errors or events or [{}])[0]
        return newest.get("code", ""), newest.get("title", "")

    def explained(self, error: DeviceError) -> DeviceError:
        """Return the reason for the end of a connection.

        A stop of the controller takes precedence over a closed socket.
        """
        if not isinstance(error, (ConnectionLost, NotInControl)):
            return error
        session = self.session
        with contextlib.suppress(DeviceError):
            sample = self._observer.fresh().value
            if sample.control_state != MOTORS_ON or not sample.running:
                cause = self._why_stopped()
                if session is not None and session.ended is error:
                    session.ended = cause
                return cause
        return error

    # -------------------------------------------------------------------------------- power and tool
    def power_on(self) -> None:
        """Switch the motors on."""
        self._observer.sample()
        rws = self.rws
        panel, state = self._ask(rws)
        self._check_takable(panel, state)
        if state != MOTORS_ON:
            self._motors_on(rws)

    def _motors_on(self, rws: Rws) -> None:
        rws.act("/rw/panel/ctrlstate", "setctrlstate", {"ctrl-state": MOTORS_ON})
        await_value(rws, "/rw/panel/ctrlstate", "ctrlstate", MOTORS_ON, MOTORS_ON_TIMEOUT, "switch its motors on")

    def set_tool(
        self, arm: str, tcp: Pose, mass: float, cog: tuple[float, float, float], inertia: tuple[float, ...] | None
    ) -> None:
        """Set the tool of an arm. Raise OutOfRange, or Refused for an inertia."""
        self._arms.within("mass", mass, 0.001, MAX_PAYLOAD)
        for axis, value in zip("xyz", cog, strict=True):
            self._arms.within(f"cog {axis}", value, -0.5, 0.5)
        if inertia is not None:
            raise Refused("{name}: this driver cannot set an inertia. Leave it out.", name=self._arms.name)
        self.current().set_tool(arm, tcp, (mass, cog))
        self._arms.tools[arm], self._arms.loads[arm] = tcp, (mass, cog)

    # -------------------------------------------------------------------------------- hand teaching
    def teaching(self, arm: str) -> bool:
        """Return whether an arm can be moved by hand."""
        return bool(self._observer.panel().lead_through[arm])

    def set_teaching(self, arm: str, enabled: bool, moving: bool) -> None:
        """Enable or disable moving an arm by hand. Raise Refused while an arm moves, or without lead-through."""
        self.current()
        if self._observer.panel().lead_through[arm] is None:
            raise Refused(
                "The controller of {name} has no lead-through for {units}.", name=self._arms.name, units=UNITS[arm]
            )
        if enabled and moving:
            raise Refused("{name} is moving. Stop both arms before hand teaching.", name=self._arms.name)
        self._set_lead_through(arm, enabled)

    def check_stiff(self, arm: str) -> None:
        """Raise Refused while this arm or the other arm is moved by hand."""
        lead_through = self._observer.panel().lead_through
        if lead_through[arm]:
            raise Refused("The {arm} arm of {name} is in hand teaching mode.", arm=arm, name=self._arms.name)
        if lead_through[other_arm(arm)]:
            raise Refused(
                "The {arm} arm of {name} is in hand teaching mode; the {other_arm} arm cannot keep clear of it.",
                arm=other_arm(arm),
                name=self._arms.name,
                other_arm=arm,
            )

    def _set_lead_through(self, arm: str, enabled: bool) -> None:
        rws = self.rws
        request_mastership(rws, "motion")
        try:
            rws.act(lead_through_path(UNITS[arm]), None, {"status": "active" if enabled else "inactive"})
        finally:
            release_mastership(rws, "motion")
        self._observer.note(read_panel(rws))

    def _end_lead_through(self, arm: str) -> None:
        panel = self._observer.known_panel
        if panel is not None and panel.lead_through[arm]:
            self._set_lead_through(arm, False)

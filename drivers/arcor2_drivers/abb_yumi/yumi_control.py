"""YumiControl: taking control of both arms of a YuMi and giving it back, power, and what only a person decides."""

import contextlib
import logging
import threading
import time
from collections.abc import Iterable
from typing import ClassVar, Final

from arcor2_hw.data.device import LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Safety
from arcor2_hw.exceptions import (
    ConnectionLost,
    DeviceError,
    DeviceFault,
    InvalidData,
    NotFound,
    NotInControl,
    Refused,
    SafetyStop,
)
from arcor2_hw.keep_alive import FROZEN_AFTER

from .observer import UNITS, Panel, Sample, holder, lead_through_path, read_panel, read_running
from .rws import Rws
from .session import (
    ControlSession,
    await_value,
    not_controlled,
    release_mastership,
    request_mastership,
    start_rapid,
)
from .settings import ARMS, LONGEST_WATCHDOG, YumiSettings
from .states import AUTOMATIC, COLLISION, MOTORS_ON, REMEDIES, safety_of
from .yumi_observed import YumiObserved

MOTORS_WITHIN: Final = 5.0
"""Seconds the controller may take to switch the motors on; a real one takes one or two."""
BRAKES_WITHIN: Final = 0.2
"""Seconds to brake from full speed."""
GIVEN_BACK_WITHIN: Final = 0.5
"""Seconds that `disconnect` waits for a controller that has fallen silent just now, or is slow."""
log = logging.getLogger(__name__)


class YumiControl(YumiObserved):
    """A YuMi whose control is taken and given back."""

    _ABSTRACT = True
    loss_reaction: ClassVar[LossReaction] = LossReaction.stops_within(FROZEN_AFTER + LONGEST_WATCHDOG + BRAKES_WITHIN)

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: YumiSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._session: ControlSession | None = None
        self._controlled_since = 0.0
        self._command: Rws | None = None
        self._mastership = False
        self._taking = threading.Lock()
        self._stops = dict.fromkeys(ARMS, 0)
        self._stopped_at = dict.fromkeys(ARMS, 0.0)
        self._loads = {arm: settings.load(arm) for arm in ARMS}

    # -------------------------------------------------------------------------------- control
    def disconnect(self) -> None:
        """Give control back and close; harmless when closed."""
        online = self._observer.observing.online
        self._observer.leave()
        command = self._command
        with contextlib.ExitStack() as hurried:
            if command is not None:
                hurried.enter_context(command.all_until(time.monotonic() + GIVEN_BACK_WITHIN))
            self.release_control()
            if command is not None and online:
                command.logout(GIVEN_BACK_WITHIN)  # with the session goes all it has mastership of
        if command is not None:
            command.close()
        self._command, self._mastership = None, False
        super().disconnect()

    def take_control(self) -> None:
        """Take control: mastership, motors on, the motion servers started from main. Harmless when it is ours.

        Raises NotInControl naming who has it, SafetyStop, Refused naming what is missing, or how the connection failed.
        """
        with self._taking:
            if self._is_ours():
                return
            self._stated_loads()
            self._observer.sample()
            rws = self._commanding()
            panel, state = self._asked(rws)
            self._may_be_taken(panel, state)
            running = read_running(rws)
            if running and not panel.ours:
                raise NotInControl(
                    f"the RAPID program {self._programs(panel)} runs on {self.name}; stop it before taking control",
                    rws.address,
                )
            if not panel.ours:
                raise Refused(
                    f"{self.name} has {self._programs(panel)} loaded: load Arcor2Left.pgf and Arcor2Right.pgf "
                    "into T_ROB_L and T_ROB_R"
                )
            self._take_mastership(rws)
            try:
                if state != MOTORS_ON:
                    self._motors_on(rws)
                if not running:
                    start_rapid(rws)
                self._open_session()
            except BaseException:
                self._give_mastership()
                raise
            self._observer.observing.settled()

    def _open_session(self) -> None:
        session = ControlSession(self.name, self._yumi, self._session_over)
        try:
            session.open()
            for arm in ARMS:
                load = self._loads[arm]
                assert load is not None
                session.tell_tool(arm, self._tools[arm], load)
        except BaseException:
            session.end(NotInControl(f"control of {self.name} was not taken"))
            raise
        self._controlled_since = time.monotonic()
        self._session = session
        self._collision_acknowledged = False  # the next one is not acknowledged by this

    def release_control(self) -> None:
        """Stop both arms and give control back; harmless when it is not ours. Motors and servers stay on."""
        session, self._session = self._session, None
        self._count_stop(ARMS)
        if session is not None:
            if session.ended is None and self._observer.observing.online:
                for arm in ARMS:
                    with contextlib.suppress(DeviceError):
                        self._end_lead_through(arm)
            session.end(NotInControl(f"control of {self.name} was given back"))
        self._give_mastership()

    def _count_stop(self, arms: Iterable[str]) -> None:
        for arm in arms:
            self._stopped_at[arm] = time.monotonic()
            self._stops[arm] += 1

    def control_owner(self) -> str | None:
        """Tell who has control: "us", the pendant, who holds mastership, the program that runs, or nobody."""
        if self._is_ours():
            return "us"
        sample, panel = self._observer.sample(), self._observer.panel()
        if panel.operation_mode != AUTOMATIC:
            return "pendant"
        if panel.holder is not None and not self._mastership:
            return str(panel.holder)
        if sample.running and not panel.ours:
            return self._programs(panel)
        return None

    def _is_ours(self) -> bool:
        return self._session is not None and self._session.ended is None

    def _controlled(self) -> ControlSession:
        """Give the living session. Raises what ended it, or NotInControl."""
        session = self._session
        if session is not None and session.ended is None:
            return session
        self._observer.observing.check()
        raise not_controlled(self.name, session.ended if session is not None else None)

    def _commanding(self) -> Rws:
        """Give the session with the controller that commands; it is another than the one that observes."""
        if self._command is None:
            yumi = self._yumi
            self._command = Rws(self.name, yumi.host, yumi.rws_port, yumi.user, yumi.password)
        return self._command

    def _asked(self, rws: Rws) -> tuple[Panel, str]:
        """Ask anew for what a person changes, and for the control state."""
        panel = read_panel(rws)
        self._observer.note(panel)
        return panel, rws.value("/rw/panel/ctrlstate", "ctrlstate")

    def _may_be_taken(self, panel: Panel, state: str) -> None:
        """Raise what forbids to switch on and to take control."""
        collided = panel.collision == COLLISION and not self._collision_acknowledged
        safety = safety_of(state, collided)
        if safety is not Safety.NORMAL:
            raise SafetyStop(
                f"{self.name} cannot be controlled: {safety.value.replace('_', ' ')}",
                REMEDIES.get(safety, ""),
                safety.value,
            )
        if panel.operation_mode != AUTOMATIC:
            raise NotInControl(
                f"{self.name} is not in automatic but in {panel.operation_mode}: the pendant has it",
                self._observer.rws.address,
            )

    @staticmethod
    def _programs(panel: Panel) -> str:
        return " and ".join(sorted({name or "no program" for name in panel.programs.values()}))

    def _take_mastership(self, rws: Rws) -> None:
        try:
            request_mastership(rws, "rapid")
        except Refused as e:
            who = holder(rws)
            if who is None:
                raise
            raise NotInControl(f"{who} has mastership of {self.name}", f"{rws.address}: {e}; {e.detail}") from e
        self._mastership = True

    def _give_mastership(self) -> None:
        rws = self._command
        if not self._mastership or rws is None or not self._observer.observing.online:
            return
        if not release_mastership(rws, "rapid"):
            return  # it is still ours, and is given back at the next occasion
        self._mastership = False
        known = self._observer.known_panel
        if known is not None:
            self._observer.note(known._replace(holder=None))

    # -------------------------------------------------------------------------------- how it ends by itself
    def _seen(self, sample: Sample) -> None:
        panel = self._observer.known_panel
        if panel is not None and panel.collision != COLLISION:
            self._collision_acknowledged = False
        session = self._session
        if session is None or session.ended is not None or sample.monotonic < self._controlled_since:
            return
        if sample.control_state != MOTORS_ON or not sample.running:
            session.end(self._why_stopped(), wait=False)
            self._mastership_back()

    def _why_stopped(self) -> DeviceError:
        """Give why the program or the motors stopped, from the controller's own words, asked anew.

        A look takes its parts one after another: what stopped the program may have come after the control state.
        """
        rws = self._observer.rws
        panel, state = self._asked(rws)
        safety = safety_of(state, panel.collision == COLLISION)
        code, title = self._last_event(rws)
        if safety is not Safety.NORMAL:
            what = safety.value.replace("_", " ")
            return SafetyStop(f"{what} on {self.name} ({rws.address})", f"{code} {title}".strip(), safety.value)
        if state != MOTORS_ON:
            return NotInControl(f"the motors of {self.name} ({rws.address}) were switched off", f"{code} {title}")
        return DeviceFault(
            f"RAPID stopped on {self.name} ({rws.address}): {title or 'no reason told'}", f"{code}", code
        )

    def _last_event(self, rws: Rws) -> tuple[str, str]:
        """Give number and title of the newest error in the event log, or of its newest entry."""
        try:
            events = rws.get("/rw/elog/0", lang="en", lim="5")
        except Refused:
            return "", ""
        errors = [event for event in events if event.get("msgtype") == "3"]
        newest = (errors or events or [{}])[0]
        return newest.get("code", ""), newest.get("title", "")

    def _session_over(self, why: DeviceError) -> None:
        """A line to an arm ended by itself; on that line's thread."""
        log.warning("%s: control ended: %s", self.name, why)

    def _lost(self, error: DeviceError) -> None:
        session = self._session
        if session is not None:
            session.end(ConnectionLost(f"the connection to {self._observer.who} is lost", str(error)), wait=False)

    def _mastership_back(self) -> None:
        """Give mastership back after control ended by itself, so that others may take it."""
        with contextlib.suppress(DeviceError):
            self._give_mastership()

    def _explained(self, error: DeviceError) -> DeviceError:
        """Give why the line to an arm ended: a stop of the controller explains more than a closed socket."""
        if not isinstance(error, (ConnectionLost, NotInControl)):
            return error
        session = self._session
        with contextlib.suppress(DeviceError):
            sample = self._observer.sample_after(time.monotonic())
            if sample.control_state != MOTORS_ON or not sample.running:
                told = self._why_stopped()
                if session is not None and session.ended is error:
                    session.ended = told
                return told
        return error

    # -------------------------------------------------------------------------------- power, and what a person decides
    def power_on(self) -> None:
        """Switch the motors on; nothing moves. Raises NotInControl in manual mode, SafetyStop, Refused."""
        self._observer.sample()
        rws = self._commanding()
        panel, state = self._asked(rws)
        self._may_be_taken(panel, state)
        if state != MOTORS_ON:
            self._motors_on(rws)

    def _motors_on(self, rws: Rws) -> None:
        rws.act("/rw/panel/ctrlstate", "setctrlstate", {"ctrl-state": MOTORS_ON})
        await_value(rws, "/rw/panel/ctrlstate", "ctrlstate", MOTORS_ON, MOTORS_WITHIN, "switch its motors on")

    def acknowledge(self, code: str) -> None:
        """Refuse: a safety stop is acknowledged by a person by name; NotFound when `code` does not stand."""
        if code not in {alarm.code for alarm in self.alarms()}:
            raise NotFound(f"{self.name} has no alarm {code}")
        if code == Safety.PROTECTIVE_STOP.value:
            raise Refused(
                f"{code} of {self.name} needs the person who looked: acknowledge_protective_stop(confirmed_by)"
            )
        raise Refused(f"{code} of {self.name} is acknowledged at the controller")

    def acknowledge_protective_stop(self, confirmed_by: str) -> None:
        """Take note that a person looked at a collision; control may be taken again, the old motion is forgotten."""
        if not confirmed_by.strip():
            raise InvalidData("confirmed_by must name the person who looked at the robot")
        sample = self._observer.sample()
        if self._safety(sample) is not Safety.PROTECTIVE_STOP:
            raise Refused(f"{self.name} is in no protective stop")
        self._collision_acknowledged = True
        log.warning("%s: collision acknowledged by %s", self.name, confirmed_by)

    # -------------------------------------------------------------------------------- hand teaching
    def get_hand_teaching_mode(self, arm_id: str | None = None) -> bool:
        """Tell whether an arm can be moved by hand. Raises Refused where the controller has no lead-through."""
        arm = self._arm(arm_id)
        return bool(self._observer.panel().lead_through[arm])

    def set_hand_teaching_mode(self, enabled: bool, arm_id: str | None = None) -> None:
        """Make an arm movable by hand, or stiff again. It needs control, a stated load, and both arms at rest."""
        arm = self._arm(arm_id)
        self._controlled()
        if self._observer.panel().lead_through[arm] is None:
            raise Refused(f"the controller of {self.name} has no lead-through for {UNITS[arm]}")
        if enabled and self.move_in_progress:
            raise Refused(f"{self.name} moves; an arm is released for hand teaching when both stand")
        self._set_lead_through(arm, enabled)

    def _set_lead_through(self, arm: str, enabled: bool) -> None:
        rws = self._commanding()
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

    def _stiff(self, arm: str) -> None:
        """Raise Refused when an arm is moved by hand: it does not move, and the other has nothing to keep clear of."""
        lead_through = self._observer.panel().lead_through
        other = ARMS[1 - ARMS.index(arm)]
        if lead_through[arm]:
            raise Refused(f"the {arm} arm of {self.name} is in hand teaching mode")
        if lead_through[other]:
            raise Refused(
                f"the {other} arm of {self.name} is in hand teaching mode: the {arm} arm cannot keep clear of it"
            )

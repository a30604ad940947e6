"""The simulated IRC5 controller: panel, operating mode, mastership, RAPID, event log, and both arms."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from arcor2_fakes.abb_yumi.arm import Arm

CONTROL_STATES: Final = (
    "init",
    "motoroff",
    "motoron",
    "guardstop",
    "emergencystop",
    "emergencystopreset",
    "sysfail",
)
OPERATION_MODES: Final = ("INIT", "AUTO_CH", "MANF_CH", "MANR", "MANF", "AUTO", "UNDEF")
TASKS: Final = {"left": "T_ROB_L", "right": "T_ROB_R"}
UNITS: Final = {"left": "ROB_L", "right": "ROB_R"}
PROGRAMS: Final = {"left": "Arcor2Left", "right": "Arcor2Right"}
DOMAINS: Final = ("cfg", "motion", "rapid")
MOTORS_ON_TIME: Final = 0.5  # s
MAX_STEP: Final = 0.005  # s


@dataclass
class Holder:
    """Holder of mastership: number of its session, or 0 for a client outside of the fake."""

    session: int
    alias: str
    application: str
    location: str


@dataclass
class Event:
    """An entry of the event log."""

    number: int
    code: int
    kind: int
    title: str
    stamp: str = field(default_factory=lambda: time.strftime("%Y-%m-%d T %H:%M:%S"))


class Controller:
    """State of the controller. `pace` is the speed of the simulation; 1 is real time."""

    def __init__(self, pace: float = 1.0) -> None:
        self.pace = pace
        self.arms = {name: Arm(name) for name in TASKS}
        self.control_state = "motoroff"
        self.operation_mode = "AUTO"
        self.speed_ratio = 100
        self.collision = "INIT"
        self.running = False
        self.at_main = False
        self.programs = dict(PROGRAMS)
        self.mastership: dict[str, Holder | None] = dict.fromkeys(DOMAINS)
        self.events: deque[Event] = deque(maxlen=100)
        self.writes: dict[str, int] = {}
        self.stopped: list[Callable[[], None]] = []
        self.reset_to_main: list[Callable[[], None]] = []
        self._motors_due: float | None = None
        self._logged = 0

    # -------------------------------------------------------------------------------- commands of clients
    @property
    def ours(self) -> bool:
        """Return whether the programs of both tasks are the motion servers."""
        return self.programs == PROGRAMS

    def wrote(self, command: str) -> None:
        """Count a command that changed the state."""
        self.writes[command] = self.writes.get(command, 0) + 1

    def motors(self, on: bool) -> bool:
        """Switch the motors; return False if the state does not allow it."""
        if self.operation_mode != "AUTO" or self.control_state not in ("motoroff", "motoron"):
            return False
        self.wrote("motors")
        if not on:
            self._power_lost("motoroff", 10011, "Motors OFF state")
        elif self.control_state == "motoroff":
            self._motors_due = time.monotonic() + MOTORS_ON_TIME / self.pace
        return True

    def start(self) -> bool:
        """Start RAPID in both tasks; return False if the state does not allow it."""
        if self.control_state != "motoron" or self.running or not self.at_main:
            return False
        self.wrote("start")
        self.running, self.at_main, self.collision = True, False, "INIT"
        self.log(10015 if self.operation_mode != "AUTO" else 10151, 1, "Program started")
        return True

    def stop(self) -> None:
        """Stop RAPID in both tasks; the arms brake along their paths."""
        self.wrote("stop")
        if self.running:
            self._stop_program(10125, 1, "Program stopped")

    def to_main(self) -> bool:
        """Set the program pointers to main; return False while RAPID runs."""
        if self.running:
            return False
        self.wrote("resetpp")
        self.at_main = True
        for listener in self.reset_to_main:
            listener()
        return True

    def set_lead_through(self, arm: str, on: bool) -> bool:
        """Enable or disable moving an arm by hand. Return False if the state does not allow it."""
        if self.control_state != "motoron" or self.arms[arm].moving:
            return False
        self.wrote("lead-through")
        self.arms[arm].lead_through = on
        return True

    def log(self, code: int, kind: int, title: str) -> None:
        """Add an entry to the event log; kind 1 is information, 2 warning, 3 error."""
        self._logged += 1
        self.events.appendleft(Event(self._logged, code, kind, title))

    # -------------------------------------------------------------------------------- commands of tests
    def set_control_state(self, state: str) -> None:
        """Set the control state, such as emergency stop or emergency stop reset."""
        if state not in CONTROL_STATES:
            raise ValueError(f"state must be one of {', '.join(CONTROL_STATES)}")
        if state == "motoron":
            self.control_state = state
            return
        code = {"emergencystop": 10013, "guardstop": 10012, "sysfail": 10020}.get(state, 10011)
        self._power_lost(state, code, f"{state} state")

    def set_operation_mode(self, mode: str) -> None:
        """Turn the key; RAPID stops and the motors switch off, as with a real key."""
        if mode not in OPERATION_MODES:
            raise ValueError(f"mode must be one of {', '.join(OPERATION_MODES)}")
        if mode != self.operation_mode:
            self.operation_mode = mode
            if self.control_state == "motoron":
                self._power_lost("motoroff" if mode == "AUTO" else "guardstop", 10011, "Motors OFF state")

    def foreign_program(self, on: bool = True, name: str = "Palletizing") -> None:
        """Load and run another program, or load ours and leave it stopped."""
        if on:
            self._stop_program(10125, 1, "Program stopped")
            self.programs = dict.fromkeys(TASKS, name)
            self.control_state, self.running = "motoron", True
        else:
            self.running, self.at_main = False, False
            self.programs = dict(PROGRAMS)

    def hold_mastership(self, on: bool = True, alias: str = "Operator", location: str = "Flexpendant") -> None:
        """Let another client hold mastership of RAPID and motion."""
        for domain in ("rapid", "motion"):
            self.mastership[domain] = Holder(0, alias, "RobotStudio", location) if on else None

    def rapid_error(self, code: int = 40512, title: str = "Missing external axis value") -> None:
        """Stop the program with an error."""
        self._stop_program(code, 3, title)

    def collide(self, arm: str) -> None:
        """Trip the motion supervision of an arm; both arms stop at once."""
        unit = UNITS[arm]
        self.collision = "TRIGGERED"
        for each in self.arms.values():
            each.halt()
        self._stop_program(50204, 3, f"Motion supervision triggered for axis 2 on {unit}")

    def session_ended(self, session: int) -> None:
        """Release the mastership of a session."""
        for domain, holder in self.mastership.items():
            if holder is not None and holder.session == session:
                self.mastership[domain] = None

    def advance(self, dt: float) -> None:
        """Advance by `dt` s of the real clock."""
        if self._motors_due is not None and time.monotonic() >= self._motors_due:
            self._motors_due = None
            if self.control_state == "motoroff":
                self.control_state = "motoron"
                self.log(10011, 1, "Motors ON state")
        left = dt * self.pace
        while left > 0.0:
            step = min(left, MAX_STEP)
            left -= step
            for arm in self.arms.values():
                arm.advance(step, self.speed_ratio / 100.0)

    def _power_lost(self, state: str, code: int, title: str) -> None:
        self._motors_due = None
        self.control_state = state
        for arm in self.arms.values():
            arm.halt()
            arm.lead_through = False
        self.log(code, 1, title)
        if self.running:
            self._stop_program(10125, 1, "Program stopped")

    def _stop_program(self, code: int, kind: int, title: str) -> None:
        self.running = self.at_main = False
        for arm in self.arms.values():
            arm.ended = lambda: None
            arm.stop()
        self.log(code, kind, title)
        for listener in self.stopped:
            listener()

    def truth(self) -> dict[str, Any]:
        """Return the true state, for tests; joints in degrees, axes 1 to 7."""
        flanges = {name: arm.kinematics.forward(arm.q) for name, arm in self.arms.items()}
        return {
            "control_state": self.control_state,
            "operation_mode": self.operation_mode,
            "running": self.running,
            "programs": self.programs,
            "mastership": {domain: holder and holder.alias for domain, holder in self.mastership.items()},
            "writes": self.writes,
            "flange_distance": float(np.linalg.norm(flanges["left"][:3, 3] - flanges["right"][:3, 3])),
            "arms": {
                name: {
                    "joints": np.degrees(arm.q).tolist(),
                    "speed": float(np.abs(arm.qd).max()),
                    "moving": arm.moving,
                    "moves_begun": arm.moves_begun,
                    "position": flanges[name][:3, 3].tolist(),
                    "tool_position": arm.tool[:3, 3].tolist(),
                    "load": arm.load,
                    "lead_through": arm.lead_through,
                    "width": arm.hand.width,
                    "vacuum": arm.hand.vacuum,
                }
                for name, arm in self.arms.items()
            },
        }

"""The control channel of the fake: the true state, and events from outside the controller.

To read and subscribe: `truth` (everything), `pose` (the state for a simulated world, at a high rate). To read: `stops`
(frames that request a stop, stamped at arrival), `commands_taken` (executed motions), `popup`. To do, with `on` true or
false: `safeguard_stop` (`reports_paused`), `emergency_stop` (`system`), `reduced`, `remote_control`,
`foreign_program`, `power`, `contact`, `fieldbus` (owns registers 0 to 23). To do: `protective_stop`, `violation`,
`fault`, `boot`, `obstacle` point normal stiffness (a plane in the base, in m and N/m; `no_obstacle` removes it),
`recovery` on, `brake_release`, `operational_mode` mode, `set_input` bit on, `speed_slider` fraction, `place` q (a
test's set-up), `guide` q speed (by hand, in freedrive only), `in_use` and `not_found` names of RTDE variables. The
faults of the wires rtde, script and dashboard are those of `arcor2_fakes.wire`.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

from arcor2_fakes.control import ControlServer
from arcor2_fakes.ur.contact import STIFFNESS, Obstacle
from arcor2_fakes.ur.controller import Controller
from arcor2_fakes.ur.dashboard import Dashboard
from arcor2_fakes.ur.motion import JOINT_RANGE, GuidedMotion
from arcor2_fakes.ur.rtde_server import RtdeServer
from arcor2_fakes.ur.script_port import ScriptPort
from arcor2_fakes.ur.states import RobotMode
from arcor2_fakes.ur.urscript import ForeignProgram


def truth(c: Controller, rtde: RtdeServer, script: ScriptPort) -> dict[str, Any]:
    """Return the true state. Time stamps are `time.monotonic()` of this machine."""
    return {
        "timestamp": c.cycles * c.period,
        "q": c.arm.q,
        "qd": c.arm.qd,
        "tcp_pose": c.arm.pose,
        "tcp_offset": c.tcp_offset,
        "payload": c.payload,
        "payload_cog": c.payload_cog,
        "payload_inertia": c.payload_inertia,
        "tcp_force": c.tcp_force,
        "moving": c.arm.moving,
        "program": c.program.name if c.program is not None else None,
        "register_offset": c.program.register_offset if c.program is not None else None,
        "runtime": c.runtime.name,
        "robot_mode": c.robot_mode.name,
        "safety": c.safety.name,
        "remote": c.remote,
        "operational_mode": c.operational_mode,
        "freedrive": c.freedrive,
        "speed_slider": c.arm.slider,
        "digital_outputs": c.digital_outputs,
        "digital_inputs": c.digital_inputs,
        "stops_seen": c.stops_seen,
        "last_stop": c.stops[-1] if c.stops else None,
        "last_command": c.commands[-1] if c.commands else None,
        "watchdog": c.watchdog,
        "watchdog_trips": c.watchdog_trips,
        "programs_killed": c.programs_killed,
        "samples_sent": rtde.samples_sent,
        "samples_lost": rtde.samples_lost,
        "rtde_clients": len(rtde.sessions),
        "scripts_taken": script.scripts_taken,
        "scripts_ignored": script.scripts_ignored,
    }


def pose_truth(c: Controller) -> dict[str, Any]:
    """Return the state for a simulated world that polls it at a high rate."""
    return {
        "t": c.cycles * c.period,
        "q": c.arm.q,
        "tcp_pose": c.arm.pose,
        "moving": c.arm.moving,
        "digital_outputs": c.digital_outputs,
        "digital_inputs": c.digital_inputs,
    }


def _switch(act: Callable[[bool], None]) -> Callable[..., None]:
    def command(on: bool = True) -> None:
        if not isinstance(on, bool):
            raise ValueError("on is true or false")
        act(on)

    return command


def register(control: ControlServer, c: Controller, rtde: RtdeServer, script: ScriptPort, dashboard: Dashboard) -> None:
    """Register all commands and sources."""

    def power(on: bool) -> None:
        if on:
            c.power_on()
        else:
            c.power_off()

    def foreign_program(on: bool) -> None:
        if on:
            c.start_program(ForeignProgram(c))
        elif isinstance(c.program, ForeignProgram):
            c.stop_program("control channel")

    def set_input(bit: int, on: bool = True) -> None:
        if not 0 <= bit < 18:
            raise ValueError("bit must be 0 to 17: 8 standard, 8 configurable, 2 tool inputs")
        c.digital_inputs = c.digital_inputs & ~(1 << bit) | int(on) << bit
        c.changed()

    def joints(q: Sequence[float]) -> tuple[float, ...]:
        if len(q) != 6 or not all(math.isfinite(v) and abs(v) <= JOINT_RANGE for v in q):
            raise ValueError("q must have six joint positions within +-2 pi")
        return tuple(map(float, q))

    def place(q: Sequence[float]) -> None:
        c.arm.teleport(joints(q))
        c.changed()

    def guide(q: Sequence[float], speed: float = 0.5) -> None:
        if not c.freedrive or c.robot_mode is not RobotMode.RUNNING:
            raise ValueError("the brakes hold: not in freedrive")
        c.arm.motion = GuidedMotion(c.arm.q, joints(q), speed)

    def operational_mode(mode: str) -> None:
        if mode not in ("MANUAL", "AUTOMATIC", "NONE"):
            raise ValueError("mode is MANUAL, AUTOMATIC or NONE")
        c.operational_mode = mode
        c.changed()

    def slider(fraction: float) -> None:
        if not 0.0 <= fraction <= 1.0:
            raise ValueError("fraction must be 0 to 1")
        c.arm.slider = float(fraction)

    def safeguard_stop(on: bool = True, reports_paused: bool = False) -> None:
        _switch(lambda to: c.safeguard_stop(to, reports_paused))(on)

    def contact(on: bool) -> None:
        c.contact = on

    def obstacle(point: Sequence[float], normal: Sequence[float], stiffness: float = STIFFNESS) -> None:
        c.place_obstacle(Obstacle.of(point, normal, stiffness))

    def remote(on: bool) -> None:
        c.remote = on
        c.changed()

    def in_use(names: Sequence[str]) -> None:
        rtde.claims.update(dict.fromkeys(names, c))

    def fieldbus(on: bool) -> None:
        """Assign the lower half of the registers to a fieldbus."""
        lower = [f"input_{kind}_register_{i}" for kind in ("int", "double") for i in range(24)]
        if on:
            in_use(lower)
        else:
            for name in lower:
                if rtde.claims.get(name) is c:
                    del rtde.claims[name]

    control.source("truth", lambda: truth(c, rtde, script))
    control.source("pose", lambda: pose_truth(c))
    control.command("stops", lambda: list(c.stops))
    control.command("commands_taken", lambda: list(c.commands))
    control.command("popup", lambda: dashboard.popup)
    control.command("protective_stop", lambda why="control channel": c.protective_stop(why))
    control.command("safeguard_stop", safeguard_stop)
    control.command("emergency_stop", lambda on=True, system=False: c.emergency_stop(on, system))
    control.command("reduced", _switch(c.reduced))
    control.command("violation", lambda: c.fault(violation=True))
    control.command("fault", lambda: c.fault(violation=False))
    control.command("restart_safety", c.restart_safety)
    control.command("remote_control", _switch(remote))
    control.command("operational_mode", operational_mode)
    control.command("foreign_program", _switch(foreign_program))
    control.command("power", _switch(power))
    control.command("brake_release", c.brake_release)
    control.command("boot", c.boot)
    control.command("set_input", set_input)
    control.command("place", place)
    control.command("guide", guide)
    control.command("speed_slider", slider)
    control.command("contact", _switch(contact))
    control.command("obstacle", obstacle)
    control.command("no_obstacle", lambda: c.place_obstacle(None))
    control.command("recovery", _switch(c.recovery))
    control.command("fieldbus", _switch(fieldbus))
    control.command("in_use", lambda names: in_use(names))
    control.command("not_found", lambda names: rtde.not_found.update(names))

    def changed() -> None:
        control.publish("truth")
        control.publish("pose")

    c.changed = changed

"""Model of the program that ur_rtde uploads: a command loop over registers, with threads.

The command codes are those of the program's text. Its stops too: a stopL or stopJ is run as stopj until the first
asynchronous stop, and as stopl from then on.
"""

import math
import re
from collections.abc import Callable, Sequence

from arcor2_fakes.ur.controller import Controller, Program, Steps
from arcor2_fakes.ur.kinematics import compose, from_pose, to_pose
from arcor2_fakes.ur.motion import JOINT_RANGE, JointSpeed, LinearSpeed, Servo
from arcor2_fakes.ur.outputs import flange_pose, readers
from arcor2_fakes.ur.urscript import Call, Interpreter, calls

_READY, _DONE = 1, 2
_REALTIME = frozenset({24, 11, 9, 10, 6, 25, 26, 27, 38, 58, 66, 67, 68, 69, 70, 71})
_STOP_SCRIPT = 255
_NOT_MODELLED = frozenset({6, 8, 20, 21, 56, 57, 59, 62, 63, 66, 67, 68, 69, 71})
"""Commands of the program that the fake does not execute: force mode, external sensors, contact detection, dynamics."""
_OFFSET = re.compile(r"reg_offset_int =\s*(?:#[^\n]*\n)?\s*(\d+)")
_PATH = re.compile(r"def exec_move_path\(\):(.*?)^\s*end\b", re.DOTALL | re.MULTILINE)
_MARK = "def rtde_control()"


class ControlScript(Program):
    """The control script of a client, identified by its text."""

    name = "rtde_control"
    register_offset: int

    @staticmethod
    def is_one(text: str) -> bool:
        """Return whether a program text is the control script."""
        return text.startswith(_MARK)

    def __init__(self, controller: Controller, text: str) -> None:
        offset = _OFFSET.search(text)
        self.register_offset = int(offset[1]) if offset else 0
        path = _PATH.search(text)
        self._path = calls(path[1]) if path else []
        self._c = controller
        self._arm = controller.arm
        self._interpreter = _WithProgress(self)
        self._threads: dict[str, Steps] = {}
        self._stop_is_linear = False
        self._async_writes = self._async_operation = 0
        self._speed: tuple[bool, tuple[float, ...], float] = (False, (0.0,) * 6, 0.5)
        self._servo_target: tuple[float, ...] = (0.0,) * 6
        self._servo_lookahead = 0.1
        self._torques = readers(controller)["target_moment"]
        self._handlers: dict[int, Callable[[], Steps | None]] = self._table()

    # ----------------------------------------------------------------------------------------------------- registers
    def _ints(self, i: int) -> int:
        return self._c.input_ints[self.register_offset + i]

    def _double(self, i: int) -> float:
        return self._c.input_doubles[self.register_offset + i]

    def _six(self, i: int) -> tuple[float, ...]:
        start = self.register_offset + i
        return tuple(self._c.input_doubles[start : start + 6])

    def _write_int(self, i: int, value: int) -> None:
        self._c.output_ints[self.register_offset + i] = value

    def _write_doubles(self, values: Sequence[float]) -> None:
        start = self.register_offset
        self._c.output_doubles[start : start + len(values)] = values

    def progress(self, value: int) -> None:
        """Write the asynchronous status: 0 starts an operation, a negative value ends it, others are its progress."""
        self._async_writes = (self._async_writes + 1) % 128
        if value == 0:
            self._async_operation = (self._async_operation + 1) % 128
        status = self._async_writes << 16 | self._async_operation << 24
        self._write_int(2, status | 1 << 15 | value if value >= 0 else status)

    # ----------------------------------------------------------------------------------------------------- main loop
    def run(self) -> Steps:
        """Run the main thread and the other threads, one control cycle at a time."""
        main = self._main()
        while True:
            try:
                next(main)
            except StopIteration:
                return
            for name, thread in tuple(self._threads.items()):
                try:
                    next(thread)
                except StopIteration:
                    self._threads.pop(name, None)
            yield

    def _main(self) -> Steps:
        self.progress(-1)
        self._write_int(0, _READY)
        executing = False
        while True:
            command = self._ints(0)
            if command in _REALTIME:
                self._run_at_once(command)
                self._write_int(0, _READY)
            elif command == 0:
                executing = False
                self._write_int(0, _READY)
            elif command == _STOP_SCRIPT:
                return
            elif not executing:
                steps = self._handler(command)()
                if steps is not None:
                    yield from steps
                self._write_int(0, _DONE)
                executing = True
            yield

    def _run_at_once(self, command: int) -> None:
        self._handler(command)()

    def _handler(self, command: int) -> Callable[[], Steps | None]:
        """Return the function for a command; a function without effect if the program lacks the command."""
        if command in _NOT_MODELLED:
            raise ValueError(f"command {command} is not modelled")
        return self._handlers.get(command, lambda: None)

    def _start(self, name: str, steps: Steps) -> None:
        self._threads[name] = steps

    def _kill(self, name: str) -> bool:
        thread = self._threads.pop(name, None)
        if thread is None:
            return False
        thread.close()
        self._arm.halt()
        return True

    # ------------------------------------------------------------------------------------------------------- motions
    def _table(self) -> dict[int, Callable[[], Steps | None]]:
        c, interpreter = self._c, self._interpreter
        return {
            1: lambda: self._move(lambda: interpreter.move_joints(self._six(0), self._double(6), self._double(7))),
            2: lambda: self._move(self._move_joints_to_pose),
            3: lambda: self._move(
                lambda: interpreter.move_linear(self._six(0), self._double(6), self._double(7), True)
            ),
            4: lambda: self._move(
                lambda: interpreter.move_linear(self._six(0), self._double(6), self._double(7), False)
            ),
            7: lambda: interpreter.stop(10.0, linear=True),
            9: lambda: self._set_speed(linear=False),
            10: lambda: self._set_speed(linear=True),
            11: lambda: self._set_servo(self._six(0)),
            12: lambda: self._start(
                "servo", interpreter.move_linear(self._six(0), self._double(6), self._double(7), True)
            ),
            15: self._speed_stop,
            16: self._servo_stop,
            17: lambda: self._set_payload(),
            18: lambda: self._freedrive(True),
            19: lambda: self._freedrive(False),
            24: lambda: self._set_servo(interpreter.joints(self._six(0))),
            25: lambda: self._write_int(1, int(c.touching)),
            26: lambda: self._write_doubles((c.period,)),
            27: lambda: self._write_doubles(c.arm.q),
            28: lambda: self._write_doubles(c.arm.pose),
            29: lambda: interpreter.at_once(Call("set_tcp", (self._six(0),))),
            30: lambda: self._write_doubles(interpreter.joints(self._six(0), self._six(6))),
            31: lambda: c.protective_stop("by the program"),
            33: lambda: self._stop(),
            34: lambda: self._stop(),
            35: lambda: c.set_watchdog(self.register_offset, self._double(0)),
            36: lambda: self._write_int(1, int(self._reachable(self._six(0)))),
            37: lambda: self._write_int(1, int(max(map(abs, self._six(0))) <= JOINT_RANGE)),
            38: lambda: self._write_doubles(tuple(self._torques())),
            39: lambda: self._write_doubles(to_pose(compose(from_pose(self._six(0)), from_pose(self._six(6))))),
            40: lambda: self._write_doubles(c.tcp_offset),
            41: self._start_jog,
            42: self._stop_jog,
            43: lambda: self._write_doubles(c.arm.pose),
            44: lambda: self._write_doubles(to_pose(compose(c.chain.flange(self._six(0)), from_pose(self._six(6))))),
            45: lambda: self._move(lambda: interpreter.run(self._path)),
            46: lambda: self._write_doubles(interpreter.joints(self._six(0))),
            47: lambda: self._write_int(1, int(not c.arm.moving)),
            51: self._move_until_contact,
            52: lambda: self._freedrive(True),
            53: lambda: self._freedrive(False),
            54: lambda: self._write_int(1, 0),
            58: lambda: self._write_doubles(flange_pose(c)),
            60: lambda: self._write_int(1, int(self._reachable(self._six(0)))),
            61: lambda: self._write_int(1, int(self._reachable(self._six(0)))),
            64: lambda: self._write_int(1, int(c.touching)),
            65: lambda: self._set_payload(with_inertia=True),
            70: self._jacobian,
        }

    def _move(self, motion: Callable[[], Steps]) -> Steps | None:
        """Run a motion command, in a separate thread if requested, else in the command loop."""
        self._stop_async_move()
        if self._ints(1) != 1:
            return motion()
        self._start("move", self._asynchronous(motion()))
        return None

    def _asynchronous(self, steps: Steps) -> Steps:
        self.progress(0)
        yield from steps
        self.progress(-1)

    def _stop_async_move(self) -> None:
        if self._kill("move"):
            self.progress(-1)

    def _move_joints_to_pose(self) -> Steps:
        q = self._interpreter.joints(self._six(0))
        return self._interpreter.move_joints(q, self._double(6), self._double(7))

    def _stop(self) -> Steps | None:
        deceleration, asynchronous = self._double(0), self._ints(1) == 1
        if self._threads.pop("stop", None) is not None:
            self.progress(-1)
        else:
            self._stop_async_move()
        if not asynchronous:
            return self._interpreter.stop(deceleration, self._stop_is_linear)
        self._stop_is_linear = True
        self._start("stop", self._asynchronous(self._interpreter.stop(deceleration, linear=True)))
        return None

    def _move_until_contact(self) -> Steps:
        twist, acceleration = self._six(0), max(0.01, self._double(12))
        while not self._c.touching:
            if type(self._arm.motion) is not LinearSpeed:
                self._arm.motion = LinearSpeed(self._arm, twist, acceleration)
            yield
        yield from self._interpreter.stop(3.0, linear=True)

    # ------------------------------------------------------------------------------------------- speed, servo and jog
    def _set_speed(self, linear: bool) -> None:
        _finite(self._six(0))
        self._speed = (linear, self._six(0), max(0.01, self._double(6)))
        if "speed" not in self._threads:
            self._c.note_command("speedl" if linear else "speedj", target=list(self._six(0)))
            self._start("speed", self._keep_speed())

    def _keep_speed(self) -> Steps:
        arm = self._arm
        while True:
            linear, target, acceleration = self._speed
            motion = arm.motion
            if isinstance(motion, LinearSpeed if linear else JointSpeed):
                motion.target, motion.acceleration = target, acceleration
            elif linear:
                arm.motion = LinearSpeed(arm, target, acceleration)
            else:
                arm.motion = JointSpeed(target, acceleration)
            yield

    def _speed_stop(self) -> Steps:
        self._kill("speed")
        return self._interpreter.stop(self._double(0), linear=self._speed[0])

    def _set_servo(self, target: tuple[float, ...]) -> None:
        _finite(target)
        self._servo_target, self._servo_lookahead = target, self._double(9)
        if "servo" not in self._threads:
            self._c.note_command("servoj", target=list(target))
            self._start("servo", self._keep_servo())

    def _keep_servo(self) -> Steps:
        arm = self._arm
        while True:
            if isinstance(arm.motion, Servo):
                arm.motion.target = self._servo_target
            else:
                arm.motion = Servo(self._servo_target, self._servo_lookahead)
            yield

    def _servo_stop(self) -> Steps:
        self._kill("servo")
        return self._interpreter.stop(self._double(0), linear=True)

    def _start_jog(self) -> None:
        twist, feature = self._six(0), round(self._double(6))
        if feature != 0:
            frame = self._arm.pose if feature == 1 else self._six(8)
            turn = from_pose((0.0, 0.0, 0.0, *frame[3:]))
            twist = tuple(
                compose(turn, from_pose((*part, 0.0, 0.0, 0.0)))[3][i]
                for part in (twist[:3], twist[3:])
                for i in range(3)
            )
        self._speed = (True, twist, max(0.01, self._double(7)))
        if "jog" not in self._threads:
            self._c.note_command("jog", target=list(twist))
            self._start("jog", self._keep_speed())

    def _stop_jog(self) -> Steps:
        self._kill("jog")
        return self._interpreter.stop(1.2, linear=True)

    # -------------------------------------------------------------------------------------------------------- the rest
    def _reachable(self, pose: tuple[float, ...]) -> bool:
        return bool(self._c.chain.solutions(from_pose(pose)))

    def _set_payload(self, with_inertia: bool = False) -> None:
        mass, cog = self._double(0), self._six(1)[:3]
        if with_inertia:
            self._interpreter.at_once(Call("set_target_payload", (mass, cog, self._six(4))))
        else:
            self._interpreter.at_once(Call("set_payload", (mass, cog if any(cog) else None)))

    def _freedrive(self, on: bool) -> None:
        self._c.freedrive = on
        if not on:
            self._arm.halt()
        self._c.changed()

    def _jacobian(self) -> None:
        columns = self._c.chain.jacobian(self._arm.q).T.flatten().tolist()
        self._c.output_doubles[0:24], self._c.output_doubles[36:48] = columns[:24], columns[24:]


def _finite(values: Sequence[float]) -> None:
    if not all(map(math.isfinite, values)):
        raise ValueError("not a number")


class _WithProgress(Interpreter):
    """Runs the path that a client has written into its control script, and reports the progress."""

    def __init__(self, script: ControlScript) -> None:
        super().__init__(script._c)
        self._script = script

    def at_once(self, call: Call) -> None:
        """Run a call, or report progress."""
        if call.name == "signal_async_progress":
            self._script.progress(int(call.get("value", 0, 0)))
        else:
            super().at_once(call)

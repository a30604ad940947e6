"""The process that holds ur_rtde's control and I/O interfaces and kicks the controller's watchdog. Run by `control.py`.

A process of its own for two reasons. A busy cell host must not stop the arm: kicks and the deadline of a jog do not
depend on the host's interpreter. And ur_rtde 1.6.5, when its connection breaks, reconnects on its own account and sends
its program again, which ends whatever plays on the controller by then, without the watchdog; it sometimes crashes the
process; and its constructors and destructors hold the interpreter. A process can be killed at any moment.

Standard input has one request a line, `{"n": 1, "do": "moveL", "args": [...]}`, and the host's pulses. Standard output
has one answer a line, `{"n": 1, "data": ...}` or `{"n": 1, "error": "..."}`; a request without a number is not
answered. When the host ends, or sends no pulse for FROZEN_AFTER s, this process stops the program and ends.
"""

import contextlib
import json
import math
import os
import queue
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from rtde_control import RTDEControlInterface
from rtde_io import RTDEIOInterface

from arcor2_hw.keep_alive_process import Parent, ParentEnd

COMMANDS = (
    "endTeachMode",
    "getForwardKinematics",
    "getInverseKinematics",
    "getInverseKinematicsHasSolution",
    "moveJ",
    "moveL",
    "setPayload",
    "setTargetPayload",
    "setTcp",
    "speedStop",
    "stopScript",
    "teachMode",
)
SPEEDS = ("speedJ", "speedL")
MOTIONS = frozenset({"moveJ", "moveL", "teachMode", "own"})
"""Commands before which a jog is ended: two threads of the program must not both move the arm."""
OUTPUTS = ("setConfigurableDigitalOut", "setStandardDigitalOut", "setToolDigitalOut")
SHOWN = 0.02  # s until the next command, a kick, may take the velocity's place in the register: two cycles of a CB3
RESUMED_WITHIN = 3.0  # s for the control program to play again; it takes 0.1
KICKS_PER_PERIOD = 8.0  # kicks within one period of the watchdog
AHEAD = -10  # niceness that is asked for; most computers refuse it
LAST_STOP = 0.15  # s for the stop with which this process ends; the watchdog stops the arm if it fails
LOOK = 0.1  # s between two looks whether the host has ended

TOO_SLOW: Final = 3
"""Exit status when the watchdog must have tripped because this process was not run in time."""
HOST_FROZEN: Final = 4
"""Exit status when the host has sent no pulse for FROZEN_AFTER s."""


def main() -> None:
    """Open with the arguments of the command line, a JSON object, and serve."""
    answers = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    with contextlib.suppress(OSError):  # as a service it needs LimitNICE for it
        os.setpriority(os.PRIO_PROCESS, 0, AHEAD)
    os.dup2(2, 1)  # the library writes to standard output as it pleases
    arguments = json.loads(sys.argv[1])
    try:
        program = ControlProgram(**arguments)
    except RuntimeError as e:
        answers.write(json.dumps({"n": 0, "error": str(e)}) + "\n")
        os._exit(1)
    requests: queue.SimpleQueue[bytes | int] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    answers.write(json.dumps({"n": 0, "data": None}) + "\n")
    while True:
        try:
            line = requests.get(timeout=program.keep_alive())
        except queue.Empty:
            continue
        if isinstance(line, int):
            program.last_stop()
            os._exit(line)
        request = json.loads(line)
        number = request.get("n")
        try:
            answer = {"n": number, "data": program.do(request["do"], request["args"])}
        except (RuntimeError, TypeError, ValueError, KeyError) as e:
            answer = {"n": number, "error": f"{type(e).__name__}: {e}"}
        if number is not None:
            answers.write(json.dumps(answer) + "\n")
        if request["do"] == "stopScript":
            os._exit(0)


def _listen(requests: "queue.SimpleQueue[bytes | int]") -> None:
    """Put requests into the queue, at last the exit status, and leave the main thread a moment for its last stop."""
    parent = Parent()
    while parent.ended is None:
        for line in parent.lines(LOOK):
            requests.put(line)
    status = HOST_FROZEN if parent.ended is ParentEnd.FROZEN else 0
    requests.put(status)
    time.sleep(LAST_STOP)
    os._exit(status)


class ControlProgram:
    """The control program on the controller, or a program of our own in its place: commands, kicks, ends of jogs."""

    def __init__(self, host: str, frequency: float, upper: bool, watchdog: float) -> None:
        self._io = RTDEIOInterface(host, False, upper)
        flags = RTDEControlInterface.FLAG_UPLOAD_SCRIPT | RTDEControlInterface.FLAG_NO_EXT_FT
        if upper:
            flags |= RTDEControlInterface.FLAG_UPPER_RANGE_REGISTERS
        self._control = RTDEControlInterface(host, frequency, flags)
        self._frequency = watchdog
        if not self._control.setWatchdog(watchdog):
            raise RuntimeError("the watchdog of the control program cannot be armed")
        self._registers = Registers(self._io, 42 if upper else 18)
        self._own = False
        self._jog_ends = math.inf
        self._written = time.monotonic()
        self._period = 1.0 / (KICKS_PER_PERIOD * watchdog)
        control = self._control
        self._commands: dict[str, Callable[..., Any]] = {
            **{name: getattr(control, name) for name in COMMANDS},
            **{name: getattr(self._io, name) for name in OUTPUTS},
            **{name: self._speed(getattr(control, name)) for name in SPEEDS},
            "own": self._begin_own,
            "control": self._end_own,
            "resume": self._resume,
            "stop": self._stop,
        }

    @property
    def _jogs(self) -> bool:
        return self._jog_ends < math.inf

    def do(self, command: str, arguments: list[Any]) -> Any:
        """Carry out a command and return what the library returns."""
        if command in MOTIONS and self._jogs:
            self.do("speedStop", [])
        if command == "speedStop":
            self._jog_ends = math.inf
        try:
            return self._commands[command](*arguments)
        finally:
            self._written = time.monotonic()

    def keep_alive(self) -> float:
        """End a jog that was not renewed, kick the watchdog when that is due; return the seconds to the next time."""
        now = time.monotonic()
        if now - self._written > 1.0 / self._frequency:
            os._exit(TOO_SLOW)  # the controller has stopped the program
        if now >= self._jog_ends:
            self.do("speedStop", [])
        elif now >= self._written + self._period:
            (self._registers.kick if self._own else self._control.kickWatchdog)()
            self._written = time.monotonic()
        return max(min(self._written + self._period, self._jog_ends) - time.monotonic(), 0.0)

    def last_stop(self) -> None:
        """Stop what plays: the host is gone."""
        if self._own:
            self._registers.halt()
        else:
            self._control.stopScript()

    def _stop(self, deceleration: float) -> Any:
        """Stop what moves; a jog stands when this returns.

        Always the asynchronous stopL, the only one of the four that is run as what it is called: ur_rtde 1.6.5 runs a
        synchronous stopL as stopj until the first asynchronous stop, and stopJ as stopl from then on.
        """
        if self._own:
            return self._registers.halt()
        if self._jogs:  # a stopL beside the thread that holds the velocity is no stop
            return self.do("speedStop", [])
        return self._control.stopL(deceleration, True)

    def _speed(self, command: Callable[..., bool]) -> Callable[..., bool]:
        def speed(velocities: list[float], acceleration: float, until: float) -> bool:
            """Move by a velocity until a moment of the monotonic clock; false when that is over."""
            if time.monotonic() >= until:
                return False
            # Without the library's own time: its call would last that long, and kicks and a stop would wait behind it.
            taken = command(velocities, acceleration)
            self._jog_ends = until
            time.sleep(SHOWN)
            return taken

        return speed

    def _begin_own(self) -> bool:
        """Kick the watchdog of a program of our own from now on, and take back an earlier request to stop."""
        self._own = True  # the library's own kick would wait for its program without end
        return self._registers.ready()

    def _end_own(self) -> bool:
        """Kick the watchdog of the control program again, which plays still."""
        self._own = False
        return True

    def _resume(self) -> bool:
        """Send the control program again, after one of our own, and arm its watchdog."""
        control, until = self._control, time.monotonic() + RESUMED_WITHIN
        # While the library still believes that a program runs it would send "stop" first, which the new one obeys.
        while control.isProgramRunning() and time.monotonic() < until:
            time.sleep(0.002)
        control.reuploadScript()
        while not (control.isProgramRunning() and control.setWatchdog(self._frequency)):
            if time.monotonic() > until:
                return False
            time.sleep(0.005)
        self._own = False
        return True


class Registers:
    """The two integer registers that a program of our own reads: kicks, and the request to stop."""

    def __init__(self, io: RTDEIOInterface, first: int) -> None:
        self._io, self._first, self._kicks = io, first, 0

    def ready(self) -> bool:
        """Take back an earlier request to stop."""
        return bool(self._io.setInputIntRegister(self._first + 1, 0)) and self.kick()

    def kick(self) -> bool:
        """Kick the watchdog."""
        self._kicks = (self._kicks + 1) % 1000
        return bool(self._io.setInputIntRegister(self._first, self._kicks))

    def halt(self) -> bool:
        """Request that the program stops."""
        return bool(self._io.setInputIntRegister(self._first + 1, 1))


if __name__ == "__main__":
    main()

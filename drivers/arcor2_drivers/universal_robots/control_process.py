"""Control process: holds ur_rtde's control and I/O interfaces and signals the controller's watchdog.

`session.py` runs this script in a separate process for two reasons. First, a busy cell host must not stop the arm:
watchdog signals and the deadline of a jog must not depend on the host's interpreter. Second, a process can be killed.
When the connection of ur_rtde 1.6.5 breaks, it reconnects and sends its program again without the watchdog, which stops
any program that the controller is running then. It sometimes crashes, and its constructors and destructors block the
interpreter.

Standard input has one request per line, `{"n": 1, "do": "moveL", "args": [...]}`, and the host's pulses. Standard
output has one answer per line, `{"n": 1, "data": ...}` or `{"n": 1, "error": "..."}`; a request without a number is not
answered. When the host ends, or sends no pulse for FROZEN_AFTER s, this process stops the program and exits.
"""

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

from arcor2_hw.keep_alive_process import Parent, ParentEnd, hurry

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
SIGNALS = frozenset({*COMMANDS, *SPEEDS, "own"})
"""Commands that signal the watchdog, too: they write the register that it checks."""
MOTIONS = frozenset({"moveJ", "moveL", "teachMode", "own"})
"""Commands that end a jog first: two threads of the control program must not both move the arm."""
OUTPUTS = ("setConfigurableDigitalOut", "setStandardDigitalOut", "setToolDigitalOut")
MIN_VELOCITY_INTERVAL: Final = 0.02
"""Time before the next command may overwrite a velocity in its register, s: two cycles of a CB3."""
RESUME_TIMEOUT: Final = 3.0
"""Time for the control program to play again, s; it takes 0.1 s."""
KICKS_PER_PERIOD: Final = 8.0
"""Watchdog signals within one period of the watchdog."""
LATE_SIGNAL_FRACTION: Final = 0.8
"""Fraction of the period of the watchdog after which it may have tripped."""
MAX_LATE_SIGNAL_AGE: Final = 2.0
"""Time for which a late signal may be the reason for a stopped program, s."""
LAST_STOP_TIMEOUT: Final = 0.15
"""Time for the last stop of this process, s; if it fails, the watchdog stops the arm."""
HOST_CHECK_INTERVAL: Final = 0.1
"""Time between two checks whether the host has ended, s."""
EXIT_TOO_SLOW: Final = 3
"""Exit status when this process was not scheduled in time, so that the watchdog must have tripped."""
EXIT_HOST_FROZEN: Final = 4
"""Exit status when the host has sent no pulse for FROZEN_AFTER s."""


def main() -> None:
    """Connect with the arguments of the command line, a JSON object, and execute requests."""
    answers = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    hurry()
    os.dup2(2, 1)  # the library prints to standard output
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
    """Queue requests, then the exit status. Wait until the main thread has sent its last stop."""
    parent = Parent()
    while parent.ended is None:
        for line in parent.lines(HOST_CHECK_INTERVAL):
            requests.put(line)
    status = EXIT_HOST_FROZEN if parent.ended is ParentEnd.FROZEN else 0
    requests.put(status)
    time.sleep(LAST_STOP_TIMEOUT)
    os._exit(status)


class ControlProgram:
    """The control program on the controller, or a motion program in its place: commands, watchdog signals, jogs."""

    def __init__(self, host: str, frequency: float, upper: bool, watchdog: float) -> None:
        self._io = RTDEIOInterface(host, False, upper)
        flags = RTDEControlInterface.FLAG_UPLOAD_SCRIPT | RTDEControlInterface.FLAG_NO_EXT_FT
        if upper:
            flags |= RTDEControlInterface.FLAG_UPPER_RANGE_REGISTERS
        self._control = RTDEControlInterface(host, frequency, flags)
        self._frequency = watchdog
        self._written, self._late = time.monotonic(), -math.inf
        if not self._armed():
            raise RuntimeError("The watchdog of the control program cannot be armed.")
        self._registers = Registers(self._io, 42 if upper else 18)
        self._own = False
        self._jog_ends = math.inf
        self._period = 1.0 / (KICKS_PER_PERIOD * watchdog)
        control = self._control
        self._commands: dict[str, Callable[..., Any]] = {
            **{name: getattr(control, name) for name in COMMANDS},
            **{name: getattr(self._io, name) for name in OUTPUTS},
            **{name: self._speed(getattr(control, name)) for name in SPEEDS},
            "own": self._begin_own,
            "control": self._end_own,
            "was_late": self._was_late,
            "resume": self._resume,
            "stop": self._stop,
        }

    @property
    def _jogs(self) -> bool:
        return self._jog_ends < math.inf

    def do(self, command: str, arguments: list[Any]) -> Any:
        """Execute a command and return the result of the library."""
        self._exit_if_too_slow()
        if command in MOTIONS and self._jogs:
            self.do("speedStop", [])
        if command == "speedStop":
            self._jog_ends = math.inf
        started = time.monotonic()
        result = self._commands[command](*arguments)
        if command in SIGNALS:
            if result is False:  # the library may have sent nothing
                self._exit_if_too_slow()  # the watchdog tripped during the command
            else:
                self._signalled(started)
        return result

    def keep_alive(self) -> float:
        """End an expired jog and signal the watchdog, if due. Return the time until the next call, s."""
        self._exit_if_too_slow()
        now = time.monotonic()
        if now >= self._jog_ends:
            self.do("speedStop", [])
        elif now >= self._written + self._period:
            # Before the signal: the robot receives it later, so its watchdog never trips earlier than it seems here.
            self._written = now
            (self._registers.kick if self._own else self._control.kickWatchdog)()
        return max(min(self._written + self._period, self._jog_ends) - time.monotonic(), 0.0)

    def _signalled(self, since: float) -> None:
        """Record that the library sent a signal between `since` and now; the exact time is unknown."""
        self._written = time.monotonic()
        if self._written - since > LATE_SIGNAL_FRACTION / self._frequency:
            self._late = self._written

    def _armed(self) -> bool:
        """Arm the watchdog of the control program; return whether the program accepted it."""
        started = time.monotonic()
        armed = bool(self._control.setWatchdog(self._frequency))
        self._signalled(started)
        return armed

    def _exit_if_too_slow(self) -> None:
        """Exit if the watchdog has tripped, because the library would refuse commands without a reason."""
        now = time.monotonic()
        if now - self._written > 1.0 / self._frequency:
            os._exit(EXIT_TOO_SLOW)
        if now - self._written > LATE_SIGNAL_FRACTION / self._frequency:
            self._late = now

    def _was_late(self) -> bool:
        """Return whether the watchdog may have tripped recently.

        The times at which it received signals are not known exactly.
        """
        return time.monotonic() - self._late < MAX_LATE_SIGNAL_AGE

    def last_stop(self) -> None:
        """Stop the program: the host has ended."""
        if self._own:
            self._registers.halt()
        else:
            self._control.stopScript()

    def _stop(self, deceleration: float) -> Any:
        """Stop the motion. A jog is at standstill when this returns.

        Of the four stops, only the asynchronous stopL works as its name says: ur_rtde 1.6.5 runs a
        synchronous stopL as stopj until the first asynchronous stop, and stopJ as stopl from then on.
        """
        if self._own:
            return self._registers.halt()
        if self._jogs:  # stopL has no effect while the thread for the velocity runs
            return self.do("speedStop", [])
        return self._control.stopL(deceleration, True)

    def _speed(self, command: Callable[..., bool]) -> Callable[..., bool]:
        def speed(velocities: list[float], acceleration: float, until: float) -> bool:
            """Move with a velocity until a time of the monotonic clock; return False if it has passed."""
            if time.monotonic() >= until:
                return False
            # The library's parameter `time` is not used: its call would block watchdog signals and stops for that time.
            taken = command(velocities, acceleration)
            self._jog_ends = until
            time.sleep(MIN_VELOCITY_INTERVAL)
            return taken

        return speed

    def _begin_own(self) -> bool:
        """Signal the watchdog of a motion program from now on, and clear an earlier stop request."""
        self._own = True  # the library's own signal would wait forever for its program
        return self._registers.ready()

    def _end_own(self) -> bool:
        """Signal the watchdog of the control program again, which is still playing."""
        self._own = False
        return True

    def _resume(self) -> bool:
        """Send the control program again, after a motion program, and arm its watchdog."""
        control, until = self._control, time.monotonic() + RESUME_TIMEOUT
        # While the library assumes that a program runs, it would first send "stop", which the new program obeys.
        while control.isProgramRunning() and time.monotonic() < until:
            time.sleep(0.002)
        control.reuploadScript()
        while not (control.isProgramRunning() and self._armed()):
            if time.monotonic() > until:
                return False
            time.sleep(0.005)
        self._own = False
        return True


class Registers:
    """The two integer registers that a motion program reads: watchdog signal and stop request."""

    def __init__(self, io: RTDEIOInterface, first: int) -> None:
        self._io, self._first, self._kicks = io, first, 0

    def ready(self) -> bool:
        """Clear an earlier stop request."""
        return bool(self._io.setInputIntRegister(self._first + 1, 0)) and self.kick()

    def kick(self) -> bool:
        """Signal the watchdog."""
        self._kicks = (self._kicks + 1) % 1000
        return bool(self._io.setInputIntRegister(self._first, self._kicks))

    def halt(self) -> bool:
        """Request the program to stop."""
        return bool(self._io.setInputIntRegister(self._first + 1, 1))


if __name__ == "__main__":
    main()

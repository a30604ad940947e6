"""A script run by hand (`python script.py`): events as lines on standard output, commands from standard input."""

import argparse
import os
import signal
import sys
import threading
import types
from collections.abc import Sequence
from pathlib import Path

import msgspec

from arcor2_hw.data.events import Event, PackageStateData
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.exceptions import ProgramStopped
from arcor2_hw.runtime.program import Program
from arcor2_hw.runtime.streaming import Streams

_encode = msgspec.json.Encoder().encode


class _Lines:
    """The channel to standard output; one event per line (protocol, section 12.4)."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def event(self, name: str, encoded: bytes, *_: object, **__: object) -> None:  # noqa: ARG002 - it is in the event
        with self._lock:
            sys.stdout.write(encoded.decode() + "\n")
            sys.stdout.flush()

    def action_over(self, number: int, duration: float, error: str) -> None:
        pass  # the protocol has no line for it

    def changed(self, state: str) -> None:
        self.event("PackageState", _encode(Event("PackageState", data=PackageStateData(PackageStateEnum(state)))))


def _parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Run the program of this package.")
    parser.add_argument("-p", "--pause", action="store_true", help="start paused, before the first action")
    parser.add_argument(
        "-b", "--breakpoints", default="", help="ids of action points and actions to pause at, separated by commas"
    )
    return parser.parse_known_args(arguments)[0]


class Standalone:
    """The program of a script that runs outside a cell host."""

    def __init__(self) -> None:
        options = _parse(sys.argv[1:])
        breakpoints = {item for item in options.breakpoints.split(",") if item}
        main = sys.modules.get("__main__")
        script = getattr(main, "__file__", None)
        self.directory = Path(script).resolve().parent if script else Path.cwd()
        channel = _Lines()
        self.program = Program(channel, self.directory.name, start_paused=options.pause, breakpoints=breakpoints)
        self._streams = Streams(lambda told: channel.event(told.event, told.encoded))
        self._ticking = threading.Event()

    def start(self) -> None:
        """Listen for commands and for Ctrl-C, and stream the robots."""
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, self._interrupted)
            signal.signal(signal.SIGTERM, self._interrupted)
        threading.Thread(target=self._listen, name="commands", daemon=True).start()
        threading.Thread(target=self._tick, name="streams", daemon=True).start()

    def end(self) -> None:
        """Stop streaming."""
        self._ticking.set()

    def _interrupted(self, number: int, frame: types.FrameType | None) -> None:  # noqa: ARG002
        if not self.program.stop_requested:
            # Not from here: a signal handler runs in the middle of whatever the main thread does, locks included.
            threading.Thread(target=self.program.stop, name="stop").start()
        if not self.program.inside and not self.program.ended:
            raise ProgramStopped

    def _listen(self) -> None:
        commands = {"p": self.program.gate.pause, "r": self.program.gate.resume, "s": self.program.gate.step}
        for line in sys.stdin:
            if (command := commands.get(line.strip())) is not None:
                command()

    def _tick(self) -> None:
        try:
            period = float(os.environ.get("ARCOR2_STREAMING_PERIOD", "0.1"))
        except ValueError:
            period = 0.1
        if period <= 0:
            return
        while not self._ticking.wait(period):
            for device in self.program.cell:
                self._streams.send(device, joints=True, eef=True)

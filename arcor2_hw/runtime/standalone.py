"""Support for scripts run by hand (`python script.py`): events on standard output, commands from standard input."""

import argparse
import os
import signal
import sys
import threading
import types
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from arcor2_hw.data.events import Event, PackageStateData
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.position import ProgramStep
from arcor2_hw.exceptions import ProgramStopped
from arcor2_hw.messages import Message
from arcor2_hw.runtime.program import Program
from arcor2_hw.runtime.recorder import Recorder
from arcor2_hw.runtime.streaming import Streams

_encode = msgspec.json.Encoder().encode


class _StdoutChannel:
    """Channel that prints one event per line (protocol, section 12.4)."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def event(self, name: str, encoded: bytes, *_: object, **__: object) -> None:  # noqa: ARG002 - the encoded event contains the name
        with self._lock:
            sys.stdout.write(encoded.decode() + "\n")
            sys.stdout.flush()

    def action_over(self, number: int, duration: float, error: Message | None, waited: float) -> None:
        pass  # the protocol has no event for this

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
        channel = _StdoutChannel()
        self.program = Program(channel, self.directory.name, start_paused=options.pause, breakpoints=breakpoints)
        self._streams = Streams(lambda event: channel.event(event.event, event.encoded), Recorder())
        self._ended = threading.Event()

    def start(self) -> None:
        """Start to read commands, handle Ctrl-C and stream the state of robots."""
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, self._on_interrupt)
            signal.signal(signal.SIGTERM, self._on_interrupt)
        threading.Thread(target=self._read_commands, name="commands", daemon=True).start()
        threading.Thread(target=self._stream, name="streams", daemon=True).start()

    def end(self) -> None:
        """Stop streaming."""
        self._ended.set()

    def _on_interrupt(self, number: int, frame: types.FrameType | None) -> None:  # noqa: ARG002
        if not self.program.stop_requested:
            # On another thread, because the main thread may hold a lock that the stop needs.
            threading.Thread(target=self.program.stop, name="stop").start()
        if not self.program.inside and not self.program.ended:
            raise ProgramStopped

    def _read_commands(self) -> None:
        gate = self.program.gate
        commands: dict[str, Callable[[], None]] = {"p": gate.pause, "r": gate.resume, "s": gate.step}
        commands |= {"i": lambda: gate.step(ProgramStep.INTO), "o": lambda: gate.step(ProgramStep.OUT)}
        for line in sys.stdin:
            if (command := commands.get(line.strip())) is not None:
                command()

    def _stream(self) -> None:
        try:
            period = float(os.environ.get("ARCOR2_STREAMING_PERIOD", "0.1"))
        except ValueError:
            period = 0.1
        if period <= 0:
            return
        while not self._ended.wait(period):
            for device in self.program.cell:
                self._streams.send(device, joints=True, eef=True)

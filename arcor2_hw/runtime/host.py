"""The cell host: the only process that owns the device instances of a scene or of a program run.

The server starts it with one end of a socket pair (`--fd N`). The main thread runs the script, so that a signal can
interrupt a waiting script. One thread reads messages, one writes them, and one runs timers. Each device
has its lanes.
"""

import argparse
import contextlib
import faulthandler
import logging
import os
import signal
import socket
import sys
import threading
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Final, TypeVar

import msgspec

from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.held import HeldData
from arcor2_hw.data.interlocks import Interlock, InterlockState
from arcor2_hw.data.position import MAIN_BRANCH, Frame
from arcor2_hw.exceptions import Arcor2Error, Conflict, ProgramFinished, ProgramStopped
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.calls import Calls, described_error, error_data
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.checkpoints_at_server import CheckpointsAtServer
from arcor2_hw.runtime.clock import Clock
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.forcing import CHECK_PERIOD, Forces
from arcor2_hw.runtime.holding import ActiveHolds
from arcor2_hw.runtime.hosted_scene import HostedScene, recognise
from arcor2_hw.runtime.interlocks import Interlocks
from arcor2_hw.runtime.link import Link
from arcor2_hw.runtime.program import Program, set_current
from arcor2_hw.runtime.record import RunRecord
from arcor2_hw.runtime.recorder import Recorder
from arcor2_hw.runtime.remote_objects import RemoteObjects
from arcor2_hw.runtime.ring import Ring
from arcor2_hw.runtime.script import execute, save_traceback, traceback_text
from arcor2_hw.runtime.stopping import wait_stopped
from arcor2_hw.runtime.streaming import RatedStreams, Streams
from arcor2_hw.runtime.teaching import TEACHING_PERIOD, Teaching
from arcor2_hw.runtime.watch import OBSERVE_PERIOD, Watch

M = TypeVar("M", m.OpenScene, m.RunPackage)

EXIT_TIMEOUT: Final = 1.8
"""Time from the end of the server to the exit of this process, even if a call hangs, s."""
INTERRUPT_PERIOD: Final = 0.1
"""Period at which a script that does not end after a stop is interrupted, s."""
SCRIPT_END_TIMEOUT: Final = 5.0
"""Time that a script has to end after the connection of a device is lost, s."""
EVENT_WAIT: Final = 1.0
"""Longest time that an event of the program waits for a slow server, s."""
FORCES_END_TIMEOUT: Final = 0.5
"""Time to switch forced outputs back before their devices are disconnected, s."""
NICENESS: Final = -5
"""Niceness of this process: devices have priority over user interfaces."""
FLUSH_TIMEOUT: Final = 2.0
"""Time without progress after which the last messages are dropped, s. A busy server may be that late."""


class _LogHandler(logging.Handler):
    """Send the log records of drivers and scripts to the server."""

    def __init__(self, link: Link) -> None:
        super().__init__()
        self._link = link

    def emit(self, record: logging.LogRecord) -> None:
        self._link.post(m.LogLine(record.levelname.lower(), self.format(record)[:65536]))


class Host:
    """Serve one scene or one program run, from the first message to the exit."""

    def __init__(self, sock: socket.socket, ring: Ring | None = None) -> None:
        self.link = Link(sock)
        self.clock = Clock()
        self.program: Program | None = None
        self._cell = Cell()
        self._updates = self._cell.updates
        self._work: SimpleQueue[m.HostBound] = SimpleQueue()
        self._subscribed: dict[str, m.Subscribe] = {}
        self._teaching = Teaching(lambda *ended: self._holds.teaching_ended(*ended))
        self._interlocks = Interlocks(lambda: self._cell, self._interlocks_changed)
        self._recorder = Recorder(ring, lambda: self._cell)
        self._cell.state_taken = self._recorder.state_taken
        self._calls = Calls(
            lambda: self._cell,
            self.link.post,
            self.clock,
            self._stopping,
            self._teaching,
            self._interlocks,
            self._recorder,
        )
        self._holds = ActiveHolds(
            lambda: self._cell, self.link.post, self.clock, self._calls, self._teaching, self._interlocks
        )
        self._forces = Forces(lambda: self._cell, self.link.post, self.clock)
        self._streams = Streams(self.link.post_stream, self._recorder)
        self._rated = RatedStreams(lambda: self._cell, self.clock, self._streams)
        self._watch = Watch(self._cell, self._device_changed, self._device_lost)
        self._shutting_down = threading.Event()
        self._saved = threading.Event()
        self._stop_requested = threading.Event()
        self._remotes = RemoteObjects(self.link.post)
        self._scene = HostedScene(self._cell, self._watch, self.link, self._remotes)
        self._package: m.RunPackage | None = None
        self._at_server = CheckpointsAtServer(self.link.post)
        self._wake, wake_up = socket.socketpair()
        wake_up.setblocking(False)
        signal.set_wakeup_fd(wake_up.detach(), warn_on_full_buffer=False)
        signal.signal(signal.SIGTERM, lambda *_: None)  # arrives on the wake-up socket: the reader acts
        signal.signal(signal.SIGUSR1, self._on_interrupt)

    # -------------------------------------------------------------------------------- main thread
    def run(self) -> int:
        """Serve until the scene is closed or the program has ended, and return the exit status."""
        logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s", handlers=[_LogHandler(self.link)])
        logging.getLogger("httpx").setLevel(logging.WARNING)  # it logs every request, and drivers poll
        self.clock.every(m.HEARTBEAT_PERIOD, lambda: self.link.post(m.Heartbeat()))
        self.clock.every(OBSERVE_PERIOD, lambda: self._watch.check_all())
        self.clock.every(INTERRUPT_PERIOD, self._interrupt_script)
        self.clock.every(TEACHING_PERIOD, self._teaching.check_all)
        self.clock.every(OBSERVE_PERIOD, self._publish_interlocks)
        self.clock.every(CHECK_PERIOD, self._forces.check_all)
        self.clock.start()
        self.link.post(m.Ready(os.getpid()))
        threading.Thread(target=self._read, name="from server", daemon=True).start()
        status = 0
        while True:
            match self._work.get():
                case m.OpenScene() as message:
                    if not self._open_scene(self._scene.open, message, message.scene.interlocks):
                        break
                case m.RunPackage() as message if not message.main:
                    self._package = message
                    if not self._open_scene(self._scene.serve, message):
                        break
                case m.RunPackage() as message:
                    self._run_package(message)
                    break
                case _:
                    self._close_scene()
                    break
        if self._shutting_down.is_set():
            self._saved.wait(EXIT_TIMEOUT)
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        self.link.close(FLUSH_TIMEOUT)
        return status

    def _open_scene(self, opened: Callable[[M], bool], message: M, interlocks: list[Interlock] | Unset = UNSET) -> bool:
        """Open the scene, or the objects of a package for another host. Return False if the host has to exit."""
        try:
            if not opened(message):
                return False
        except ProgramStopped:
            return True
        self._interlocks.configure(interlocks)
        self.link.post(m.SceneOpened())
        self.clock.every(message.streaming_period if message.streaming_period > 0 else 0.1, self._stream_subscribed)
        return True

    def _close_scene(self) -> None:
        active = (
            self._shutting_down.is_set()
            or self._holds.any
            or any(device.lane.busy_with or device.moving for device in self._cell)
        )
        self._interlocks.close()
        self._forces.end_all(FORCES_END_TIMEOUT)
        stopped = wait_stopped(self._cell.stop_all(), 0.5) if active else None
        problem = self._cell.close() or stopped
        self.link.post(m.SceneClosed(None if problem is None else error_data(problem)))

    def _run_package(self, message: m.RunPackage) -> None:
        program = Program(
            self,
            message.package_id,
            start_paused=message.start_paused,
            breakpoints=frozenset(message.breakpoints),
            shared_breakpoints=frozenset(message.shared_breakpoints),
            cell_file=message.cell,
            secrets=message.secrets,
            held=self._held if message.hold_on_error else None,
            record=RunRecord.of(message, self.link.post, self._at_server),
            interlock_states=self._interlocks_changed,
            values=message.values,
            remotes=self._remotes,
        )
        self._package, self._cell = message, program.cell
        self._cell.assets, self._cell.updates = message.assets, self._updates
        recognise(self._cell, message.identities, self.link)
        self._watch = Watch(program.cell, self._device_changed, self._device_lost)
        self._cell.state_taken = self._recorder.state_taken
        program.inside = True
        self.program = program
        set_current(program)
        if self._shutting_down.is_set() or self._stop_requested.is_set():
            self._stop_program()
        if message.streaming_period > 0:
            self.clock.every(message.streaming_period, self._stream_all)
        directory = Path(message.directory)
        handled = True
        try:
            execute(directory, program)
        except (ProgramFinished, ProgramStopped):
            pass
        except SystemExit as error:
            if error.code not in (None, 0):
                program.exception(error)
        except BaseException as error:  # noqa: BLE001 - the script may raise anything
            program.exception(error)
            handled = False
        program.ended = True
        failed = program.stop_requested or program.error is not None
        if program.error is not None and not (handled and isinstance(program.error, Arcor2Error)):
            save_traceback(directory, program.error)
            if message.records_at_server:  # this directory is removed
                self.link.post(m.LogLine("error", traceback_text(program.error)[:65536]))
        problem = program.settle(failed)
        self._calls.settle()  # before the devices are closed
        program.interlocks.close()
        problem = program.cell.close() or problem
        if program.record is not None:
            program.record.close()
        why = program.error or problem
        self.link.post(
            m.ProgramChanged(
                "stopped",
                not failed and problem is None,
                None if why is None else described_error(why, program.source_of(why)),
            )
        )

    # -------------------------------------------------------------------------------- channel of the program
    def event(
        self,
        name: str,
        encoded: bytes,
        number: int = 0,
        action: str = "",
        time: float = 0.0,
        device: str = "",
        waited: float = 0.0,
        call: int = 0,
        frames: Sequence[Frame] = (),
        branch: str = MAIN_BRANCH,
        attempt: int = 1,
    ) -> None:
        """Send an encoded event of the program. Wait up to EVENT_WAIT for a server that does not keep up."""
        if name == "ActionStateBefore":
            self._recorder.action_started(number, action, device, frames, branch, call)
        elif name == "ActionStateAfter":
            self._recorder.action_ended(number, waited, event=encoded)
        self.link.wait_for_room(EVENT_WAIT)
        self.link.post(
            m.ProgramEvent(name, encoded, number, action, time, device, waited, call, list(frames), branch, attempt)
        )

    def changed(self, state: str) -> None:
        """Report that the program is running or paused."""
        self.link.post(m.ProgramChanged(state))

    def action_over(self, number: int, duration: float, error: Message | None, waited: float) -> None:
        """Report the end of an action that sends no event at its end."""
        self._recorder.action_ended(number, waited, error)
        self.link.post(m.ActionFailed(number, duration, error, waited))

    # -------------------------------------------------------------------------------- reader thread
    def _read(self) -> None:
        try:
            for message in self.link.messages(self._wake):
                self._handle(message)
        except (msgspec.MsgspecError, ValueError) as error:  # later messages cannot be read either
            self.link.post(m.LogLine("error", f"received an invalid message from the server: {error}"))
        self._shut_down()

    def _handle(self, message: m.HostBound) -> None:
        match message:
            case m.OpenScene() | m.RunPackage():
                for body in message.bodies:  # at once, because later messages may change these values
                    self._updates.put(body)
                for object_id, calibration in message.calibrations.items():
                    self._updates.calibrate(object_id, calibration)
                if message.main:
                    self._remotes.expect(message.remote)
                self._work.put(message)
            case m.AddBody():
                self._updates.put(message.body)
            case m.RemoveBodies():
                self._updates.remove(message.ids)
            case m.Calibrate():
                self._updates.calibrate(message.object_id, message.calibration)
            case m.CloseScene():
                self._cell.abandon()
                self._work.put(message)
            case m.Call():
                self._calls.call(message)
            case m.RemoteDone() | m.RemoteFailed():
                self._remotes.answered(message)
            case m.RemoteChanged():
                self._remotes.changed(message)
            case m.StopMotion():
                self._calls.stop_motion(message)
            case m.StopAll():
                self._calls.stop_all(message, self.program)  # first, because a program that ends waits for this answer
                self._stop_program()
            case m.ForcePoint():
                self._forces.start(message)
            case m.RenewForces():
                self._forces.renew(message)
            case m.EndForce():
                self._forces.end(message)
            case m.Lease():
                self._holds.lease(message)
            case m.RetryObject():
                self._scene.retry(message)
            case m.AddObject():
                self._scene.add(message)
            case m.Stream():
                self._rated.set_rates(message)
            case m.Subscribe():
                self._subscribed[message.object_id] = message
            case m.StopProgram():
                self._stop_program()
            case m.Pause() | m.Resume() if self.program is not None:
                gate = self.program.gate
                {m.Pause: gate.pause, m.Resume: gate.resume}[type(message)]()
            case m.Step() if self.program is not None:
                self.program.gate.step(message.mode, message.branch)
            case m.SetBreakpoints() if self.program is not None:
                self.program.set_shared_breakpoints(frozenset(message.shared_breakpoints))
            case m.SetInterlocks():
                self._interlocks.configure(message.interlocks)
            case m.ConfirmIdentity():
                self._confirm_identity(message)
            case m.DecideHeld():
                self._decide(message)
            case m.ConfirmParts():  # this waits for a disk, which must not delay stops
                threading.Thread(target=self._confirm_parts, args=(message,), name="confirm parts", daemon=True).start()
            case m.CheckpointAnswer():
                self._at_server.answered(message)
        if isinstance(message, m.StopMotion | m.StopAll | m.StopProgram):
            self._remotes.stopped()

    def _device_changed(self, report: m.DeviceChanged) -> None:
        self.link.post(report)
        self._recorder.device_changed(report)

    def _interlocks_changed(self, states: list[InterlockState]) -> None:
        self.link.post(m.InterlocksChanged(states))

    def _publish_interlocks(self) -> None:
        (self._interlocks if self.program is None else self.program.interlocks).publish()

    def _held(self, held: HeldData, device: Device, error: BaseException) -> None:
        """Report that the program is held."""
        self.link.post(m.ProgramHeld(held, described_error(error, device)))

    def _confirm_identity(self, message: m.ConfirmIdentity) -> None:
        self._cell.identities = {**self._cell.identities, message.object_id: message.identity}
        with contextlib.suppress(Arcor2Error):  # the object was removed
            if (identification := self._cell[message.object_id].identification) is not None:
                identification.confirm(message.identity)

    def _decide(self, message: m.DecideHeld) -> None:
        """Continue the held program."""
        recovery = None if self.program is None else self.program.recovery
        try:
            if recovery is None:
                raise Conflict("The program is not held at this action.")
            recovery.decide(message)
        except Arcor2Error as error:
            self.link.post(m.CallFailed(message.id, error_data(error)))
        else:
            self.link.post(m.CallDone(message.id))
            recovery.release()

    def _confirm_parts(self, message: m.ConfirmParts) -> None:
        """Record where a person has found parts."""
        try:
            record = None if self.program is None else self.program.record
            if self.program is None or record is None:
                raise Conflict("The program has no part inventory.")
            record.confirm(message.parts)
        except Arcor2Error as error:
            self.link.post(m.CallFailed(message.id, error_data(error)))
        else:
            recovery = self.program.recovery
            if recovery is not None and (held := recovery.without_part()) is not None:
                self.link.post(m.HeldChanged(held))
            self.link.post(m.CallDone(message.id))

    def _stopping(self, device: Device) -> None:
        self._holds.stopping(device)

    def _shut_down(self) -> None:
        """Stop motion, disconnect and exit within EXIT_TIMEOUT, because the server has ended or sent SIGTERM."""
        watchdog = threading.Timer(EXIT_TIMEOUT, os._exit, (3,))
        watchdog.daemon = True
        watchdog.start()
        self._shutting_down.set()
        self._remotes.end()  # before the stops, which would wait for an answer
        interrupted = self._package is not None and not (self.program is not None and self.program.ended)
        if self.program is not None and self.program.record is not None:
            self.program.record.interrupt()
        self._at_server.abandon()
        self._cell.stop_all()
        self._stop_program()
        self._cell.abandon()
        self._work.put(m.CloseScene())
        if interrupted and self._package is not None and self._package.recordings:
            with contextlib.suppress(OSError):  # such as a full disk
                self._recorder.save(Path(self._package.recordings), self._package.run, main=self._package.main)
        self._saved.set()

    def _stop_program(self) -> None:
        self._stop_requested.set()  # before the check, so that a program that is being created is stopped too
        if self.program is not None and not self.program.stop_requested:
            self.program.stop()
            self._interrupt_script()

    def _device_lost(self, device: Device, reason: Message | None) -> None:
        """End the program if it needs a device that is lost. An online scene continues without the device."""
        program = self.program
        if program is None or not device.recipe.cls.loss_ends_program or not program.device_lost(device, reason):
            return
        self._interrupt_script()
        self.clock.after(SCRIPT_END_TIMEOUT, lambda: program.ended or os._exit(4))

    # -------------------------------------------------------------------------------- clock thread
    def _interrupt_script(self) -> None:
        program = self.program
        if program is not None and program.stop_requested and not program.ended:
            signal.pthread_kill(_MAIN, signal.SIGUSR1)

    def _stream_subscribed(self) -> None:
        for wanted in list(self._subscribed.values()):
            with contextlib.suppress(Arcor2Error):
                self._streams.send(self._cell[wanted.object_id], joints=wanted.joints, eef=wanted.eef)

    def _stream_all(self) -> None:
        program = self.program
        if program is not None and not program.ended:
            for device in program.cell:
                self._streams.send(device, joints=True, eef=True)

    # -------------------------------------------------------------------------------- signal handler
    def _on_interrupt(self, number: int, frame: types.FrameType | None) -> None:  # noqa: ARG002
        """Raise ProgramStopped in the script, but not in our code, which checks for the stop itself."""
        program = self.program
        if program is not None and program.stop_requested and not program.inside and not program.ended:
            raise ProgramStopped


_MAIN: Final = threading.main_thread().ident or 0


def main() -> None:
    """Serve the socket inherited as `--fd`, then end the process even if threads still run."""
    parser = argparse.ArgumentParser(description="Run the devices of a scene. The server starts this process.")
    parser.add_argument("--fd", type=int, required=True, help="inherited socket to the server")
    parser.add_argument("--ring", type=int, help="inherited memory of the ring of recent values")
    options = parser.parse_args()
    faulthandler.enable()
    with contextlib.suppress(OSError):  # not permitted without LimitNICE in the service file
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    sys.setswitchinterval(0.0005)  # a script that computes must not delay a stop
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(line_buffering=True, errors="backslashreplace")
    ring = None if options.ring is None else Ring(options.ring)
    status = Host(socket.socket(fileno=options.fd), ring).run()
    os._exit(status)


if __name__ == "__main__":
    main()

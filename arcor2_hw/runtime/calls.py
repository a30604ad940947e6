"""Calls and stops of devices for the server. Each is answered exactly once; stops run concurrently with calls."""

import contextlib
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

import msgspec
from msgspec.structs import replace

from arcor2_hw.actions.json_values import encode as encode_json
from arcor2_hw.exceptions import Arcor2Error, Cancelled, message_of
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.clock import Clock
from arcor2_hw.runtime.device import STOP_DEADLINE, STOP_GRACE, Device, describe
from arcor2_hw.runtime.interlocks import Interlocks
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.program import Program
from arcor2_hw.runtime.recorder import Recorder
from arcor2_hw.runtime.stopping import SentStop, outcomes, send_stop
from arcor2_hw.runtime.teaching import SET_MODE, Teaching

Post = Callable[[m.ToServer], None]
_Guard = Callable[[Mapping[str, Any]], contextlib.AbstractContextManager[None]]
_ONLY_CONTROL: Final = frozenset({"check_if_ready_to_move"})
"""Methods that the server calls to take control. They move nothing."""


def error_data(error: BaseException, object_id: str = "") -> m.ErrorData:
    """Convert an error to the form that is sent to the server."""
    code, detail = (error.code, error.detail) if isinstance(error, Arcor2Error) else ("error", "")
    fault = str(getattr(error, "fault_code", "") or getattr(error, "kind", ""))
    return m.ErrorData(code, type(error).__name__, message_of(error), detail, object_id, fault, time.monotonic())


def described_error(error: BaseException, device: Device | None) -> m.ErrorData:
    """Convert an error to the form that is sent to the server, with its device."""
    data = error_data(error)
    if device is None:
        return data
    return replace(data, object_id=device.id, object_name=device.name, object_type=device.recipe.cls.__name__)


class Calls:
    """Start calls and stops, and answer them.

    Args:
        cell: Returns the current devices.
        post: Sends an answer.
        clock: Runs the deadlines.
        stopping: Called for each device that is being stopped.
        teaching: Receives the changes of hand teaching mode.
        interlocks: Admit the calls that act on a device.
        recorder: Records the calls that act on a device.
    """

    def __init__(
        self,
        cell: Callable[[], Cell],
        post: Post,
        clock: Clock,
        stopping: Callable[[Device], None] = lambda _: None,
        teaching: Teaching | None = None,
        interlocks: Interlocks | None = None,
        recorder: Recorder | None = None,
    ) -> None:
        self._cell = cell
        self._post = post
        self._clock = clock
        self._stopping = stopping
        self._teaching = teaching
        self._interlocks = interlocks
        self._recorder = recorder or Recorder()
        self._answering: threading.Thread | None = None

    def call(self, message: m.Call) -> None:
        """Start a call, which is answered by CallDone or CallFailed."""
        device: Device | None = None
        try:
            device = self._cell()[message.object_id]
            answer = self._answer(message, device)
            method = device.cancelled_by(message.method) if message.cancel else message.method
            if method == "stop":
                self.stop_motion(m.StopMotion(message.id, message.object_id))
                return
            guard, waits = self._guard(device, method, message.control)
            job, own = device.prepare(method, message.arguments, message.control, answer, guard)
            lane = device.stop_lane if message.cancel else device.lane_for(method)
            if message.control and method not in _ONLY_CONTROL:
                self._recorder.action_started(-message.id, f"{device.name}: {method}", device.id)
            lane.submit(job)
        except Exception as error:  # noqa: BLE001 - a call that cannot start is answered too
            self._recorder.action_ended(-message.id, error=message_of(error))
            reported = error if device is None else describe(device, error)
            self._post(m.CallFailed(message.id, error_data(reported, message.object_id)))
            return
        deadline = own if message.deadline is None else message.deadline
        if deadline is not None:
            within = deadline + waits
            self._clock.after(within, lambda: lane.expire(job, within))

    def _guard(self, device: Device, method: str, control: bool) -> tuple[_Guard | None, float]:
        """Return the context of a call that acts on its device, and the maximum waiting time in this context, s."""
        interlocks = self._interlocks
        if interlocks is None or not control or method in _ONLY_CONTROL:
            return None, 0.0

        def wait(seconds: float) -> float:
            time.sleep(seconds)
            device.lane_for(method).check_wanted()
            return 0.0

        if method == SET_MODE:
            return (
                lambda keywords: (
                    interlocks.guarded(device, method, (), None)
                    if keywords.get("enabled")
                    else contextlib.nullcontext()
                ),
                0.0,
            )
        return (
            lambda keywords: interlocks.guarded(device, method, keywords.values(), wait),
            interlocks.longest_wait(device, method),
        )

    def _answer(self, message: m.Call, device: Device) -> Callable[[Job], None]:
        number = message.id

        def answer(job: Job) -> None:
            error = job.error
            self._recorder.action_ended(-number, error=None if error is None else message_of(error))
            if error is None:
                try:
                    value = b"" if job.value is None else encode_json(job.value).encode()
                except Arcor2Error as caught:
                    error = caught
                else:
                    if message.method == SET_MODE and self._teaching is not None:
                        given = {name: msgspec.json.decode(value) for name, value in message.arguments.items()}
                        arm = {} if given.get("arm_id") is None else {"arm_id": given["arm_id"]}
                        self._teaching.set(device, arm, given.get("enabled") is True)
                    self._post(m.CallDone(number, value, time.monotonic()))
                    return
            self._post(m.CallFailed(number, error_data(describe(device, error), device.id)))

        return answer

    def stop_motion(self, message: m.StopMotion) -> None:
        """Stop one device. The answer follows when it has stopped, or contains the error."""
        try:
            device = self._cell()[message.object_id]
        except Arcor2Error as error:
            self._post(m.CallFailed(message.id, error_data(error, message.object_id)))
            return

        def answer(device: Device, error: BaseException | None) -> None:
            if error is None:
                self._post(m.CallDone(message.id))
            else:
                self._post(m.CallFailed(message.id, error_data(describe(device, error), device.id)))

        if device.stop_method is None:
            answer(device, Arcor2Error("{name} cannot be stopped: its type has no stop()", name=device.name))
            return
        self.stop(device, answer)
        self._stopping(device)

    def stop_all(self, message: m.StopAll, program: Program | None) -> None:
        """Stop every device, or wait for the stops of the program. The answer follows within STOP_DEADLINE."""
        stops: list[SentStop] = []
        if program is None:
            stops = [send_stop(device) for device in self._cell() if device.up]
            for stop in stops:
                self._stopping(stop.device)

        def answer() -> None:
            sent = stops if program is None else program.sent_stops()
            self._post(m.CallDone(message.id, msgspec.json.encode(outcomes(sent))))

        thread = threading.Thread(target=answer, name="stop all", daemon=True)
        thread.start()
        self._answering = thread

    def settle(self) -> None:
        """Wait until the last `stop_all` is answered."""
        if self._answering is not None:
            self._answering.join(STOP_DEADLINE)

    def stop(self, device: Device, answer: Callable[[Device, BaseException | None], None]) -> None:
        """Stop a device while its call runs. `answer` is called with the error, or None when it has stopped."""
        try:
            started = device.begin_stop(lambda job: answer(device, job.error))
        except Arcor2Error as error:  # an earlier stop hangs
            answer(device, error)
            return
        if started is None:
            answer(device, None)
            return
        stop, interrupted = started
        self._clock.after(STOP_DEADLINE, lambda: device.stop_lane.expire(stop, STOP_DEADLINE))
        if interrupted is not None:
            cancelled = Cancelled("{name}: {method} was stopped", name=device.name, method=interrupted.method)
            self._clock.after(STOP_GRACE, lambda: interrupted.give_up(cancelled))

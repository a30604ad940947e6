"""Calls of the server on devices, each answered once, and stops, which pass whatever else a device is doing."""

import threading
from collections.abc import Callable

from arcor2_hw.actions.json_values import encode as encode_json
from arcor2_hw.exceptions import Arcor2Error, Cancelled
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.cell import Cell
from arcor2_hw.runtime.clock import Clock
from arcor2_hw.runtime.device import STOP_DEADLINE, STOP_GRACE, Device, describe
from arcor2_hw.runtime.lane import Job

Post = Callable[[m.ToServer], None]


def error_data(error: BaseException, object_id: str = "") -> m.ErrorData:
    """Give an error in the form in which it leaves the process."""
    code = error.code if isinstance(error, Arcor2Error) else "error"
    detail = error.detail if isinstance(error, Arcor2Error) else ""
    return m.ErrorData(code, type(error).__name__, str(error) or type(error).__name__, detail, object_id)


class Calls:
    """Makes the calls. `cell` gives the devices that there are; `stopping` is told of each device to be stopped."""

    def __init__(
        self,
        cell: Callable[[], Cell],
        post: Post,
        clock: Clock,
        stopping: Callable[[Device], None] = lambda _: None,
    ) -> None:
        self._cell = cell
        self._post = post
        self._clock = clock
        self._stopping = stopping

    def call(self, message: m.Call) -> None:
        """Begin a call; CallDone or CallFailed answers it."""
        device: Device | None = None
        try:
            device = self._cell()[message.object_id]
            answer = self._answer(message.id, device)
            method = device.cancelled_by(message.method) if message.cancel else message.method
            if method == "stop":
                self.stop_motion(m.StopMotion(message.id, message.object_id))
                return
            job, own = device.prepare(method, message.arguments, message.control, answer)
            lane = device.stop_lane if message.cancel else device.lane_for(method)
            lane.submit(job)
        except Exception as error:  # noqa: BLE001 - a call that cannot be made is an answer too
            told = error if device is None else describe(device, error)
            self._post(m.CallFailed(message.id, error_data(told, message.object_id)))
            return
        deadline = own if message.deadline is None else message.deadline
        if deadline is not None:
            within = deadline
            self._clock.after(within, lambda: lane.expire(job, within))

    def _answer(self, number: int, device: Device) -> Callable[[Job], None]:
        def answer(job: Job) -> None:
            error = job.error
            if error is None:
                try:
                    value = b"" if job.value is None else encode_json(job.value).encode()
                except Arcor2Error as caught:
                    error = caught
                else:
                    self._post(m.CallDone(number, value))
                    return
            self._post(m.CallFailed(number, error_data(describe(device, error), device.id)))

        return answer

    def stop_motion(self, message: m.StopMotion) -> None:
        """Stop one device, or all; answered when all have obeyed, or one has not."""
        try:
            devices = [self._cell()[message.object_id]] if message.object_id else list(self._cell())
        except Arcor2Error as error:
            self._post(m.CallFailed(message.id, error_data(error, message.object_id)))
            return
        stops = [device for device in devices if device.stop_method is not None]
        if message.object_id and not stops:
            refusal = Arcor2Error(f"{devices[0].name} cannot be stopped: it has no stop")
            self._post(m.CallFailed(message.id, error_data(refusal, message.object_id)))
            return
        left = len(stops)
        failed: list[m.ErrorData] = []
        lock = threading.Lock()

        def answer(device: Device, error: BaseException | None) -> None:
            nonlocal left
            with lock:
                left -= 1
                if error is not None:
                    failed.append(error_data(describe(device, error), device.id))
                if left:
                    return
            self._post(m.CallFailed(message.id, failed[0]) if failed else m.CallDone(message.id))

        if not stops:
            self._post(m.CallDone(message.id))
        for device in stops:
            self.stop(device, answer)
            self._stopping(device)

    def stop(self, device: Device, answer: Callable[[Device, BaseException | None], None]) -> None:
        """Stop a device past everything else; `answer` is called once it has obeyed, or with why it did not."""
        try:
            begun = device.begin_stop(lambda job: answer(device, job.error))
        except Arcor2Error as error:  # an earlier stop hangs
            answer(device, error)
            return
        if begun is None:
            answer(device, None)
            return
        stop, interrupted = begun
        self._clock.after(STOP_DEADLINE, lambda: device.stop_lane.expire(stop, STOP_DEADLINE))
        if interrupted is not None:
            cancelled = Cancelled(f"{device.name}: {interrupted.method} was stopped")
            self._clock.after(STOP_GRACE, lambda: interrupted.give_up(cancelled))

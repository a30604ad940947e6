"""A lane: one thread that runs the calls of one device one after the other, each with a deadline."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from queue import Empty, SimpleQueue
from typing import Any, Final, TypeVar

from arcor2_hw.exceptions import Arcor2Error, Cancelled, DeviceTimeout
from arcor2_hw.keep_alive import LONGEST_STEP, RunningTime

T = TypeVar("T")

_NO_ARGUMENTS: Final[Mapping[str, Any]] = {}

_on_lane = threading.local()


def on_any_lane() -> bool:
    """Return whether this is the thread of a lane, whose calls are part of the running call."""
    return getattr(_on_lane, "here", False)


class Job:
    """One call. It ends exactly once: when it returns, at its deadline, or when its caller abandons it."""

    __slots__ = (
        "_claim",
        "_gate",
        "arguments",
        "error",
        "function",
        "given_up",
        "keywords",
        "method",
        "notify",
        "since",
        "stop_token",
        "value",
    )

    def __init__(
        self,
        method: str,
        function: Callable[..., Any],
        arguments: Sequence[Any] = (),
        keywords: Mapping[str, Any] = _NO_ARGUMENTS,
        notify: "Callable[[Job], None] | None" = None,
    ) -> None:
        self.method = method
        self.function = function
        self.arguments = arguments
        self.keywords = keywords
        self.notify = notify
        self.value: Any = None
        self.error: BaseException | None = None
        self.since = time.monotonic()
        self.stop_token: object = None
        self.given_up = False
        self._claim = threading.Lock()
        self._gate = threading.Lock()
        self._gate.acquire()

    @property
    def ended(self) -> bool:
        """Return whether the call has ended."""
        return self._claim.locked()

    def finish(self, value: Any = None, error: BaseException | None = None) -> bool:
        """End the call with a result or an error. Return False if it had ended before, so that these are dropped."""
        if not self._claim.acquire(blocking=False):
            return False
        self.value = value
        self.error = error
        self._gate.release()
        if self.notify is not None:
            self.notify(self)
        return True

    def give_up(self, error: BaseException) -> bool:
        """End the call with an error without waiting until it returns. Return False if it had ended before."""
        self.given_up = True  # before `finish`, so that the lane refuses calls made by `notify`
        if self.finish(None, error):
            return True
        self.given_up = False
        return False

    def wait(self, timeout: float | None) -> bool:
        """Wait until the call has ended, at most `timeout` s. Return False on timeout."""
        ended = self._gate.acquire() if timeout is None else self._gate.acquire(timeout=max(timeout, 0.0))
        if ended:
            self._gate.release()
        return ended

    def wait_running(self, timeout: float) -> bool:
        """Wait as `wait`, but at most `timeout` s of running time; see RunningTime."""
        clock = RunningTime()
        while not self.wait(LONGEST_STEP / 2.0):
            if clock() >= timeout:
                return self.wait(0.0)
        return True

    def outcome(self) -> Any:
        """Return the result of a call that has ended, or raise its error."""
        if self.error is not None:
            raise self.error
        return self.value


class Lane:
    """Run the calls of one device on one thread.

    A call that has not returned at its deadline fails with DeviceTimeout, and its result is dropped. Until it returns,
    the lane hangs and refuses further calls at once.
    """

    def __init__(self, device: str, purpose: str = "") -> None:
        self.device = device
        self._queue: SimpleQueue[Job | None] = SimpleQueue()
        self._current: Job | None = None
        self._stop_token = object()  # replaced by each stop; a call that was queued under another one is cancelled
        self._thread = threading.Thread(target=self._run, name=f"{device} {purpose}".strip(), daemon=True)
        self._thread.start()

    # -------------------------------------------------------------------------------- callers
    def call(
        self,
        method: str,
        function: Callable[..., Any],
        arguments: Sequence[Any] = (),
        keywords: Mapping[str, Any] = _NO_ARGUMENTS,
        deadline: float | None = None,
    ) -> Any:
        """Run a call and return its result. On the thread of the lane, call the function directly.

        Raises:
            DeviceTimeout: The call has not returned after `deadline` s, or the lane hangs.
        """
        if threading.current_thread() is self._thread:
            return function(*arguments, **keywords)
        job = Job(method, function, arguments, keywords)
        self.submit(job)
        if deadline is None:
            job.wait(None)
        elif not job.wait(deadline):
            self.expire(job, deadline)
        return job.outcome()

    def read(self, method: str, function: Callable[[], T], timeout: float) -> T:
        """Call a function that only observes, within `timeout` s of running time. Raises as `call`.

        A busy computer delays the threads of the device as well, which then allow more time themselves.
        """
        job = Job(method, function)
        self.submit(job)
        if not job.wait_running(timeout):
            self.expire(job, timeout)
        value: T = job.outcome()
        return value

    def submit(self, job: Job) -> None:
        """Queue a call. Raises DeviceTimeout if the lane hangs."""
        current = self._current
        if current is not None and current.given_up:
            raise self._hung(current)
        job.stop_token = self._stop_token
        self._queue.put(job)

    def submit_or_fail(self, job: Job) -> bool:
        """Queue a call, or end it with an error if the lane hangs. Return whether it was queued."""
        try:
            self.submit(job)
        except DeviceTimeout as error:
            job.finish(None, error)
            return False
        return True

    def expire(self, job: Job, deadline: float) -> None:
        """End a call whose deadline has passed, and all queued calls."""
        if job is not self._current:
            current = self._current
            text = (
                "{device}: {method} did not get its turn within {deadline:g} s"
                if current is None
                else "{device}: {method} did not get its turn within {deadline:g} s: the device is busy with {running}"
            )
            running = "" if current is None else current.method
            error = DeviceTimeout(text, device=self.device, method=job.method, deadline=deadline, running=running)
            job.finish(None, error)
        elif job.give_up(
            DeviceTimeout(
                "{device}: {method} did not finish within {deadline:g} s",
                device=self.device,
                method=job.method,
                deadline=deadline,
            )
        ):
            for waiting in self._drain():
                waiting.finish(None, self._hung(job))

    def interrupt(self) -> Job | None:
        """Cancel the queued calls. Mark the running call, so that it ends as Cancelled, and return it."""
        self._stop_token = object()
        current = self._current
        self.cancel_waiting()
        return current

    def cancel_waiting(self) -> None:
        """Cancel the queued calls."""
        for waiting in self._drain():
            waiting.finish(
                None,
                Cancelled("{device}: {method} was stopped before it began", device=self.device, method=waiting.method),
            )

    def check_wanted(self) -> None:
        """Raise Cancelled if the running call was stopped or abandoned. A call uses it before it commands the device.

        This also restarts the time in which a command may reach the device after a stop.
        """
        job = self._current
        if job is None:
            return
        job.since = time.monotonic()
        if job.ended or job.stop_token is not self._stop_token:
            raise Cancelled("{device}: {method} was stopped before it began", device=self.device, method=job.method)

    # -------------------------------------------------------------------------------- state
    @property
    def current(self) -> Job | None:
        """Return the running call, or None if the lane is idle."""
        return self._current

    @property
    def busy_with(self) -> str:
        """Return the name of the running method; empty if the lane is idle."""
        current = self._current
        return "" if current is None else current.method

    @property
    def hung(self) -> bool:
        """Return whether an abandoned call has not returned yet."""
        current = self._current
        return current is not None and current.given_up

    def close(self) -> None:
        """Cancel the queued calls and end the thread after the running call."""
        self.interrupt()
        self._queue.put(None)

    def join(self, timeout: float) -> bool:
        """Wait until the thread has ended after `close`, at most `timeout` s. Return False on timeout."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    # -------------------------------------------------------------------------------- inside
    def _hung(self, job: Job) -> DeviceTimeout:
        return DeviceTimeout(
            "{device} is still busy with {method}, which was given up",
            f"it began {time.monotonic() - job.since:.1f} s ago",
            device=self.device,
            method=job.method,
        )

    def _drain(self) -> list[Job]:
        found: list[Job] = []
        ended = False
        while True:
            try:
                job = self._queue.get_nowait()
            except Empty:
                break
            if job is None:
                ended = True
            else:
                found.append(job)
        if ended:
            self._queue.put(None)
        return found

    def _run(self) -> None:
        _on_lane.here = True
        while (job := self._queue.get()) is not None:
            job.since = time.monotonic()
            self._current = job  # before the check, so that `expire` on another thread sees it
            if job.ended or job.stop_token is not self._stop_token:
                self._current = None
                job.finish(
                    None,
                    Cancelled("{device}: {method} was stopped before it began", device=self.device, method=job.method),
                )
                continue
            value: Any = None
            error: BaseException | None = None
            try:
                value = job.function(*job.arguments, **job.keywords)
            except BaseException as caught:  # noqa: BLE001 - the caller receives every error
                error = caught
            if job.stop_token is not self._stop_token and not isinstance(error, Arcor2Error):
                error = Cancelled(
                    "{device}: {method} was stopped",
                    "" if error is None else repr(error),
                    device=self.device,
                    method=job.method,
                )
            self._current = None
            job.finish(value, error)
            del job, value, error

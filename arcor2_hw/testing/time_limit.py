"""A time limit for calls that may never return: the call runs on its own thread, whose stack is shown when it hangs."""

import sys
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any, Final

from arcor2_hw.objects import Generic
from arcor2_hw.testing.own_time import own_time

CHECK_PERIOD: Final = 0.5
"""Time between two comparisons with the limit, s. The end of the call is noticed at once."""
SUITE: Final = str(Path(__file__).parent)


class CallHangs(Exception):
    """A call has not returned within its time limit and is still running on its thread.

    Attributes:
        call: The call of the driver that has not returned.
        stack: The stack of the thread.
    """

    def __init__(self, what: str, limit: float, thread: threading.Thread) -> None:
        frames = _frames(sys._current_frames().get(thread.ident or 0))
        self.thread = thread
        self.call = _call_of(frames)
        self.stack = "".join(traceback.StackSummary.extract((each, each.f_lineno) for each in frames).format())
        super().__init__(f"{what} has not ended within {limit:g} s: {self.call} did not return")

    def returned(self, timeout: float) -> bool:
        """Wait some time, s, until the call returns, and return whether it has."""
        self.thread.join(timeout)
        return not self.thread.is_alive()


def within(limit: float, call: Callable[[], Any], what: str) -> Any:
    """Call on another thread, and return the result or raise the error of the call.

    Args:
        limit: Time limit, s, of the suite's clock, which stops while this process waits for a processor.
        call: The call.
        what: Name of the call in the error.

    Raises:
        CallHangs: The call has not returned in time. Its thread does not keep the process from ending.
    """
    results: list[Any] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            results.append(call())
        except BaseException as error:  # noqa: BLE001 - raised below; pytest's skip is no Exception
            errors.append(error)

    thread = threading.Thread(target=run, name=what, daemon=True)
    began = own_time()
    thread.start()
    while thread.is_alive():
        thread.join(CHECK_PERIOD)
        if thread.is_alive() and began.is_past(limit):
            raise CallHangs(what, limit, thread)
    if errors:
        raise errors.pop()  # no reference is left, so that its frames are freed
    return results[0]


def _frames(frame: FrameType | None) -> list[FrameType]:
    """Return the frames of a thread from the call on, outermost first."""
    frames: list[FrameType] = []
    while frame is not None and frame.f_code.co_filename != __file__:
        frames.insert(0, frame)
        frame = frame.f_back
    return frames


def _call_of(frames: list[FrameType]) -> str:
    """Return the outermost call of a driver on a stack, or without one the outermost call outside of the suite."""
    outside = ""
    for frame in frames:
        code = frame.f_code
        place = f"({Path(code.co_filename).name}, line {frame.f_lineno})"
        device = frame.f_locals.get("self")
        if isinstance(device, Generic):
            return f"{type(device).__name__}.{code.co_name}() {place}"
        if not outside and not code.co_filename.startswith(SUITE):
            outside = f"{code.co_qualname}() {place}"
    return outside or "the call"


# Names before version 0.2.
LOOK_EVERY = CHECK_PERIOD

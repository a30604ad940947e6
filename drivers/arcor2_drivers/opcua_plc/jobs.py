"""Jobs: the handshake of a job: number, request, busy, done or error, request off, idle (docs/devices/opcua-plc.md)."""

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Final

from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotInControl,
    OutOfRange,
    Refused,
)

from .plc import Handshake, Plc
from .values import INTEGERS

POLL_PERIOD: Final = 0.02
"""Time between readings of the handshake, s."""
ANSWERS_WITHIN: Final = 2.0
"""Time the PLC has to answer a request by busy, done or error, and to become idle after its end, s."""
STOPS_WITHIN: Final = 5.0
"""Time a job may take to stop, s."""


class Jobs:
    """Runs one job at a time on a PLC."""

    def __init__(self, plc: Plc) -> None:
        self._plc = plc
        self._one = threading.Lock()

    def run(self, number: int, timeout: float) -> None:
        """Run a job to its end.

        Raises:
            Refused: Another job is running, or the PLC is not idle.
            OutOfRange: The number is outside of the range of its variable.
            DeviceFault: The PLC reports an error; `fault_code` is its code.
            DeviceTimeout: The job did not end in time.
            Cancelled: The job was stopped.
            ConnectionLost: The connection was lost.
            NotInControl: Control ended.
        """
        plc = self._plc
        stops, losses = plc.stops, plc.losses
        plc.require_handshake()
        plc.require_control(f"job {number}")
        low, high = INTEGERS.get(plc.variant("number", 0).VariantType, (0, 0))
        if not low <= number <= high:
            raise OutOfRange(
                "{device}: the number of a job must be {low} to {high}, not {number}",
                device=plc.who,
                low=low,
                high=high,
                number=number,
            )
        if not self._one.acquire(blocking=False):
            raise Refused("{device}: job {number} is refused: another job runs", device=plc.who, number=number)
        try:
            found = plc.handshake()
            if found.busy or found.done or found.error:
                raise Refused(
                    "{device}: job {number} is refused: the PLC is {found}",
                    device=plc.who,
                    number=number,
                    found=_state(found),
                )
            plc.link.write({"number": plc.variant("number", number), "request": plc.variant("request", True)})
            try:
                self._wait(
                    lambda hand: hand.busy or hand.done or hand.error,
                    ANSWERS_WITHIN,
                    f"the start of job {number}",
                    stops,
                    losses,
                )
                ended = self._wait(
                    lambda hand: not hand.busy and (hand.done or hand.error), timeout, f"job {number}", stops, losses
                )
            finally:
                self._end_request()
        finally:
            self._one.release()
        if ended.error:
            raise DeviceFault(
                "{device}: job {number} ended with error {code}",
                "",
                ended.code,
                device=plc.who,
                number=number,
                code=ended.code,
            )

    def _end_request(self) -> None:
        """Reset the request, which stops a running job, and wait until the PLC is idle."""
        plc = self._plc
        with contextlib.suppress(DeviceError):  # else the PLC stops the job because our life sign is missing
            if plc.in_control:
                plc.link.write({"request": plc.variant("request", False)})
                self._wait(
                    lambda hand: not (hand.busy or hand.done or hand.error), ANSWERS_WITHIN, "being idle", -1, -1
                )

    def stop(self) -> None:
        """Reset the request if we have control, and wait until no job runs. Raises DeviceTimeout."""
        plc = self._plc
        plc.stop_waiting()
        if not plc.in_control:
            return
        plc.link.write({"request": plc.variant("request", False)})
        self._wait(lambda hand: not hand.busy, STOPS_WITHIN, "stopping", -1, -1)

    def _wait(
        self, holds: Callable[[Handshake], bool], timeout: float, what: str, stops: int, losses: int
    ) -> Handshake:
        """Wait until a condition holds. `stops`, `losses`: counters at the start of the call; -1: ignored."""
        plc = self._plc
        deadline = time.monotonic() + timeout
        while True:
            if stops not in (-1, plc.stops):
                raise Cancelled("{device}: {what} was stopped", device=plc.who, what=what)
            if losses >= 0:
                plc.check_loss(losses)
                plc.check_program()
                if not plc.in_control:
                    raise NotInControl(
                        "{device}: {what} was cancelled: {why_not}", device=plc.who, what=what, why_not=plc.why_not
                    )
            try:
                found = plc.handshake()
            except DeviceTimeout as e:
                raise ConnectionLost(
                    "{device}: {what}: the connection was lost", f"{e} {e.detail}", device=plc.who, what=what
                ) from e
            if stops not in (-1, plc.stops):
                raise Cancelled("{device}: {what} was stopped", device=plc.who, what=what)
            if holds(found):
                return found
            if time.monotonic() >= deadline:
                raise DeviceTimeout(
                    "{device}: {what} took longer than {timeout:g} s; the PLC is {found}",
                    device=plc.who,
                    what=what,
                    timeout=timeout,
                    found=_state(found),
                )
            time.sleep(POLL_PERIOD)


def _state(hand: Handshake) -> str:
    words = [name for name in ("busy", "done", "error") if getattr(hand, name)]
    return f"{' and '.join(words) or 'idle'}" + (f" (code {hand.code})" if hand.error else "")

"""The handshake of a job: number, request, busy, done or error, request off, idle again (docs/devices/opcua-plc.md)."""

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

from .plc import Hand, Plc
from .values import INTEGERS

LOOK: Final = 0.02
"""Time between looks at the handshake, s."""
BEGINS_WITHIN: Final = 2.0
"""s the PLC has to answer a request by busy, done or error, and to be idle again when the request is taken back."""
STOPS_WITHIN: Final = 5.0
"""Time a job may take to stop, s."""


class Jobs:
    """Runs one job at a time on a PLC."""

    def __init__(self, plc: Plc) -> None:
        self._plc = plc
        self._one = threading.Lock()

    def run(self, number: int, timeout: float) -> None:
        """Run a job to its end.

        Raises Refused while another runs or the PLC is not idle, OutOfRange for a number the PLC cannot hold,
        DeviceFault with the PLC's error code, DeviceTimeout, Cancelled when it was stopped, ConnectionLost,
        NotInControl when control was lost.
        """
        plc = self._plc
        stops, losses = plc.stops, plc.losses
        plc.need_handshake()
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
            found = plc.hand()
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
                    BEGINS_WITHIN,
                    f"beginning job {number}",
                    stops,
                    losses,
                )
                ended = self._wait(
                    lambda hand: not hand.busy and (hand.done or hand.error), timeout, f"job {number}", stops, losses
                )
            finally:
                self._take_back()
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

    def _take_back(self) -> None:
        """Take the request back, so that a job that still runs stops, and see the PLC idle."""
        plc = self._plc
        with contextlib.suppress(DeviceError):  # it is gone: its own supervision stops the job
            if plc.in_control:
                plc.link.write({"request": plc.variant("request", False)})
                self._wait(lambda hand: not (hand.busy or hand.done or hand.error), BEGINS_WITHIN, "being idle", -1, -1)

    def stop(self) -> None:
        """Take the request back when control is ours, and return when nothing runs. Raises DeviceTimeout."""
        plc = self._plc
        plc.stop_waiting()
        if not plc.in_control:
            return
        plc.link.write({"request": plc.variant("request", False)})
        self._wait(lambda hand: not hand.busy, STOPS_WITHIN, "stopping", -1, -1)

    def _wait(self, holds: Callable[[Hand], bool], timeout: float, what: str, stops: int, losses: int) -> Hand:
        """Look until something holds. stops, losses: of when the caller began; -1 when neither matters."""
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
                        "{device}: {what} was given up: {why_not}", device=plc.who, what=what, why_not=plc.why_not
                    )
            try:
                found = plc.hand()
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
            time.sleep(LOOK)


def _state(hand: Hand) -> str:
    words = [name for name in ("busy", "done", "error") if getattr(hand, name)]
    return f"{' and '.join(words) or 'idle'}" + (f" (code {hand.code})" if hand.error else "")

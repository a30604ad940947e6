"""Sending of stops to devices, and their outcomes."""

import time
from typing import Final, NamedTuple

from arcor2_hw.exceptions import Arcor2Error, Cancelled
from arcor2_hw.messages import Message
from arcor2_hw.runtime.device import STOP_DEADLINE, Device, describe, time_left
from arcor2_hw.runtime.lane import Job
from arcor2_hw.runtime.message_parts import DeviceStop

UNSTOPPABLE_AFTER: Final = 0.25
"""Time after which a call that cannot be stopped is reported as still running, s."""
POLL: Final = 0.005
"""Period of the check whether a call has returned, s."""


class SentStop(NamedTuple):
    """A stop that was sent to one device.

    call: on the stop lane; None if there is no method to call. running: the call that the stop interrupted; None if the
    device was idle. problem: why the stop could not be sent.
    """

    device: Device
    call: Job | None
    running: Job | None
    problem: Arcor2Error | None = None


def send_stop(device: Device) -> SentStop:
    """Send a stop to a device without waiting for it."""
    running = device.lane.current
    try:
        sent = device.begin_stop()
    except Arcor2Error as error:  # an earlier stop has not returned
        return SentStop(device, None, running, error)
    return SentStop(device, None, running) if sent is None else SentStop(device, *sent)


def wait_stopped(stops: list[SentStop], within: float = STOP_DEADLINE) -> Arcor2Error | None:
    """Wait until the stops have returned, at most `within` s, and return the first error."""
    deadline = time.monotonic() + within
    errors = [_call_error(stop, deadline, within) for stop in stops]
    return next((error for error in errors if error is not None), None)


def outcomes(stops: list[SentStop], within: float = STOP_DEADLINE) -> list[DeviceStop]:
    """Wait until the devices have stopped, and return the outcome for each that was sent a stop or still runs a call.

    within: time limit for all devices, which stop concurrently, s.
    """
    deadline = time.monotonic() + within
    found = []
    for stop in stops:
        reason = _reason(stop, deadline, within)
        if stop.call is not None or reason is not None:
            method = "" if stop.running is None else stop.running.method
            found.append(DeviceStop(stop.device.id, reason, method))
    return found


def _call_error(stop: SentStop, deadline: float, within: float) -> Arcor2Error | None:
    device, call = stop.device, stop.call
    if call is None:
        return None
    if not call.wait(time_left(deadline)):
        device.stop_lane.expire(call, within)
    if call.error is None or isinstance(call.error, Cancelled):
        return None
    return describe(device, call.error)


def _reason(stop: SentStop, deadline: float, within: float) -> Message | None:
    """Return why a device was not stopped; None if it was stopped."""
    error = stop.problem or _call_error(stop, deadline, within)
    if error is not None:
        return error.message
    device, running = stop.device, stop.running
    if running is None:
        return None
    if stop.call is None:
        if _returned(device, running, min(deadline, time.monotonic() + UNSTOPPABLE_AFTER)):
            return None
        kind = device.recipe.cls.__name__
        return Message.of(
            "{device}: {method} cannot be stopped, because {kind} has neither stop() nor a CANCEL_MAPPING entry for it",
            device=device.name,
            method=running.method,
            kind=kind,
        )
    if _returned(device, running, deadline):
        return None
    return Message.of(
        "{device}: stop() returned, but {method} is still running", device=device.name, method=running.method
    )


def _returned(device: Device, running: Job, deadline: float) -> bool:
    while device.lane.current is running:
        if time.monotonic() >= deadline:
            return False
        time.sleep(POLL)
    return True

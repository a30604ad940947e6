"""Repeats actions of a device after they have failed."""

from collections.abc import Callable
from typing import Any

from arcor2_hw.actions import metadata_of
from arcor2_hw.data.object_type import Again
from arcor2_hw.exceptions import ENDS_PROGRAM, Arcor2Error, InvalidData
from arcor2_hw.objects import Generic
from arcor2_hw.runtime.program import ATTEMPT, RETRIES, Program
from arcor2_hw.runtime.recovery import is_decided


class Retrying:
    """Forward methods to a device. An action that fails is repeated, each time as an action of its own.

    An error that always ends the program is not followed by another attempt: a lost device, lost control, a safety stop
    or a cancelled action.

    Args:
        device: the device, or its proxy.
        program: the running program.
        count: maximum number of repetitions.
        pause: time before each repetition, s.
    """

    def __init__(self, device: Generic, program: Program, count: int, pause: float) -> None:
        self._device, self._program, self._count, self._pause = device, program, count, pause

    def __getattr__(self, name: str) -> Callable[..., Any]:
        found = metadata_of(getattr(self._device.__class__, name, None))
        if found is None or found.again != Again.SAFE:
            raise InvalidData(
                "{device}: {name} cannot be retried, because repeating it may do harm.",
                device=self._device.name,
                name=name,
            )
        method = getattr(self._device, name)

        def call(*arguments: Any, **keywords: Any) -> Any:
            for attempt in range(1, self._count + 2):
                token, retries = ATTEMPT.set(attempt), RETRIES.set(self._count + 1 - attempt)
                try:
                    return method(*arguments, **keywords)
                except Arcor2Error as error:
                    if attempt > self._count or isinstance(error, ENDS_PROGRAM) or is_decided(error):
                        raise
                finally:
                    ATTEMPT.reset(token)
                    RETRIES.reset(retries)
                self._program.pause_before_retry(self._pause)
            raise AssertionError("unreachable: the last attempt returns or raises")

        return call

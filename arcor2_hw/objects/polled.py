"""Polled: a StateObserver made of functions, for drivers in released packages. New ones derive from StateObserver."""

from collections.abc import Callable
from typing import TypeVar

from arcor2_hw.exceptions import DeviceError
from arcor2_hw.messages import Message
from arcor2_hw.objects.observing import GoOn as GoOn
from arcor2_hw.objects.state_observer import Snapshot as Snapshot, StateObserver

T = TypeVar("T")


class Polled(StateObserver[T]):
    """A StateObserver whose hooks are functions; see there."""

    def __init__(
        self,
        who: str | Message,
        open_: Callable[[float], Snapshot[T]],
        read: Callable[[], T | None],
        close: Callable[[], None],
        *,
        quiet: float = 0.1,
        busy: float = 0.02,
        fresh: float = 0.5,
        answers_within: float = 3.0,
        taken: Callable[[Snapshot[T]], None] = lambda _: None,
        after: Callable[[], None] = lambda: None,
        lost: Callable[[DeviceError], None] = lambda _: None,
        interrupt: Callable[[], None] = lambda: None,
    ) -> None:
        self.__dict__ |= {"open": open_, "read": read, "close": close, "interrupt": interrupt}
        self.__dict__ |= {"on_state": taken, "after_reading": after, "on_lost": lost}
        self.period, self.busy_period, self.fresh_for, self.answers_within = quiet, busy, fresh, answers_within
        super().__init__(who)

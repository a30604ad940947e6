"""Counting: one counter per object."""

import dataclasses

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic, Settings


@dataclasses.dataclass
class CounterSettings(Settings):
    """What the counter begins with."""

    start: int = 0


class CounterActions(Generic):
    """A counter. Place one object for each thing to be counted."""

    category = "Program"
    icon = "counter"
    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: CounterSettings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        self._start = settings.start if settings is not None else 0
        self._value = self._start

    @action
    def increment(self, by: int = 1, *, an: str | None = None) -> int:
        """Count up and give the new value.

        :param by: how many to add
        """
        assert 0 <= by <= 1000000

        self._value += by
        return self._value

    @action
    def decrement(self, by: int = 1, *, an: str | None = None) -> int:
        """Count down and give the new value.

        :param by: how many to take away
        """
        assert 0 <= by <= 1000000

        self._value -= by
        return self._value

    @action
    def value(self, *, an: str | None = None) -> int:
        """Give the present value."""
        return self._value

    @action
    def set_value(self, new_value: int, *, an: str | None = None) -> None:
        """Set the counter to a value.

        :param new_value: what it shall show
        """
        self._value = new_value

    @action
    def reset(self, *, an: str | None = None) -> None:
        """Go back to what the counter began with."""
        self._value = self._start

    @action
    def below(self, limit: int, *, an: str | None = None) -> bool:
        """Tell whether the counter is below a limit.

        :param limit: the first value that is not below
        """
        return self._value < limit

    @action
    def reached(self, limit: int, *, an: str | None = None) -> bool:
        """Tell whether the counter has reached a limit.

        :param limit: the first value that counts as reached
        """
        return self._value >= limit

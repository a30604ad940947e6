"""A counter for programs."""

import dataclasses

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic, Settings


@dataclasses.dataclass
class CounterSettings(Settings):
    """Initial value of the counter."""

    start: int = 0


class CounterActions(Generic):
    """A counter. Add one object for each quantity to count."""

    category = "Program"
    icon = "counter"
    _ABSTRACT = False
    display_name = "Counters"

    def __init__(self, obj_id: str, name: str, settings: CounterSettings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        self._start = settings.start if settings is not None else 0
        self._value = self._start

    @action
    def increment(self, by: int = 1, *, an: str | None = None) -> int:
        """Increase the counter and return the new value.

        :param by: amount to add
        """
        assert 0 <= by <= 1000000

        self._value += by
        return self._value

    @action
    def decrement(self, by: int = 1, *, an: str | None = None) -> int:
        """Decrease the counter and return the new value.

        :param by: amount to subtract
        """
        assert 0 <= by <= 1000000

        self._value -= by
        return self._value

    @action
    def value(self, *, an: str | None = None) -> int:
        """Return the present value."""
        return self._value

    @action
    def set_value(self, new_value: int, *, an: str | None = None) -> None:
        """Set the counter to a value.

        :param new_value: new value
        """
        self._value = new_value

    @action
    def reset(self, *, an: str | None = None) -> None:
        """Reset the counter to its initial value."""
        self._value = self._start

    @action
    def below(self, limit: int, *, an: str | None = None) -> bool:
        """Return whether the counter is below a limit.

        :param limit: first value that is not below the limit
        """
        return self._value < limit

    @action
    def reached(self, limit: int, *, an: str | None = None) -> bool:
        """Return whether the counter has reached a limit.

        :param limit: first value that reaches the limit
        """
        return self._value >= limit

"""Chance: random numbers and decisions."""

import dataclasses
import random

from arcor2_hw.actions import action
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.objects import Generic, Settings


@dataclasses.dataclass
class RandomSettings(Settings):
    """Zero gives another sequence each time, any other seed always its own."""

    seed: int = 0


class RandomActions(Generic):
    """Draws numbers and decides by chance."""

    category = "Program"
    icon = "random"
    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: RandomSettings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        self._random = random.Random((settings.seed if settings is not None else 0) or None)

    @action
    def random_double(self, minimum: float = 0.0, maximum: float = 1.0, *, an: str | None = None) -> float:
        """Give a number between two others, all equally likely.

        :param minimum: the lowest that may come
        :param maximum: the highest that may come
        """
        if minimum > maximum:
            raise InvalidData(f"{self.name}: the minimum {minimum} is above the maximum {maximum}")
        return self._random.uniform(minimum, maximum)

    @action
    def random_integer(self, minimum: int = 1, maximum: int = 6, *, an: str | None = None) -> int:
        """Give a whole number out of a range, all equally likely.

        :param minimum: the lowest that may come
        :param maximum: the highest that may come
        """
        if minimum > maximum:
            raise InvalidData(f"{self.name}: the minimum {minimum} is above the maximum {maximum}")
        return self._random.randint(minimum, maximum)

    @action
    def random_bool(self, probability: float = 0.5, *, an: str | None = None) -> bool:
        """Give true by chance.

        :param probability: how likely true is
        """
        assert 0.0 <= probability <= 1.0

        return self._random.random() < probability

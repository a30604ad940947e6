"""Random numbers and decisions."""

import dataclasses
import random

from arcor2_hw.actions import action
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.objects import Generic, Settings


@dataclasses.dataclass
class RandomSettings(Settings):
    """Seed of the sequence; zero gives a different sequence each time."""

    seed: int = 0


class RandomActions(Generic):
    """Returns random numbers and decisions."""

    category = "Program"
    icon = "random"
    _ABSTRACT = False
    display_name = "Random numbers"

    def __init__(self, obj_id: str, name: str, settings: RandomSettings | None = None) -> None:
        super().__init__(obj_id, name, settings)
        self._random = random.Random((settings.seed if settings is not None else 0) or None)

    @action(renamed={"minimum": "range_min", "maximum": "range_max"})
    def random_double(self, range_min: float = 0.0, range_max: float = 1.0, *, an: str | None = None) -> float:
        """Return a random number from a range, uniformly distributed.

        :param range_min: smallest possible number
        :param range_max: largest possible number
        """
        self._check_range(range_min, range_max)
        return self._random.uniform(range_min, range_max)

    @action(renamed={"minimum": "range_min", "maximum": "range_max"})
    def random_int(self, range_min: int = 1, range_max: int = 6, *, an: str | None = None) -> int:
        """Return a random integer from a range, including its ends, uniformly distributed.

        :param range_min: smallest possible integer
        :param range_max: largest possible integer
        """
        self._check_range(range_min, range_max)
        return self._random.randint(range_min, range_max)

    random_integer = random_int

    def _check_range(self, range_min: float, range_max: float) -> None:
        if range_min > range_max:
            raise InvalidData(
                "{name}: range_min {range_min} is above range_max {range_max}",
                name=self.name,
                range_min=range_min,
                range_max=range_max,
            )

    @action
    def random_bool(self, probability: float = 0.5, *, an: str | None = None) -> bool:
        """Return a random boolean.

        :param probability: probability of true
        """
        assert 0.0 <= probability <= 1.0

        return self._random.random() < probability

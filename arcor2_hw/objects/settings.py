"""Settings of an object type: a dataclass, filled from the scene object's parameters."""

import dataclasses


@dataclasses.dataclass
class Settings:
    """Base of every settings dataclass: fields are bool, int, float, str or enumerations."""

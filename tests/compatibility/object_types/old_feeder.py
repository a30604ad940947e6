"""A feeder in the convention of older object types."""

from dataclasses import dataclass
from enum import unique
from typing import Optional

from arcor2.data.common import ActionMetadata, Pose, StrEnum
from arcor2.exceptions import Arcor2Exception
from arcor2_object_types.abstract import GenericWithPose, Settings


@unique
class Mode(StrEnum):
    SLOW = "SLOW"
    FAST = "FAST"


@dataclass
class FeederSettings(Settings):
    url: str
    parts: int = 3


class FeederException(Arcor2Exception):
    """The feeder refuses the request."""


class OldFeeder(GenericWithPose):
    """A feeder."""

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: FeederSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._left = settings.parts

    def cleanup(self) -> None:
        super().cleanup()

    def feed(self, count: int, mode: Mode, *, an: Optional[str] = None) -> int:  # noqa: UP045 - as older sources are written
        """Feeds parts.

        :param count: How many.
        """
        assert 0 <= count <= 100

        if count > self._left:
            raise FeederException("Empty.")
        self._left = self._left - count if mode is not Mode.FAST else 0
        return self._left

    feed.__action__ = ActionMetadata()

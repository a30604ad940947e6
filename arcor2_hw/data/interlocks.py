"""Interlocks of a scene: conditions for actions and zones, and their present state."""

import enum
from typing import Annotated, Final

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, TranslatableData, Unset
from arcor2_hw.data.geometry import Position
from arcor2_hw.data.operator import Operator

MAX_WAIT: Final = 3600.0
"""Longest time for which an action waits for its conditions, s."""


class InterlockTarget(enum.StrEnum):
    """Target of an interlock: actions of an object, or a zone."""

    ACTION = "action"
    ZONE = "zone"


class Unmet(enum.StrEnum):
    """Reaction of an action to a condition that is not met: wait, then hold the program; or hold it at once."""

    WAIT = "wait"
    HOLD = "hold"


class Need(Data, frozen=True):
    """A condition: an observation of an object, compared with a constant.

    observation: name of the observation in the metadata of the type. point: name of the point, for an observation of
    many points. value, and upper of a range: JSON in a string.
    """

    object_id: str
    observation: str
    operator: Operator = Operator.EQUAL
    value: str = "true"
    upper: str | Unset = UNSET
    point: str = ""


class Interlock(Data, frozen=True):
    """Conditions for actions of an object, or for a zone.

    object_id: the object, or the collision body that is the zone. A zone belongs to one robot at a time. actions: names
    of actions of the object; none for all its actions and motions. during: whether the conditions are needed as long as
    the action runs, or a robot moves in the zone. within: longest time for which an action waits, s. retract: path on
    which a robot leaves the zone, points in the frame of the body, the last one outside; none for the shortest path.
    """

    name: str
    on: InterlockTarget
    object_id: str
    actions: list[str] = field(default_factory=list)
    needs: list[Need] = field(default_factory=list)
    during: bool = False
    within: Annotated[float, Meta(ge=0.0, le=MAX_WAIT)] = 30.0
    otherwise: Unmet = field(name="else", default=Unmet.WAIT)
    id: str = ""
    retract: list[Position] = field(default_factory=list)

    @property
    def zone(self) -> str:
        """The id of the zone; empty for an interlock of actions."""
        return self.object_id if self.on is InterlockTarget.ZONE else ""


class InterlockCondition(enum.StrEnum):
    """Whether the conditions of an interlock are met. Unknown counts as not met."""

    MET = "met"
    NOT_MET = "not_met"
    UNKNOWN = "unknown"


class InterlockState(TranslatableData, frozen=True):
    """The present state of an interlock.

    text: the first condition that is not met. owner: id of the robot that has the zone. waiting: ids of the objects
    whose actions wait. inside: ids of the robots whose end effectors are in the zone.
    """

    id: str
    state: InterlockCondition
    text: str = ""
    owner: str = ""
    waiting: list[str] = field(default_factory=list)
    inside: list[str] = field(default_factory=list)


class InterlockStates(Data, frozen=True):
    """The states of all interlocks of the online scene, or of the running program; none while it is offline."""

    interlocks: list[InterlockState]


# Names before version 0.2.
LONGEST_WAIT = MAX_WAIT

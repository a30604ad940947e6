"""Requests about points and forced outputs (docs/protocol/points.md)."""

from typing import Annotated, Final

from msgspec import Meta

from arcor2_hw.data.base import Data
from arcor2_hw.data.points import MAX_FORCE_MS, MIN_FORCE_MS
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc

FASTEST_POINTS: Final = 5.0
"""Maximum rate of points, Hz."""
MAX_RENEWED: Final = 500
"""Maximum number of forces that one request renews."""

ForceTime = Annotated[int, Meta(ge=MIN_FORCE_MS, le=MAX_FORCE_MS)]


class StreamPointsArgs(Data, frozen=True):
    """Arguments of StreamPoints: ObjectPoints of a device, 0.2 to 5 times per second, or off."""

    object_id: str
    rate: float = 2.0
    send: bool = True


class ForcePointArgs(Data, frozen=True):
    """Arguments of ForcePoint.

    point: name of the output. value: a boolean for a digital output, a number in its unit for an analogue one.
    valid_ms: 500 to 10000, duration of the force unless it is renewed.
    """

    object_id: str
    point: str
    value: bool | float
    valid_ms: ForceTime


class ForcePointData(Data, frozen=True):
    """Answer to ForcePoint: the id of the force."""

    id: str


class RenewForcesArgs(Data, frozen=True):
    """Arguments of RenewForces: forces of this client, and their duration from now unless they are renewed again."""

    ids: Annotated[list[str], Meta(max_length=MAX_RENEWED)]
    valid_ms: ForceTime


class EndForceArgs(Data, frozen=True):
    """Arguments of EndForce: a force of any client."""

    id: str


POINT_RPCS: Final = (
    Rpc("EndForce", EndForceArgs, None, Role.OPERATOR, additional=True),
    Rpc("ForcePoint", ForcePointArgs, ForcePointData, Role.TECHNICIAN, additional=True),
    Rpc("RenewForces", RenewForcesArgs, None, Role.TECHNICIAN, additional=True),
    Rpc("StreamPoints", StreamPointsArgs, None, Role.OPERATOR, additional=True),
)
"""Requests about points."""


# Names before version 0.2.
MOST_RENEWED = MAX_RENEWED

"""General arguments and answers, and those about the server itself."""

from typing import Annotated, Final

from msgspec import Meta, field

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.camera import CameraParameters, EstimatedPose, MarkerCorners
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class AuthenticateArgs(Data, frozen=True):
    """Arguments of Authenticate."""

    token: str


class AuthenticateData(Data, frozen=True):
    """Answer to Authenticate: the name of the token and its role; `shared`: true if persons have to log on."""

    name: str
    role: str
    shared: bool | Unset = UNSET


class IdArgs(Data, frozen=True):
    """Arguments of every RPC that takes one id."""

    id: str


class TypeArgs(Data, frozen=True):
    """Arguments of GetActions."""

    type: str


class GetCameraPoseArgs(Data, frozen=True):
    """Arguments of GetCameraPose."""

    camera_parameters: CameraParameters
    image: str
    inverse: bool = False


class MarkersCornersArgs(Data, frozen=True):
    """Arguments of MarkersCorners."""

    camera_parameters: CameraParameters
    image: str


class RegisterUserArgs(Data, frozen=True):
    """Arguments of RegisterUser."""

    user_name: str


class RenameArgs(Data, frozen=True):
    """Arguments of RenameScene and RenameObject."""

    id: str
    new_name: str


class SubscribeEventsArgs(Data, frozen=True):
    """Arguments of SubscribeEvents: names of additional events to subscribe to, or to unsubscribe from.

    users: users whose view states are sent with ViewStateChanged, in addition to the user of this connection.
    """

    events: set[str]
    send: bool = True
    users: Annotated[set[str], Meta(max_length=100)] | Unset = UNSET


class CellInfo(Data, frozen=True):
    """The cell of the server. fleet: address of the page with all cells; left out if there is none."""

    name: str
    fleet: str | Unset = UNSET


class SystemInfoData(Data, frozen=True):
    """Answer to SystemInfo. cell: left out if the cell has no name."""

    version: str
    api_version: str
    supported_parameter_types: set[str] = field(default_factory=set)
    supported_rpc_requests: set[str] = field(default_factory=set)
    cell: CellInfo | Unset = UNSET


GENERAL_RPCS: Final = (
    Rpc("Authenticate", AuthenticateArgs, AuthenticateData, Role.OPERATOR, additional=True),
    Rpc("GetCameraPose", GetCameraPoseArgs, EstimatedPose, Role.TECHNICIAN),
    Rpc("MarkersCorners", MarkersCornersArgs, list[MarkerCorners], Role.TECHNICIAN),
    Rpc("RegisterUser", RegisterUserArgs, None, Role.OPERATOR),
    Rpc("SubscribeEvents", SubscribeEventsArgs, None, Role.OPERATOR, additional=True),
    Rpc("SystemInfo", None, SystemInfoData, Role.OPERATOR),
)
"""Requests about the server."""

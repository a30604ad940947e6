"""The Execution service's own websocket (protocol, section 12): packages and the running program, nothing else."""

from typing import Any, Final

import msgspec

from arcor2_hw.data.base import Data
from arcor2_hw.data.events import Event
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import Rpc
from arcor2_server.rpc.registry import Context
from arcor2_server.services import Services
from arcor2_server.websocket.endpoint import AUTHENTICATE, Endpoint, Route, Speech, routes

API_VERSION: Final = "1.2.0"
"""Of the Execution service whose behaviour this is: an ARServer of the original refuses another major version."""
REQUESTS: Final = (
    "DeletePackage",
    "ListPackages",
    "PausePackage",
    "RenamePackage",
    "ResumePackage",
    "RunPackage",
    "StepAction",
    "StopPackage",
    "UploadPackage",
)
"""Those that ARServer serves too; Version is here alone."""
EVENTS: Final = frozenset(
    {
        "ActionStateAfter",
        "ActionStateBefore",
        "PackageChanged",
        "PackageInfo",
        "PackageState",
        "ProjectException",
        "RobotEef",
        "RobotJoints",
    }
)


class VersionData(Data, frozen=True):
    """What the request Version is answered."""

    version: str = ""


async def _version(context: Context, args: Any) -> VersionData:  # noqa: ARG001
    return VersionData(API_VERSION)


def execution_endpoint(services: Services) -> Endpoint:
    """Make the endpoint of the Execution service."""
    known = routes()
    table = {name: known[name] for name in (*REQUESTS, AUTHENTICATE)}
    table["Version"] = Route(Rpc("Version", None, VersionData, Role.OPERATOR), _version, None, None, None)

    def greeting() -> list[Event]:
        state, info = services.execution.state_and_info()
        return [state] if info is None else [state, msgspec.json.decode(info, type=Event)]

    return Endpoint(services, Speech(table, greeting, EVENTS))

"""The websocket of the Execution service: packages and the running program (protocol, section 12)."""

from collections.abc import Callable, Mapping
from typing import Any, Final

import msgspec

from arcor2_hw.data.base import Data
from arcor2_hw.data.events import Event
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import Rpc
from arcor2_server.websocket.request import Context
from arcor2_server.websocket.routes import AUTHENTICATE, Route, Service

API_VERSION: Final = "1.2.0"
"""Version of the Execution service of ARCOR2 whose behaviour this is. ARServer of ARCOR2 checks the major version."""
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
"""The requests that ARServer serves too. Only this service has the request Version."""
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
    """Answer to Version."""

    version: str = ""


async def _version(context: Context, args: Any) -> VersionData:  # noqa: ARG001
    return VersionData(API_VERSION)


def execution_service(routes: Mapping[str, Route], state_and_info: Callable[[], tuple[Event, bytes | None]]) -> Service:
    """Return the websocket service of the Execution service.

    Args:
        routes: the routes of all requests.
        state_and_info: returns the PackageState, and the encoded PackageInfo while a program runs.
    """
    table = {name: routes[name] for name in (*REQUESTS, AUTHENTICATE)}
    table["Version"] = Route(Rpc("Version", None, VersionData, Role.OPERATOR), _version, None, None, None)

    def greeting() -> list[Event]:
        state, info = state_and_info()
        return [state] if info is None else [state, msgspec.json.decode(info, type=Event)]

    return Service(table, greeting, EVENTS)

"""Requests about the server itself and about who is there."""

import functools
from typing import Any, Final

from msgspec import Raw

from arcor2_hw.data.rpc import RegisterUserArgs, SystemInfoData
from arcor2_server.hub import encode
from arcor2_server.rpc.registry import HANDLERS, Context, at_once, rpc
from arcor2_server.services import Services

VERSION: Final = "1.4.0"
"""The version of the ARServer whose behaviour this is; our own is `arcor2-hw --version`."""
API_VERSION: Final = "1.1.0"
"""Existing clients refuse another major version."""
PARAMETER_TYPES: Final = (
    "boolean",
    "double",
    "image",
    "integer",
    "integer_enum",
    "joints",
    "pose",
    "position",
    "string",
    "string_enum",
)


@rpc("SystemInfo")
async def system_info(context: Context, args: None) -> Any:  # noqa: ARG001
    """Give versions, parameter types and the requests that are served (an existing client sends no other)."""
    return _system_info(len(HANDLERS))


@functools.lru_cache(maxsize=1)
def _system_info(_handlers: int) -> Raw:
    """Encode the answer once; the handlers only grow, and only until the server is up."""
    return Raw(encode(SystemInfoData(VERSION, API_VERSION, set(PARAMETER_TYPES), set(HANDLERS))))


@at_once("SystemInfo")
def _kept_system_info(services: Services) -> Raw:  # noqa: ARG001
    return _system_info(len(HANDLERS))


@rpc("RegisterUser")
async def register_user(context: Context, args: RegisterUserArgs) -> None:
    """Log in at this connection."""
    context.events_to_caller += await context.services.users.register(context.client, args.user_name)

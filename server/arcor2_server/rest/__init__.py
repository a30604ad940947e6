"""The REST routes: each declares the least role that may use it."""

from typing import Final

from litestar.handlers import HTTPRouteHandler

from arcor2_server.rest.devices import devices
from arcor2_server.rest.object_types import delete_object_type, object_type, object_types, put_object_type

ROUTES: Final[list[HTTPRouteHandler]] = [
    devices,
    object_types,
    object_type,
    put_object_type,
    delete_object_type,
]

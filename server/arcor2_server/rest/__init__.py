"""The REST operations of all services; each declares the least role that may use it."""

from typing import Final

from litestar.handlers import HTTPRouteHandler

# Imported for their operations.
from arcor2_server.rest import (  # noqa: F401
    api_page,
    assets,
    build,
    calibration,
    calibration_records,
    calibrations,
    diagnosis,
    display_models,
    documents,
    execution,
    general,
    kinematics,
    models,
    object_types,
    projects,
    runs,
    scene,
    scenes,
)
from arcor2_server.rest.operations import OPERATIONS, route


def routes() -> list[HTTPRouteHandler]:
    """Make the routes of one application."""
    return [route(declared) for declared in OPERATIONS]


__all__: Final = ["OPERATIONS", "routes"]

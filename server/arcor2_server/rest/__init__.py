"""The REST operations of all services. Each declares the role that it needs."""

from collections.abc import Iterable
from typing import Final

from litestar.handlers import HTTPRouteHandler

from arcor2_server.audit.trail import AuditTrail
from arcor2_server.collaboration.tasks import Tasks

# Imported for their operations.
from arcor2_server.rest import (  # noqa: F401
    alarms,
    api_page,
    assets,
    audit_trail,
    build,
    calibration_methods,
    calibration_records,
    calibration_service,
    cameras,
    diagnosis,
    display_models,
    documents,
    execution,
    general,
    history,
    kinematics,
    models,
    object_types,
    production,
    projects,
    recordings,
    runs,
    scene_service,
    scenes,
)
from arcor2_server.rest.operations import OPERATIONS, bound, route


def routes(groups: Iterable[object], tasks: Tasks, audit: AuditTrail) -> list[HTTPRouteHandler]:
    """Return the routes of all operations.

    Args:
        groups: the objects whose methods are the operations.
        tasks: the tasks, for the progress of uploads.
        audit: the audit trail.
    """
    return [route(declared, tasks, audit) for declared in bound(OPERATIONS, groups)]


__all__: Final = ["OPERATIONS", "routes"]

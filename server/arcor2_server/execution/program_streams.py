"""Subscriptions to the joints and end effector poses of the running program's devices."""

import contextlib

from arcor2_hw.exceptions import NotFound
from arcor2_server.errors import RequestRefused
from arcor2_server.hosts.session import HostSession
from arcor2_server.hosts.streams import RobotStreams
from arcor2_server.object_types.registry import ObjectTypes


class ProgramStreams:
    """Finds devices of the running program to subscribe to. Methods raise RequestRefused while it starts."""

    def __init__(self, host: HostSession, types: ObjectTypes) -> None:
        self._host = host
        self._types = types

    def of_object(self, object_id: str) -> RobotStreams:
        """Return the subscriptions, to which a device of the program can be added. Raise NotFound without it."""
        self._require_devices()
        self._host.board.object(object_id)
        return self._host.streams

    def of_robot(self, robot_id: str) -> RobotStreams:
        """Return the subscriptions, to which a robot of the program can be added. Raise NotFound without it."""
        self._require_devices()
        found = self._host.board.object(robot_id)
        with contextlib.suppress(NotFound):  # the type may be only in the package
            if not self._types.derives_from(found.type, "Robot"):
                raise RequestRefused("{name} is not a robot.", name=found.name)
        return self._host.streams

    def _require_devices(self) -> None:
        if self._host.package_info is None:
            raise RequestRefused(
                "The devices of the program are not connected yet. Try again after the event PackageInfo."
            )

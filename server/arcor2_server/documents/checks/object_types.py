"""Access of the checks to object types."""

from typing import Protocol

from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta
from arcor2_hw.data.robot import RobotMeta


class Types(Protocol):
    """Access to the object types (arcor2_server.object_types.registry.ObjectTypes)."""

    def meta(self, name: str) -> ObjectTypeMeta:
        """Return one type. Raise NotFound if there is none."""

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Return one action. Raise NotFound if there is none."""

    def robot_meta(self, name: str) -> RobotMeta:
        """Return the features of a robot type. Raise NotFound if the type is not a robot."""

"""Roles of users. Each role may do what the previous ones may."""

import enum
from typing import Final, Literal, TypeAlias, cast

from arcor2_hw.messages import Message, translatable

RoleName: TypeAlias = Literal["operator", "standard_user", "advanced_user", "technician", "programmer"]
"""The name of a role in data and on the command line."""


class Role(enum.IntEnum):
    """Roles. The minimum role is declared where a request, event or route is defined."""

    OPERATOR = 1
    """Runs, pauses and stops programs."""
    STANDARD_USER = 2
    """Adapts programs: values of parameters and points, tries actions."""
    ADVANCED_USER = 3
    """Creates programs: points, actions, logic, packages."""
    TECHNICIAN = 4
    """Sets up workplaces: objects, poses, calibration."""
    PROGRAMMER = 5
    """Adds object types."""

    @property
    def identifier(self) -> RoleName:
        """The name in data."""
        return cast("RoleName", self.name.lower())

    @property
    def shown(self) -> Message:
        """The name in messages."""
        return Message.of(_NAMES[self])


_NAMES: Final = translatable(
    {
        Role.OPERATOR: "operator",
        Role.STANDARD_USER: "standard user",
        Role.ADVANCED_USER: "advanced user",
        Role.TECHNICIAN: "technician",
        Role.PROGRAMMER: "programmer",
    }
)

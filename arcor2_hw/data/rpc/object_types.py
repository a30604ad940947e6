"""Arguments and answers about object types, overrides and aiming."""

from typing import Final

from msgspec import field

from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectAction, ObjectModel, ObjectTypeMeta
from arcor2_hw.data.parameter import IdValue, Parameter
from arcor2_hw.data.robot import RobotArg
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc
from arcor2_hw.data.rpc.general import IdArgs, TypeArgs


class ActionParamValuesArgs(Data, frozen=True):
    """Arguments of ActionParamValues."""

    id: str
    param_id: str
    parent_params: list[IdValue] = field(default_factory=list)


class AddOverrideArgs(Data, frozen=True):
    """Arguments of AddOverride."""

    id: str
    override: Parameter


class DeleteObjectTypesData(Data, frozen=True):
    """Answer to DeleteObjectTypes."""

    id: str
    error: str


class DeleteOverrideArgs(Data, frozen=True):
    """Arguments of DeleteOverride."""

    id: str
    override: Parameter


class ObjectAimingAddPointArgs(Data, frozen=True):
    """Arguments of ObjectAimingAddPoint."""

    point_idx: int


class ObjectAimingAddPointData(Data, frozen=True):
    """Answer to ObjectAimingAddPoint."""

    finished_indexes: list[int]


class ObjectAimingStartArgs(Data, frozen=True):
    """Arguments of ObjectAimingStart."""

    object_id: str
    robot: RobotArg


class UpdateObjectModelArgs(Data, frozen=True):
    """Arguments of UpdateObjectModel."""

    object_type_id: str
    object_model: ObjectModel


class UpdateOverrideArgs(Data, frozen=True):
    """Arguments of UpdateOverride."""

    id: str
    override: Parameter


OBJECT_TYPE_RPCS: Final = (
    Rpc("ActionParamValues", ActionParamValuesArgs, set[str], Role.STANDARD_USER),
    Rpc("AddOverride", AddOverrideArgs, None, Role.ADVANCED_USER, dry_run=True),
    Rpc("DeleteObjectTypes", set[str], list[DeleteObjectTypesData], Role.PROGRAMMER, args_optional=True, dry_run=True),
    Rpc("DeleteOverride", DeleteOverrideArgs, None, Role.ADVANCED_USER, dry_run=True),
    Rpc("GetActions", TypeArgs, list[ObjectAction], Role.OPERATOR),
    Rpc("GetObjectTypes", None, list[ObjectTypeMeta], Role.OPERATOR),
    Rpc("NewObjectType", ObjectTypeMeta, None, Role.PROGRAMMER, dry_run=True),
    Rpc("ObjectAimingAddPoint", ObjectAimingAddPointArgs, ObjectAimingAddPointData, Role.TECHNICIAN, dry_run=True),
    Rpc("ObjectAimingCancel", None, None, Role.TECHNICIAN, dry_run=True),
    Rpc("ObjectAimingDone", None, ObjectAimingAddPointData, Role.TECHNICIAN, dry_run=True),
    Rpc("ObjectAimingStart", ObjectAimingStartArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("ObjectTypeUsage", IdArgs, set[str], Role.OPERATOR),
    Rpc("UpdateObjectModel", UpdateObjectModelArgs, None, Role.TECHNICIAN, dry_run=True),
    Rpc("UpdateOverride", UpdateOverrideArgs, None, Role.ADVANCED_USER, dry_run=True),
    Rpc("UpdateSceneShape", UpdateObjectModelArgs, None, Role.TECHNICIAN, dry_run=True, additional=True),
)
"""Requests about object types."""

"""Arguments and answers about object types, overrides and aiming."""

from msgspec import field

from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.parameter import IdValue, Parameter
from arcor2_hw.data.robot import RobotArg


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

"""Requests about device cards and parameters of devices (docs/protocol/maintenance.md)."""

from typing import Final

from arcor2_hw.data.base import Data
from arcor2_hw.data.device import Identity
from arcor2_hw.data.maintenance import (
    BackupInfo,
    DeviceCard,
    ParameterBackup,
    ParameterDifference,
    ParameterFailure,
)
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc.envelope import Rpc


class DeviceArgs(Data, frozen=True):
    """Arguments of requests about a device: id of the scene object."""

    object_id: str


class ListDeviceCardsData(Data, frozen=True):
    """Answer to ListDeviceCards, by name."""

    devices: list[DeviceCard]


class ConfirmDeviceArgs(Data, frozen=True):
    """Arguments of ConfirmDevice: the device, and the new identity that was shown to the technician."""

    object_id: str
    identity: Identity


class BackupArgs(Data, frozen=True):
    """Arguments of requests about a backup: the device and the backup."""

    object_id: str
    backup_id: str


class CompareParametersData(Data, frozen=True):
    """Answer to CompareParameters: the differences by name, and the number of equal parameters."""

    differences: list[ParameterDifference]
    equal: int


class RestoreParametersData(Data, frozen=True):
    """Answer to RestoreParameters: the number of written parameters, and those that could not be written."""

    written: int
    failures: list[ParameterFailure]


class PutParameterBackupArgs(Data, frozen=True):
    """Arguments of PutParameterBackup: the device, and the contents of the file."""

    object_id: str
    backup: ParameterBackup


MAINTENANCE_RPCS: Final = (
    Rpc("BackUpParameters", DeviceArgs, BackupInfo, Role.TECHNICIAN, additional=True),
    Rpc("CompareParameters", BackupArgs, CompareParametersData, Role.TECHNICIAN, additional=True),
    Rpc("ConfirmDevice", ConfirmDeviceArgs, DeviceCard, Role.TECHNICIAN, additional=True),
    Rpc("DeleteParameterBackup", BackupArgs, None, Role.TECHNICIAN, additional=True),
    Rpc("GetParameterBackup", BackupArgs, ParameterBackup, Role.TECHNICIAN, additional=True),
    Rpc("ListDeviceCards", None, ListDeviceCardsData, Role.OPERATOR, additional=True),
    Rpc("PutParameterBackup", PutParameterBackupArgs, BackupInfo, Role.TECHNICIAN, additional=True),
    Rpc("RestoreParameters", BackupArgs, RestoreParametersData, Role.TECHNICIAN, additional=True),
)
"""Requests about maintenance."""

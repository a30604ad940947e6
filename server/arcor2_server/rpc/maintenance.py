"""Requests about device cards and parameters of devices (docs/protocol/maintenance.md)."""

from dataclasses import dataclass

from arcor2_hw.data.maintenance import BackupInfo, DeviceCard, ParameterBackup
from arcor2_hw.data.rpc import (
    BackupArgs,
    CompareParametersData,
    ConfirmDeviceArgs,
    DeviceArgs,
    ListDeviceCardsData,
    PutParameterBackupArgs,
    RestoreParametersData,
)
from arcor2_server.maintenance.devices import Devices
from arcor2_server.maintenance.parameters import Parameters
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class MaintenanceRequests:
    """Requests about device cards and parameters of devices (docs/protocol/maintenance.md)."""

    _devices: Devices
    _parameters: Parameters

    @rpc("ListDeviceCards")
    async def list_device_cards(self, context: Context, args: None) -> ListDeviceCardsData:
        """Return the cards of all devices that were identified."""
        return ListDeviceCardsData(self._devices.all())

    @rpc("ConfirmDevice")
    async def confirm_device(self, context: Context, args: ConfirmDeviceArgs) -> DeviceCard:
        """Accept the connected device instead of the confirmed one."""
        return await self._devices.confirm(args.object_id, args.identity, context.client.name)

    @rpc("BackUpParameters")
    async def back_up_parameters(self, context: Context, args: DeviceArgs) -> BackupInfo:
        """Read the parameters of a device, and store them."""
        return await self._parameters.back_up(args.object_id, context.client.name)

    @rpc("GetParameterBackup")
    async def get_parameter_backup(self, context: Context, args: BackupArgs) -> ParameterBackup:
        """Return a backup with its parameters, for a file."""
        return await self._parameters.get(args.object_id, args.backup_id)

    @rpc("PutParameterBackup")
    async def put_parameter_backup(self, context: Context, args: PutParameterBackupArgs) -> BackupInfo:
        """Store a backup from a file."""
        return await self._parameters.upload(args.object_id, args.backup, context.client.name)

    @rpc("DeleteParameterBackup")
    async def delete_parameter_backup(self, context: Context, args: BackupArgs) -> None:
        """Delete a backup."""
        await self._parameters.delete(args.object_id, args.backup_id)

    @rpc("CompareParameters")
    async def compare_parameters(self, context: Context, args: BackupArgs) -> CompareParametersData:
        """Compare a backup with the connected device."""
        return await self._parameters.compare(args.object_id, args.backup_id)

    @rpc("RestoreParameters")
    async def restore_parameters(self, context: Context, args: BackupArgs) -> RestoreParametersData:
        """Write a backup to the connected device."""
        return await self._parameters.restore(args.object_id, args.backup_id, context.client.name)

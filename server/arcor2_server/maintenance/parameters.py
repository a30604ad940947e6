"""Backups of the parameters of devices: read, store, compare, restore."""

from typing import Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset, new_id, now
from arcor2_hw.data.device import Identity
from arcor2_hw.data.maintenance import (
    BackupInfo,
    DeviceCard,
    DeviceParameter,
    ParameterBackup,
    ParameterDifference,
    ParameterFailure,
)
from arcor2_hw.data.rpc import CompareParametersData, RestoreParametersData
from arcor2_hw.exceptions import Arcor2Error, InvalidData, NotFound
from arcor2_hw.messages import Message
from arcor2_server.audit import changes as audit
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.service import Execution
from arcor2_server.maintenance.devices import AuditedDevice, Devices
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.storage.maintenance import MaintenanceStore

log = structlog.get_logger(__name__)

MAX_BACKUPS: Final = 20
"""Maximum number of backups of a device; the oldest are deleted."""
DUMP_TIMEOUT: Final = 60.0
"""Time limit for reading or writing all parameters, s. A slow serial line needs some 10 ms for each."""


class Parameters:
    """The backups of parameters. All methods may raise StorageError, and errors of the device.

    Args:
        devices: the device cards, which list the backups.
        store: stores the backups.
        online: the online scene with the devices.
        execution: the running program.
    """

    def __init__(self, devices: Devices, store: MaintenanceStore, online: OnlineScene, execution: Execution) -> None:
        self._devices, self._store, self._online, self._execution = devices, store, online, execution

    # -------------------------------------------------------------------------------- backups
    async def back_up(self, object_id: str, by: str) -> BackupInfo:
        """Read the parameters of a device, and store them.

        Raises:
            NotFound: the device was never identified.
            RequestRefused: the device is offline, or its driver cannot read parameters.
        """
        card = self._readable(object_id)
        parameters = await self._dump(card)
        return await self._add(card, ParameterBackup(card.object_type, _present(card), now(), parameters), by)

    async def upload(self, object_id: str, backup: ParameterBackup, by: str) -> BackupInfo:
        """Store a backup from a file.

        Raises:
            NotFound: the device was never identified.
            InvalidData: the file was changed, or belongs to another model.
        """
        card = self._devices.get(object_id)
        if backup.digest != backup.computed_digest():
            raise InvalidData("The file was changed after it was written: its digest does not match its contents.")
        if len({each.name for each in backup.parameters}) != len(backup.parameters):
            raise InvalidData("The file contains a parameter twice.")
        _require_same_model(card, backup)
        return await self._add(card, backup, by, uploaded=True)

    async def _add(self, card: DeviceCard, backup: ParameterBackup, by: str, *, uploaded: bool = False) -> BackupInfo:
        backup = replace(backup, digest=backup.computed_digest())
        info = BackupInfo(
            new_id("bak"), card.object_id, backup.object_type, backup.identity, now(), by, len(backup.parameters),
            backup.digest, uploaded,
        )  # fmt: skip
        kept = [info, *self._devices.get(card.object_id).backups]
        await self._store.put_backup(info, backup, [each.id for each in kept[MAX_BACKUPS:]])
        self._devices.set_backups(card.object_id, kept[:MAX_BACKUPS])
        return info

    async def get(self, object_id: str, key: str) -> ParameterBackup:
        """Return a backup of a device. Raise NotFound if there is none."""
        if all(each.id != key for each in self._devices.get(object_id).backups):
            raise NotFound("The backup {key!r} does not exist.", key=key)
        return await self._store.backup(key)

    async def delete(self, object_id: str, key: str) -> None:
        """Delete a backup of a device. Raise NotFound if there is none."""
        await self.get(object_id, key)
        await self._store.delete_backup(key)
        card = self._devices.get(object_id)
        self._devices.set_backups(object_id, [each for each in card.backups if each.id != key])

    # -------------------------------------------------------------------------------- restoring
    async def compare(self, object_id: str, key: str) -> CompareParametersData:
        """Compare a backup with the connected device.

        Raises:
            NotFound: the device or the backup does not exist.
            RequestRefused: the device is offline, of another model, or its driver cannot read parameters.
        """
        backup = await self.get(object_id, key)
        card = self._readable(object_id)
        _require_same_model(card, backup)
        return differences(backup.parameters, await self._dump(card))

    async def restore(self, object_id: str, key: str, by: str) -> RestoreParametersData:
        """Write the parameters that differ from the backup to the connected device, and read them again.

        Raises:
            NotFound: the device or the backup does not exist.
            RequestRefused: a program runs, the device is offline or of another model, or its driver cannot write.
        """
        backup = await self.get(object_id, key)
        self._execution.require_no_program()
        card = self._readable(object_id)
        if not card.restores:
            raise RequestRefused("The driver of {name} cannot write parameters.", name=card.name)
        if self._online.running_action is not None or object_id in self._online.moving:
            raise RequestRefused("{name} is executing an action.", name=card.name)
        _require_same_model(card, backup)
        before = await self._dump(card)
        differing = {each.name for each in differences(backup.parameters, before).differences}
        wanted = [each for each in backup.parameters if each.name in differing]
        raw = await self._online.call(object_id, "parameters_restore", {"parameters": wanted}, deadline=DUMP_TIMEOUT)
        failures = msgspec.json.decode(raw or b"[]", type=list[ParameterFailure])
        after = {each.name: each.value for each in await self._dump(card)}
        failed = {each.name for each in failures}
        not_stored = Message.of("The device has not stored the value.")
        failures += [
            ParameterFailure(each.name, not_stored.text)
            for each in wanted
            if each.name not in failed and after.get(each.name) != each.value
        ]
        was = {each.name: each.value for each in before}
        changed = {name: value for name, value in after.items() if was.get(name) != value}
        audit.record(
            [AuditedDevice("device_parameters", object_id, {name: was.get(name) for name in changed}, changed)]
        )
        log.warning(
            "parameters restored", object=card.name, backup=key, changed=len(changed), failed=len(failures), user=by
        )
        return RestoreParametersData(len(wanted) - len(failures), failures)

    def _readable(self, object_id: str) -> DeviceCard:
        card = self._devices.get(object_id)
        self._online.require_online()
        self._online.board.object(object_id)
        self._online.board.require_not_failed(object_id)
        if not card.parameters:
            raise RequestRefused("The driver of {name} cannot read parameters.", name=card.name)
        return card

    async def _dump(self, card: DeviceCard) -> list[DeviceParameter]:
        raw = await self._online.call(card.object_id, "parameters_dump", deadline=DUMP_TIMEOUT)
        try:
            return msgspec.json.decode(raw or b"[]", type=list[DeviceParameter])
        except msgspec.MsgspecError as error:
            raise Arcor2Error("{method} returned an invalid value.", str(error), method="parameters_dump") from error


def _present(card: DeviceCard) -> Identity:
    return card.identity if isinstance(card.found, Unset) else card.found


def _require_same_model(card: DeviceCard, backup: ParameterBackup) -> None:
    present = _present(card)
    if backup.object_type != card.object_type or {"vendor", "model"} & set(backup.identity.differences(present)):
        raise RequestRefused(
            "The backup is of {model} and cannot be restored to {other}.",
            model=backup.identity.model or backup.object_type,
            other=present.model or card.object_type,
        )


def differences(backup: list[DeviceParameter], device: list[DeviceParameter]) -> CompareParametersData:
    """Return the differences between a backup and a device, by name."""
    stored, present = ({each.name: each for each in some} for some in (backup, device))
    found = []
    for name in sorted({*stored, *present}):
        one, other = stored.get(name), present.get(name)
        if one is None or other is None or one.value != other.value:
            found.append(
                ParameterDifference(
                    name,
                    UNSET if one is None else one.value,
                    UNSET if other is None else other.value,
                    (one or other).unit,  # type: ignore[union-attr]
                )
            )
    return CompareParametersData(found, len({*stored, *present}) - len(found))

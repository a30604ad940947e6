"""Creates the message that runs a package in a cell host."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace

from arcor2_hw.data.device import Identity
from arcor2_hw.data.held import OnError
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidPackage
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.documents import read_document
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.execution.runs import RunStart
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.setting_secrets import SettingSecrets
from arcor2_server.workspace.host_world import HostWorld


@dataclass(frozen=True, slots=True)
class RunMessages:
    """Creates the messages with settings, secrets, breakpoints and collision models."""

    _settings: ServerSettings
    _secrets: SettingSecrets
    _breakpoints: SharedBreakpoints
    _host_world: HostWorld
    _identities: Callable[[], dict[str, Identity]]

    def prepare(self, package_id: str, directory: Path, how: RunStart) -> m.RunPackage:
        """Return the message without the parts that may change until the host is ready.

        Args:
            package_id: the package.
            directory: the directory of its files.
            how: options of the run.
        """
        return m.RunPackage(
            package_id,
            str(directory.resolve()),
            how.start_paused,
            sorted(how.breakpoints),
            self._settings.streaming_period,
            self._settings.cell,
            assets=self._host_world.shape_files(),
            hold_on_error=how.on_error is OnError.HOLD,
            records=str(self._settings.checkpoints_dir.resolve()),
            checkpoints=how.checkpoints,
            continues=how.continues,
            continue_at=how.continue_at,
            values=dict(how.values),
            recordings=str(self._settings.recordings_dir.resolve()),
        )

    async def objects(self, directory: Path) -> list[SceneObject]:
        """Return the objects of a package; none if it is damaged, which its host reports."""
        file = directory / "data" / "scene.json"
        try:
            return (await asyncio.to_thread(read_document, file, Scene)).objects
        except InvalidPackage:
            return []

    async def complete(self, message: m.RunPackage, shared_of: str) -> m.RunPackage:
        """Add secrets, shared breakpoints, collision models and robot calibrations. Send the message immediately.

        Args:
            message: the result of `prepare`.
            shared_of: the project with the shared breakpoints; empty for none.

        Raises:
            NotFound: a secret is missing.
            StorageError: the breakpoints cannot be read.
        """
        directory = Path(message.directory)
        message = replace(message, secrets=await asyncio.to_thread(self._secrets.values_for_package, directory))
        if shared_of:  # read last: later changes are sent to the program
            shared = await self._breakpoints.ids(shared_of)
            message = replace(message, shared_breakpoints=sorted(shared))
        message = replace(message, identities=self._identities())
        calibrations = await self._host_world.calibrations_of_package(directory)
        return self._host_world.with_world(message, calibrations)
